"""Meshes, images and models as arrays and bytes, named by the hash of their content. No GL here."""

from elys.common.assets.images import image_format, read_image
from elys.common.assets.mesh import Mesh, decode_mesh, encode_mesh
from elys.common.assets.primitives import PRIMITIVES, is_primitive, primitive
from elys.common.assets.store import AssetKind, AssetStore, is_reference, reference_of

__all__ = [
    "PRIMITIVES",
    "AssetKind",
    "AssetStore",
    "Mesh",
    "decode_mesh",
    "encode_mesh",
    "image_format",
    "is_primitive",
    "is_reference",
    "primitive",
    "read_image",
    "reference_of",
]

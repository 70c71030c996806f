"""Packed meshes of glTF models: KHR_draco_mesh_compression and EXT_meshopt_compression, by the extra `compressed`."""

from __future__ import annotations

import importlib
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.gltf_schema import PackedView
from elys.common.errors import AssetError

MAX_UNPACKED: Final = 1 << 30  # [B] of one view: a few bytes may claim to unpack to anything
_REMEDY: Final = "install what unpacks it with: pip install 'elys[compressed]'"
_FILTERS: Final = {
    "OCTAHEDRAL": "decode_filter_oct",
    "QUATERNION": "decode_filter_quat",
    "EXPONENTIAL": "decode_filter_exp",
}
# Bytes of an element that a filter works on.
_FILTER_STRIDES: Final = {"OCTAHEDRAL": (4, 8), "QUATERNION": (8,)}


def can_unpack(library: str) -> bool:
    """Whether `library`, "DracoPy" or "meshoptimizer", is installed."""
    try:
        importlib.import_module(library)
    except ImportError:
        return False
    return True


def unpack_view(data: bytes, packed: PackedView, where: str) -> NDArray[np.uint8]:
    """The bytes (count * byte_stride,) of a buffer view of EXT_meshopt_compression; raises AssetError."""
    if packed.count * packed.byte_stride > MAX_UNPACKED:
        raise AssetError(f"{where} unpacks to {packed.count * packed.byte_stride} bytes, there may be {MAX_UNPACKED}")
    library = _library("meshoptimizer", where, "meshopt")
    try:
        if packed.mode == "ATTRIBUTES":
            return _vertices(library, data, packed, where)
        return _indices(library, data, packed, where)
    except (RuntimeError, ValueError, OverflowError) as error:
        raise AssetError(f"{where} cannot be unpacked: {error}") from error


def unpack_draco(data: bytes, where: str) -> tuple[dict[int, NDArray[Any]], NDArray[np.uint32]]:
    """Attributes (V, width) by their ids, and indices (I,) of the triangles; raises AssetError."""
    library = _library("DracoPy", where, "Draco")
    try:
        mesh = library.decode(data)
        attributes = {int(part["unique_id"]): np.asarray(part["data"]) for part in mesh.attributes}
        faces = getattr(mesh, "faces", np.zeros((0, 3), np.uint32))
    except Exception as error:  # the library's own exceptions derive from nothing narrower
        raise AssetError(f"{where} cannot be unpacked: {error}") from error
    return attributes, np.ascontiguousarray(faces, np.uint32).reshape(-1)


def _vertices(library: Any, data: bytes, packed: PackedView, where: str) -> NDArray[np.uint8]:
    stride, count = packed.byte_stride, packed.count
    if stride % 4 or stride not in _FILTER_STRIDES.get(packed.filter, (stride,)):
        raise AssetError(f"{where} has elements of {stride} bytes, which its filter {packed.filter} does not take")
    if not count:
        return np.zeros(0, np.uint8)
    rows = library.decode_vertex_buffer(count, stride, data, dtype=np.dtype(f"V{stride}")).view(np.uint8)
    if packed.filter != "NONE":
        if packed.filter not in _FILTERS:
            raise AssetError(f"{where} has the filter {packed.filter}, which the library cannot undo yet")
        rows = getattr(library, _FILTERS[packed.filter])(rows, count, stride)
    return np.ascontiguousarray(rows).view(np.uint8).reshape(-1)


def _indices(library: Any, data: bytes, packed: PackedView, where: str) -> NDArray[np.uint8]:
    if packed.byte_stride not in (2, 4):
        raise AssetError(f"{where} has indices of {packed.byte_stride} bytes, expected 2 or 4")
    if not packed.count:
        return np.zeros(0, np.uint8)
    decode = library.decode_index_buffer if packed.mode == "TRIANGLES" else library.decode_index_sequence
    indices = decode(packed.count, 4, data)
    return np.ascontiguousarray(indices.astype(f"<u{packed.byte_stride}")).view(np.uint8)


def _library(name: str, where: str, what: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise AssetError(f"{where} is packed with {what}; {_REMEDY}") from error

"""A mesh as arrays, and as the bytes by which it is stored, hashed and sent.

The bytes are a `container` with the magic "ELYM". Its header has the counts, what the indices make where that is no triangles,
and the attributes that follow: as float32 one after the other in the order below, of morph targets their offsets of positions,
then of normals, then the indices as uint32.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Literal, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.common.assets.container import Container
from elys.common.errors import AssetError
from elys.common.math.aabb import bounds_of_points

FloatArray = NDArray[np.float32]
IndexArray = NDArray[np.uint32]
Topology = Literal["triangles", "lines", "points"]

# Name and floats a vertex; the first two are always there.
_ATTRIBUTES: Final = {
    "positions": 3,
    "normals": 3,
    "uvs": 2,
    "tangents": 4,
    "colors": 4,
    "second_uvs": 2,
    "joints": 4,
    "weights": 4,
}
_CORNERS: Final = {"triangles": 3, "lines": 2, "points": 1}  # indices of one
MAX_TARGET_VERTICES: Final = 1 << 26  # targets times vertices


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """Triangles, counter-clockwise seen from outside, or lines from one place to another, or points; in metres.

    V vertices, I indices (three a triangle, two a line, one a point), T morph targets.
    Tangents hold a sign in w: bitangent = w * cross(normal, tangent).
    Colours are linear with opacity. uv (0, 0) is the image's upper left corner, as in glTF.
    A vertex is bent by four joints of a skin (whole numbers, held as floats) whose weights add up to 1. A morph target's offsets
    are added by its weight, before joints bend. Lines and points are not lit: their normals say nothing.
    """

    positions: FloatArray  # (V, 3)
    normals: FloatArray  # (V, 3)
    uvs: FloatArray  # (V, 2)
    indices: IndexArray  # (I,)
    tangents: FloatArray | None = None  # (V, 4)
    colors: FloatArray | None = None  # (V, 4)
    second_uvs: FloatArray | None = None  # (V, 2)
    joints: FloatArray | None = None  # (V, 4)
    weights: FloatArray | None = None  # (V, 4)
    target_positions: FloatArray | None = None  # (T, V, 3)
    target_normals: FloatArray | None = None  # (T, V, 3)
    topology: Topology = "triangles"

    @property
    def target_count(self) -> int:
        """T."""
        return 0 if self.target_positions is None else len(self.target_positions)

    @property
    def vertex_count(self) -> int:
        """V."""
        return len(self.positions)

    @property
    def triangle_count(self) -> int:
        """A third of I; 0 of lines and points."""
        return len(self.indices) // 3 if self.is_surface else 0

    @property
    def is_surface(self) -> bool:
        """Whether it consists of triangles, which are lit, throw shadows and can be collided with."""
        return self.topology == "triangles"

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corner (3,) of the box around the vertices; of a mesh without vertices (+inf, -inf)."""
        return bounds_of_points(self.positions)


class _Header(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    vertex_count: int
    index_count: int
    attributes: list[str]
    target_count: int = 0
    topology: str = "triangles"  # left out where it is that, as before there were lines and points: hashes stay


_BYTES: Final = Container(magic=b"ELYM", version=1, header=_Header, noun="a mesh", largest_header=4096)


def encode_mesh(mesh: Mesh) -> bytes:
    """The bytes of a mesh: the same arrays always give the same bytes."""
    arrays = {name: getattr(mesh, name) for name in _ATTRIBUTES if getattr(mesh, name) is not None}
    header = _Header(mesh.vertex_count, len(mesh.indices), list(arrays), mesh.target_count, mesh.topology)
    offsets = (mesh.target_positions, mesh.target_normals) if mesh.target_count else ()
    numbers = [np.asarray(array, np.float32) for array in (*arrays.values(), *offsets)]
    return _BYTES.encode(header, [*numbers, np.asarray(mesh.indices, np.uint32)])


def decode_mesh(data: bytes) -> Mesh:
    """The mesh in its bytes, as read-only views of them; raises AssetError for anything that is not a whole and sound mesh."""
    header, offset = _decode_header(data)
    arrays: dict[str, Any] = {"uvs": np.zeros((header.vertex_count, 2), dtype=np.float32)}
    for name in header.attributes:
        width = _ATTRIBUTES[name]
        array = np.frombuffer(data, dtype="<f4", count=header.vertex_count * width, offset=offset)
        if not np.isfinite(array).all():
            raise AssetError(f"a mesh has {name} that are not finite numbers")
        arrays[name] = array.reshape(-1, width)
        offset += array.nbytes
    for name in ("target_positions", "target_normals") if header.target_count else ():
        array = np.frombuffer(data, dtype="<f4", count=3 * header.target_count * header.vertex_count, offset=offset)
        if not np.isfinite(array).all():
            raise AssetError(f"a mesh has {name} that are not finite numbers")
        arrays[name] = array.reshape(header.target_count, -1, 3)
        offset += array.nbytes
    indices = np.frombuffer(data, dtype="<u4", count=header.index_count, offset=offset)
    if len(indices) and int(indices.max()) >= header.vertex_count:
        raise AssetError(f"a mesh names vertex {int(indices.max())}, it has {header.vertex_count}")
    return Mesh(indices=indices, topology=cast(Topology, header.topology), **arrays)


def _decode_header(data: bytes) -> tuple[_Header, int]:
    header, offset = _BYTES.decode(data)
    in_order = [name for name in _ATTRIBUTES if name in header.attributes]
    if header.attributes != in_order or not {"positions", "normals"} <= set(in_order):
        raise AssetError(
            f"a mesh with attributes {header.attributes}; known are {', '.join(_ATTRIBUTES)}, in this order"
        )
    corners = _CORNERS.get(header.topology)
    if corners is None:
        raise AssetError(f"a mesh of {header.topology[:20]!r}; known are {', '.join(_CORNERS)}")
    if header.vertex_count < 0 or header.index_count < 0 or header.index_count % corners:
        raise AssetError(
            f"a mesh of {header.vertex_count} vertices and {header.index_count} indices of {header.topology}"
        )
    if not 0 <= header.target_count * header.vertex_count <= MAX_TARGET_VERTICES:
        raise AssetError(f"a mesh of {header.target_count} morph targets of {header.vertex_count} vertices")
    if ("joints" in in_order) != ("weights" in in_order):
        raise AssetError("a mesh with joints or weights alone")
    width = 6 * header.target_count + sum(_ATTRIBUTES[name] for name in in_order)
    expected = offset + 4 * (header.vertex_count * width + header.index_count)
    if expected != len(data):
        raise AssetError(f"a mesh has {len(data)} bytes where its header says {expected}")
    return header, offset

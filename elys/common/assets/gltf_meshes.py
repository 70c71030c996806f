"""A primitive of a glTF mesh as a Mesh: indexed triangles with normals, or lines or points, which are drawn unlit."""

from __future__ import annotations

import logging
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.gltf_accessors import Buffers
from elys.common.assets.gltf_compression import unpack_draco
from elys.common.assets.gltf_schema import DracoMesh, Primitive
from elys.common.assets.mesh import MAX_TARGET_VERTICES, FloatArray, IndexArray, Mesh, Topology
from elys.common.assets.morph_weights import MAX_TARGETS
from elys.common.errors import AssetError

Offsets = tuple[FloatArray, FloatArray]  # of T morph targets: positions and normals (T, V, 3)

logger = logging.getLogger(__name__)

POINTS: Final = 0
LINES: Final = 1
LINE_LOOP: Final = 2
TRIANGLES: Final = 4
TRIANGLE_STRIP: Final = 5
_WIDTHS: Final = {
    "POSITION": (3,),
    "NORMAL": (3,),
    "TEXCOORD_0": (2,),
    "TEXCOORD_1": (2,),
    "TANGENT": (4,),
    "COLOR_0": (3, 4),
    "JOINTS_0": (4,),
    "WEIGHTS_0": (4,),
    "JOINTS_1": (4,),
    "WEIGHTS_1": (4,),
}
LOST_WEIGHT: Final = 0.01  # of a vertex' bending, above which it is told that joints are left out
# A byte of indices can name a vertex of a hundred: where each triangle gets its own, the sum is bounded.
MAX_CORNERS: Final = 1 << 24


def read_primitive(buffers: Buffers, primitive: Primitive, where: str) -> Mesh:
    """The triangles, lines or points of a primitive; none of them where it has too few vertices. Raises AssetError."""
    if "POSITION" not in primitive.attributes:
        raise AssetError(f"{where} has no POSITION")
    draco = primitive.extensions.draco
    if draco is not None and buffers.unpacks("KHR_draco_mesh_compression", "DracoPy"):
        attributes, indices = _read_draco(buffers, primitive, draco, where)
    else:
        attributes = _read_attributes(buffers, primitive, where)
        indices = _read_indices(buffers, primitive, len(attributes["POSITION"]), where)
    if len(indices) > 3 * MAX_CORNERS:
        raise AssetError(f"{where} has {len(indices)} indices; there may be {3 * MAX_CORNERS}, so split it")
    topology, indices = _listed(indices, primitive.mode)
    targets = _read_targets(buffers, primitive, len(attributes["POSITION"]), where)
    if topology != "triangles":
        # Tangents lie in surfaces. Where normals are missing they point up: nothing is lit by them, but shaders give all of them
        # length 1 where meshes are bent.
        attributes.pop("TANGENT", None)
        attributes.setdefault("NORMAL", np.zeros_like(attributes["POSITION"]))
    elif "NORMAL" not in attributes:
        if len(indices) > MAX_CORNERS:
            raise AssetError(f"{where} has no normals and {len(indices)} corners; export it with normals")
        attributes, targets, indices = _with_flat_normals(attributes, targets, indices)
    colors = attributes.get("COLOR_0")
    if colors is not None and colors.shape[1] == 3:
        colors = np.concatenate((colors, np.ones((len(colors), 1), dtype=np.float32)), axis=1)
    joints, weights = _bending(attributes, primitive, where)
    return Mesh(
        positions=attributes["POSITION"],
        normals=_unit(attributes["NORMAL"]),
        uvs=attributes.get("TEXCOORD_0", np.zeros((len(attributes["POSITION"]), 2), dtype=np.float32)),
        indices=indices,
        tangents=attributes.get("TANGENT"),
        colors=colors,
        second_uvs=attributes.get("TEXCOORD_1"),
        joints=joints,
        weights=weights,
        target_positions=targets[0] if targets is not None else None,
        target_normals=targets[1] if targets is not None else None,
        topology=topology,
    )


def _read_attributes(buffers: Buffers, primitive: Primitive, where: str) -> dict[str, FloatArray]:
    attributes: dict[str, FloatArray] = {}
    for name in _WIDTHS:
        index = primitive.attributes.get(name)
        if index is not None:
            place = f"{where}.attributes.{name}"
            attributes[name] = _checked(attributes, name, buffers.floats(index, place), place)
    return attributes


def _read_draco(
    buffers: Buffers, primitive: Primitive, draco: DracoMesh, where: str
) -> tuple[dict[str, FloatArray], IndexArray]:
    place = f"{where}.extensions.KHR_draco_mesh_compression"
    if primitive.mode not in (TRIANGLES, TRIANGLE_STRIP):
        held = "points or lines" if primitive.mode < TRIANGLES else "a fan"
        raise AssetError(f"{place} holds {held}; Draco knows triangles")
    unpacked, indices = unpack_draco(bytes(buffers.view(draco.buffer_view, place)), place)
    attributes: dict[str, FloatArray] = {}
    for name in _WIDTHS:
        number, accessor = draco.attributes.get(name), primitive.attributes.get(name)
        if number is None or accessor is None:
            continue
        if number not in unpacked:
            raise AssetError(f"{place} has no attribute {number}, which is to be {name}")
        values = buffers.as_floats(unpacked[number], accessor, f"{where}.attributes.{name}")
        attributes[name] = _checked(attributes, name, values, place)
    if "POSITION" not in attributes:
        raise AssetError(f"{place} has no POSITION")
    return attributes, _named(indices, len(attributes["POSITION"]), place)


def _checked(others: dict[str, FloatArray], name: str, values: FloatArray, place: str) -> FloatArray:
    if values.ndim != 2 or values.shape[1] not in _WIDTHS[name]:
        raise AssetError(f"{place} must be vectors of {' or '.join(map(str, _WIDTHS[name]))} numbers")
    if others and len(values) != len(others["POSITION"]):
        raise AssetError(f"{place} has {len(values)} elements for {len(others['POSITION'])} vertices")
    return values


def _read_indices(buffers: Buffers, primitive: Primitive, vertex_count: int, where: str) -> IndexArray:
    if primitive.indices is None:
        return np.arange(vertex_count, dtype=np.uint32)
    place = f"{where}.indices"
    indices = buffers.array(primitive.indices, place)
    if indices.ndim != 1 or indices.dtype.kind != "u":
        raise AssetError(f"{place} must be unsigned whole numbers")
    return _named(indices, vertex_count, place)


def _named(indices: NDArray[Any], vertex_count: int, place: str) -> IndexArray:
    if len(indices) and int(indices.max()) >= vertex_count:
        raise AssetError(f"{place} names vertex {int(indices.max())}, there are {vertex_count}")
    return indices.astype(np.uint32)


def _listed(indices: IndexArray, mode: int) -> tuple[Topology, IndexArray]:
    """What a primitive consists of, and the indices (I,) of all its parts one by one."""
    if mode == POINTS:
        return "points", indices
    return ("lines", _lines(indices, mode)) if mode < TRIANGLES else ("triangles", _triangles(indices, mode))


def _lines(indices: IndexArray, mode: int) -> IndexArray:
    """Indices (I,), two a line, of a list, loop or strip of lines; what is left over is dropped."""
    if mode == LINES:
        return indices[: len(indices) // 2 * 2]
    if len(indices) < 2:
        return indices[:0]
    pairs = np.stack((indices, np.roll(indices, -1)), axis=-1)  # the last one leads back to where the first began
    return (pairs if mode == LINE_LOOP else pairs[:-1]).ravel()


def _triangles(indices: IndexArray, mode: int) -> IndexArray:
    """Indices (I,), three a triangle, of a list, strip or fan of triangles; what is left over is dropped."""
    if mode == TRIANGLES:
        return indices[: len(indices) // 3 * 3]
    count = max(len(indices) - 2, 0)
    step = np.arange(count)
    if mode == TRIANGLE_STRIP:
        odd = step % 2
        corners: NDArray[np.intp] = np.stack((step, step + 1 + odd, step + 2 - odd), axis=-1)
    else:  # a fan
        corners = np.stack((step + 1, step + 2, np.zeros_like(step)), axis=-1)
    return indices[corners.ravel()]


def _read_targets(buffers: Buffers, primitive: Primitive, vertex_count: int, where: str) -> Offsets | None:
    """Offsets of positions and normals; None without morph targets."""
    count = len(primitive.targets)
    if not count:
        return None
    if count > MAX_TARGETS or count * vertex_count > MAX_TARGET_VERTICES:
        raise AssetError(f"{where} has {count} morph targets of {vertex_count} vertices, which are too many")
    offsets = np.zeros((2, count, vertex_count, 3), np.float32)
    for number, target in enumerate(primitive.targets):
        for column, name in enumerate(("POSITION", "NORMAL")):
            if name in target:
                place = f"{where}.targets[{number}].{name}"
                values = buffers.floats(target[name], place)
                if values.shape != (vertex_count, 3):
                    raise AssetError(f"{place} must be {vertex_count} vectors of 3 numbers, as many as POSITION has")
                offsets[column, number] = values
    return offsets[0], offsets[1]


def _bending(
    attributes: dict[str, FloatArray], primitive: Primitive, where: str
) -> tuple[FloatArray | None, FloatArray | None]:
    """Four joints and weights of each vertex (V, 4), of eight those that bend it most, the weights adding up to 1."""
    sets = [(attributes.get(f"JOINTS_{number}"), attributes.get(f"WEIGHTS_{number}")) for number in range(2)]
    found = [(joints, weights) for joints, weights in sets if joints is not None and weights is not None]
    if not found:
        return None, None
    for number, (named, _) in enumerate(sets):
        if named is not None and ((named < 0).any() or (named != np.floor(named)).any()):
            raise AssetError(f"{where}.attributes.JOINTS_{number} must be unsigned whole numbers")
    joints, weights = (np.concatenate(parts, axis=1) for parts in zip(*found, strict=True))
    weights = np.maximum(weights, 0.0)
    if len(found) > 1:
        most = np.argsort(-weights, axis=1, kind="stable")
        joints, weights = (np.take_along_axis(values, most, axis=1) for values in (joints, weights))
        if "JOINTS_2" in primitive.attributes or (weights[:, 4:].sum(axis=1) > LOST_WEIGHT * weights.sum(axis=1)).any():
            logger.warning("%s is bent by more than four joints a vertex; the four that bend it most are kept", where)
        joints, weights = joints[:, :4], weights[:, :4]
    total = weights.sum(axis=1, keepdims=True)
    first = np.array((1.0, 0.0, 0.0, 0.0), np.float32)
    return joints, np.where(total > 0.0, weights / np.where(total > 0.0, total, 1.0), first).astype(np.float32)


def _with_flat_normals(
    attributes: dict[str, FloatArray], targets: Offsets | None, indices: IndexArray
) -> tuple[dict[str, FloatArray], Offsets | None, IndexArray]:
    """Every triangle gets vertices of its own and its face's normal: glTF 2.0, 3.7.2.1, asks for it where normals are missing."""
    unshared = {name: values[indices] for name, values in attributes.items() if name != "TANGENT"}
    unshared["NORMAL"] = _face_normals(unshared["POSITION"])
    if targets is not None:
        if len(targets[0]) * len(indices) > MAX_TARGET_VERTICES:
            raise AssetError("a mesh without normals has too many morph targets; export it with normals")
        moved = targets[0][:, indices]
        # Exact where one target is wholly there, and between near enough.
        turned = [_face_normals(unshared["POSITION"] + offset) - unshared["NORMAL"] for offset in moved]
        targets = moved, np.array(turned, np.float32)
    return unshared, targets, np.arange(len(indices), dtype=np.uint32)


def _face_normals(positions: FloatArray) -> FloatArray:
    """For each of three corners a triangle (N, 3) the normal of its face."""
    corners = positions.astype(np.float64).reshape(-1, 3, 3)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.repeat(_unit(faces), 3, axis=0).astype(np.float32)


def _unit(vectors: NDArray[np.floating]) -> FloatArray:
    """At length 1; what has no length points up. What already has it to rounding stays as it is."""
    with np.errstate(over="ignore"):
        squared = np.einsum("ij,ij->i", vectors, vectors)
    if vectors.dtype == np.float32 and np.all(np.abs(squared - 1.0) < 1e-6):
        return vectors.astype(np.float32, copy=False)
    wide = vectors.astype(np.float64)
    length = np.linalg.norm(wide, axis=-1, keepdims=True)
    up = np.array((0.0, 1.0, 0.0))
    return np.where(length > 1e-30, wide / np.where(length > 1e-30, length, 1.0), up).astype(np.float32)

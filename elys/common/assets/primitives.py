"""The meshes everybody has: their names need no asset. Each fits a cube of edge 1 m around the origin, upright along y."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.mesh import Mesh
from elys.common.errors import AssetError

_SEGMENTS: Final = 32  # around the axis
_SPHERE_RINGS: Final = 16  # from pole to pole
_CAPSULE_RADIUS: Final = 0.25  # [m]

Points = NDArray[np.float64]


@cache
def primitive(name: str) -> Mesh:
    """The mesh of one of PRIMITIVES (shared, read-only); raises AssetError if `name` is none of them."""
    try:
        build = PRIMITIVES[name]
    except KeyError:
        raise AssetError(f"there is no mesh '{name}'; built in are {', '.join(PRIMITIVES)}") from None
    mesh = build()
    for array in (mesh.positions, mesh.normals, mesh.uvs, mesh.indices, mesh.tangents):
        if array is not None:
            array.setflags(write=False)
    return mesh


def is_primitive(name: str) -> bool:
    """Whether `name` is one of PRIMITIVES."""
    return name in PRIMITIVES


def _box() -> Mesh:
    faces: list[Surface] = []
    corners = np.array(((0, 1), (1, 1), (1, 0), (0, 0)), dtype=np.float64)
    for axis in range(3):
        for sign in (1.0, -1.0):
            normal = np.zeros(3)
            normal[axis] = sign
            # Side faces show their image upright; top and bottom have its upper edge at the back and the front.
            up = np.array((0.0, 0.0, -sign)) if axis == 1 else np.array((0.0, 1.0, 0.0))
            right = np.cross(up, normal)
            positions = normal / 2 + (corners[:, :1] - 0.5) * right + (0.5 - corners[:, 1:]) * up
            normals, tangents = np.tile(normal, (4, 1)), np.tile((*right, 1.0), (4, 1))
            faces.append((positions, normals, corners, tangents, np.array((0, 1, 2, 0, 2, 3))))
    return _mesh(*_joined(*faces))


def _plane() -> Mesh:
    uvs = np.array(((0, 1), (1, 1), (1, 0), (0, 0)), dtype=np.float64)
    positions = np.stack((uvs[:, 0] - 0.5, np.zeros(4), uvs[:, 1] - 0.5), axis=-1)
    return _mesh(
        positions,
        np.tile((0.0, 1.0, 0.0), (4, 1)),
        uvs,
        np.tile((1.0, 0.0, 0.0, 1.0), (4, 1)),
        np.array((0, 1, 2, 0, 2, 3)),
    )


def _sphere() -> Mesh:
    angle = np.linspace(0.0, np.pi, _SPHERE_RINGS + 1)
    radius, height = 0.5 * np.sin(angle), 0.5 * np.cos(angle)
    return _mesh(*_lathe(radius, height, np.sin(angle), np.cos(angle)))


def _capsule() -> Mesh:
    angle = np.linspace(0.0, np.pi / 2, _SPHERE_RINGS // 2 + 1)
    middle = 0.5 - _CAPSULE_RADIUS
    radius = _CAPSULE_RADIUS * np.concatenate((np.sin(angle), np.cos(angle)))
    height = np.concatenate((middle + _CAPSULE_RADIUS * np.cos(angle), -middle - _CAPSULE_RADIUS * np.sin(angle)))
    outward = np.concatenate((np.sin(angle), np.cos(angle)))
    upward = np.concatenate((np.cos(angle), -np.sin(angle)))
    return _mesh(*_lathe(radius, height, outward, upward))


def _cylinder() -> Mesh:
    side = _lathe(np.array((0.5, 0.5)), np.array((0.5, -0.5)), np.ones(2), np.zeros(2))
    return _mesh(*_joined(side, _disk(1.0), _disk(-1.0)))


def _cone() -> Mesh:
    slope = np.array((1.0, 0.5)) / np.hypot(1.0, 0.5)  # normal of a side that rises 1 over a radius of 0.5
    side = _lathe(np.array((0.0, 0.5)), np.array((0.5, -0.5)), np.full(2, slope[0]), np.full(2, slope[1]))
    return _mesh(*_joined(side, _disk(-1.0)))


Surface = tuple[Points, Points, Points, Points, NDArray[np.int64]]  # positions, normals, uvs, tangents, indices


def _lathe(radius: Points, height: Points, outward: Points, upward: Points) -> Surface:
    """Turns a profile of R points, given from the top down with its normals, around y."""
    ring_count = len(radius)
    turn = np.linspace(0.0, 2.0 * np.pi, _SEGMENTS + 1)
    # u grows counter-clockwise seen from above, which is to the right seen from outside.
    around = np.stack((np.sin(turn), np.zeros_like(turn), np.cos(turn)), axis=-1)
    along = np.stack((np.cos(turn), np.zeros_like(turn), -np.sin(turn)), axis=-1)
    y = np.array((0.0, 1.0, 0.0))
    positions = radius[:, None, None] * around + height[:, None, None] * y
    normals = outward[:, None, None] * around + upward[:, None, None] * y
    tangents = np.broadcast_to(np.append(along, np.ones((len(turn), 1)), axis=-1), (*positions.shape[:2], 4))
    v = (height[0] - height) / (height[0] - height[-1])
    uvs = np.stack(np.broadcast_arrays(np.linspace(0.0, 1.0, _SEGMENTS + 1), v[:, None]), axis=-1)
    ring, segment = np.meshgrid(np.arange(ring_count - 1), np.arange(_SEGMENTS), indexing="ij")
    corner = (ring * (_SEGMENTS + 1) + segment).ravel()
    below = corner + _SEGMENTS + 1
    upper_half = np.stack((corner, below + 1, corner + 1), axis=-1)[radius[ring.ravel()] > 1e-9]
    lower_half = np.stack((corner, below, below + 1), axis=-1)[radius[ring.ravel() + 1] > 1e-9]
    indices = np.concatenate((upper_half, lower_half)).ravel()
    return positions.reshape(-1, 3), normals.reshape(-1, 3), uvs.reshape(-1, 2), tangents.reshape(-1, 4), indices


def _disk(sign: float) -> Surface:
    """A round lid of radius 0.5 at y = sign / 2, looking outwards."""
    turn = np.linspace(0.0, 2.0 * np.pi, _SEGMENTS, endpoint=False)
    rim = np.stack((np.sin(turn), np.cos(turn)), axis=-1)
    points = np.concatenate((np.zeros((1, 2)), rim)) * 0.5
    positions = np.stack((points[:, 0], np.full(len(points), 0.5 * sign), points[:, 1]), axis=-1)
    uvs = np.stack((points[:, 0] + 0.5, sign * points[:, 1] + 0.5), axis=-1)
    first = np.arange(_SEGMENTS) + 1
    second = first % _SEGMENTS + 1
    triangles = np.stack((np.zeros_like(first), first, second), axis=-1)[:, :: 1 if sign > 0 else -1]
    normals = np.tile((0.0, sign, 0.0), (len(points), 1))
    return positions, normals, uvs, np.tile((1.0, 0.0, 0.0, 1.0), (len(points), 1)), triangles.ravel()


def _joined(*surfaces: Surface) -> Surface:
    starts = np.cumsum([0] + [len(surface[0]) for surface in surfaces])
    positions, normals, uvs, tangents = (np.concatenate([surface[i] for surface in surfaces]) for i in range(4))
    indices = np.concatenate([surface[4] + start for surface, start in zip(surfaces, starts, strict=False)])
    return positions, normals, uvs, tangents, indices


def _mesh(positions: Points, normals: Points, uvs: Points, tangents: Points, indices: NDArray[np.int64]) -> Mesh:
    return Mesh(
        positions=np.ascontiguousarray(positions, dtype=np.float32),
        normals=np.ascontiguousarray(normals, dtype=np.float32),
        uvs=np.ascontiguousarray(uvs, dtype=np.float32),
        tangents=np.ascontiguousarray(tangents, dtype=np.float32),
        indices=np.ascontiguousarray(indices, dtype=np.uint32),
    )


PRIMITIVES: Final[Mapping[str, Callable[[], Mesh]]] = {
    "box": _box,
    "sphere": _sphere,
    "cylinder": _cylinder,
    "cone": _cone,
    "capsule": _capsule,
    "plane": _plane,
}

"""Hulls, meshes and height fields: kept once for all colliders that share them, in flat arrays that kernels read.

What is made from the same numbers is the same geometry, whoever asks. Points are relative to the centre of mass of a hull
and to the middle of the box of a mesh, where its collider's centre is.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError
from elys.sim_node.physics import checks
from elys.sim_node.physics.hull import FlatPointsError, convex_hull
from elys.sim_node.physics.kernels.tables import (
    FACE,
    GEOMETRY,
    HEIGHT_FIELD,
    HULL,
    MESH,
    TREE_LEAF,
    Geometry,
    no_geometry,
)
from elys.sim_node.physics.kernels.tree import LEAF, build_tree

Array = np.ndarray[Any, Any]

_CREASE = 0.01  # sine of the angle below which two triangles lie flat beside each other


@dataclass(frozen=True, slots=True, kw_only=True)
class Solid:
    """What Python asks of a geometry: where its centre is in the space of the points given, and for 1 kg its inertia."""

    kind: int
    center: Array  # (3,) [m]
    half_extents: Array  # (3,) of the box about the centre that holds it [m]
    reach: float  # radius of the ball about the centre that holds it [m]
    volume: float  # [m^3], 0 of what is no solid
    tensor: Array  # (3, 3) [m^2]


class GeometryStore:
    """All geometry of a world. `arrays` is what kernels take; a handle is a row of its headers."""

    def __init__(self) -> None:
        self.solids: list[Solid] = []
        self.arrays = no_geometry()
        self._known: dict[bytes, int] = {}

    def add_hull(self, points: ArrayLike) -> int:
        """The handle of the convex hull of points (N, 3) [m]; PhysicsError where they span no volume."""
        given = _points("A hull", points)
        digest = _digest(HULL, given)
        if digest in self._known:
            return self._known[digest]
        try:
            hull = convex_hull(given)
        except FlatPointsError as error:
            raise PhysicsError(
                f"A hull of {len(given)} points {error}: give it a thickness, or use a box or a static mesh instead"
            ) from error
        corners = hull.corners - hull.center
        loops = np.concatenate(hull.faces)
        counts = np.array([len(face) for face in hull.faces])
        faces = np.zeros(len(counts), FACE)
        faces["normal"] = hull.normals
        faces["corner_count"] = counts
        faces["first_corner"] = len(corners) + np.cumsum(counts) - counts
        header = np.zeros(1, GEOMETRY)
        header["kind"] = HULL
        header["point_count"] = len(corners)
        solid = _solid(HULL, corners, hull.center, hull.volume, hull.tensor)
        return self._append(digest, solid, header, np.concatenate([corners, corners[loops]]), faces, np.zeros((0, 6)))

    def add_mesh(self, vertices: ArrayLike, triangles: ArrayLike) -> int:
        """The handle of a mesh of vertices (V, 3) [m] and triangles (T, 3), counter-clockwise as seen from outside."""
        points = _points("A mesh", vertices)
        corners = np.asarray(triangles)
        if corners.ndim != 2 or corners.shape[1] != 3 or corners.dtype.kind not in "iu" or not len(corners):
            raise PhysicsError(f"A mesh takes triangles as whole numbers of shape (T, 3), not {corners.shape}")
        if corners.min() < 0 or corners.max() >= len(points):
            raise PhysicsError(f"A mesh of {len(points)} vertices has a triangle with corner {corners.max()}")
        return self._add_triangles(MESH, points, corners.astype(np.int64))

    def add_height_field(self, heights: ArrayLike, size: ArrayLike) -> int:
        """The handle of a field of heights (M, N) [m] over a grid of `size` (2,) [m] in x and z, about its middle."""
        grid = np.asarray(heights, np.float64)
        if grid.ndim != 2 or min(grid.shape) < 2 or not np.isfinite(grid).all():
            raise PhysicsError(
                f"A height field takes finite heights of shape (M, N), at least (2, 2), not {grid.shape}"
            )
        spans = np.asarray(size, np.float64)
        if spans.shape != (2,) or not (np.isfinite(spans).all() and (spans > 0.0).all()):
            raise PhysicsError(f"A height field takes its size as two lengths above 0 m, in x and z, not {size!r}")
        m, n = grid.shape
        x, z = np.meshgrid(np.linspace(-0.5, 0.5, m) * spans[0], np.linspace(-0.5, 0.5, n) * spans[1], indexing="ij")
        points = np.stack([x, grid, z], -1).reshape(-1, 3)
        i, j = np.indices((m - 1, n - 1)).reshape(2, -1)
        here = i * n + j
        first = np.stack([here, here + 1, here + n], 1)
        second = np.stack([here + n, here + 1, here + n + 1], 1)
        return self._add_triangles(HEIGHT_FIELD, points, np.stack([first, second], 1).reshape(-1, 3))

    def saved(self) -> dict[str, Array]:
        """The arrays that a snapshot holds."""
        solids = self.solids
        return {
            "geometry_headers": self.arrays.headers.copy(),
            "geometry_faces": self.arrays.faces.copy(),
            "geometry_points": self.arrays.points.copy(),
            "geometry_nodes": self.arrays.nodes.copy(),
            "geometry_digests": np.array([*self._known], "S16"),
            "geometry_solids": np.array(
                [[*s.center, *s.half_extents, s.reach, s.volume, *s.tensor.ravel()] for s in solids]
            ).reshape(len(solids), 17),
        }

    def load(self, saved: dict[str, Array]) -> None:
        """Takes back what `saved` gave."""
        try:
            headers = checks.saved_table(saved, "geometry_headers", GEOMETRY)
            faces = checks.saved_table(saved, "geometry_faces", FACE)
            points, nodes = (saved[f"geometry_{name}"].copy() for name in ("points", "nodes"))
            solids, digests = saved["geometry_solids"], saved["geometry_digests"]
        except KeyError as error:
            raise PhysicsError(f"This is not a snapshot of this version: its table {error} is missing") from error
        self.arrays = self.arrays._replace(headers=headers, faces=faces, points=points, nodes=nodes)
        self._known = {bytes(digest).ljust(16, b"\0"): handle for handle, digest in enumerate(digests)}
        self.solids = [
            Solid(
                kind=int(kind),
                center=row[:3],
                half_extents=row[3:6],
                reach=float(row[6]),
                volume=float(row[7]),
                tensor=row[8:].reshape(3, 3),
            )
            for kind, row in zip(self.arrays.headers["kind"], solids, strict=True)
        ]

    def _add_triangles(self, kind: int, points: Array, triangles: Array) -> int:
        digest = _digest(kind, points, triangles)
        if digest in self._known:
            return self._known[digest]
        corners = points[triangles]
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(area, axis=1)
        real = np.flatnonzero(length > 1e-12 * np.ptp(points, axis=0).max() ** 2)
        if not len(real):
            raise PhysicsError(f"A mesh of {len(triangles)} triangles has none with an area: check its vertices' scale")
        corners, normals = corners[real], area[real] / length[real, None]
        active, around = _surroundings(points, triangles[real], normals)
        center = 0.5 * (corners.reshape(-1, 3).min(0) + corners.reshape(-1, 3).max(0))
        corners = corners - center
        order, nodes, leaf_count = _tree_over(corners)
        faces = np.zeros(len(real), FACE)
        faces["normal"] = normals[order]
        faces["corner_count"] = 3
        faces["first_corner"] = 10 * np.arange(len(real))
        faces["active"] = active[order]
        faces["source"] = real[order]
        header = np.zeros(1, GEOMETRY)
        header["kind"] = kind
        header["leaf_count"] = leaf_count
        solid = _solid(kind, corners.reshape(-1, 3), center, 0.0, np.zeros((3, 3)))
        around[:, :3] -= center
        flat = np.concatenate([corners, around], axis=1)[order].reshape(-1, 3)
        return self._append(digest, solid, header, flat, faces, nodes)

    def _append(self, digest: bytes, solid: Solid, header: Array, points: Array, faces: Array, nodes: Array) -> int:
        old = self.arrays
        header["first_point"] = len(old.points)
        header["first_face"] = len(old.faces)
        header["face_count"] = len(faces)
        header["first_node"] = len(old.nodes)
        faces["first_corner"] += len(old.points)
        self.arrays = Geometry(
            np.concatenate([old.headers, header]),
            np.concatenate([old.faces, faces]),
            np.concatenate([old.points, points]),
            np.concatenate([old.nodes, nodes]),
            old.convex,
            old.simplex,
            old.clusters,
        )
        self.solids.append(solid)
        self._known[digest] = len(self.solids) - 1
        return len(self.solids) - 1


def _points(what: str, values: ArrayLike) -> Array:
    try:
        points = np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise PhysicsError(f"{what} takes points as numbers of shape (N, 3)") from error
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise PhysicsError(f"{what} takes points of shape (N, 3), not {points.shape}")
    if not np.isfinite(points).all():
        first = int(np.flatnonzero(~np.isfinite(points).all(1))[0])
        raise PhysicsError(f"{what} takes finite points: point {first} is {points[first]}")
    return points


def _digest(kind: int, *arrays: Array) -> bytes:
    digest = hashlib.blake2b(bytes([kind]), digest_size=16)
    for array in arrays:
        digest.update(str(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.digest()


def _solid(kind: int, points: Array, center: Array, volume: float, tensor: Array) -> Solid:
    return Solid(
        kind=kind,
        center=center,
        half_extents=abs(points).max(0),
        reach=float(np.linalg.norm(points, axis=1).max()),
        volume=volume,
        tensor=tensor,
    )


def _surroundings(points: Array, triangles: Array, normals: Array) -> tuple[Array, Array]:
    """What lies around T triangles: `FACE.active`, and (T, 7, 3) what follows their corners among the points.

    Rows 0 to 2 are the third corners of the triangles beyond the sides. Rows 3 to 5 are, of each corner, the middle of the
    normals of all triangles that meet there; row 6 the least cosines between a middle and its normals, -2 at an open border.
    Something may hang over a side without a neighbour and over one where the surface bends away.
    """
    _, welded = np.unique(points, axis=0, return_inverse=True)
    corners = welded.reshape(-1)[triangles]
    count = len(points)
    begin = corners.ravel()
    end = np.roll(corners, -1, axis=1).ravel()
    key = np.minimum(begin, end) * count + np.maximum(begin, end)
    order = np.argsort(key, kind="stable")
    active = np.ones(len(key), bool)
    neighbours = np.zeros(len(key), int)
    around = np.zeros((len(triangles), 7, 3))
    beyond = np.zeros((len(key), 3))
    # Sides with the same two ends stand beside each other in the order; a side flat or hollow towards one is not active.
    for step in (1, 2, 3):
        same = np.flatnonzero(key[order[step:]] == key[order[:-step]])
        for one, two in ((order[same], order[same + step]), (order[same + step], order[same])):
            apex = points[triangles[two // 3, (two + 2) % 3]]
            base = points[triangles[one // 3, one % 3]]
            away = apex - base
            rise = np.einsum("ni,ni->n", away, normals[one // 3])
            edge = points[triangles[one // 3, (one + 1) % 3]] - base
            aside = np.cross(away, edge)
            width = np.linalg.norm(aside, axis=1) / np.maximum(np.linalg.norm(edge, axis=1), 1e-300)
            active[one[rise > -_CREASE * width]] = False
            neighbours[one] += 1
            beyond[one] = apex
    around[:, :3] = beyond.reshape(-1, 3, 3)
    middle = np.zeros((count, 3))
    np.add.at(middle, begin, np.repeat(normals, 3, axis=0))
    middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), 1e-300)
    least = np.ones(count)
    np.minimum.at(least, begin, np.einsum("ni,ni->n", middle[begin], np.repeat(normals, 3, axis=0)))
    is_open = neighbours != 1
    least[begin[is_open]] = least[end[is_open]] = -2.0
    around[:, 3:6] = middle[corners]
    around[:, 6] = least[corners]
    bits = np.array([1, 2, 4])
    known = neighbours.reshape(-1, 3) == 1
    return active.reshape(-1, 3) @ bits + known @ (bits << 3), around


def _tree_over(corners: Array) -> tuple[Array, Array, int]:
    """The order of triangles (T, 3, 3) along a tree, the tree's nodes, and how many leaves it has."""
    boxes = np.concatenate([corners.min(1), corners.max(1)], axis=1)
    leaf_count = 1
    while leaf_count * LEAF < len(boxes):
        leaf_count *= 2
    leaves = np.zeros(len(boxes), TREE_LEAF)
    nodes = np.zeros((2 * leaf_count, 6))
    # The same layout as the colliders' boxes, for which the kernel is compiled.
    strided = np.zeros(len(boxes), np.dtype([("box", "f8", 6), ("pad", "f8", 6)]))
    strided["box"] = boxes
    build_tree(strided["box"], leaves, nodes, np.zeros(1025, np.int32), np.zeros(6), True)
    return leaves["order"].copy(), nodes, leaf_count

"""The convex hull of points: its corners, its flat faces, its volume and how that is spread. Built once, when a shape is made.

Corners are added farthest first (Barber, Dobkin and Huhdanpaa, "The Quickhull Algorithm", 1996), so that a hull of too many
corners keeps those that matter most.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

Array = np.ndarray[Any, Any]

MOST_CORNERS = 256
_FLAT = 1e-9  # by the extent of the points: what is closer to a plane lies in it
# Likewise: what is thinner is flat. Rounding would decide there which points are corners: hulls
# came out open, or many times as large.
_THIN = 1e-5


class Hull(NamedTuple):
    """A convex polyhedron; lengths in metres."""

    corners: Array  # (V, 3)
    faces: list[Array]  # corners of each face, counter-clockwise as seen from outside
    normals: Array  # (F, 3) unit, outward
    volume: float
    center: Array  # (3,) centre of mass
    tensor: Array  # (3, 3) inertia about it for 1 kg [m^2]


class FlatPointsError(ValueError):
    """The points span no volume; the text says how they lie."""


def convex_hull(points: Array) -> Hull:
    """The hull of points (N, 3), all finite.

    Raises:
        FlatPointsError: the points lie in a plane, on a line or in one place, to a hundred-thousandth of their extent.
    """
    points = np.unique(np.asarray(points, np.float64), axis=0)
    extent = float(np.ptp(points, axis=0).max(initial=0.0)) if len(points) else 0.0
    tolerance = _FLAT * extent
    triangles = _first_tetrahedron(points, _THIN * extent)
    normals, offsets = _planes(points, triangles)
    outside = points @ normals.T - offsets
    corner_count = 4
    while corner_count < MOST_CORNERS:
        farthest = int(outside.max(1).argmax())
        visible = outside[farthest] > tolerance
        if not visible.any():
            break
        new = np.array([[p, q, farthest] for p, q in _horizon(triangles[visible])])
        new_normals, new_offsets = _planes(points, new)
        triangles = np.concatenate([triangles[~visible], new])
        normals = np.concatenate([normals[~visible], new_normals])
        outside = np.concatenate([outside[:, ~visible], points @ new_normals.T - new_offsets], axis=1)
        corner_count += 1
    used, place = np.unique(triangles, return_inverse=True)
    corners, triangles = points[used], place.reshape(-1, 3)
    faces, face_normals = _flat_faces(corners, triangles, normals, 10.0 * tolerance)
    volume, center, tensor = solid_properties(corners[triangles])
    return Hull(corners, faces, face_normals, volume, center, tensor)


def solid_properties(triangles: Array) -> tuple[float, Array, Array]:
    """Volume, centre of mass and inertia about it for 1 kg of the solid within closed triangles (T, 3, 3).

    Sums over the tetrahedra between each triangle and one point, by the divergence theorem: Mirtich, "Fast and Accurate
    Computation of Polyhedral Mass Properties" (1996).
    """
    origin = triangles.reshape(-1, 3).mean(0)
    a, b, c = (triangles[:, k] - origin for k in range(3))
    six = np.einsum("ni,ni->n", a, np.cross(b, c))  # six times each volume
    total = float(six.sum())
    sums = a + b + c
    middle = (six[:, None] * sums).sum(0) / (4.0 * total)
    spread = np.zeros((3, 3))
    for part in (a, b, c, sums):
        spread += np.einsum("n,ni,nj->ij", six, part, part)
    spread = spread / (20.0 * total) - np.outer(middle, middle)
    return total / 6.0, origin + middle, np.trace(spread) * np.eye(3) - spread


def _first_tetrahedron(points: Array, thinnest: float) -> Array:
    if len(points) < 4:
        raise FlatPointsError(f"has {len(points)} different points; a hull takes at least 4")
    first = int(points[:, 0].argmin())
    away = points - points[first]
    second = int(np.einsum("ni,ni->n", away, away).argmax())
    along = away[second] / np.linalg.norm(away[second])
    aside = np.linalg.norm(np.cross(away, along), axis=1)
    third = int(aside.argmax())
    if aside[third] <= thinnest:
        raise FlatPointsError("has all its points on a line")
    normal = np.cross(along, away[third])
    height = away @ (normal / np.linalg.norm(normal))
    fourth = int(abs(height).argmax())
    if abs(height[fourth]) <= thinnest:
        raise FlatPointsError("has all its points in a plane")
    if height[fourth] > 0.0:
        second, third = third, second
    return np.array(
        [[first, second, third], [first, fourth, second], [second, fourth, third], [third, fourth, first]], np.int64
    )


def _planes(points: Array, triangles: Array) -> tuple[Array, Array]:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(length > 0.0, length, 1.0)
    return normals, np.einsum("ni,ni->n", normals, a)


def _horizon(visible: Array) -> list[tuple[int, int]]:
    """Edges of visible triangles whose other side is not visible, in the direction of the triangles."""
    edges = [(int(t[k]), int(t[(k + 1) % 3])) for t in visible for k in range(3)]
    present = set(edges)
    return [edge for edge in edges if (edge[1], edge[0]) not in present]


def _flat_faces(corners: Array, triangles: Array, normals: Array, tolerance: float) -> tuple[list[Array], Array]:
    """Joins triangles that lie in one plane into faces."""
    other = {(int(t[k]), int(t[(k + 1) % 3])): f for f, t in enumerate(triangles) for k in range(3)}
    area = np.linalg.norm(_area_vectors(corners, triangles), axis=1)
    face_of = np.full(len(triangles), -1)
    faces: list[Array] = []
    face_normals: list[Array] = []
    for seed in np.argsort(-area, kind="stable"):  # large ones first: their normals are the best known
        if face_of[seed] >= 0:
            continue
        face_of[seed] = len(faces)
        members, waiting = [], [int(seed)]
        while waiting:
            triangle = waiting.pop()
            members.append(triangle)
            for k in range(3):
                edge = (int(triangles[triangle, (k + 1) % 3]), int(triangles[triangle, k]))
                beside = other[edge]
                flat = (
                    abs((corners[triangles[beside]] - corners[triangles[seed, 0]]) @ normals[seed]).max() <= tolerance
                )
                if face_of[beside] < 0 and flat:
                    face_of[beside] = len(faces)
                    waiting.append(beside)
        following = dict(_horizon(triangles[members]))
        start = min(following)
        loop = [start]
        while following[loop[-1]] != start:
            loop.append(following[loop[-1]])
        faces.append(np.array(loop))
        total = _area_vectors(corners, triangles[members]).sum(0)
        face_normals.append(total / np.linalg.norm(total))
    return faces, np.array(face_normals)


def _area_vectors(corners: Array, triangles: Array) -> Array:
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)

"""Tangents for meshes that bring none, so that normal maps lie on them as the tools meant that baked them.

After Mikkelsen, "Simulation of Wrinkled Surfaces Revisited" (2008): each triangle's direction of growing u, laid into the plane
of each corner's normal, weighted by the angle at the corner and summed over all corners that share place, normal and uv. A
vertex where triangles of both hands meet, as on the seam of a mirrored image, is split.
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.mesh import Mesh

Array = NDArray[np.float64]


def with_tangents(mesh: Mesh, *, uv_set: int = 0) -> Mesh:
    """The mesh with tangents along the first or second uv set; vertices may be more and stand in another order.

    Triangles without area in the image take part in nothing; a vertex that has only such gets any tangent.
    """
    uvs = mesh.second_uvs if uv_set and mesh.second_uvs is not None else mesh.uvs
    corners = mesh.indices.reshape(-1, 3).astype(np.int64)
    along, area = _triangle_tangents(mesh.positions.astype(np.float64)[corners], uvs.astype(np.float64)[corners])
    # The image's v falls along the bitangent: what is not mirrored in the image has negative area there.
    is_right = np.repeat((area < 0.0)[:, None], 3, axis=1)
    counts = np.repeat((area != 0.0)[:, None], 3, axis=1)
    has_right = np.zeros(mesh.vertex_count, np.bool_)
    has_right[corners[is_right & counts]] = True
    is_right |= ~counts & has_right[corners]
    vertices, indices = np.unique(2 * corners.ravel() + is_right.ravel(), return_inverse=True)
    source, hand = vertices // 2, vertices % 2
    welded = _welded(mesh, uvs)
    sums = _summed(mesh, corners, along, 2 * welded[corners] + is_right, counts)
    normals = mesh.normals[source].astype(np.float64)
    tangents = _unit_in_plane(sums[2 * welded[source] + hand], normals)
    signed = np.append(tangents, np.where(hand == 1, 1.0, -1.0)[:, None], axis=1)
    parted = {
        field.name: getattr(mesh, field.name)[source]
        for field in fields(mesh)
        if field.name not in ("indices", "tangents", "topology") and getattr(mesh, field.name) is not None
    }
    return replace(mesh, **parted, tangents=signed.astype(np.float32), indices=indices.astype(np.uint32))


def _triangle_tangents(places: Array, uvs: Array) -> tuple[Array, Array]:
    """Unit directions (T, 3) in which u grows, 0 where there is none, and twice the signed areas (T,) in the image."""
    first, second = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
    du, dv = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    area = du[:, 0] * dv[:, 1] - dv[:, 0] * du[:, 1]
    along = (first * dv[:, 1:] - second * du[:, 1:]) * np.sign(area)[:, None]
    return _unit(along), area


def _summed(
    mesh: Mesh, corners: NDArray[np.int64], along: Array, group: NDArray[np.int64], counts: NDArray[np.bool_]
) -> Array:
    """The weighted tangents (G, 3) of all corners of each group."""
    places, normals = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64)
    sums = np.zeros((2 * mesh.vertex_count, 3))
    for corner in range(3):
        here = corners[:, corner]
        normal = normals[here]
        to_next = _in_plane(places[corners[:, (corner + 1) % 3]] - places[here], normal)
        to_last = _in_plane(places[corners[:, (corner + 2) % 3]] - places[here], normal)
        cosine = np.einsum("ij,ij->i", _unit(to_next), _unit(to_last))
        weight = np.arccos(np.clip(cosine, -1.0, 1.0)) * counts[:, corner]
        tangent = _unit(_in_plane(along, normal)) * weight[:, None]
        for axis in range(3):
            sums[:, axis] += np.bincount(group[:, corner], tangent[:, axis], minlength=len(sums))
    return sums


def _welded(mesh: Mesh, uvs: NDArray[np.float32]) -> NDArray[np.int64]:
    """For each vertex (V,) the first one of the same place, normal and uv."""
    rows = np.ascontiguousarray(np.concatenate([mesh.positions, mesh.normals, uvs], axis=1) + np.float32(0.0))  # no -0
    keys = rows.view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1])))[:, 0]
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    return np.asarray(first[inverse], np.int64)


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 1e-30))


def _in_plane(vectors: Array, normals: Array) -> Array:
    return np.asarray(vectors - normals * np.einsum("ij,ij->i", vectors, normals)[:, None])


def _unit_in_plane(vectors: Array, normals: Array) -> Array:
    """Unit vectors perpendicular to the normals; any where a vector is too short to say."""
    some = np.where(np.abs(normals[:, :1]) < 0.9, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    known = np.linalg.norm(vectors, axis=1, keepdims=True) > 1e-12
    return _unit(_in_plane(np.where(known, vectors, some), normals))

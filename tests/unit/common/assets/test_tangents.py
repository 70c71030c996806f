"""Computed tangents against closed forms, and against those that meshes made by formula bring."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from elys.common.assets import Mesh, primitive
from elys.common.assets.tangents import with_tangents


def ball(rings: int, sectors: int) -> Mesh:
    """A unit ball by longitude (u) and latitude (v), its seam and poles with vertices of their own."""
    v, u = np.meshgrid(np.linspace(0, 1, rings + 1), np.linspace(0, 1, sectors + 1), indexing="ij")
    polar, around = v.ravel() * np.pi, u.ravel() * 2 * np.pi
    places = np.stack([np.sin(polar) * np.cos(around), np.cos(polar), -np.sin(polar) * np.sin(around)], axis=1)
    first = (np.arange(rings)[:, None] * (sectors + 1) + np.arange(sectors)).ravel()
    below = first + sectors + 1
    triangles = np.stack([first, below, below + 1, first, below + 1, first + 1], axis=1)
    uvs = np.stack([u.ravel(), v.ravel()], axis=1)
    return Mesh(
        positions=places.astype(np.float32),
        normals=places.astype(np.float32),
        uvs=uvs.astype(np.float32),
        indices=triangles.ravel().astype(np.uint32),
    )


def test_on_a_ball_they_point_east():
    found = with_tangents(ball(64, 128))
    assert found.tangents is not None
    # At the seam, where u jumps, and at the poles there are triangles on one side alone.
    inner = (np.abs(found.positions[:, 1]) < 0.99) & (np.abs(found.uvs[:, 0] - 0.5) < 0.499)
    around = found.uvs[inner, 0] * 2 * np.pi
    east = np.stack([-np.sin(around), np.zeros_like(around), -np.cos(around)], axis=1)
    cosine = np.einsum("ij,ij->i", found.tangents[inner, :3], east)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 0.1
    assert (found.tangents[inner, 3] == 1.0).all()
    np.testing.assert_allclose(np.linalg.norm(found.tangents[:, :3], axis=1), 1.0, atol=1e-5)


@pytest.mark.parametrize("name", ["box", "cylinder", "plane", "sphere"])
def test_they_are_those_that_a_primitive_brings(name):
    mesh = primitive(name)
    found = with_tangents(replace(mesh, tangents=None))
    assert mesh.tangents is not None
    assert found.tangents is not None
    # Each found vertex is one of the mesh: compare by what is the same in both.
    known = {row.tobytes(): tangent for row, tangent in zip(_rows(mesh), mesh.tangents, strict=True)}
    pairs = [(known[row.tobytes()], tangent) for row, tangent in zip(_rows(found), found.tangents, strict=True)]
    angles = [np.degrees(np.arccos(np.clip(a[:3] @ b[:3], -1, 1))) for a, b in pairs]
    assert np.median(angles) < 0.1
    assert np.mean([a[3] == b[3] for a, b in pairs]) > 0.95  # but at poles, where triangles have no area in the image


def test_a_mirrored_half_is_parted_from_the_other():
    """A strip whose image is mirrored at its middle edge, and nothing else."""
    mesh = Mesh(
        positions=np.array([(-1, 0, 0), (0, 0, 0), (1, 0, 0), (-1, 1, 0), (0, 1, 0), (1, 1, 0)], np.float32),
        normals=np.tile(np.array((0, 0, 1), np.float32), (6, 1)),
        uvs=np.array([(0, 1), (1, 1), (0, 1), (0, 0), (1, 0), (0, 0)], np.float32),
        indices=np.array((0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4), np.uint32),
    )
    found = with_tangents(mesh)
    assert found.tangents is not None
    assert found.vertex_count == 8
    np.testing.assert_allclose(np.abs(found.tangents[:, 0]), 1.0, atol=1e-6)
    np.testing.assert_array_equal(found.tangents[:, 0], found.tangents[:, 3])  # u grows to the left on the right half
    triangles = found.positions[found.indices].reshape(-1, 3, 3)
    np.testing.assert_array_equal(triangles, mesh.positions[mesh.indices].reshape(-1, 3, 3))


def test_an_image_without_area_harms_nobody():
    mesh = primitive("box")
    found = with_tangents(replace(mesh, tangents=None, uvs=np.zeros_like(mesh.uvs)))
    assert found.tangents is not None
    assert np.isfinite(found.tangents).all()
    np.testing.assert_allclose(np.einsum("ij,ij->i", found.tangents[:, :3], found.normals), 0.0, atol=1e-6)


def _rows(mesh: Mesh) -> np.ndarray:
    return np.ascontiguousarray(np.concatenate([mesh.positions, mesh.normals, mesh.uvs], axis=1) + np.float32(0))

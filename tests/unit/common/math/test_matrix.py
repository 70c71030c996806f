"""Affine transforms and projections, against PyGLM and whole matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyglm import glm

from elys.common.math import matrix, quaternion


def random_affines(count: int, seed: int = 1, *, signs: bool = False) -> tuple[np.ndarray, ...]:
    chance = np.random.default_rng(seed)
    position = chance.normal(size=(count, 3)) * 10
    rotation = quaternion.normalize(chance.normal(size=(count, 4)))
    scale = chance.uniform(0.2, 3.0, size=(count, 3))
    if signs:
        scale[:, 0] *= chance.choice((-1.0, 1.0), size=count)
    return position, rotation, scale


def as_array(theirs: glm.dmat4) -> np.ndarray:
    return np.array(theirs.to_list()).T


def test_composition_agrees_with_glm() -> None:
    position, rotation, scale = random_affines(20)
    ours = matrix.affine_to_mat4(matrix.compose_affine(position, rotation, scale))
    for p, q, s, m in zip(position, rotation, scale, ours, strict=True):
        theirs = glm.translate(glm.dmat4(), glm.dvec3(*p)) * glm.mat4_cast(glm.dquat(q[3], q[0], q[1], q[2]))
        assert np.allclose(m, as_array(glm.scale(theirs, glm.dvec3(*s))), atol=1e-12)


def test_products_and_inverses_are_those_of_whole_matrices() -> None:
    a = matrix.compose_affine(*random_affines(30, 2))
    b = matrix.compose_affine(*random_affines(30, 3))
    whole = matrix.affine_to_mat4(a) @ matrix.affine_to_mat4(b)
    assert np.allclose(matrix.affine_to_mat4(matrix.multiply_affine(a, b)), whole)
    assert np.allclose(matrix.affine_to_mat4(matrix.inverse_affine(a)), np.linalg.inv(matrix.affine_to_mat4(a)))
    with pytest.raises(np.linalg.LinAlgError, match="scale of 0"):
        matrix.inverse_affine(matrix.compose_affine(np.zeros(3), quaternion.IDENTITY, (1.0, 0.0, 1.0)))
    points = np.random.default_rng(4).normal(size=(30, 3))
    assert np.allclose(matrix.transform_points(a, points), (whole_points(a, points)))


def whole_points(affine: np.ndarray, points: np.ndarray) -> np.ndarray:
    homogeneous = np.concatenate((points, np.ones((len(points), 1))), axis=1)
    return (matrix.affine_to_mat4(affine) @ homogeneous[..., None])[:, :3, 0]


@pytest.mark.parametrize("signs", [False, True])
def test_decomposition_undoes_composition(signs: bool) -> None:
    position, rotation, scale = random_affines(200, 5, signs=signs)
    affine = matrix.compose_affine(position, rotation, scale)
    p, q, s = matrix.decompose_affine(affine)
    assert np.allclose(matrix.compose_affine(p, q, s), affine, atol=1e-9)
    assert np.allclose(p, position)
    assert np.allclose(s, scale)


@pytest.mark.parametrize("scale", [(0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0), (0, 0, 2), (0, 2, 0), (2, 0, 0)])
def test_decomposition_of_flattened_transforms_is_a_rotation(scale: tuple[float, ...]) -> None:
    affine = matrix.compose_affine((1.0, 2.0, 3.0), quaternion.from_euler((0.3, 0.2, 0.1)), scale)
    p, q, s = matrix.decompose_affine(affine)
    assert np.isclose(np.linalg.norm(q), 1.0)
    assert np.allclose(matrix.compose_affine(p, q, s), affine, atol=1e-9)


def test_perspective_and_look_at_agree_with_glm() -> None:
    ours = matrix.perspective(0.8, 1.6, 0.1, 250.0)
    assert np.allclose(ours, as_array(glm.perspective(0.8, 1.6, 0.1, 250.0)), rtol=1e-5)
    eye, target = (3.0, 4.0, 5.0), (0.5, -1.0, 0.0)
    theirs = as_array(glm.lookAt(glm.dvec3(*eye), glm.dvec3(*target), glm.dvec3(0.0, 1.0, 0.0)))
    assert np.allclose(matrix.affine_to_mat4(matrix.look_at(eye, target)), theirs, atol=1e-12)


@pytest.mark.parametrize("direction", [(0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1), (1, 0, 0), (0.3, -2.0, 0.1)])
def test_looking_turns_minus_z_to_the_direction(direction: tuple[float, ...]) -> None:
    q = matrix.look_rotation(direction)
    assert np.allclose(
        quaternion.rotate(q, (0.0, 0.0, -1.0)), np.array(direction) / np.linalg.norm(direction), atol=1e-12
    )
    if direction[1] == 0:
        assert np.allclose(quaternion.rotate(q, (0.0, 1.0, 0.0)), (0.0, 1.0, 0.0), atol=1e-12)


def test_looking_nowhere_is_still_a_rotation() -> None:
    assert np.isclose(np.linalg.norm(matrix.look_rotation((0.0, 0.0, 0.0))), 1.0)


def propagated_slowly(parents: list[int], local: np.ndarray) -> np.ndarray:
    whole = matrix.affine_to_mat4(local)
    world: list[np.ndarray] = []
    for row, parent in enumerate(parents):
        world.append(whole[row] if parent < 0 else world[parent] @ whole[row])
    return np.array(world).reshape(-1, 4, 4)[:, :3]


@given(st.integers(0, 60).flatmap(lambda n: st.tuples(*[st.integers(-1, row - 1) for row in range(n)])))
def test_propagation_is_the_product_along_the_chain(parents: tuple[int, ...]) -> None:
    local = matrix.compose_affine(*random_affines(len(parents), 7))
    world = matrix.propagate_affine(np.array(parents, dtype=np.int32), local)
    assert np.allclose(world, propagated_slowly(list(parents), local), rtol=1e-6)


def test_a_chain_has_a_level_for_each_row_and_kept_levels_serve_again() -> None:
    parents = np.arange(-1, 999, dtype=np.int32)
    levels = matrix.depth_levels(parents)
    assert [len(rows) for rows in levels] == [1] * 1000
    local = matrix.compose_affine(np.ones((1000, 3)), np.tile(quaternion.IDENTITY, (1000, 1)), np.ones((1000, 3)))
    assert np.allclose(matrix.propagate_affine(parents, local, levels=levels)[:, 0, 3], np.arange(1, 1001))


def test_float32_stays() -> None:
    local = np.zeros((3, 3, 4), dtype=np.float32)
    assert matrix.propagate_affine(np.array([-1, 0, 1]), local).dtype == np.float32
    assert matrix.compose_affine(*(np.ones(n, dtype=np.float32) for n in (3, 4, 3))).dtype == np.float32


def test_the_near_plane_is_minus_one_and_the_far_one() -> None:
    clip_from_view = matrix.perspective(math.pi / 2, 2.0, 0.5, 20.0)
    for depth, expected in ((0.5, -1.0), (20.0, 1.0)):
        clip = clip_from_view @ (0.0, depth, -depth, 1.0)
        assert np.isclose(clip[2] / clip[3], expected)
        assert np.isclose(clip[1] / clip[3], 1.0)

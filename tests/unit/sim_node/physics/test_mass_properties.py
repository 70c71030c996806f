"""Mass properties against sums over many small cubes, and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.sim_node.physics.kernels.tables import BOX, CAPSULE, CYLINDER, SPHERE
from elys.sim_node.physics.mass_properties import Shapes, mass_properties, tensors, volumes


def shapes_of(*entries):
    kinds, halves, positions, rotations = zip(*entries, strict=True)
    kinds, halves = np.array(kinds), np.array(halves, float)
    weight, tensor = volumes(kinds, halves), tensors(kinds, halves)
    bodies = np.zeros(len(kinds), int)
    return Shapes(bodies, kinds, halves, np.array(positions), np.array(rotations), weight, tensor)


def tensor_of(properties):
    turn = Rotation.from_quat(properties.axes[0]).as_matrix()
    return turn @ np.diag(properties.inertia[0]) @ turn.T


def sampled(entries, count=60):
    """Centre and tensor per kilogram from a grid of points in every shape."""
    points, weights = [], []
    steps = (np.arange(count) + 0.5) / count * 2.0 - 1.0
    grid = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), -1).reshape(-1, 3)
    for kind, half, position, rotation in entries:
        box = np.array([half[0], half[1] + half[0], half[0]]) if kind == CAPSULE else np.asarray(half)
        inside = grid * box
        aside = inside[:, 0] ** 2 + inside[:, 2] ** 2
        if kind == SPHERE:
            inside = inside[(grid**2).sum(1) <= 1.0]
        elif kind == CYLINDER:
            inside = inside[aside <= half[0] ** 2]
        elif kind == CAPSULE:
            inside = inside[aside + np.maximum(abs(inside[:, 1]) - half[1], 0.0) ** 2 <= half[0] ** 2]
        points.append(Rotation.from_quat(rotation).apply(inside) + position)
        weights.append(np.full(len(inside), np.prod(box)))
    points, weights = np.concatenate(points), np.concatenate(weights)
    weights /= weights.sum()
    center = weights @ points
    away = points - center
    squared = (away**2).sum(1)
    return center, (weights * squared).sum() * np.eye(3) - np.einsum("n,ni,nj->ij", weights, away, away)


def test_a_box_and_a_ball_have_the_textbook_tensors():
    one = mass_properties(shapes_of((BOX, [1.0, 2.0, 3.0], [0, 0, 0], [0, 0, 0, 1])), 1)
    np.testing.assert_allclose(one.inertia[0], [(16 + 36) / 12, (4 + 36) / 12, (4 + 16) / 12])
    one = mass_properties(shapes_of((SPHERE, [0.5] * 3, [1, 0, 0], [0, 0, 0, 1])), 1)
    np.testing.assert_allclose(one.inertia[0], 0.4 * 0.25)
    np.testing.assert_allclose(one.center[0], [1, 0, 0])


@pytest.mark.parametrize("kind", [CAPSULE, CYLINDER])
def test_a_capsule_and_a_cylinder_equal_sums_over_small_cubes(kind):
    entry = (kind, [0.4, 0.7, 0.4], [0.0, 0, 0], [0.0, 0, 0, 1])
    _, tensor = sampled([entry], 90)
    np.testing.assert_allclose(tensor_of(mass_properties(shapes_of(entry), 1)), tensor, atol=2e-3 * np.trace(tensor))


def test_a_turned_box_is_turned_exactly():
    rotation = Rotation.from_euler("xyz", [0.3, -1.1, 2.0]).as_quat()
    one = mass_properties(shapes_of((BOX, [1.0, 2.0, 3.0], [0, 0, 0], rotation)), 1)
    np.testing.assert_array_equal(one.axes[0], rotation)


@pytest.mark.parametrize("seed", range(6))
def test_a_compound_equals_the_sum_of_its_parts(seed):
    rng = np.random.default_rng(seed)
    entries = []
    for kind in rng.integers(0, 4, 3):
        half = rng.uniform(0.2, 1.0, 3)
        if kind != BOX:
            half[[0, 2]] = half[0]
        if kind == SPHERE:
            half[1] = half[0]
        entries.append((kind, half, rng.uniform(-2, 2, 3), Rotation.random(random_state=rng).as_quat()))
    center, tensor = sampled(entries)
    properties = mass_properties(shapes_of(*entries), 1)
    np.testing.assert_allclose(properties.center[0], center, atol=2e-3)
    np.testing.assert_allclose(tensor_of(properties), tensor, atol=3e-3 * np.trace(tensor))
    assert (properties.inertia[0] <= properties.inertia[0].sum() - properties.inertia[0] + 1e-12).all()


def test_bodies_do_not_mix_and_one_without_shape_still_turns():
    shapes = Shapes(
        np.array([0, 2, 2]),
        np.array([BOX, BOX, BOX]),
        np.full((3, 3), 0.5),
        np.array([[0.0, 0, 0], [-1, 0, 0], [1, 0, 0]]),
        np.tile([0.0, 0, 0, 1], (3, 1)),
        np.ones(3),
        np.tile(np.eye(3) / 6, (3, 1, 1)),
    )
    properties = mass_properties(shapes, 3)
    np.testing.assert_allclose(properties.inertia[0], 1 / 6)
    np.testing.assert_allclose(properties.inertia[1], 0.4 * 0.25)
    np.testing.assert_allclose(properties.inertia[2], [1 / 6, 1 / 6 + 1, 1 / 6 + 1])

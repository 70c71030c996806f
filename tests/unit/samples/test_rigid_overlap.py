"""The judge of overlap, against closed forms, against a convex hull, sampled points and all pairs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from elys.samples.rigid_cases import BOX, CAPSULE, SPHERE, STATIC, deepest_overlap
from elys.samples.rigid_cases.overlap import pair_depths
from elys.samples.rigid_cases.scene import bodies


def depth_of(pair):
    return float(pair_depths(pair, pair.position, pair.rotation, np.array([0]), np.array([1]))[0])


def about_z(degrees):
    return Rotation.from_euler("z", degrees, degrees=True).as_quat()


@pytest.mark.parametrize(
    ("position", "rotation", "depth"),
    [
        ((0, 0.99, 0), (0, 0, 0, 1), 0.01),
        ((0.3, 1.02, -0.2), (0, 0, 0, 1), -0.02),
        ((0, 0.5 + math.sqrt(0.5) - 0.003, 0), about_z(45), 0.003),
    ],
)
def test_cubes_overlap_as_their_faces_do(position, rotation, depth):
    pair = bodies([(0, 0, 0), position], rotation=[(0, 0, 0, 1), rotation])
    assert depth_of(pair) == pytest.approx(depth, abs=1e-12)


def test_crossed_edges_are_parted_along_their_common_normal():
    """Two cubes that stand on edge, the upper turned by a quarter: the lowest edge lies across the highest."""
    upper = (Rotation.from_euler("y", 90, degrees=True) * Rotation.from_quat(about_z(45))).as_quat()
    pair = bodies([(0, 0, 0), (0, math.sqrt(2.0) - 0.004, 0)], rotation=[about_z(45), upper])
    assert depth_of(pair) == pytest.approx(0.004, abs=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_boxes_overlap_by_the_way_out_of_their_minkowski_difference(seed):
    """Two bodies overlap where the origin lies inside all differences of their points; the nearest face is the way out."""
    rng = np.random.default_rng(seed)
    turns = Rotation.random(2, random_state=seed)
    pair = bodies([(0, 0, 0), rng.uniform(-0.4, 0.4, 3)], size=rng.uniform(0.5, 1.5, (2, 3)), rotation=turns.as_quat())
    corners = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, 8).T
    first, second = (turns[k].apply(corners * pair.size[k]) + pair.position[k] for k in range(2))
    differences = (second[:, None] - first[None]).reshape(-1, 3)
    assert depth_of(pair) == pytest.approx(-ConvexHull(differences).equations[:, 3].max(), abs=1e-9)


def test_round_shapes_overlap_by_radii_less_distance():
    shape = [SPHERE, CAPSULE]
    pair = bodies([(0, 0, 0), (0.75, 0.3, 0)], shape=shape, radius=[0.5, 0.3], half_length=[0.0, 0.4])
    assert depth_of(pair) == pytest.approx(0.05)
    beside = bodies([(0, 0, 0), (0.3, 0.6 + 0.4, 0.4)], shape=shape, radius=[0.5, 0.3], half_length=[0.0, 0.4])
    assert depth_of(beside) == pytest.approx(0.8 - math.sqrt(0.09 + 0.36 + 0.16))


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("other", [BOX, CAPSULE])
def test_a_capsule_is_as_deep_as_the_deepest_of_many_spheres_on_its_axis(seed, other):
    rng = np.random.default_rng(seed)
    pair = bodies(
        [(0, 0, 0), rng.normal(size=3)],
        shape=[other, CAPSULE],
        radius=0.3,
        half_length=0.6,
        rotation=Rotation.random(2, random_state=seed).as_quat(),
    )
    axis = Rotation.from_quat(pair.rotation[1]).apply([0, 1, 0])
    centers = pair.position[1] + np.linspace(-0.6, 0.6, 2001)[:, None] * axis
    count = len(centers)
    first = bodies(
        np.zeros((count, 3)), shape=other, radius=0.3, half_length=0.6, rotation=np.tile(pair.rotation[0], (count, 1))
    )
    spheres = bodies(centers, shape=SPHERE, radius=0.3)
    both = type(first)(*(np.concatenate(columns) for columns in zip(first, spheres, strict=True)))
    rows = np.arange(count)
    depths = pair_depths(both, both.position, both.rotation, rows, rows + count)
    # Distance changes by no more than one moves: half of 1.2 m / 2000 between samples.
    assert depths.max() - 1e-9 <= depth_of(pair) <= depths.max() + 3e-4


@pytest.mark.parametrize("seed", range(5))
def test_neighbours_are_all_found(seed):
    """Against every pair there is."""
    rng = np.random.default_rng(seed)
    count = 80
    crowd = bodies(
        rng.uniform(-3, 3, (count, 3)) + 1e4,
        shape=rng.integers(0, 3, count),
        size=rng.uniform(0.1, 1.0, (count, 3)),
        radius=0.2,
        half_length=0.3,
        rotation=Rotation.random(count, random_state=seed).as_quat(),
        motion=np.where(np.arange(count) < 3, STATIC, 0),
    )
    a, b = np.triu_indices(count, 1)
    some_move = b >= 3  # two static bodies may overlap as they like
    deepest = pair_depths(crowd, crowd.position, crowd.rotation, a[some_move], b[some_move]).max()
    assert deepest > 0.0
    assert deepest_overlap(crowd, crowd.position, crowd.rotation) == pytest.approx(deepest, abs=1e-12)

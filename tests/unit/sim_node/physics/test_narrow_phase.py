"""Manifolds against a plain separating-axis test in numpy and against geometry: hundreds of random pairs in one world."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.sim_node.physics import BOX, SPHERE, PhysicsSettings, PhysicsWorld

COUNT = 400
INSTANT = 1e-7  # a step so short that nothing moves
SPACING = 50.0


class Pairs:
    """Random pairs of shapes, each at its own place; `a` and `b` are (kind, half, position, rotation) by pair."""

    def __init__(self, kind_a, kind_b, seed, distance=(0.2, 1.6)):
        rng = np.random.default_rng(seed)
        self.kind = [kind_a, kind_b]
        self.half = [rng.uniform(0.2, 1.0, (COUNT, 3)) for _ in range(2)]
        for side in range(2):
            if self.kind[side] == SPHERE:
                self.half[side][:] = self.half[side][:, :1]
        self.rotation = [Rotation.random(COUNT, random_state=rng) for _ in range(2)]
        # Some pairs lie flat on one another, as in a stack.
        flat = np.arange(COUNT) % 4 == 0
        turned = Rotation.from_rotvec(rng.uniform(-1, 1, (COUNT, 1)) * [0, 1, 0])
        self.rotation = [
            Rotation.from_quat(np.where(flat[:, None], turned.as_quat(), r.as_quat())) for r in self.rotation
        ]
        away = rng.normal(size=(COUNT, 3))
        away *= rng.uniform(*distance, (COUNT, 1)) / np.linalg.norm(away, axis=1, keepdims=True)
        base = np.zeros((COUNT, 3))
        base[:, 0] = SPACING * np.arange(COUNT)
        self.position = [base, base + away]

    def manifolds(self, swapped=False):
        """By pair: (normal from a to b, points, depths), for those that overlap."""
        world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0)))
        order = (1, 0) if swapped else (0, 1)
        entities = 1 + 2 * np.arange(COUNT)
        for offset, side in enumerate(order):
            world.add_bodies(entities + offset, position=self.position[side], rotation=self.rotation[side].as_quat())
        for offset, side in enumerate(order):
            world.add_colliders(
                entities + offset, shape=self.kind[side], size=2 * self.half[side], radius=self.half[side][:, 0]
            )
        world.step(INSTANT)
        contacts = world.contacts
        pair = (contacts.entity_a.astype(int) - 1) // 2
        sign = -1.0 if swapped else 1.0
        return {
            int(p): (sign * contacts.normal[pair == p][0], contacts.point[pair == p], contacts.depth[pair == p])
            for p in np.unique(pair)
        }

    def axes(self, side, pair):
        return self.rotation[side].as_matrix()[pair].T

    def extent(self, side, pair, direction):
        """How far a shape reaches along a direction, from its centre."""
        half = self.half[side][pair]
        return half[0] if self.kind[side] == SPHERE else abs(self.axes(side, pair) @ direction) @ half

    def gap_along(self, pair, direction):
        away = self.position[1][pair] - self.position[0][pair]
        return abs(away @ direction) - self.extent(0, pair, direction) - self.extent(1, pair, direction)

    def box_gap(self, pair):
        """Largest gap over the fifteen axes of two boxes: negative for overlap."""
        a, b = self.axes(0, pair), self.axes(1, pair)
        directions = [*a, *b]
        for i in range(3):
            for j in range(3):
                product = np.cross(a[i], b[j])
                if np.linalg.norm(product) > 1e-2:
                    directions.append(product / np.linalg.norm(product))
        return max(self.gap_along(pair, d) for d in directions)

    def distance_outside(self, side, pair, points):
        """How far points lie outside a shape; 0 inside."""
        local = (points - self.position[side][pair]) @ self.axes(side, pair).T
        if self.kind[side] == SPHERE:
            return np.maximum(np.linalg.norm(local, axis=1) - self.half[side][pair, 0], 0.0)
        return np.linalg.norm(np.maximum(abs(local) - self.half[side][pair], 0.0), axis=1)


@pytest.fixture(scope="module")
def boxes():
    return Pairs(BOX, BOX, seed=3)


def test_boxes_touch_exactly_where_no_axis_separates_them(boxes):
    manifolds = boxes.manifolds()
    for pair in range(COUNT):
        gap = boxes.box_gap(pair)
        if abs(gap) > 1e-6:
            assert (pair in manifolds) == (gap < 0.0), pair
    assert 100 < len(manifolds) < COUNT - 50


def test_a_box_normal_is_an_axis_of_nearly_least_overlap_and_the_depth_is_the_overlap_along_it(boxes):
    for pair, (normal, _, depth) in boxes.manifolds().items():
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        assert normal @ (boxes.position[1][pair] - boxes.position[0][pair]) >= 0.0
        along = -boxes.gap_along(pair, normal)
        smallest = min(boxes.half[0][pair].min(), boxes.half[1][pair].min())
        least = -boxes.box_gap(pair)
        assert along <= least + 0.012 * smallest
        # The deepest corner lies over the face unless an edge would have been the slightly better axis.
        assert depth.max() <= along + 1e-6
        assert depth.max() >= least - (1e-6 if along < least + 1e-9 else 0.012 * smallest)


def test_box_contact_points_lie_in_both_boxes(boxes):
    for pair, (_, points, depth) in boxes.manifolds().items():
        assert 1 <= len(points) <= 4
        for side in range(2):
            # Points are kept in the middle between the surfaces; those with a gap lie up to half of it outside.
            outside = boxes.distance_outside(side, pair, points)
            assert (outside <= np.maximum(-depth, 0.5 * depth.clip(0)) + 1e-6).all(), pair


def test_flat_boxes_get_points_that_span_their_common_area():
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0)))
    world.add_bodies([1, 2], position=[[0, 0, 0], [0.6, 0.999, 0.3]])
    world.add_colliders([1, 2], size=[1.0, 1.0, 1.0])
    world.step(INSTANT)
    found = {tuple(np.round(p, 5)) for p in world.contacts.point[:, [0, 2]]}
    assert found == {(0.1, -0.2), (0.1, 0.5), (0.5, -0.2), (0.5, 0.5)}


@pytest.mark.parametrize(("kind_a", "kind_b"), [(BOX, BOX), (BOX, SPHERE), (SPHERE, SPHERE)])
def test_swapping_the_bodies_mirrors_the_manifold(kind_a, kind_b):
    pairs = Pairs(kind_a, kind_b, seed=11)
    there, back = pairs.manifolds(), pairs.manifolds(swapped=True)
    assert there.keys() == back.keys()
    same = 0
    for pair, (normal, points, depth) in there.items():
        other_normal, other_points, other_depth = back[pair]
        if np.allclose(normal, other_normal, atol=1e-6):
            same += 1
            assert depth.max() == pytest.approx(other_depth.max(), abs=1e-6)
            if kind_b == SPHERE:
                np.testing.assert_allclose(points, other_points, atol=1e-6)
    # Where two axes are equally good, either may be chosen.
    assert same > 0.9 * len(there)


def test_spheres_touch_where_geometry_says():
    pairs = Pairs(SPHERE, SPHERE, seed=5)
    manifolds = pairs.manifolds()
    away = pairs.position[1] - pairs.position[0]
    distance = np.linalg.norm(away, axis=1)
    depth = pairs.half[0][:, 0] + pairs.half[1][:, 0] - distance
    assert set(manifolds) == set(np.flatnonzero(depth > 0.0))
    for pair, (normal, points, found) in manifolds.items():
        np.testing.assert_allclose(normal, away[pair] / distance[pair], atol=1e-6)
        assert found[0] == pytest.approx(depth[pair], abs=1e-5)
        middle = pairs.position[0][pair] + normal * (pairs.half[0][pair, 0] - depth[pair])
        assert np.linalg.norm(points[0] - middle) <= depth[pair] + 1e-6


def test_a_sphere_touches_a_box_at_its_nearest_point():
    pairs = Pairs(BOX, SPHERE, seed=6, distance=(0.5, 2.0))
    manifolds = pairs.manifolds()
    for pair in range(COUNT):
        local = pairs.rotation[0][pair].apply(pairs.position[1][pair] - pairs.position[0][pair], inverse=True)
        nearest = np.clip(local, -pairs.half[0][pair], pairs.half[0][pair])
        gap = np.linalg.norm(local - nearest) - pairs.half[1][pair, 0]
        if abs(gap) > 1e-6:
            assert (pair in manifolds) == (gap < 0.0)
        if pair in manifolds and np.linalg.norm(local - nearest) > 1e-6:
            normal = pairs.rotation[0][pair].apply((local - nearest) / np.linalg.norm(local - nearest))
            np.testing.assert_allclose(manifolds[pair][0], normal, atol=1e-6)
            assert manifolds[pair][2][0] == pytest.approx(-gap, abs=1e-5)


def test_a_sphere_within_a_box_leaves_through_the_nearest_face():
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0)))
    world.add_bodies([1, 2], position=[[0, 0, 0], [0.1, -0.7, 0.2]], motion=[2, 0])
    world.add_colliders([1, 2], shape=[BOX, SPHERE], size=[2.0, 2.0, 2.0], radius=0.25)
    world.step(INSTANT)
    np.testing.assert_allclose(world.contacts.normal, [[0.0, -1.0, 0.0]])
    assert world.contacts.depth[0] == pytest.approx(0.3 + 0.25, abs=1e-5)


def test_concentric_spheres_part():
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0)))
    world.add_bodies([1, 2])
    world.add_colliders([1, 2], shape=SPHERE)
    for _ in range(60):
        world.step(1.0 / 60.0)
    assert np.linalg.norm(world.bodies.position[1] - world.bodies.position[0]) > 0.95

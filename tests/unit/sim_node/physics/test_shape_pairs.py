"""Manifolds of every pair of shapes against a program that looks for the widest gap: who touches, how deep, and symmetries."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from elys.sim_node.physics import BOX, CAPSULE, CYLINDER, HULL, PLANE, SPHERE, PhysicsSettings, PhysicsWorld

COUNT = 30
INSTANT = 1e-7  # a step so short that nothing moves
KINDS = [BOX, SPHERE, CAPSULE, CYLINDER, HULL]
NAMES = {BOX: "box", SPHERE: "sphere", CAPSULE: "capsule", CYLINDER: "cylinder", HULL: "hull", PLANE: "plane"}
PAIRS = [(a, b) for a in KINDS for b in KINDS if a <= b and b not in (SPHERE,)] + [(SPHERE, SPHERE)]
TURN = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
RIM = np.stack([np.cos(TURN), np.zeros(len(TURN)), np.sin(TURN)], 1)
UP = np.array([0.0, 1.0, 0.0])
STRAIGHT = Rotation.identity()
AWAY = np.array([1000.0, -2000.0, 500.0])
HULL_POINTS = np.random.default_rng(12).normal(size=(14, 3)) * 0.4


class Pairs:
    """Random pairs of shapes, each pair at its own place."""

    def __init__(self, kinds, seed, frame=STRAIGHT, shift=(0.0, 0.0, 0.0)):
        rng = np.random.default_rng(seed)
        self.kinds = kinds
        self.radius = rng.uniform(0.2, 0.6, (2, COUNT))
        self.half_length = rng.uniform(0.2, 0.8, (2, COUNT))
        self.size = rng.uniform(0.5, 1.5, (2, COUNT, 3))
        self.rotation = [frame * Rotation.random(COUNT, random_state=rng) for _ in range(2)]
        base = np.zeros((COUNT, 3))
        base[:, 0] = 20.0 * np.arange(COUNT)
        away = rng.normal(size=(COUNT, 3))
        away *= rng.uniform(0.5, 1.3, (COUNT, 1)) / np.linalg.norm(away, axis=1, keepdims=True)
        self.position = [frame.apply(base) + shift, frame.apply(base + away) + shift]

    def world(self, order=(0, 1)):
        world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0)))
        hull = world.add_hull(HULL_POINTS)
        entities = 1 + 2 * np.arange(COUNT)
        for offset, side in enumerate(order):
            world.add_bodies(entities + offset, position=self.position[side], rotation=self.rotation[side].as_quat())
            world.add_colliders(
                entities + offset,
                shape=self.kinds[side],
                size=self.size[side],
                radius=self.radius[side],
                half_length=self.half_length[side],
                geometry=hull,
            )
        return world

    def manifolds(self, order=(0, 1)):
        """By pair: normal from a to b, points (P, 3), depths (P,), of those that overlap."""
        world = self.world(order)
        world.step(INSTANT)
        contacts = world.contacts
        pair = (contacts.entity_a.astype(int) - 1) // 2
        sign = 1.0 if order == (0, 1) else -1.0
        return {
            int(p): (sign * contacts.normal[pair == p][0], contacts.point[pair == p], contacts.depth[pair == p])
            for p in np.unique(pair)
        }

    def core(self, side, pair):
        """Points whose hull is the shape without its radius, and the radius."""
        kind = self.kinds[side]
        radius, half = self.radius[side, pair], self.half_length[side, pair]
        if kind == BOX:
            local = 0.5 * self.size[side, pair] * (np.indices((2, 2, 2)).reshape(3, -1).T * 2 - 1)
        elif kind == HULL:
            local = HULL_POINTS
        elif kind == CYLINDER:
            local = np.concatenate([radius * RIM + half * UP, radius * RIM - half * UP])
        else:
            local = np.array([half * UP, -half * UP]) if kind == CAPSULE else np.zeros((1, 3))
        points = self.position[side][pair] + self.rotation[side][pair].apply(local)
        return points, radius if kind in (SPHERE, CAPSULE) else 0.0

    def gap_along(self, pair, direction):
        p, radius_p = self.core(0, pair)
        q, radius_q = self.core(1, pair)
        return (q @ direction).min() - (p @ direction).max() - radius_p - radius_q

    def gap(self, pair):
        """The widest gap over all directions: the distance, or minus the least overlap."""
        rng = np.random.default_rng(0)
        starts = rng.normal(size=(3000, 3))
        starts /= np.linalg.norm(starts, axis=1, keepdims=True)
        p, radius_p = self.core(0, pair)
        q, radius_q = self.core(1, pair)
        middle = p.mean(0)
        p, q = p - middle, q - middle
        gaps = (q @ starts.T).min(0) - (p @ starts.T).max(0)
        best = -np.inf
        for start in starts[np.argsort(-gaps)[:3]]:
            x0 = np.array([*start, (p @ start).max(), (q @ start).min() - (p @ start).max()])
            constraints = [
                {"type": "ineq", "fun": lambda x: q @ x[:3] - x[3] - x[4], "jac": lambda x: rows(q, -1.0, -1.0)},
                {"type": "ineq", "fun": lambda x: x[3] - p @ x[:3], "jac": lambda x: rows(-p, 1.0, 0.0)},
                {"type": "eq", "fun": lambda x: x[:3] @ x[:3] - 1.0, "jac": lambda x: np.array([*(2 * x[:3]), 0, 0])},
            ]
            found = minimize(
                lambda x: -x[4],
                x0,
                jac=lambda x: np.array([0, 0, 0, 0, -1.0]),
                constraints=constraints,
                method="SLSQP",
                options={"ftol": 1e-12, "maxiter": 200},
            )
            n = found.x[:3] / np.linalg.norm(found.x[:3])
            best = max(best, (q @ n).min() - (p @ n).max())
        return best - radius_p - radius_q

    def smallest(self, pair):
        return min(self.radius[:, pair].min(), 0.5 * self.size[:, pair].min(), self.half_length[:, pair].min())


def rows(points, third, fourth):
    return np.column_stack([points, np.full(len(points), third), np.full(len(points), fourth)])


def named(pair):
    return "-".join(NAMES[kind] for kind in pair)


@pytest.mark.parametrize("kinds", PAIRS, ids=named)
def test_shapes_touch_where_no_direction_shows_a_gap_and_as_deep_as_they_overlap(kinds):
    pairs = Pairs(kinds, seed=kinds[0] * 10 + kinds[1])
    manifolds = pairs.manifolds()
    assert 5 <= len(manifolds) < COUNT
    alike = 0
    for pair in range(COUNT):
        gap = pairs.gap(pair)
        if abs(gap) > 1e-4:
            assert (pair in manifolds) == (gap < 0.0), (pair, gap)
        if pair not in manifolds:
            continue
        normal, points, depth = manifolds[pair]
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-6)
        # What the normal says: the depth is the overlap seen along it, and parting by it parts the shapes.
        along = -pairs.gap_along(pair, normal)
        slack = 1e-4 + 0.012 * pairs.smallest(pair)
        assert along > 0.0
        assert depth.max() <= along + 1e-4
        # A deep point of a rim may lie between the corners of the octagon that stands for it, or beside the other's face.
        assert depth.max() >= along - slack - (0.1 * along if CYLINDER in kinds else 0.0) or len(points) == 4
        alike += along <= -gap + slack
        assert 1 <= len(points) <= 4
    # Where the overlap is deep a neighbouring minimum may be found.
    assert alike >= 0.6 * len(manifolds)


@pytest.mark.parametrize("kinds", PAIRS, ids=named)
def test_swapping_the_bodies_mirrors_the_manifold(kinds):
    pairs = Pairs(kinds, seed=50 + kinds[0] * 10 + kinds[1])
    there, back = pairs.manifolds(), pairs.manifolds((1, 0))
    assert there.keys() == back.keys()
    same = 0
    for pair, (normal, _, depth) in there.items():
        other_normal, _, other_depth = back[pair]
        if np.allclose(normal, other_normal, atol=1e-4):
            same += 1
            assert depth.max() == pytest.approx(other_depth.max(), abs=1e-4)
    assert same >= 0.8 * len(there)


@pytest.mark.parametrize("kinds", PAIRS, ids=named)
def test_turning_and_moving_the_world_turns_and_moves_the_manifolds(kinds):
    turn = Rotation.from_euler("xyz", [0.4, -1.2, 2.2])
    here = Pairs(kinds, seed=kinds[0] * 10 + kinds[1])
    there = Pairs(kinds, seed=kinds[0] * 10 + kinds[1], frame=turn, shift=AWAY)
    before, after = here.manifolds(), there.manifolds()
    assert before.keys() == after.keys()
    same = 0
    for pair, (normal, points, depth) in before.items():
        other_normal, other_points, other_depth = after[pair]
        if np.allclose(turn.apply(normal), other_normal, atol=1e-4) and len(points) == len(other_points):
            same += 1
            assert depth.max() == pytest.approx(other_depth.max(), abs=1e-4)
            middle = turn.apply(points.mean(0)) + AWAY
            if len(points) < 3 and CYLINDER not in kinds:  # of more, and of a rim, others may be chosen
                np.testing.assert_allclose(middle, other_points.mean(0), atol=2e-3)
    # Rims end their search early, and deep ones differ by where they began.
    assert same >= (0.7 if CYLINDER in kinds else 0.9) * len(before)


@pytest.mark.parametrize("kind", KINDS, ids=NAMES.get)
def test_a_plane_meets_what_reaches_into_it_by_its_lowest_points(kind):
    pairs = Pairs((kind, kind), seed=3)
    pairs.position[0][:, 1] = np.linspace(-0.3, 1.5, COUNT)
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0)))
    hull = world.add_hull(HULL_POINTS)
    entities = 2 + np.arange(COUNT)
    world.add_bodies([1], motion=2, position=[[300.0, 0.0, -50.0]], rotation=[[0.0, 0.6, 0.0, 0.8]])
    world.add_colliders([1], shape=PLANE)
    world.add_bodies(entities, position=pairs.position[0], rotation=pairs.rotation[0].as_quat())
    world.add_colliders(
        entities,
        shape=kind,
        size=pairs.size[0],
        radius=pairs.radius[0],
        half_length=pairs.half_length[0],
        geometry=hull,
    )
    world.step(INSTANT)
    contacts = world.contacts
    assert (contacts.entity_a == 1).all()
    np.testing.assert_allclose(contacts.normal, np.tile(UP, (len(contacts.normal), 1)), atol=1e-7)
    lowest = np.array([points[:, 1].min() - radius for points, radius in (pairs.core(0, k) for k in range(COUNT))])
    touching = np.isin(entities, contacts.entity_b)
    np.testing.assert_array_equal(touching[abs(lowest) > 1e-6], (lowest < 0.0)[abs(lowest) > 1e-6])
    for k in np.flatnonzero(touching):
        assert contacts.depth[contacts.entity_b == entities[k]].max() == pytest.approx(-lowest[k], abs=1e-4)

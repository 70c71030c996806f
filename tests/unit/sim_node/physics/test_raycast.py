"""Rays against a plain implementation that tries every shape."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.common.errors import PhysicsError
from elys.sim_node.physics import BOX, SPHERE, PhysicsWorld

BODIES = 60
RAYS = 150


def scene():
    rng = np.random.default_rng(4)
    position = rng.uniform(-10, 10, (BODIES, 3))
    rotation = Rotation.random(BODIES, random_state=rng)
    kind = rng.integers(0, 2, BODIES)
    size = rng.uniform(0.5, 4.0, (BODIES, 3))
    radius = rng.uniform(0.3, 2.0, BODIES)
    world = PhysicsWorld()
    entities = np.arange(1, BODIES + 1)
    world.add_bodies(entities, position=position, rotation=rotation.as_quat())
    world.add_colliders(entities, shape=kind, size=size, radius=radius)
    return world, position, rotation, kind, size, radius


def slow_raycast(origin, direction, position, rotation, kind, size, radius):
    """Nearest (distance, body, normal); a shape around the origin counts at distance 0."""
    best = (np.inf, -1, np.zeros(3))
    for i in range(BODIES):
        o = rotation[i].apply(origin - position[i], inverse=True)
        d = rotation[i].apply(direction, inverse=True)
        if kind[i] == SPHERE:
            roots = np.roots([d @ d, 2 * o @ d, o @ o - radius[i] ** 2])
            if o @ o <= radius[i] ** 2:
                t, normal = 0.0, -d
            elif np.isreal(roots).all() and roots.real.min() >= 0:
                t = roots.real.min()
                normal = (o + t * d) / radius[i]
            else:
                continue
        else:
            half = size[i] / 2
            near, far = np.sort([(-half - o) / d, (half - o) / d], axis=0)
            if near.max() > far.min() or far.min() < 0:
                continue
            t = max(near.max(), 0.0)
            axis = near.argmax()
            normal = -np.sign(d[axis]) * np.eye(3)[axis] if t > 0 else -d
        if t < best[0]:
            best = (t, i, rotation[i].apply(normal))
    return best


def test_rays_meet_what_a_plain_search_finds():
    world, *shapes = scene()
    rng = np.random.default_rng(5)
    origins = rng.uniform(-15, 15, (RAYS, 3))
    directions = rng.uniform(-10, 10, (RAYS, 3)) - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    hits = world.raycast(origins, 3.0 * directions)
    for r in range(RAYS):
        distance, body, normal = slow_raycast(origins[r], directions[r], *shapes)
        assert hits.entity[r] == body + 1
        if body >= 0:
            assert hits.distance[r] == pytest.approx(distance, abs=1e-6)
            np.testing.assert_allclose(hits.normal[r], normal, atol=1e-5)
        else:
            assert hits.distance[r] == np.inf
    assert 20 < (hits.entity > 0).sum() < RAYS


def test_the_farthest_distance_is_kept_and_axis_aligned_rays_work():
    world = PhysicsWorld()
    world.add_bodies([5], position=[0, 0, 10])
    world.add_colliders([5], shape=BOX, size=[2, 2, 2], owners=[9])
    near, far = world.raycast([[0, 0, 0], [0, 0, 0]], [0, 0, 1], max_distance=[8.9, 9.1]).entity
    assert (near, far) == (0, 9)
    beside = world.raycast([1.5, 0, 0], [0, 0, 1])
    assert beside.entity.tolist() == [0]


def test_asking_changes_nothing():
    def run(ask):
        world, *_ = scene()
        for _ in range(20):
            world.step(1 / 60)
            if ask:
                world.raycast([0, 20, 0], [0, -1, 0])
        return world.state_hash()

    assert run(True) == run(False)


@pytest.mark.parametrize(
    ("origin", "direction", "sentence"),
    [([0, 0, 0], [0, 0, 0], "length 0"), ([np.nan, 0, 0], [0, 0, 1], "finite"), ([0, 0], [0, 1], "shape")],
)
def test_bad_rays_are_refused(origin, direction, sentence):
    with pytest.raises(PhysicsError, match=sentence):
        PhysicsWorld().raycast(origin, direction)


def test_rays_into_an_empty_world_meet_nothing():
    assert PhysicsWorld().raycast([0, 0, 0], [1, 0, 0]).entity.tolist() == [0]

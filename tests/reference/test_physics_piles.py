"""Many bodies at rest: stacks stand, piles stay in their bin and come to rest."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.sim_node.physics import BOX, DYNAMIC, STATIC, PhysicsWorld

DT = 1.0 / 60.0


def run(world, seconds):
    for _ in range(round(seconds / DT)):
        world.step(DT)


def stack(count, *, offset, seed=0, size=1.0):
    rng = np.random.default_rng(seed)
    position = np.zeros((count + 1, 3))
    position[1:, 1] = (np.arange(count) + 0.5) * size
    position[1:, [0, 2]] = rng.uniform(-offset, offset, (count, 2))
    position[0, 1] = -1.0
    world = PhysicsWorld()
    entities = np.arange(1, count + 2)
    world.add_bodies(entities, motion=[STATIC] + [DYNAMIC] * count, position=position)
    world.add_colliders(entities, size=[[40, 2, 40]] + [[size] * 3] * count)
    return world, position


@pytest.mark.parametrize("seed", [0, 1])
def test_a_stack_of_ten_stands_for_ten_seconds(seed):
    world, start = stack(10, offset=0.002, seed=seed)
    run(world, 10.0)
    moved = world.bodies.position - start
    assert abs(moved[:, [0, 2]]).max() < 0.01
    assert moved[-1, 1] > -0.04
    assert world.contacts.depth.max() < 0.006
    assert world.energy().kinetic < 1e-6


def test_a_stack_of_thirty_sways_but_stands():
    world, start = stack(30, offset=0.002)
    run(world, 20.0)
    moved = world.bodies.position - start
    assert abs(moved[:, [0, 2]]).max() < 0.03
    assert moved[-1, 1] > -0.3


def test_the_weight_of_a_stack_stands_on_its_foot():
    world, _ = stack(5, offset=0.0)
    run(world, 3.0)
    contacts = world.contacts
    for k in range(5):
        below = (contacts.entity_a == k + 1) & (contacts.entity_b == k + 2)
        assert contacts.normal_impulse[below].sum() == pytest.approx((5 - k) * 9.81 * DT, rel=1e-4)


def bin_of(count, *, shapes, seed=0, restitution=0.0):
    """Bodies, randomly turned, over a bin of four walls and a floor."""
    rng = np.random.default_rng(seed)
    width, layer = 8.0, 16
    i = np.arange(count)
    position = np.stack([i % 4 - 1.5, i // layer + 0.6, (i // 4) % 4 - 1.5], axis=1) * 1.8
    position += rng.uniform(-0.03, 0.03, (count, 3))
    height = position[:, 1].max() + 10.0
    half = width / 2 + 1.0
    walls = [[0, -1, 0], [half, height / 2, 0], [-half, height / 2, 0], [0, height / 2, half], [0, height / 2, -half]]
    sizes = [[20, 2, 20], [2, height, 20], [2, height, 20], [20, height, 2], [20, height, 2]]
    entities = np.arange(1, count + 6)
    world = PhysicsWorld()
    world.add_bodies(
        entities,
        motion=[STATIC] * 5 + [DYNAMIC] * count,
        position=np.concatenate([walls, position]),
        rotation=np.concatenate([np.tile([0, 0, 0, 1.0], (5, 1)), Rotation.random(count, random_state=rng).as_quat()]),
    )
    world.add_colliders(
        entities,
        shape=[BOX] * 5 + [shapes[k % len(shapes)] for k in range(count)],
        size=np.concatenate([sizes, np.ones((count, 3))]),
        restitution=restitution,
    )
    return world, width


@pytest.mark.parametrize(("shapes", "restitution"), [([0], 0.0), ([0, 1], 0.3)])
def test_a_pile_of_two_hundred_stays_in_its_bin_and_comes_to_rest(shapes, restitution):
    world, width = bin_of(200, shapes=shapes, restitution=restitution)
    highest = sum(world.energy())
    for _ in range(600):
        world.step(DT)
        energy = sum(world.energy())
        assert energy <= highest * 1.0001 + 1.0
        highest = min(highest, energy)
    inside = world.bodies.position[5:]
    assert (abs(inside[:, [0, 2]]) < width / 2).all()
    assert (inside[:, 1] > 0.0).all()
    assert world.contacts.depth.max() < 0.08
    assert world.energy().kinetic < 1.0
    assert world.take_problems() == []

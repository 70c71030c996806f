"""Hashes and snapshots of the whole state."""

from __future__ import annotations

import numpy as np
import pytest

from elys.common.errors import PhysicsError
from elys.sim_node.physics import DYNAMIC, SPHERE, STATIC, PhysicsWorld

DT = 1.0 / 60.0


def heap(count=40, seed=0):
    rng = np.random.default_rng(seed)
    world = PhysicsWorld()
    entities = np.arange(1, count + 2)
    position = np.concatenate([[[0, -1, 0]], rng.uniform([-2, 0.5, -2], [2, 6, 2], (count, 3))])
    world.add_bodies(entities, motion=[STATIC] + [DYNAMIC] * count, position=position)
    world.add_colliders(
        entities,
        shape=[0] + [SPHERE * (k % 2) for k in range(count)],
        size=[[40, 2, 40]] + [[0.8, 0.6, 0.7]] * count,
        radius=0.4,
        restitution=0.2,
    )
    return world


def test_equal_states_have_equal_hashes_and_any_bit_counts():
    one, two = heap(), heap()
    assert one.state_hash() == two.state_hash()
    hashes = {one.state_hash()}
    velocity = one.bodies.linear_velocity[5].astype(float)
    two.set_velocities([6], linear=np.nextafter(velocity, 1.0))
    hashes.add(two.state_hash())
    two.remove_bodies([6])
    hashes.add(two.state_hash())
    one.step(DT)
    hashes.add(one.state_hash())
    assert len(hashes) == 4
    assert all(0 <= value < 2**64 for value in hashes)
    assert PhysicsWorld().state_hash() == PhysicsWorld().state_hash()


def test_exchanged_bodies_have_another_hash():
    one, two = PhysicsWorld(), PhysicsWorld()
    one.add_bodies([1, 2], position=[[0, 0, 0], [5, 0, 0]])
    two.add_bodies([1, 2], position=[[5, 0, 0], [0, 0, 0]])
    assert one.state_hash() != two.state_hash()


@pytest.mark.parametrize("at", [0, 1, 25, 90])
def test_from_a_snapshot_the_same_bits_follow(at):
    world = heap()
    for _ in range(at):
        world.step(DT)
    snapshot = world.snapshot()
    other = heap(7, seed=9)
    other.step(DT)
    other.restore(snapshot)
    assert other.state_hash() == world.state_hash()
    np.testing.assert_array_equal(other.bodies.position, world.bodies.position)
    for _ in range(60):
        world.step(DT)
        other.step(DT)
        assert other.state_hash() == world.state_hash()
    again = heap()
    again.restore(snapshot)
    for _ in range(60):
        again.step(DT)
    assert again.state_hash() == world.state_hash()


def test_a_restored_world_takes_further_changes():
    world = heap()
    for _ in range(60):
        world.step(DT)
    other = PhysicsWorld()
    other.restore(world.snapshot())
    for each in (world, other):
        each.remove_bodies([3, 4, 5])
        each.add_bodies([4, 100], position=[[0, 9, 0], [1, 9, 0]])
        each.add_colliders([4, 100])
        for _ in range(40):
            each.step(DT)
    assert world.state_hash() == other.state_hash()


def test_what_is_no_snapshot_is_refused():
    with pytest.raises(PhysicsError, match="'bodies' is missing"):
        PhysicsWorld().restore({})

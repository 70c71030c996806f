"""Joints that hang together are solved as one part, know of no others, and let go of one another without a bang."""

from __future__ import annotations

import numpy as np
import pytest

from elys.sim_node.physics import PhysicsSettings, PhysicsWorld
from elys.sim_node.physics.joint_parts import parts_of, ranges_of

DT = 1.0 / 60.0
KINEMATIC = 1


def test_joints_hang_together_by_bodies_that_can_be_pushed_and_by_gears() -> None:
    bodies = np.array([[-1, 0], [0, 1], [2, 3], [-1, 4], [-1, -1], [-1, -1], [5, 6], [6, 7]])
    holds = np.array([True, True, True, True, True, True, False, True])
    gears = np.array([False, False, False, False, False, True, False, False])
    geared = np.zeros((8, 2), int)
    geared[5] = 1, 3
    np.testing.assert_array_equal(parts_of(bodies, holds, gears, geared), [0, 0, 1, 0, -1, 0, -1, 2])
    gears[5] = False  # then it is a joint with nothing to push
    np.testing.assert_array_equal(parts_of(bodies, holds, gears, geared), [0, 0, 1, 2, -1, -1, -1, 3])


def test_ranges_tell_where_parts_stand_in_a_sorted_list() -> None:
    first, last = ranges_of(np.array([0, 0, 2, 2, 2]), 4)
    assert first.tolist() == [0, 2, 2, 5]
    assert last.tolist() == [2, 2, 5, 5]


def chains(count: int) -> PhysicsWorld:
    """Chains of five rods side by side, the first struck softly and each other one harder than the one before."""
    world = PhysicsWorld(PhysicsSettings(sleeping=False))
    for chain in range(count):
        rods = np.arange(5) + 1 + 10 * chain
        world.add_bodies(rods, position=[[k + 0.5, 0.0, 3.0 * chain] for k in range(5)])
        world.add_colliders(rods, size=(1.0, 0.1, 0.1), mask=0)
        before = np.where(rods % 10 == 1, 0, rods - 1)
        world.add_joints(rods, kind="ball", entity_a=before, entity_b=rods, anchor_b=(-0.5, 0.0, 0.0))
        world.apply_impulse([rods[-1]], [0.0, 1.0 + 300.0 * chain, 2.0])
    return world


def test_a_chain_moves_alike_whoever_else_is_there() -> None:
    """Bit for bit, though others are struck so hard that they need all rounds, and more."""
    alone, among = chains(1), chains(4)
    for _ in range(120):
        alone.step(DT)
        among.step(DT)
        for name in ("position", "rotation", "linear_velocity", "angular_velocity"):
            np.testing.assert_array_equal(getattr(alone.bodies, name), getattr(among.bodies, name)[:5])


@pytest.mark.parametrize("removed", [False, True])
def test_what_was_torn_at_from_two_sides_follows_the_one_that_holds(removed: bool) -> None:
    """What two bodies that move apart do to the one between them is without bounds, until one lets go."""
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0)))
    motion = [KINEMATIC, 0, KINEMATIC]
    world.add_bodies([1, 2, 3], motion=motion, position=[[-2, 0, 0], [0, 0, 0], [2, 0, 0]])
    world.add_colliders([1, 2, 3], size=(0.5, 0.5, 0.5))
    world.set_velocities([1, 3], linear=[[-1.0, 0.2, 0.0], [1.0, 0.0, 0.0]])
    world.add_joints([1], kind="fixed", entity_a=1, entity_b=2)
    world.add_joints([2], kind="fixed", entity_a=3, entity_b=2, break_force=np.inf if removed else 1e5)
    for _ in range(10):
        world.step(DT)
    if removed:
        world.remove_joints([2])
    assert world.joints.broken.tolist() == ([False] if removed else [False, True])
    for _ in range(60):
        world.step(DT)
        assert np.linalg.norm(world.bodies.linear_velocity[1]) < 3.0
    assert world.take_problems() == []
    np.testing.assert_allclose(world.bodies.position[1] - world.bodies.position[0], [2.0, 0.0, 0.0], atol=1e-5)


def test_joints_of_what_was_thrown_about_hold_again() -> None:
    """A rigid joint that cannot be met, between a body whose place is locked and one that flies off: then it lands."""
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0)))
    world.add_bodies([1, 2, 3], motion=[KINEMATIC, 0, 0], position=[[0, 0, 0], [0.5, 0, 0], [1.5, 0, 0]])
    world.add_colliders([1, 2, 3], size=(0.2, 0.3, 0.4), mask=0)
    world.set_properties([2], locked=[True, True, False, False, False, False])
    world.add_joints([1], kind="ball", entity_a=1, entity_b=2, anchor_b=(-0.1, 0.05, 0.02))
    world.add_joints([2], kind="ball", entity_a=2, entity_b=3, anchor_b=(-0.5, 0.0, 0.0))
    world.set_velocities([1], linear=[20.0, 5.0, 0.0])
    for _ in range(60):
        world.step(DT)
        assert np.isfinite(world.bodies.position).all()
    world.take_problems()
    world.remove_joints([1])
    world.set_velocities([2, 3], linear=[0, 0, 0], angular=[0, 0, 0])
    for _ in range(600):  # from tens of metres away
        world.step(DT)
    assert world.take_problems() == []
    anchor = world.bodies.position[2] - 0.5 * first_axis(world.bodies.rotation[2])
    offset = anchor - world.bodies.position[1]
    assert np.linalg.norm(offset) == pytest.approx(0.5, abs=1e-3)


def first_axis(q: np.ndarray) -> np.ndarray:
    """Where a rotation takes the x axis."""
    x, y, z, w = q
    return np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])

"""Forces that are shown against what statics and Newton's second law say of them."""

from __future__ import annotations

import numpy as np
import pytest

from elys.sim_node.physics import STATIC, PhysicsSettings, PhysicsWorld
from elys.sim_node.physics.force_lines import ASKED, CONTACT, JOINT, LENGTH, WEIGHT
from elys.sim_node.physics.settings import Attractor

DT = 1.0 / 60.0
G = 9.81


def forces(world: PhysicsWorld, entity: int, color: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (L, 3) and forces (L, 3) of a colour that push an entity."""
    lines = world.debug_lines("forces")
    meant = (lines.colors == color) & (lines.entities[:, 0] == entity)
    segments = lines.positions[meant].astype(float)
    ways = segments[:, 1] - segments[:, 0]
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), LENGTH, atol=1e-5)
    return segments[:, 0], ways / LENGTH * lines.values[meant, None]


def total(world: PhysicsWorld, entity: int) -> np.ndarray:
    return sum(forces(world, entity, color)[1].sum(axis=0) for color in (WEIGHT, CONTACT, JOINT, ASKED))


def on_a_slope(angle: float, **settings: object) -> PhysicsWorld:
    """A cube of 2 kg at rest on a slope about z."""
    world = PhysicsWorld(PhysicsSettings(**settings))
    turn = [0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)]
    normal = np.array([-np.sin(angle), np.cos(angle), 0.0])
    world.add_bodies([1, 2], motion=[STATIC, 0], position=[[0, 0, 0], normal], rotation=[turn, turn], mass=2.0)
    world.add_colliders([1, 2], size=[[20, 1, 20], [1, 1, 1]], friction=0.8)
    for _ in range(60):
        world.step(DT)
    return world


@pytest.mark.parametrize("sleeping", [False, True])
def test_what_rests_on_a_slope_is_held_by_its_ground(sleeping: bool) -> None:
    angle = 0.4
    world = on_a_slope(angle, sleeping=sleeping)
    point, weight = forces(world, 2, WEIGHT)
    np.testing.assert_allclose(weight, [[0.0, -2.0 * G, 0.0]], atol=1e-5)
    np.testing.assert_allclose(point[0], world.bodies.position[1], atol=1e-5)
    point, held = forces(world, 2, CONTACT)
    np.testing.assert_allclose(held.sum(axis=0), [0.0, 2.0 * G, 0.0], atol=0.02)  # normal and friction together
    down = np.array([-np.cos(angle), -np.sin(angle), 0.0])
    assert held.sum(axis=0) @ down == pytest.approx(-2.0 * G * np.sin(angle), abs=0.02)
    np.testing.assert_allclose(total(world, 2), 0.0, atol=0.02)
    # What keeps it from tipping acts where its weight meets the ground.
    arm = point[0] - world.bodies.position[1]
    np.testing.assert_allclose(np.cross(arm, held[0]), 0.0, atol=0.1)
    assert not len(forces(world, 1, CONTACT)[1])  # nothing moves the ground


def test_the_lower_of_two_carries_the_upper() -> None:
    world = PhysicsWorld()
    world.add_bodies(
        [1, 2, 3], motion=[STATIC, 0, 0], position=[[0, -0.5, 0], [0, 0.5, 0], [0, 1.5, 0]], mass=[1, 1, 3]
    )
    world.add_colliders([1, 2, 3], size=[[9, 1, 9], [1, 1, 1], [1, 1, 1]])
    for _ in range(60):
        world.step(DT)
    _, lower = forces(world, 2, CONTACT)
    np.testing.assert_allclose(sorted(lower[:, 1]), [-3.0 * G, 4.0 * G], rtol=2e-3)
    np.testing.assert_allclose(forces(world, 3, CONTACT)[1], [[0.0, 3.0 * G, 0.0]], atol=0.05)


def test_a_pendulum_is_pulled_by_its_joint_as_newton_says() -> None:
    """The mean force of a step is the mass times the change of velocity in it."""
    world = PhysicsWorld()
    world.add_bodies([1], position=[[1.0, 0.0, 0.0]], mass=2.0)
    world.add_colliders([1], size=[[0.2, 0.2, 0.2]])
    world.add_joints([7], kind="ball", entity_a=1, anchor_a=[-1.0, 0.0, 0.0])
    for step in range(40):
        before = world.bodies.linear_velocity[0].astype(float)
        world.step(DT)
        change = 2.0 * (world.bodies.linear_velocity[0] - before) / DT
        if step:
            np.testing.assert_allclose(total(world, 1), change, atol=0.05)
    point, pull = forces(world, 1, JOINT)
    np.testing.assert_allclose(point, [[0.0, 0.0, 0.0]], atol=2e-3)
    assert pull[0] @ world.bodies.position[0] < 0.0  # towards the anchor


def test_two_that_are_joined_pull_each_other_equally() -> None:
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0)))
    world.add_bodies([1, 2], position=[[0, 0, 0], [2, 0, 0]], linear_velocity=[[0, 1, 0], [0, -1, 0]])
    world.add_colliders([1, 2], size=[[0.2, 0.2, 0.2]] * 2)
    world.add_joints([7], kind="ball", entity_a=1, entity_b=2, anchor_a=[1.0, 0.0, 0.0])
    for _ in range(5):
        world.step(DT)
    (first,), (second,) = (forces(world, entity, JOINT)[1] for entity in (1, 2))
    np.testing.assert_allclose(first, -second, atol=1e-5)
    assert np.linalg.norm(first) > 0.1


def test_what_was_asked_for_and_what_stars_pull_is_shown() -> None:
    star = Attractor(position=(0.0, 0.0, 0.0), strength=50.0)
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0), attractors=(star,)))
    world.add_bodies([1, 2], position=[[5.0, 0, 0], [0, 10.0, 0]], mass=[1.0, 4.0], gravity_scale=[1.0, 0.5])
    world.add_colliders([1, 2], size=[[0.2, 0.2, 0.2]] * 2)
    world.set_forces([2], force=[0.0, 0.0, 3.0])
    np.testing.assert_allclose(forces(world, 1, WEIGHT)[1], [[-2.0, 0.0, 0.0]], atol=1e-5)
    np.testing.assert_allclose(forces(world, 2, WEIGHT)[1], [[0.0, -1.0, 0.0]], atol=1e-5)
    np.testing.assert_allclose(forces(world, 2, ASKED)[1], [[0.0, 0.0, 3.0]], atol=1e-5)
    assert not len(forces(world, 1, ASKED)[1])

"""How strongly islands are solved, and that they do not know of each other."""

from __future__ import annotations

import numpy as np

from elys.sim_node.physics import PLANE, STATIC, PhysicsSettings, PhysicsWorld
from elys.sim_node.physics.kernels.groups import CHUNK
from elys.sim_node.physics.kernels.islands import HUGE
from elys.sim_node.physics.settings import step_strengths

DT = 1.0 / 60.0


def world_of_cubes(position, **settings) -> PhysicsWorld:
    """Cubes of 1 m at (N, 3), entities 2 and up, on a ground plane."""
    world = PhysicsWorld(PhysicsSettings(sleeping=False, **settings))
    world.add_bodies([1], motion=STATIC)
    world.add_colliders([1], shape=PLANE)
    entities = np.arange(2, 2 + len(position))
    world.add_bodies(entities, position=position)
    world.add_colliders(entities, friction=0.6)
    return world


def substeps_of(world: PhysicsWorld, row: int) -> int:
    """The substeps that a body was solved with in the last step."""
    strengths = step_strengths(world.settings, DT)
    return int(strengths["substeps"][world._bodies.rows["strength"][row]])


def column(height: int, x: float = 0.0, z: float = 0.0) -> list[list[float]]:
    return [[x + 0.001 * (k % 3), 0.5 + k, z] for k in range(height)]


def plate(side: int) -> list[list[float]]:
    """side * side cubes on the ground, each touching its neighbours."""
    return [[float(x), 0.5, float(z)] for x in range(side) for z in range(side)]


def test_a_column_is_solved_more_strongly_than_a_cube_from_its_first_step_on() -> None:
    world = world_of_cubes([[20.0, 0.5, 0.0], *column(20)])
    world.step(DT)
    assert substeps_of(world, 1) == 8
    assert substeps_of(world, 2) >= 32
    for _ in range(30):
        world.step(DT)
    assert substeps_of(world, 2) >= 32  # its loads are felt by now, and say the same


def test_an_island_of_very_many_does_with_half_the_substeps() -> None:
    side = int(np.sqrt(HUGE)) + 1
    world = world_of_cubes(plate(side))
    world.step(DT)
    assert substeps_of(world, 1) == 4
    assert substeps_of(world_after_step(plate(side - 4)), 1) == 8


def test_joints_are_never_solved_with_half_the_substeps() -> None:
    world = world_of_cubes(plate(int(np.sqrt(HUGE)) + 1))
    world.add_joints([1], kind="ball", entity_a=2, entity_b=3)
    world.step(DT)
    assert substeps_of(world, 1) == 8


def world_after_step(position) -> PhysicsWorld:
    world = world_of_cubes(position)
    world.step(DT)
    return world


def test_an_island_moves_alike_whoever_else_is_there() -> None:
    """Bit for bit, though it is solved among others, in groups that hold several islands."""
    leaning = [[0.0, 0.5, 0.0], [0.1, 1.51, 0.0], [0.25, 2.52, 0.05], [0.3, 3.53, 0.1]]
    others = [place for k in range(1, 700) for place in column(4, 3.0 * (k % 20), 3.0 + 3.0 * (k // 20))]
    alone, among = world_of_cubes(leaning), world_of_cubes([*leaning, *others])
    for _ in range(90):
        alone.step(DT)
        among.step(DT)
        for name in ("position", "rotation", "linear_velocity"):
            np.testing.assert_array_equal(getattr(among.bodies, name)[1:5], getattr(alone.bodies, name)[1:5])
    contacts = among._room.groups["contacts"]
    assert (contacts > 0).sum() > 1
    assert contacts.max() <= CHUNK

"""Characters in worlds made by chance: never inside anything, never through a fence, always the same."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from elys.common.components import Character, Collider, Transform
from elys.common.math import quaternion
from elys.sim_node.character.kernels.tables import SKIN
from elys.sim_node.simulation import Simulation

DEEPEST = 1e-3  # [m] that a character may be in something immovable at the end of a tick, beside its skin of 10 mm
HALF = 6.0  # [m] from the middle to the fence
FENCE = 0.004  # [m] thick
TICKS = 90


def world_of(seed: int, count: int) -> tuple[Simulation, list[int]]:
    """Boxes, balls and capsules that stand about within a fence, and three characters that start above them."""
    chance = np.random.default_rng(seed)
    simulation = Simulation()
    world = simulation.world
    world.spawn([Transform(position=(0.0, -0.5, 0.0)), Collider(size=(40.0, 1.0, 40.0))])
    for x, z, size in ((HALF, 0.0, (FENCE, 40.0, 12.2)), (0.0, HALF, (12.2, 40.0, FENCE))):
        for side in (1.0, -1.0):
            world.spawn([Transform(position=(side * x, 18.0, side * z)), Collider(size=size)])
    for _ in range(count):
        turn = quaternion.from_axis_angle(chance.normal(size=3), chance.uniform(0.0, 3.0)).tolist()
        place = (*chance.uniform(-5.0, 5.0, 1), chance.uniform(0.0, 1.5), *chance.uniform(-5.0, 5.0, 1))
        kind = str(chance.choice(("box", "box", "sphere", "capsule", "cylinder")))
        collider = Collider(
            shape=kind,  # type: ignore[arg-type]
            size=tuple(chance.uniform(0.2, 3.0, 3)),
            radius=float(chance.uniform(0.2, 1.0)),
            half_length=float(chance.uniform(0.2, 1.0)),
        )
        world.spawn([Transform(position=place, rotation=tuple(turn)), collider])
    walkers = [
        world.spawn([Transform(position=(x, 6.0, 0.0)), Character(run_speed=15.0, acceleration=200.0)])
        for x in (-2.0, 0.0, 2.0)
    ]
    return simulation, walkers


def run(seed: int, count: int) -> tuple[list[int], float, float]:
    """Hashes of all ticks; how deep a walker was in anything [m], and how far from the middle [m]."""
    simulation, walkers = world_of(seed, count)
    chance = np.random.default_rng(seed + 1)
    hashes, deepest, farthest = [], 0.0, 0.0
    for tick in range(TICKS):
        if tick % 12 == 0:
            simulation.settle()
            for walker in walkers:
                direction = chance.normal(size=2)
                direction /= np.linalg.norm(direction)
                wishes = {"wish": (direction[0], 0.0, direction[1]), "wish_run": bool(chance.random() < 0.7)}
                wishes |= {"wish_jump": bool(chance.random() < 0.4), "wish_crouch": bool(chance.random() < 0.2)}
                simulation.world.set_fields(walker, Character, wishes)
        simulation.step()
        hashes.append(simulation.state_hash())
        for walker in walkers:
            deepest = max(deepest, depth_of(simulation, walker))
            x, _, z = simulation.world.transforms.world_pose(walker)[0]
            farthest = max(farthest, abs(x), abs(z))
    return hashes, deepest, farthest


def depth_of(simulation: Simulation, walker: int) -> float:
    """How deep a walker's capsule is in anything: by asking which thinner one is free, halving the doubt."""
    character = simulation.world.get(walker, Character)
    x, y, z = simulation.world.transforms.world_pose(walker)[0]
    half = 0.5 * character.stature - character.radius

    def is_free(depth: float) -> bool:
        asked = ((x, y + 0.5 * character.stature, z),)
        return not len(
            simulation.physics.overlap_capsule(asked, character.radius - depth, half, own_body=walker).entity
        )

    low, high = 0.0, character.radius
    if is_free(low):
        return 0.0
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if is_free(middle) else (middle, high)
    return high


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 25))
def test_a_character_is_never_in_anything_nor_through_the_fence(seed, count):
    _, deepest, farthest = run(seed, count)
    assert deepest <= DEEPEST
    assert farthest <= HALF - 0.5 * FENCE - 0.3


@pytest.mark.parametrize("seed", [3, 77])
def test_the_same_world_gives_the_same_bits(seed):
    assert run(seed, 20)[0] == run(seed, 20)[0]


def test_the_skin_is_thicker_than_what_may_be_entered():
    assert DEEPEST < SKIN

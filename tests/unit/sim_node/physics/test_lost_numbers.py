"""Bodies whose numbers got lost are stopped, and nothing of them is left in what later steps work with."""

from __future__ import annotations

import numpy as np
import pytest

from elys.sim_node.physics import PhysicsWorld

COUNT = 10


def row_of_boxes(rng: np.random.Generator) -> PhysicsWorld:
    world = PhysicsWorld()
    world.add_bodies([1], motion=[2], position=[[0.0, -0.5, 0.0]])
    world.add_colliders([1], size=[[400.0, 1.0, 400.0]], friction=0.5)
    entities = np.arange(2, 2 + COUNT)
    aside = rng.uniform(-0.2, 0.2, COUNT)
    world.add_bodies(entities, position=np.stack([0.9 * np.arange(COUNT), np.full(COUNT, 0.5), aside], axis=1))
    world.add_colliders(entities, size=np.ones((COUNT, 3)), friction=0.7)
    return world


@pytest.mark.parametrize("seed", [1, 4, 7, 13, 15, 16])
def test_what_goes_on_is_what_begins_anew_from_the_same_state(seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = row_of_boxes(rng)
    for _ in range(10):
        world.step(1 / 60)
    for _ in range(3):
        struck = [int(rng.integers(2, 2 + COUNT))]
        linear, angular = (rng.normal(0.0, 1.0, 3) * 10.0 ** rng.integers(5, 38) for _ in range(2))
        world.set_velocities(struck, linear=[linear], angular=[angular])
        world.step(1 / 60)
    assert any("not finite" in str(problem) for problem in world.take_problems())
    again = PhysicsWorld()
    again.restore(world.snapshot())
    for _ in range(20):
        world.step(1 / 60)
        again.step(1 / 60)
        assert world.state_hash() == again.state_hash()
        assert np.isfinite(world.bodies.position).all()

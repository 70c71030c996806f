"""A game of one ball, for tests that play it: `game.py ENDPOINT RECORDING`. W, A, S, D and Space push it, the pointer turns it.

Imported it gives the same game in the process that imports it.
"""

from __future__ import annotations

import asyncio
import logging
import sys
from pathlib import Path

import numpy as np

from elys.bus.access.listening import Listening
from elys.common.assets.store import AssetStore
from elys.common.scene import EntityRecord
from elys.sim_node.scene.loading import load_records
from elys.sim_node.simulation import Simulation
from elys.verbs.simulate import simulate

RECORDS = [
    EntityRecord(
        name="Ground",
        components={
            "Transform": {"position": [0, -0.1, 0], "scale": [60, 0.2, 60]},
            "Collider": {},
            "MeshRenderer": {},
        },
    ),
    EntityRecord(
        name="Ball",
        components={
            "Transform": {"position": [0, 0.5, 0]},
            "RigidBody": {"mass": 2.0, "angular_damping": 2.0},
            "Collider": {"shape": "sphere"},
            "MeshRenderer": {"mesh": "builtin:sphere"},
        },
    ),
]


def ball_game() -> Simulation:
    """Before its first tick."""
    simulation = Simulation(name="game", assets=AssetStore())
    _, ball = load_records(simulation.world, RECORDS)

    def push(world) -> None:
        player = simulation.inputs[1]
        force = np.array(
            (
                20.0 * (player.is_down("d") - player.is_down("a")) + 5.0 * player.moved("pointer_x"),
                400.0 * player.was_pressed("space"),
                20.0 * (player.is_down("s") - player.is_down("w")),
            )
        )
        if force.any():
            simulation.physics.apply_force([int(ball)], force)

    simulation.systems = (push, *simulation.systems)
    simulation.settle()
    simulation.take_changes()
    return simulation


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stdout)
    asyncio.run(
        simulate(
            ball_game(),
            listen=Listening(endpoint=sys.argv[1]),
            step_limit=0,
            record=Path(sys.argv[2]),
            realtime=True,
            paused=True,
            name="game",
        )
    )

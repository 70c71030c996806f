"""A keyboard is enough: hands as slow as people's finish each level with W, A, S, D and space, and have a medal for it."""

from __future__ import annotations

import pytest

from elys.common.assets.store import AssetStore
from elys.samples.game.levels import LEVELS
from elys.sim_node.simulation import Simulation
from tests.unit.game.keyboard_hands import KeyboardHands

LIMIT = 60  # [s] of simulation


@pytest.mark.parametrize("name", LEVELS)
@pytest.mark.timeout(400)
def test_a_keyboard_is_enough(name: str) -> None:
    assets = AssetStore()
    opened, layout = LEVELS[name].open(assets)
    simulation = Simulation.load(opened, assets)
    hands = KeyboardHands(simulation, layout)
    finished, falls = [], 0
    while not finished and simulation.tick < LIMIT * 60:
        if (pressed := hands()) is not None:
            simulation.inputs.take(pressed)
        simulation.step()
        events = simulation.take_events()
        falls += sum(event.kind == "ball_fell" for event in events)
        finished = [event for event in events if event.kind == "race_finished"]
    assert finished and finished[0].values["medal"] in ("gold", "silver")
    assert falls <= 2

"""A run that fails leaves its last seconds behind."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from elys.bus.access.listening import LOOPBACK
from elys.bus.recording import Recording
from elys.verbs.simulate import prepare, simulate


def test_what_led_to_a_failing_system_is_a_recording(tmp_path: Path) -> None:
    simulation, _ = prepare("stack", record=None)

    def stumbles(world: object) -> None:
        if simulation.tick == 40:
            raise ZeroDivisionError("a mistake of the user's own")

    simulation.systems = (stumbles, *simulation.systems)
    run = simulate(
        simulation,
        listen=LOOPBACK,
        step_limit=100,
        record=tmp_path / "run.mcap",
        realtime=False,
        paused=False,
        name="fails",
    )
    with pytest.raises((ZeroDivisionError, ExceptionGroup)):
        asyncio.run(run)
    (path,) = tmp_path.glob("elys-problem-*.mcap")
    for kept in (path, tmp_path / "run.mcap"):
        with Recording(kept) as recording:
            assert int(recording.tick[-1]) == 40

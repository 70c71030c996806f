"""The picture of docs/recordings.md: how two runs part of which one was forked with a body moved by a micrometre."""

from __future__ import annotations

import asyncio
import json
import tempfile
from pathlib import Path

from elys.bus.access.listening import LOOPBACK
from elys.bus.recording import Recording
from elys.bus.run_comparison import compare
from elys.verbs.diff import write_plot
from elys.verbs.fork import opened_at
from elys.verbs.simulate import simulate
from tests.recorded_sessions import recorded

TICKS, AT = 480, 1.0
PUSH = 1e-6  # [m]


async def draw_run_comparison(path: Path) -> None:
    """Records, forks and compares."""
    with tempfile.TemporaryDirectory() as folder:
        source, target, edits = (Path(folder) / name for name in ("run.mcap", "other.mcap", "edits.json"))
        async with recorded(Path(folder), "yard", outside=False) as stage:
            person = await stage.person("Anna")
            await person.step(TICKS)
        stage.beside.rename(source)
        with Recording(source) as recording:
            frame = recording.frame(recording.position_at(AT))
        place = frame.position[40] + (PUSH, 0.0, 0.0)
        change = {"type": "set_component", "entity": int(frame.entity[40]), "component": "Transform"}
        edits.write_text(json.dumps([{**change, "values": {"position": place.tolist()}}]))
        simulation, origin = opened_at(source, AT, edits=edits)
        await simulate(
            simulation,
            listen=LOOPBACK,
            step_limit=0,
            record=target,
            realtime=False,
            paused=False,
            name="",
            keep=0.0,
            origin=origin,
        )
        write_plot(compare(source, target, curves=5), path)


if __name__ == "__main__":
    asyncio.run(draw_run_comparison(Path(__file__).parents[1] / "docs" / "pictures" / "run_comparison.png"))

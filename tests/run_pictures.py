"""The pictures of docs/recordings.md: how two runs part of which one was forked with a body moved by a micrometre, and one run
as the ghost of another, in which a body was thrown.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import tempfile
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

from elys.bus.access.listening import LOOPBACK
from elys.bus.messages.state_frame import StateFrame
from elys.bus.recording import Recording
from elys.bus.run_comparison import compare
from elys.verbs.diff import write_plot
from elys.verbs.fork import opened_at
from elys.verbs.render import render
from elys.verbs.simulate import simulate
from tests.recorded_sessions import recorded

AT = 1.0  # [s]
PUSH = 1e-6  # [m]
THROWN = (9.0, 0.0, 5.0)  # [m/s]
CHOSEN = 40  # row of the body that is pushed
Change = Callable[[StateFrame], tuple[str, dict[str, Any]]]  # of a body at AT: a component and its values


@contextlib.asynccontextmanager
async def run_and_fork(scene: str, ticks: int, row: int, change: Change) -> AsyncIterator[tuple[Path, Path]]:
    """Recordings of a sample, and of a fork of it in which the body of a row was changed."""
    with tempfile.TemporaryDirectory() as folder:
        source, target, edits = (Path(folder) / name for name in ("run.mcap", "other.mcap", "edits.json"))
        async with recorded(Path(folder), scene, outside=False) as stage:
            person = await stage.person("Anna")
            await person.step(ticks)
        stage.beside.rename(source)
        with Recording(source) as recording:
            frame = recording.frame(recording.position_at(AT))
            component, values = change(frame)
            entity = int(frame.entity[row])
        edits.write_text(
            json.dumps([{"type": "set_component", "entity": entity, "component": component, "values": values}])
        )
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
        yield source, target


async def draw_run_comparison(path: Path) -> None:
    """Compares two runs of 8 s in numbers."""

    def push(frame: StateFrame) -> tuple[str, dict[str, Any]]:
        return "Transform", {"position": (frame.position[CHOSEN] + (PUSH, 0.0, 0.0)).tolist()}

    async with run_and_fork("yard", 480, CHOSEN, push) as (source, target):
        write_plot(compare(source, target, curves=5), path)


async def draw_ghost(path: Path) -> None:
    """Draws both runs, a short while after they part."""
    async with run_and_fork("stack", 170, 4, lambda _: ("RigidBody", {"linear_velocity": THROWN})) as (source, target):
        options: dict[str, Any] = {"size": "1280x720", "time": 1.3, "duration": 0.0, "fps": 30.0}
        await asyncio.to_thread(render, str(target), path, debug="divergence", ghosts=[source], **options)


if __name__ == "__main__":
    pictures = Path(__file__).parents[1] / "docs" / "pictures"
    asyncio.run(draw_run_comparison(pictures / "run_comparison.png"))
    asyncio.run(draw_ghost(pictures / "ghost.png"))

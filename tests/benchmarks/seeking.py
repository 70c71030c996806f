"""From a seek to its picture: a player and a render node as processes, and somebody who waits for the picture of just that tick.

`python -m tests.benchmarks.seeking` measures it alone; tests/benchmarks/recording.py has it in its table.
"""

from __future__ import annotations

import asyncio
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

import numpy as np

from elys.bus import topics
from elys.bus.messages.commands import CommandRequest, Seek
from elys.bus.messages.views import FRAMED, ViewFrame, ViewRequest
from elys.bus.recording import Recording
from elys.bus.session import Session
from elys.verbs.nodes import joined
from tests.benchmarks.figures import percentiles
from tests.benchmarks.machine import machine
from tests.benchmarks.processes import environment, running

ENDPOINT: Final = "tcp/127.0.0.1:17553"
SIZE: Final = (1280, 720)
WARM_UP: Final = 4
SEEKS: Final = 80
PATIENCE: Final = 20.0  # [s]
Row = tuple[str, str]


def picture_rows(path: Path) -> list[Row]:
    """Rows about seeks in a recording, to any of its instants."""
    player = (sys.executable, "-m", "elys", "node", "player", str(path), "--paused", "--listen", ENDPOINT)
    render = (sys.executable, "-m", "elys", "node", "render", "--connect", ENDPOINT)
    with (
        environment() as env,
        running(player, env=env, wait_for="playing") as playing,
        running(render, env=env, wait_for="drawing views") as drawer,
        Recording(path) as recording,
    ):
        whole, drawing, used = asyncio.run(_sought(recording, (playing.pid, drawer.pid)))
    others = [age - drawn for age, drawn in zip(whole, drawing, strict=True)]
    return [
        ("a seek there, until its picture of 1280x720 is here, p50 / p99", percentiles(whole)),
        ("of which drawing (software OpenGL), p50 / p99", percentiles(drawing)),
        ("of which all else, p50 / p99", percentiles(others)),
        ("processor time of a seek: player, render node", f"{used[0]:.1f}, {used[1]:.1f} ms"),
    ]


async def _sought(recording: Recording, nodes: tuple[int, ...]) -> tuple[list[float], list[float], list[float]]:
    """Milliseconds from the command to the picture, and those of drawing it, of each seek; and of these processes those that a
    processor spent on a seek, of which the machine's other work takes nothing away.
    """
    chance = np.random.default_rng(1)
    whole, drawing = [], []
    async with joined(ENDPOINT, kind="tool", timeout=30.0) as session:
        async with asyncio.timeout(30.0):
            while not session.nodes_of("render"):
                await asyncio.sleep(0.01)
        eye = _Eye(session)
        before = [0.0] * len(nodes)
        for number, position in enumerate(chance.integers(0, len(recording), WARM_UP + SEEKS).tolist()):
            if number == WARM_UP:
                before = [_processor_time(node) for node in nodes]
            began = time.perf_counter()
            frame = await eye.seek(float(recording.time[position]), int(recording.tick[position]))
            whole.append(1e3 * (time.perf_counter() - began))
            drawing.append(frame.render_time)
        used = [1e3 * (_processor_time(node) - since) / SEEKS for node, since in zip(nodes, before, strict=True)]
    return whole[WARM_UP:], drawing[WARM_UP:], used


def _processor_time(process: int) -> float:
    """[s] that all its threads have had."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class _Eye:
    """A view that is asked for again as soon as its last picture has come."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._render = session.nodes_of("render")[0].id
        self._sequence, self._tick = 0, -1
        self._came = asyncio.Event()
        self._frame: ViewFrame | None = None
        session.subscribe(topics.VIEW_FRAME, self._take, key="eye")
        self._ask()

    async def seek(self, when: float, tick: int) -> ViewFrame:
        """Goes there; returns the first picture of that tick."""
        request = CommandRequest(origin=self._session.node.id, command=Seek(time=when))
        reply = await self._session.request(topics.COMMAND, request, timeout=PATIENCE)
        assert reply.accepted and reply.tick == tick, reply
        async with asyncio.timeout(PATIENCE):
            while self._frame is None or self._frame.tick != tick:
                self._came.clear()
                await self._came.wait()
        return self._frame

    def _take(self, frame: ViewFrame, _: str) -> None:
        self._frame, self._tick = frame, frame.tick
        self._came.set()
        self._ask()

    def _ask(self) -> None:
        self._sequence += 1
        width, height = SIZE
        request = ViewRequest(
            view="eye",
            sequence=self._sequence,
            through=FRAMED,
            width=width,
            height=height,
            newer_than_tick=max(self._tick, 0),
        )
        self._session.publish(topics.VIEW_REQUEST, request, key=self._render)


def main() -> None:
    """Measures it in a recording that is made for it."""
    from tests.benchmarks.recording import ten_minutes

    with tempfile.TemporaryDirectory() as folder:
        rows = picture_rows(ten_minutes(Path(folder)))
    print(machine())
    for what, figure in rows:
        print(f"{what}: {figure}")


if __name__ == "__main__":
    main()

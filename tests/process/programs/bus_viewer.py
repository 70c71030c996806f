"""A viewer for tests that stop or kill it: `bus_viewer.py ENDPOINT`. Prints the tick of every frame that is right."""

from __future__ import annotations

import asyncio
import sys

import numpy as np

from elys.bus.discovery import join_session
from elys.bus.following import follow_scene, follow_state
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror


def show(frame: StateFrame) -> None:
    expected = frame.tick + np.arange(1, frame.body_count + 1)
    if np.array_equal(frame.position[:, 1], expected):
        print(frame.epoch, frame.tick, flush=True)


async def run(endpoint: str) -> None:
    session = await join_session(endpoint, kind="render", timeout=20.0)
    mirror = SceneMirror()
    await follow_scene(session, mirror)
    follow_state(session, mirror, show)
    await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(run(sys.argv[1]))

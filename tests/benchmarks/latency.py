"""From the tick to the picture: how old the shown state is when its picture is in the asker's hands, over a real render node."""

from __future__ import annotations

import asyncio
import sys
import time

from elys.bus import topics
from elys.bus.messages.views import ViewCamera, ViewFrame, ViewRequest
from elys.bus.session import Session
from elys.common.math.matrix import look_rotation
from elys.verbs.nodes import joined
from tests.benchmarks.figures import percentiles
from tests.benchmarks.processes import environment, running

PICTURE_COUNT = 200
SIZE = (640, 360)
Row = tuple[str, str]


def measure() -> list[Row]:
    """Rows of the table."""
    simulation = (
        sys.executable,
        "-m",
        "elys",
        "run",
        "yard",
        "--headless",
        "--realtime",
        "--listen",
        "tcp/127.0.0.1:17550",
    )
    render = (sys.executable, "-m", "elys", "node", "render", "--connect", "tcp/127.0.0.1:17550")
    with (
        environment() as env,
        running(simulation, env=env, wait_for="simulating"),
        running(render, env=env, wait_for="drawing views"),
    ):
        ages, times = asyncio.run(ask_for_pictures())
    width, height = SIZE
    return [
        (f"tick to picture of 200 bodies, {width}x{height}, JPEG, p50 / p99", percentiles(ages)),
        ("of which drawing (software OpenGL), p50 / p99", percentiles(times)),
    ]


async def ask_for_pictures() -> tuple[list[float], list[float]]:
    """Ages [ms] of the states in the pictures when they arrived, and what drawing them took [ms]."""
    async with joined("tcp/127.0.0.1:17550", kind="tool") as session:
        while not session.nodes_of("render"):
            await asyncio.sleep(0.05)
        return await _pictures(session, session.nodes_of("render")[0].id)


async def _pictures(session: Session, renderer: str) -> tuple[list[float], list[float]]:
    arrived: asyncio.Queue[ViewFrame] = asyncio.Queue()
    session.subscribe(topics.VIEW_FRAME, lambda frame, _: arrived.put_nowait(frame), key="bench")
    eye = (9.0, 6.0, 11.0)
    rotation = look_rotation([-x for x in eye]).tolist()
    camera = ViewCamera(position=eye, rotation=(rotation[0], rotation[1], rotation[2], rotation[3]))
    ages, times, newest = [], [], -1
    for sequence in range(PICTURE_COUNT):
        request = ViewRequest(
            view="bench", sequence=sequence, camera=camera, width=SIZE[0], height=SIZE[1], newer_than_tick=newest
        )
        session.publish(topics.VIEW_REQUEST, request, key=renderer)
        frame = await asyncio.wait_for(arrived.get(), 20)
        ages.append((time.time_ns() - frame.state_published_at) / 1e6)
        times.append(frame.render_time)
        newest = frame.tick
    return ages[10:], times[10:]

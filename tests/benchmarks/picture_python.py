"""What a frame costs before the driver draws: Python and numpy on the drawing thread, from poses of moving cubes to draw calls.

Measured in a process of its own with Mesa's driver that takes all calls and draws nothing (GALLIUM_NOOP). What it takes to
find memory for the instances and to copy them is not counted: it frees and asks anew, where those that draw do not.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from elys.bus.messages.state_frame import StateFrame
from elys.render_node.gpu import offscreen_context
from elys.render_node.quality import FAST
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer

Row = tuple[str, str]

COUNTS: Final = (1000, 10_000)
FRAMES: Final = 200
WARMING: Final = 20  # frames before those that count
TICK: Final = 1 / 60  # [s]


def measure() -> list[Row]:
    """Rows of the table."""
    command = [sys.executable, "-m", "tests.benchmarks.picture_python"]
    done = subprocess.run(command, env={**os.environ, "GALLIUM_NOOP": "1"}, stdout=subprocess.PIPE, check=True)
    found = json.loads(done.stdout)
    what = f"Python and numpy of a frame of {' / '.join(map(str, COUNTS))} moving cubes, a driver that draws nothing"
    if not found:
        return [(what, "not measured: the driver is not Mesa's")]
    return [(what, f"{' / '.join(f'{value:.2f}' for value in found)} ms")]


def times() -> list[float]:
    """Medians [ms] of the drawing thread's processor time; none where the driver draws."""
    context = offscreen_context()
    if "NOOP" not in context.info["GL_RENDERER"]:
        return []
    return [frame_time(Renderer(context, quality=FAST), count) for count in COUNTS]


def frame_time(renderer: Renderer, count: int) -> float:
    """From the arrival of a state frame to the last draw call."""
    from tests.benchmarks.pictures import SIZE, cubes

    world, camera = cubes(count)
    renderer.settle(world)
    frames = [moved(world, tick) for tick in range(4)]
    copying = _Copying(renderer)
    spent = []
    for tick in range(FRAMES + WARMING):
        now = tick * TICK
        frame = replace(frames[tick % 4], tick=tick, simulation_time=now, published_at=round(now * 1e9))
        copying.seconds = 0.0
        start = time.thread_time()
        world.take_state(frame, now)
        world.place(now + TICK / 2)
        renderer.draw(world, camera, *SIZE)
        if tick >= WARMING:
            spent.append((time.thread_time() - start - copying.seconds) * 1e3)
    return float(np.median(spent))


class _Copying:
    """How long a renderer's instances take to be handed over."""

    def __init__(self, renderer: Renderer) -> None:
        self.seconds = 0.0
        instances = renderer.resources.instances
        write = instances.write

        def timed(data: NDArray[Any]) -> None:
            start = time.thread_time()
            write(data)
            self.seconds += time.thread_time() - start

        instances.write = timed  # type: ignore[method-assign]


def moved(world: RenderWorld, seed: int) -> StateFrame:
    """All cubes somewhat beside their places, turning at 1.7 rad/s."""
    random = np.random.default_rng(seed)
    count = world.instance_count
    order = np.argsort(world.entity)
    return StateFrame(
        epoch=1,
        tick=0,
        simulation_time=0.0,
        published_at=0,
        delta_sequence=0,
        state_hash=0,
        playing=True,
        position=world.position[order] + random.normal(scale=0.02, size=(count, 3)),
        rotation=Rotation.from_rotvec(random.normal(scale=0.01, size=(count, 3))).as_quat().astype(np.float32),
        linear_velocity=np.zeros((count, 3), np.float32),
        angular_velocity=np.ones((count, 3), np.float32),
        entity=world.entity[order],
    )


if __name__ == "__main__":
    print(json.dumps(times()))

"""What a frame costs before the driver draws: Python and numpy on the drawing thread, from poses of moving cubes, or an edit of a
still one, to draw calls.

Measured in a process of its own with Mesa's driver that takes all calls and draws nothing (GALLIUM_NOOP); what is handed over to
it is copied, and counts.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from elys.bus.messages.state_frame import StateFrame
from elys.render_node.gpu import offscreen_context
from elys.render_node.quality import FAST
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from tests.benchmarks.picture_edits import edit_times

Row = tuple[str, str]

COUNTS: Final = (1000, 10_000)
FRAMES: Final = 150
WARMING: Final = 20  # frames before those that count
TICK: Final = 1 / 60  # [s]
REACH: Final = 1.0  # [m] to which the cubes swing from where they began
SPEED: Final = 3.0  # [m/s] at which they pass there


def measure() -> list[Row]:
    """Rows of the table."""
    command = [sys.executable, "-m", "tests.benchmarks.picture_python"]
    done = subprocess.run(command, env={**os.environ, "GALLIUM_NOOP": "1"}, stdout=subprocess.PIPE, check=True)
    found = json.loads(done.stdout)
    what = f"Python and numpy of a frame of {' / '.join(map(str, COUNTS))}"
    if not found:
        return [(f"{what} cubes", "not measured: the driver is not Mesa's")]
    return [
        (f"{what} {words}", f"{' / '.join(f'{value:.2f}' for value in values)} ms") for words, values in found.items()
    ]


def times() -> dict[str, list[float]]:
    """[ms] of the drawing thread's processor time, one value a count; nothing where the driver draws."""
    from tests.benchmarks.pictures import SIZE

    context = offscreen_context()
    if "NOOP" not in context.info["GL_RENDERER"]:
        return {}
    spent = [frame_times(Renderer(context, quality=FAST), count) for count in COUNTS]
    edited = [edit_times(Renderer(context, quality=FAST), count, SIZE) for count in COUNTS]
    news, between = zip(*spent, strict=True)
    moving, still = (f"{how} cubes, a driver that draws nothing" for how in ("moving", "still"))
    return {
        f"{moving}: median with a new state": [float(np.median(values)) for values in news],
        f"{moving}: mean with a new state": [float(np.mean(values)) for values in news],
        f"{moving}: median between two states": [float(np.median(values)) for values in between],
    } | {f"{still}: {words}": [float(np.median(of[words])) for of in edited] for words in edited[0]}


def frame_times(renderer: Renderer, count: int) -> tuple[list[float], list[float]]:
    """From the arrival of each state frame to the last draw call, and of pictures between two of them [ms]."""
    from tests.benchmarks.pictures import SIZE, cubes

    world, camera = cubes(count)
    renderer.settle(world)
    frame_at = swinging(world)
    frames = [frame_at(tick) for tick in range(FRAMES + WARMING)]
    news, between = [], []
    for tick, frame in enumerate(frames):
        now = tick * TICK
        start = time.thread_time()
        world.take_state(frame, now)
        world.place(now + TICK / 4)
        renderer.draw(world, camera, *SIZE)
        middle = time.thread_time()
        world.place(now + TICK * 3 / 4)
        renderer.draw(world, camera, *SIZE)
        if tick >= WARMING:
            news.append((middle - start) * 1e3)
            between.append((time.thread_time() - middle) * 1e3)
    return news, between


def swinging(world: RenderWorld) -> Callable[[int], StateFrame]:
    """State frames by their ticks: all cubes swing about their places, each its own way, turning at 1.7 rad/s."""
    random = np.random.default_rng(1)
    count, order = world.instance_count, np.argsort(world.entity)
    entity, places = world.entity[order], world.position[order]
    way = random.normal(size=(count, 3))
    way *= REACH / np.linalg.norm(way, axis=1, keepdims=True)
    phase = random.uniform(0.0, 2.0 * np.pi, (count, 1))
    spin = np.ones((count, 3))

    def frame_at(tick: int) -> StateFrame:
        now = tick * TICK
        angle = phase + now * SPEED / REACH
        return StateFrame(
            epoch=1,
            tick=tick,
            simulation_time=now,
            published_at=round(now * 1e9),
            delta_sequence=0,
            state_hash=0,
            playing=True,
            position=places + way * np.sin(angle),
            rotation=Rotation.from_rotvec(spin * now).as_quat().astype(np.float32),
            linear_velocity=(way * np.cos(angle) * SPEED / REACH).astype(np.float32),
            angular_velocity=spin.astype(np.float32),
            entity=entity.copy(),
        )

    return frame_at


if __name__ == "__main__":
    print(json.dumps(times()))

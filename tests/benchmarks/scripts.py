"""Scripts: what a tick with a thousand of them costs beyond their own code, alone and beside a hundred characters.

python -m tests.benchmarks scripts

Asked are less than 2 ms for a thousand scripts that do nothing, and less than 8 ms for a tick with a thousand scripts and a
hundred characters that walk about. Time is processor time of the thread, so that what else the machine does counts little.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from elys.common import trust
from elys.common.assets.scripts import read_script
from elys.common.components import Script, Transform
from elys.sim_node.scripts.behaviour import Behaviour
from elys.sim_node.simulation import Simulation
from tests.benchmarks import characters

COUNT = 1000
CHARACTERS = 100
TICKS = 600
WARM = 60  # ticks that are not counted
HEAD = "from elys.script import *\n"
EMPTY = """
class Empty(Behaviour):
    def fixed_update(self, dt): pass
    def update(self, dt): pass
"""
WAITING = """
class Waiting(Behaviour):
    async def start(self):
        while True:
            await ticks(1)
"""
WORKING = """
class Working(Behaviour):
    angle = 0.0
    def fixed_update(self, dt): self.angle += 0.5 * dt
    def update(self, dt):
        if self.angle > 6.0: self.angle = 0.0
"""
Row = tuple[str, str]


def measure() -> list[Row]:
    """Rows of the table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        trust.trust(folder)
        return [
            (
                f"{COUNT} empty scripts with `update` and `fixed_update`, beyond their own code, p50 / p99",
                empty(folder),
            ),
            (f"{COUNT} async functions that wait for each tick, p50 / p99", waiting(folder)),
            (f"tick at 60 Hz, {COUNT} scripts and {CHARACTERS} characters, p50 / p99", together(folder)),
        ]


def scripted(folder: Path, text: str, simulation: Simulation) -> Simulation:
    """A simulation with a thousand entities more, that carry a script."""
    (folder / "script.py").write_text(HEAD + text)
    source = read_script(folder / "script.py", "", simulation.assets)
    for number in range(COUNT):
        simulation.world.spawn([Transform(), Script(source=source)], name=f"Scripted {number}")
    return simulation


def empty(folder: Path) -> str:
    simulation = scripted(folder, EMPTY, Simulation())
    simulation.step()
    scripts, world, dt = simulation.scripts, simulation.world, simulation.scripts.world.dt
    every = scripts.behaviours_of(Behaviour)
    beyond = []
    for _ in range(TICKS):
        began = time.thread_time()
        scripts.run(world)
        scripts.run_late(world)
        both = time.thread_time()
        for one in every:
            one.fixed_update(dt)
        for one in every:
            one.update(dt)
        beyond.append((both - began) - (time.thread_time() - both))
    return figure(beyond)


def waiting(folder: Path) -> str:
    simulation = scripted(folder, WAITING, Simulation())
    times = []
    for _ in range(TICKS):
        simulation.step()
        began = time.thread_time()
        simulation.scripts.run(simulation.world)
        times.append(time.thread_time() - began)
    return figure(times)


def together(folder: Path) -> str:
    simulation, walkers = characters.crowd(CHARACTERS)
    scripted(folder, WORKING, simulation)
    chance = np.random.default_rng(2)
    times = []
    for tick in range(TICKS):
        if tick % characters.TURN == 0:
            characters.wish(simulation, walkers, chance)
        began = time.thread_time()
        simulation.step()
        times.append(time.thread_time() - began)
    return figure(times)


def figure(times: list[float]) -> str:
    p50, p99 = np.percentile(1000.0 * np.array(times[WARM:]), (50, 99))
    return f"{p50:.2f} / {p99:.2f} ms"

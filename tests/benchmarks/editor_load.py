"""What editors cost the simulation: processor time of the tick's thread, with nobody attached and with eight editors, in turns.

A thousand cubes that never come to rest, at 60 Hz; the simulation on one core, the editors (real ones, without a display) on
the other. Every turn begins at the same tick of the same state and so does the same work. Of each tick the cheapest turn counts:
other programs on the machine make ticks dearer, never cheaper.
"""

from __future__ import annotations

import asyncio
import os
import time
from pathlib import Path
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.bus import topics
from elys.bus.messages.commands import Command, CommandRequest, Resume, Rewind
from elys.bus.session import Session
from elys.bus.transports.zenoh import ZenohTransport
from elys.common.assets.store import AssetStore
from elys.common.scene import OpenedScene, expand
from elys.samples.pile import pile
from elys.sim_node.ecs.world import World
from elys.sim_node.node import SimulationNode
from elys.sim_node.simulation import Simulation
from elys.sim_node.timing import StageTimes
from tests.benchmarks.editor_people import Person, all_do, people

EDITORS: Final = 8
BODIES: Final = 1000
TICKS: Final = 180  # of a turn
TURNS: Final = 3  # with, and as many without
FIRST: Final = 180  # ticks before: the cubes have met
_PULLS: Final = ((0.0, -9.81, 0.0), (6.0, -7.0, 0.0), (0.0, -9.81, 3.0), (-6.0, -7.0, -3.0))  # [m/s^2] a second each
Row = tuple[str, str]


class TimedNode(SimulationNode):
    """Knows what each tick took of its thread."""

    def __init__(self, simulation: Simulation, session: Session) -> None:
        super().__init__(simulation, session)
        self.taken: dict[int, float] = {}  # [s] by tick
        self.stepped: dict[int, float] = {}  # [s] of it the step, which publishes nothing

    def _step(self, stages: StageTimes) -> None:
        began, tick = time.thread_time(), self.simulation.tick
        super()._step(stages)
        self.stepped[tick] = time.thread_time() - began

    def tick(self) -> None:
        """One tick."""
        began, tick = time.thread_time(), self.simulation.tick
        super().tick()
        if self.simulation.tick == tick + 1:
            self.taken[tick] = time.thread_time() - began


def restless(count: int) -> Simulation:
    """A pile whose down is elsewhere each second."""
    document, assets = pile(count), AssetStore()
    records = expand(document, directory=Path(), assets=assets)
    opened = OpenedScene(name=document.name, path=Path(), settings=document.settings, records=records)
    simulation = Simulation.load(opened, assets)

    def pull(world: World) -> None:
        physics = simulation.physics
        gravity = _PULLS[simulation.tick // simulation.settings.tick_rate % len(_PULLS)]
        if physics.settings.gravity != gravity or physics.settings.sleeping:
            physics.settings = msgspec.structs.replace(physics.settings, gravity=gravity, sleeping=False)

    simulation.systems = (pull, *simulation.systems)
    return simulation


def measure() -> list[Row]:
    """Rows of the table."""
    with people(EDITORS, core=1) as persons:
        alone, attached = (times.min(0) for times in asyncio.run(_turns(persons)))  # [tick, (whole, step)]
    (tick, _), (busy_tick, _) = np.median(alone, 0), np.median(attached, 0)
    # What the step takes does not depend on who looks, but on what else the machine does: the rest is compared with the rest.
    rest, busy_rest = (float(np.median(times[:, 0] - times[:, 1])) for times in (alone, attached))
    return [
        (
            f"tick of {BODIES} moving bodies, processor time of its thread: nobody, {EDITORS} editors",
            _ms(tick, busy_tick),
        ),
        (
            "of it all but the step, which is what can depend on editors",
            f"{_ms(rest, busy_rest)}: {100.0 * (busy_rest - rest) / tick:+.1f} % of the tick",
        ),
    ]


def _ms(*seconds: float) -> str:
    return ", ".join(f"{1e3 * one:.2f}" for one in seconds) + " ms"


async def _turns(persons: list[Person]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """[turn, tick, (whole, step)] seconds without and with editors."""
    transport = await asyncio.to_thread(ZenohTransport.listen_on_free_port, first_port=17650)
    session = await Session.host(transport, name="load", kind="simulation", epoch=1)
    node = TimedNode(restless(BODIES), session)
    client = await Session.join(ZenohTransport.connect(transport.endpoint), kind="tool")
    running = asyncio.create_task(node.run())
    alone, attached = [], []
    await _until(node, FIRST + TICKS)
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {0})  # this thread, which ticks; zenoh's go where there is room
    try:
        for _ in range(TURNS):
            alone.append(await _turn(node, client))
            await asyncio.to_thread(all_do, persons, "attach", transport.endpoint)
            attached.append(await _turn(node, client))
            await asyncio.to_thread(all_do, persons, "detach")
    finally:
        os.sched_setaffinity(0, cores)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    await client.close()
    await session.close()
    return np.array(alone), np.array(attached)


async def _turn(node: TimedNode, client: Session) -> list[tuple[float, float]]:
    """What each of the same ticks took."""
    await _ask(client, Rewind(tick=FIRST))
    node.taken.clear()
    await _ask(client, Resume())
    await _until(node, FIRST + TICKS)
    return [(node.taken[tick], node.stepped[tick]) for tick in range(FIRST, FIRST + TICKS)]


async def _ask(client: Session, command: Command) -> None:
    reply = await client.request(topics.COMMAND, CommandRequest(origin="bench", command=command), timeout=30.0)
    assert reply.accepted, reply.reason


async def _until(node: TimedNode, tick: int) -> None:
    while node.simulation.tick < tick:
        await asyncio.sleep(0.05)

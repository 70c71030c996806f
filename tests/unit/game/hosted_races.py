"""Races that a referee hosts in this process, recorded and proven, driven by a bot whose hands can be taken off meanwhile."""

from __future__ import annotations

import asyncio
import contextlib
import os
import threading
from collections.abc import AsyncIterator, Callable, Mapping
from pathlib import Path
from typing import Any

from elys.bus.messages.commands import CommandRequest, Input
from elys.bus.recorder_process import record_pipe
from elys.bus.session import Session
from elys.bus.tap import RecordingTap
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.scene import OpenedScene
from elys.game.board import Entry
from elys.game.bot import Bot
from elys.game.proof import proof_of
from elys.game.referee import AnyLevel, Referee
from elys.samples.game.levels import LEVELS
from elys.sim_node.node import SimulationNode
from elys.sim_node.simulation import Simulation
from elys.sim_node.verification import verify

Hands = Callable[[int], tuple[str, ...] | None]  # by tick of the race's scene: what is held, or None: the bot drives
STICKS_LET_GO = {"pad_left_x": 0.0, "pad_left_y": 0.0}


class Driver:
    """A bot whose hands are taken off the wheel now and then, to press keys."""

    def __init__(self, bot: Bot, hands: Hands) -> None:
        self.bot, self._hands = bot, hands
        self._held: set[str] = set()

    def __call__(self) -> list[CommandRequest]:
        wanted = self._hands(self.bot._simulation.tick)
        now = set(wanted or ())
        changes = tuple((key, key in now) for key in sorted(now ^ self._held))
        self._held = now
        axes = STICKS_LET_GO if wanted is not None else {}
        name = f"bot-{self.bot.player}"  # the hands are the bot's own
        pressed = Input(player=self.bot.player, axes=axes, changes=changes, source=name)
        told = [CommandRequest(origin=name, command=pressed)] if changes or axes else []
        return told if wanted is not None else [*told, *self.bot()]


class Recorder:
    """As `RecordingChild`, in a thread."""

    def __init__(self, path: Path, node: SimulationNode, session: Session, assets: AssetStore) -> None:
        self.path = path
        reading, writing = os.pipe()
        self._reading = reading
        self._thread = threading.Thread(target=record_pipe, args=(reading, path))
        self._thread.start()
        self._tap = RecordingTap(
            session, writing, take_snapshot=node.snapshot, assets=assets, lossless=True, exact=node.chronicle
        )
        node.recorder = self._tap

    async def finish(self) -> int:
        await asyncio.to_thread(self._tap.close)
        await asyncio.to_thread(self._thread.join)
        os.close(self._reading)
        return self.path.stat().st_size


@contextlib.asynccontextmanager
async def hosted(
    level: AnyLevel,
    folder: Path,
    *,
    hands: Hands = lambda tick: None,
    players: int = 1,
    has_menu: bool = False,
    has_ghosts: bool = False,
    races: int = 0,
) -> AsyncIterator[Referee]:
    """A referee that runs until the context ends; it has the node as `_node`."""
    assets = AssetStore()
    opened, layout = level.open(assets, players=players)
    simulation = Simulation.load(opened, assets)
    broker = LoopbackBroker()
    session = await Session.host(broker.listen(), name="race", kind="simulation", epoch=7)
    node = SimulationNode(simulation, session, realtime=False)
    known = layout or LEVELS["meadow"].open(AssetStore())[1]  # nobody knows the line of a file: it is meadow's
    bots = [Bot(simulation, known, player=number) for number in range(1, players + 1)]
    node.players += [Driver(bot, hands if bot.player == 1 else lambda tick: None) for bot in bots]

    def reopened(chosen: AnyLevel, count: int, values: Mapping[str, Mapping[str, Any]]) -> OpenedScene:
        opened, layout = chosen.open(assets, players=count, values=values)
        for bot in bots if layout is not None else ():
            bot.drive(layout)
        return opened

    async def prove(path: Path, entry: Entry) -> str:
        return proof_of(await asyncio.to_thread(verify, path), began=entry.began, ended=entry.ended)

    referee = Referee(
        node,
        session,
        level=level,
        players=players,
        person="ann",
        folder=folder,
        record=lambda path: Recorder(path, node, session, assets),
        open_level=reopened,
        prove=prove,
        race_limit=races,
        has_menu=has_menu,
        has_ghosts=has_ghosts,
    )
    ticking = asyncio.create_task(node.run())
    judging = asyncio.create_task(referee.run())
    referee.judging = judging  # type: ignore[attr-defined]
    referee.broker = broker  # type: ignore[attr-defined]
    try:
        yield referee
    finally:
        for task in (judging, ticking):
            task.cancel()
        outcomes = await asyncio.gather(judging, ticking, return_exceptions=True)
        await referee.prove()
        await session.close()
    for outcome in outcomes:
        if isinstance(outcome, Exception):
            raise outcome


async def raced(level: AnyLevel, folder: Path, *, hands: Hands = lambda tick: None, **options: Any) -> Referee:
    """One race, to its end and proven; the referee with its board."""
    async with hosted(level, folder, hands=hands, races=1, **options) as referee:
        await asyncio.wait_for(referee.judging, 300.0)  # type: ignore[attr-defined]
    return referee

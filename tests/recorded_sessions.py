"""Sessions of a real simulation node in one process, recorded beside it and from outside; and files that were altered."""

from __future__ import annotations

import asyncio
import contextlib
import os
import threading
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path

from elys.bus import topics
from elys.bus.exact_keeping import BUILD_FACTS
from elys.bus.messages.commands import Command, CommandReply, CommandRequest, StepTicks
from elys.bus.messages.history import HistoryRequest
from elys.bus.recorder import _OutsideRecording, record_pipe
from elys.bus.recording_plan import PLAIN, RecordingPlan
from elys.bus.session import Session
from elys.bus.tap import RecordingTap
from elys.bus.transports.loopback import LoopbackBroker
from elys.bus.transports.mcap import METADATA_NAME, McapWriter
from elys.bus.transports.mcap_reading import McapReader, RecordedMessage
from elys.common.assets.store import AssetStore, is_reference
from elys.common.errors import RequestError
from elys.sim_node.node import SimulationNode
from elys.sim_node.simulation import Simulation
from elys.verbs.scenes import open_scene_or_sample


class Person:
    """Somebody who edits in a session, and can undo what he has done."""

    def __init__(self, session: Session, stage: Stage) -> None:
        self.session = session
        self.stage = stage
        self.author = ""

    async def attach(self, name: str) -> None:
        reply = await self.session.request(topics.HISTORY, HistoryRequest(person=name, node=self.session.node.id))
        self.author = reply.author

    async def ask(self, command: Command) -> CommandReply | RequestError:
        request = CommandRequest(origin=self.session.node.id, command=command, author=self.author, label="Edit")
        try:
            return await self.session.request(topics.COMMAND, request, timeout=30.0)
        except RequestError as error:  # refused at the border
            return error

    async def do(self, *commands: Command) -> tuple[int, ...]:
        for command in commands:
            reply = await self.ask(command)
            assert isinstance(reply, CommandReply) and reply.accepted, (command, reply)
        return reply.entities  # type: ignore[union-attr]

    async def together(self, *commands: Command) -> list[CommandReply | RequestError]:
        """Asks for several in the same tick."""
        return list(await asyncio.gather(*(self.ask(command) for command in commands)))

    async def step(self, count: int) -> None:
        await self.do(StepTicks(count=count))
        await self.stage.stands()


class Stage:
    """A node, its simulation, and where it is recorded."""

    def __init__(self, node: SimulationNode, broker: LoopbackBroker, folder: Path) -> None:
        self.node = node
        self.broker = broker
        self.beside, self.outside = folder / "beside.mcap", folder / "outside.mcap"
        self.sessions: list[Session] = []

    @property
    def simulation(self) -> Simulation:
        return self.node.simulation

    async def person(self, name: str) -> Person:
        session = await Session.join(self.broker.connect(), kind="editor")
        self.sessions.append(session)
        person = Person(session, self)
        await person.attach(name)
        return person

    async def stands(self) -> None:
        """Until all steps that were asked for are done."""
        async with asyncio.timeout(50.0):
            while self.node._steps_asked or self.node._waiting:
                await asyncio.sleep(0)
        await asyncio.sleep(0.01)  # and heard of

    def named(self, name: str) -> int:
        hierarchy = self.simulation.world.hierarchy
        return next(e for e in self.simulation.world.entities().tolist() if hierarchy.name_of(e) == name)


@contextlib.asynccontextmanager
async def recorded(
    folder: Path, scene: str = "stack", *, keep: float = 60.0, outside: bool = True, plan: RecordingPlan = PLAIN
) -> AsyncIterator[Stage]:
    """A session that is recorded until the context ends: both files are whole then."""
    assets = AssetStore()
    simulation = Simulation.load(open_scene_or_sample(scene, assets), assets)
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="stage", kind="simulation", epoch=7)
    node = SimulationNode(simulation, host, realtime=False, playing=False, keep=keep)
    stage = Stage(node, broker, folder)
    reading, writing = os.pipe()
    thread = threading.Thread(target=record_pipe, args=(reading, stage.beside, plan))
    thread.start()
    tap = RecordingTap(host, writing, take_snapshot=node.snapshot, assets=assets, lossless=True, exact=node.chronicle)
    node.recorder = tap
    running = asyncio.create_task(node.run())
    async with contextlib.AsyncExitStack() as stack:
        stack.push_async_callback(host.close)
        if outside:
            await stack.enter_async_context(recorded_outside(stage, stage.outside, plan))
        try:
            yield stage
        finally:
            await asyncio.sleep(0.05)  # what was said has been heard
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
            await asyncio.to_thread(tap.close)
            await asyncio.to_thread(thread.join)
            os.close(reading)
            for session in stage.sessions:
                await session.close()


@contextlib.asynccontextmanager
async def recorded_outside(stage: Stage, path: Path, plan: RecordingPlan = PLAIN) -> AsyncIterator[None]:
    """Records from outside while the context lasts; when it begins an exact state is in the file."""
    session = await Session.join(stage.broker.connect(), kind="recorder")
    recording, stop = _OutsideRecording(session, path, (), plan), asyncio.Event()
    running = asyncio.create_task(recording.run(stop))
    async with asyncio.timeout(20.0):
        while recording._exact._last is None:
            await asyncio.sleep(0.001)
    try:
        yield
    finally:
        await asyncio.sleep(0.05)  # what was said has been heard
        stop.set()
        await running
        recording.close()
        await session.close()


Alter = Callable[[RecordedMessage], bytes | None]


def altered(source: Path, target: Path, alter: Alter, *, compact: bool = False) -> Path:
    """A whole and valid recording of other messages: `alter` gives the body of each, or None to leave it out."""
    with McapReader(source) as reader:
        session = reader.metadata[METADATA_NAME]["session"]
        writer = McapWriter(target, session=session, compact=compact, overwrites=True)
        if BUILD_FACTS in reader.metadata:
            writer.add_metadata(BUILD_FACTS, reader.metadata[BUILD_FACTS])
        for name in reader.attachments:
            if is_reference(name):
                writer.attach(name, reader.attachment(name), media_type="application/octet-stream")
        for message in reader.messages():
            body = alter(message)
            if body is not None:
                writer.write(message.channel, body, log_time=message.log_time)
        writer.close()
    return target


def in_short_chunks(session: Path, target: Path, more: Sequence[tuple[str, bytes]] = ()) -> Path:
    """The same messages and `more`, a chunk for every few of them."""
    with McapReader(session) as reader:
        writer = McapWriter(target, session=reader.metadata[METADATA_NAME]["session"])
        writer.add_metadata(BUILD_FACTS, reader.metadata[BUILD_FACTS])
        for name in filter(is_reference, reader.attachments):
            writer.attach(name, reader.attachment(name), media_type="application/octet-stream")
        for number, message in enumerate(reader.messages()):
            writer.write(message.channel, message.body, log_time=message.log_time)
            if number % 20 == 19:
                writer._flush()
        for channel, body in more:
            writer.write(channel, body, log_time=message.log_time)
        writer.close()
    return target

"""Rewinding a session: what its node answers, publishes and forgets, and how those who follow it come along."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from elys.bus import codec, topics
from elys.bus.following import follow_scene, follow_state
from elys.bus.marker_log import MarkerLog
from elys.bus.messages.commands import (
    Command,
    CommandReply,
    CommandRequest,
    Resume,
    Rewind,
    Seek,
    SetComponent,
    SetPlaying,
    Spawn,
    StepTicks,
)
from elys.bus.messages.session import Event, EventBatch, SessionStatus
from elys.bus.messages.state_frame import HEADER, StateFrame
from elys.bus.messages.timeline import Marker, MarkersRequest
from elys.bus.mirror import SceneMirror
from elys.bus.player import Player
from elys.bus.recorder import record_session
from elys.bus.recorder_files import Recorder
from elys.bus.recording import Recording
from elys.bus.session import Session
from elys.bus.topics import Encoding
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.errors import RequestError
from elys.common.scene import EntityRecord
from elys.sim_node.node import SimulationNode
from elys.sim_node.simulation import Simulation
from elys.verbs.scenes import open_scene_or_sample

BOX = EntityRecord(
    name="Late", components={"Transform": {"position": [0.1, 9.0, 0.0]}, "RigidBody": {}, "Collider": {}}
)


class Watcher:
    """Somebody who follows a session and asks for things."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.mirror = SceneMirror()
        self.frames: list[StateFrame] = []
        self.events: list[Event] = []
        self.status: SessionStatus | None = None

    async def begin(self) -> None:
        self.session.subscribe(topics.STATUS, lambda status, _: setattr(self, "status", status))
        self.session.subscribe(topics.EVENTS, lambda batch, _: self.events.extend(batch.events))
        follow_state(self.session, self.mirror, self.frames.append)
        await follow_scene(self.session, self.mirror)

    async def ask(self, command: Command) -> CommandReply:
        return await self.session.request(topics.COMMAND, CommandRequest(origin="test", command=command), timeout=30.0)

    async def do(self, *commands: Command) -> tuple[int, ...]:
        for command in commands:
            reply = await self.ask(command)
            assert reply.accepted, reply.reason
        return reply.entities

    async def step(self, count: int) -> None:
        goal = self.node.simulation.tick + count
        await self.do(StepTicks(count=count))
        await self.until(lambda: self.node.simulation.tick == goal and self.frames[-1].tick == goal)

    async def until(self, condition) -> None:
        async with asyncio.timeout(20.0):
            while not condition():
                await asyncio.sleep(0.001)

    async def current(self) -> None:
        """Until the mirror is what the node's world is."""
        await self.until(lambda: self.mirror.sequence == self.node.snapshot().sequence)

    def hashes(self) -> dict[int, int]:
        return {frame.tick: frame.state_hash for frame in self.frames}

    node: SimulationNode
    broker: LoopbackBroker


@contextlib.asynccontextmanager
async def watched(keep: float = 60.0) -> AsyncIterator[Watcher]:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="stack", kind="simulation", epoch=1)
    assets = AssetStore()
    simulation = Simulation.load(open_scene_or_sample("stack", assets), assets)
    node = SimulationNode(simulation, host, realtime=False, playing=False, keep=keep)
    running = asyncio.create_task(node.run())
    session = await Session.join(broker.connect(), kind="tool")
    watcher = Watcher(session)
    watcher.node, watcher.broker = node, broker
    try:
        await watcher.begin()
        yield watcher
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await session.close()
        await host.close()


def test_back_and_on_again_shows_the_same_frames_and_then_new_ones():
    async def main() -> None:
        async with watched() as it:
            await it.step(100)
            first = it.hashes()
            await it.do(Seek(time=0.5))
            await it.until(lambda: it.frames[-1].tick == 30)
            assert it.frames[-1].state_hash == first[30]
            assert it.frames[-1].is_told_again
            assert not it.frames[-1].playing
            status = it.status
            assert (status.is_rewound, status.start_time, status.tick) == (True, 0.0, 30)
            assert status.end_time == pytest.approx(100 / 60)
            it.frames.clear()
            await it.step(70)
            assert it.hashes() == {tick: first[tick] for tick in range(31, 101)} | (
                {30: first[30]} if 30 in it.hashes() else {}
            )
            assert not it.frames[-1].is_told_again
            await it.step(5)
            assert not it.node.flight.is_rewound
            assert it.frames[-1].tick == 105
            assert not [event for event in it.events if event.kind == "forked"]

    asyncio.run(main())


def test_steps_back_and_a_tick_by_its_number():
    async def main() -> None:
        async with watched() as it:
            await it.step(20)
            first = it.hashes()
            await it.do(StepTicks(count=-3))
            await it.until(lambda: it.frames[-1].tick == 17)
            await it.do(Rewind(tick=4))
            await it.until(lambda: it.frames[-1].tick == 4)
            assert it.frames[-1].state_hash == first[4]
            await it.do(StepTicks(count=-(10**20)))
            await it.until(lambda: it.frames[-1].tick == 0)
            assert not (await it.ask(Rewind(tick=21))).accepted
            await it.do(Seek(time=1e9))
            await it.until(lambda: it.frames[-1].tick == 20)
            assert not it.node.flight.is_rewound

    asyncio.run(main())


def test_an_edit_in_the_past_is_a_fork_and_everybody_comes_along():
    async def main() -> None:
        async with watched() as it:
            await it.step(10)
            (late,) = await it.do(Spawn(records=(BOX,)))
            await it.step(50)
            await it.current()
            assert late in it.mirror.entities
            await it.do(Rewind(tick=5))
            await it.current()
            assert late not in it.mirror.entities
            assert it.frames[-1].is_told_again
            cube = int(it.frames[-1].entity[0])
            refused = await it.ask(SetComponent(entity=cube, component="RigidBody", values={"mass": -1.0}))
            assert not refused.accepted
            assert it.node.flight.is_rewound  # what was refused has changed nothing
            await it.do(SetComponent(entity=cube, component="RigidBody", values={"mass": 50.0}))
            await it.until(lambda: any(event.kind == "forked" for event in it.events))
            forked = next(event for event in it.events if event.kind == "forked")
            assert forked.values == {"from_tick": 5, "dropped_ticks": 55}
            assert not it.node.flight.is_rewound
            assert not it.frames[-1].is_told_again
            assert it.frames[-1].is_forked
            await it.step(70)
            assert not it.frames[-1].is_forked
            await it.current()
            assert it.mirror.entities[cube].components["RigidBody"].mass == 50.0
            assert late not in it.mirror.entities
            (again,) = await it.do(Spawn(records=(BOX,)))
            assert again == late  # as it would have been

    asyncio.run(main())


def test_to_go_on_from_here_is_a_fork_that_plays():
    async def main() -> None:
        async with watched() as it:
            await it.step(60)
            first = it.hashes()
            await it.do(Rewind(tick=20), Resume())
            await it.until(lambda: it.frames[-1].tick >= 60)
            await it.do(SetPlaying(playing=False))
            assert [event.values for event in it.events if event.kind == "forked"] == [
                {"from_tick": 20, "dropped_ticks": 40}
            ]
            assert it.hashes()[60] == first[60]  # nobody changed anything: it is the same again
            assert it.status.end_time >= 1.0

    asyncio.run(main())


def test_an_edit_and_a_jump_in_one_tick_are_both_kept():
    async def main() -> None:
        async with watched() as it:
            await it.step(10)
            cube = int(it.frames[-1].entity[0])
            edit = SetComponent(entity=cube, component="RigidBody", values={"mass": 50.0})
            await asyncio.gather(it.do(edit), it.do(Rewind(tick=3)), it.do(Seek(time=100.0)))
            await it.current()
            assert it.mirror.entities[cube].components["RigidBody"].mass == 50.0
            assert it.node.simulation.tick == 10
            assert not it.node.flight.is_rewound
            other = SetComponent(entity=cube, component="RigidBody", values={"mass": 60.0})
            await asyncio.gather(it.do(other), it.do(Seek(time=100.0)))  # to where it is
            await it.current()
            assert it.mirror.entities[cube].components["RigidBody"].mass == 60.0

    asyncio.run(main())


def test_markers_are_of_what_is_kept_and_go_with_a_future_that_is_dropped():
    async def main() -> None:
        async with watched() as it:
            await it.do(Spawn(records=(BOX,)))
            await it.step(150)
            await it.do(Spawn(records=(BOX,)))
            markers = await it.session.request(topics.MARKERS, MarkersRequest())
            kinds = [(marker.kind, marker.tick) for marker in markers.markers]
            assert ("edit", 0) in kinds and ("edit", 150) in kinds
            hits = [marker for marker in markers.markers if marker.kind == "collision"]
            assert hits and all(hit.strength > 0.0 and hit.entity for hit in hits[-1:])
            few = await it.session.request(topics.MARKERS, MarkersRequest(limit=3))
            assert len(few.markers) == 3
            assert few.left_out == len(markers.markers) - 3
            await it.do(Rewind(tick=100))
            await it.step(10)  # told again, and not marked again
            assert (await it.session.request(topics.MARKERS, MarkersRequest())) == markers
            await it.do(Resume(), SetPlaying(playing=False))
            left = await it.session.request(topics.MARKERS, MarkersRequest())
            assert ("edit", 150) not in [(marker.kind, marker.tick) for marker in left.markers]
            assert "forked" in [marker.text for marker in left.markers if marker.tick >= 110]

    asyncio.run(main())


def test_without_a_recorder_there_is_no_way_back():
    async def main() -> None:
        async with watched(keep=0.0) as it:
            await it.step(3)
            for command in (Seek(time=0.0), Rewind(tick=0), StepTicks(count=-1)):
                reply = await it.ask(command)
                assert not reply.accepted
                assert "nothing is kept to go back to: start the simulation with --keep" in reply.reason
            assert it.status.start_time == it.status.end_time == it.status.simulation_time

    asyncio.run(main())


class Recorded:
    """Records a session from outside, and knows what it has."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, it: Watcher, path: Path) -> None:
        self.it, self.path = it, path
        self.heard: list[tuple[str, bytes]] = []
        write = Recorder.message

        def message(recorder: Recorder, channel: str, body: bytes, *, time_ns: int) -> None:
            self.heard.append((channel, body))
            write(recorder, channel, body, time_ns=time_ns)

        monkeypatch.setattr(Recorder, "message", message)

    async def __aenter__(self) -> None:
        self.session = await Session.join(self.it.broker.connect(), kind="recorder")
        self.stop = asyncio.Event()
        self.running = asyncio.create_task(record_session(self.session, self.path, self.stop))
        await self.it.until(lambda: self.sequences("snapshot"))

    async def __aexit__(self, *_: object) -> None:
        tick = self.it.node.simulation.tick
        await self.it.until(lambda: self.ticks() and self.ticks()[-1] == tick and not self.lacks_snapshot())
        self.stop.set()
        await self.running
        await self.session.close()

    def ticks(self) -> list[int]:
        return [HEADER.unpack_from(body)[1] for channel, body in self.heard if channel == "state"]

    def sequences(self, channel: str) -> list[int]:
        return [json.loads(body)["sequence"] for heard, body in self.heard if heard == channel]

    def lacks_snapshot(self) -> bool:
        deltas = [json.loads(body) for channel, body in self.heard if channel == "delta"]
        resyncs = [delta["sequence"] for delta in deltas if delta.get("resync")]
        return bool(resyncs) and max(self.sequences("snapshot")) < max(resyncs)


def test_a_recording_of_a_session_that_was_rewound_is_of_the_history_that_was_kept(tmp_path, monkeypatch):
    path = tmp_path / "run.mcap"

    async def main() -> dict[int, int]:
        async with watched() as it, Recorded(monkeypatch, it, path):
            await it.step(30)
            await it.do(Spawn(records=(BOX,)))
            await it.step(40)
            await it.do(Rewind(tick=10))  # only looked at
            await it.step(5)
            await it.do(Seek(time=100.0))
            await it.step(10)
            kept = it.hashes()
            await it.do(Rewind(tick=50))
            await it.current()
            cube = int(it.frames[-1].entity[0])
            push = {"linear_velocity": [3.0, 0.0, 0.0]}
            await it.do(SetComponent(entity=cube, component="RigidBody", values=push))
            await it.step(60)
            await it.current()
            fork = next(number for number, frame in enumerate(it.frames) if frame.is_forked)
            return {tick: value for tick, value in kept.items() if tick <= 50} | {
                frame.tick: frame.state_hash for frame in it.frames[fork:]
            }

    kept = asyncio.run(main())
    with Recording(path) as recording:
        told = {int(tick): recording.frame(place).state_hash for place, tick in enumerate(recording.tick)}
        assert max(told) == 110
        assert sorted(told) == list(range(min(told), 111))
        assert told == {tick: kept[tick] for tick in told}
        mirror = recording.mirror_at(len(recording) - 1)
        assert len(mirror.entities) == len(recording.mirror_at(20).entities) + 1
        # Each kind of message once: what was told again, and what a fork made void, is not part of it.
        forks = [
            event
            for message in recording.messages_of(0, len(recording) - 1)
            if message.channel == "events"
            for event in codec.decode_body(message.body, EventBatch, Encoding.JSON).events
        ]
        assert [event.values for event in forks if event.kind == "forked"] == [{"from_tick": 50, "dropped_ticks": 30}]


def test_the_player_of_a_recording_finds_its_markers(tmp_path, monkeypatch):
    path = tmp_path / "run.mcap"

    async def record() -> None:
        async with watched() as it, Recorded(monkeypatch, it, path):
            await it.step(20)
            await it.do(Spawn(records=(BOX,)))
            await it.step(130)

    async def play() -> list[Marker]:
        broker = LoopbackBroker()
        with Recording(path) as recording:
            host = await Session.host(broker.listen(), name="stack", kind="replay", epoch=7)
            running = asyncio.create_task(Player(recording, host, playing=False).run())
            session = await Session.join(broker.connect(), kind="editor")
            log = MarkerLog()
            log.line = 0
            async with asyncio.timeout(20.0):
                while not any(marker.kind == "collision" and marker.strength > 1.0 for marker in log.markers):
                    request = MarkersRequest(from_tick=log.last_tick, line=log.line)
                    log.take(await session.request(topics.MARKERS, request))
                    await asyncio.sleep(0.001)
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
            await session.close()
            await host.close()
            return list(log.markers)

    asyncio.run(record())
    markers = asyncio.run(play())
    (edit,) = [marker for marker in markers if marker.kind == "edit"]
    assert (edit.tick, edit.text, edit.time) == (20, "spawn", pytest.approx(20 / 60))
    hardest = max(markers, key=lambda marker: marker.strength)
    assert hardest.tick > 20  # the box that fell


def test_where_there_is_no_time_to_go_to():
    async def main() -> None:
        async with watched() as it:
            with pytest.raises(RequestError, match="float"):
                await it.ask(Seek(time=float("nan")))

    asyncio.run(main())

"""A replay says what was recorded, wherever one goes in it."""

from __future__ import annotations

import asyncio
import os
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from elys.bus import topics
from elys.bus.asset_service import AssetClient
from elys.bus.export import export_npz
from elys.bus.following import follow_scene, follow_state
from elys.bus.messages.commands import (
    Command,
    CommandReply,
    CommandRequest,
    Rename,
    Seek,
    SetLoop,
    SetPlaying,
    SetRate,
    StepTicks,
)
from elys.bus.messages.session import Event, EventBatch, SessionStatus
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.bus.player import Player
from elys.bus.recorder import record_pipe
from elys.bus.recording import Recording
from elys.bus.recording_info import recording_info
from elys.bus.session import Session
from elys.bus.tap import RecordingTap
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.errors import RequestError

TICKS = 120


@pytest.fixture
def recorded(tmp_path: Path, random_host: Callable[..., Any]) -> tuple[Path, Any]:
    """A recording of TICKS ticks with edits and a resync, and the host that made it."""
    path = tmp_path / "f.mcap"

    async def record() -> Any:
        session = await Session.host(LoopbackBroker().listen(), name="yard", kind="simulation", epoch=7)
        host = random_host(session)
        reading, writing = os.pipe()
        thread = threading.Thread(target=record_pipe, args=(reading, path))
        thread.start()
        tap = RecordingTap(session, writing, take_snapshot=host.truth.to_snapshot, assets=host.assets, lossless=True)
        for number in range(TICKS):
            host.publish_tick(resync=number == 60)
        tap.close()
        thread.join(30)
        await session.close()
        return host

    return path, asyncio.run(record())


class Viewer:
    """A node that has joined a replay and keeps all it hears."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.mirror = SceneMirror()
        self.frames: list[StateFrame] = []
        self.events: list[Event] = []
        self.statuses: list[SessionStatus] = []

    async def follow(self) -> None:
        follow_state(self.session, self.mirror, self.frames.append)
        self.session.subscribe(topics.EVENTS, self._heard)
        self.session.subscribe(topics.STATUS, lambda status, _: self.statuses.append(status))
        await follow_scene(self.session, self.mirror)

    def _heard(self, batch: EventBatch, _: str) -> None:
        assert batch.epoch == self.session.epoch
        self.events.extend(batch.events)

    async def command(self, command: Command) -> CommandReply:
        return await self.session.request(topics.COMMAND, CommandRequest(origin=self.session.node.id, command=command))

    async def shows(self, tick: int, host: Any) -> StateFrame:
        """Waits until frame and scene are those of a tick."""
        expected = host.scenes[tick]
        while True:
            frame = self.mirror.latest_frame
            if frame is not None and frame.tick == tick and frame.delta_sequence == self.mirror.sequence:
                break
            await asyncio.sleep(0.005)
        placed = SceneMirror()
        placed.apply_snapshot(expected)
        bodies = {entity: one.components["RigidBody"].mass for entity, one in placed.entities.items()}  # type: ignore[attr-defined]
        seen = {entity: one.components["RigidBody"].mass for entity, one in self.mirror.entities.items()}  # type: ignore[attr-defined]
        assert seen == bodies
        return frame


@asynccontextmanager
async def replay(path: Path, **options: Any) -> AsyncIterator[tuple[Player, LoopbackBroker]]:
    broker = LoopbackBroker()
    recording = Recording(path)
    session = await Session.host(broker.listen(), name="replay", kind="replay", epoch=99)
    player = Player(recording, session, **options)
    task = asyncio.create_task(player.run())
    yield player, broker
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    await session.close()
    recording.close()


async def viewer_of(broker: LoopbackBroker) -> Viewer:
    viewer = Viewer(await Session.join(broker.connect(), kind="render"))
    await viewer.follow()
    return viewer


@pytest.mark.parametrize("rate", [1.0, 5.0])
def test_what_is_replayed_is_what_was_recorded(
    recorded: tuple[Path, Any], same_columns: Callable[..., None], rate: float
) -> None:
    path, host = recorded

    async def run() -> None:
        async with replay(path, playing=False, rate=rate) as (_, broker):
            viewer = await viewer_of(broker)
            await viewer.shows(1, host)
            assert (await viewer.command(SetPlaying(playing=True))).accepted
            await viewer.shows(TICKS, host)
            for frame in viewer.frames:
                same_columns(frame, host.frames[frame.tick])
                assert frame.epoch == 99
            ticks = [frame.tick for frame in viewer.frames]
            assert ticks == sorted(ticks)
            assert len(set(ticks)) > TICKS // 8
            assert [event.values["tick"] for event in viewer.events] == list(range(10, TICKS + 1, 10))
            while viewer.statuses[-1].playing:
                await asyncio.sleep(0.01)
            assert viewer.statuses[-1].end_time == TICKS / 60
            assert viewer.statuses[-1].kind == "replay"
            await viewer.session.close()

    asyncio.run(run())


def test_seeking_and_stepping_land_on_the_tick(recorded: tuple[Path, Any], same_columns: Callable[..., None]) -> None:
    path, host = recorded

    async def run() -> None:
        async with replay(path, playing=False) as (player, broker):
            viewer = await viewer_of(broker)
            for tick in (100, 3, 61, 60, 62, 120, 1, 77):
                reply = await viewer.command(Seek(time=tick / 60))
                assert (reply.accepted, reply.tick) == (True, tick)
                same_columns(await viewer.shows(tick, host), host.frames[tick])
                late = await viewer_of(broker)
                same_columns(await late.shows(tick, host), host.frames[tick])
                pose = late.mirror.world_pose(int(host.frames[tick].entity[0]))
                assert pose.position == tuple(host.frames[tick].position[0].tolist())
                await late.session.close()
            for count, tick in ((1, 78), (-1, 77), (-20, 57), (10, 67), (-1000, 1), (1000, TICKS)):
                assert (await viewer.command(StepTicks(count=count))).tick == tick
                same_columns(await viewer.shows(tick, host), host.frames[tick])
            for time, tick in ((-5.0, 1), (1e9, TICKS), (0.5 + 0.4 / 60, 30), (0.5 + 0.6 / 60, 31)):
                assert (await viewer.command(Seek(time=time))).tick == tick
            assert not player.playing
            await viewer.session.close()

    asyncio.run(run())


def test_edits_and_impossible_wishes_are_refused_with_a_sentence(recorded: tuple[Path, Any]) -> None:
    path, _ = recorded

    async def run() -> None:
        async with replay(path) as (player, broker):
            viewer = await viewer_of(broker)
            reply = await viewer.command(Rename(entity=1, name="x"))
            assert not reply.accepted
            assert reply.reason.startswith("this is a recording: it cannot be edited; ")
            for command, word in (
                (SetRate(rate=0.001), "rate"),
                (SetRate(rate=1000.0), "rate"),
                (StepTicks(count=1), "pause"),
            ):
                refused = await viewer.command(command)
                assert not refused.accepted and word in refused.reason
            assert (await viewer.command(SetRate(rate=100.0))).accepted
            assert player.rate == 100.0
            await viewer.session.close()

    asyncio.run(run())


def test_a_loop_starts_again(recorded: tuple[Path, Any], same_columns: Callable[..., None]) -> None:
    path, host = recorded

    async def run() -> None:
        async with replay(path, rate=100.0) as (_, broker):
            viewer = await viewer_of(broker)
            assert (await viewer.command(SetLoop(loop=True))).accepted
            await viewer.command(SetPlaying(playing=True))
            rounds = 0
            while rounds < 3:
                before = len(viewer.frames)
                await asyncio.sleep(0.01)
                ticks = [frame.tick for frame in viewer.frames[max(0, before - 1) :]]
                rounds += sum(later < earlier for earlier, later in pairwise(ticks))
            await viewer.command(SetPlaying(playing=False))
            await viewer.command(Seek(time=1.0))
            same_columns(await viewer.shows(60, host), host.frames[60])
            await viewer.session.close()

    asyncio.run(run())


def test_assets_come_from_the_recording(recorded: tuple[Path, Any]) -> None:
    path, host = recorded

    async def run() -> None:
        async with replay(path, playing=False) as (_, broker):
            viewer = await viewer_of(broker)
            client = AssetClient(viewer.session, AssetStore())
            drawn = {one.components["MeshRenderer"].mesh for one in viewer.mirror.entities.values()}  # type: ignore[attr-defined]
            assert drawn and drawn <= set(host.assets.references())
            for reference in drawn:
                assert await client.fetch(reference) == host.assets.get(reference)
            await viewer.session.close()

    asyncio.run(run())


def test_the_rate_is_checked_at_the_start(recorded: tuple[Path, Any]) -> None:
    path, _ = recorded

    async def run() -> None:
        session = await Session.host(LoopbackBroker().listen(), name="replay", kind="replay", epoch=1)
        with Recording(path) as recording, pytest.raises(RequestError, match="rate"):
            Player(recording, session, rate=0.0)
        await session.close()

    asyncio.run(run())


def test_export_is_the_frames_as_arrays(recorded: tuple[Path, Any], tmp_path: Path) -> None:
    path, host = recorded
    shapes = export_npz(path, tmp_path / "out.npz")
    arrays = np.load(tmp_path / "out.npz")
    assert {name: array.shape for name, array in arrays.items()} == shapes
    np.testing.assert_array_equal(arrays["tick"], np.arange(1, TICKS + 1))
    np.testing.assert_allclose(arrays["time"], np.arange(1, TICKS + 1) / 60)
    entities = arrays["entity"].tolist()
    assert arrays["name"].tolist() == [f"body {entity}" for entity in entities]
    for row, frame in enumerate(host.frames.values()):
        for column in ("position", "rotation", "linear_velocity", "angular_velocity"):
            expected = np.full(arrays[column].shape[1:], np.nan)
            for body, value in zip(frame.entity.tolist(), getattr(frame, column), strict=True):
                expected[entities.index(body)] = value
            np.testing.assert_array_equal(arrays[column][row], expected)


def test_the_facts_about_a_recording(recorded: tuple[Path, Any]) -> None:
    path, host = recorded
    info = recording_info(path)
    assert (info.complete, info.scene, info.session) == (True, "Yard", "yard")
    assert (info.ticks, info.first_tick, info.last_tick) == (TICKS, 1, TICKS)
    assert info.duration == pytest.approx((TICKS - 1) / 60)
    assert info.body_count == max(frame.body_count for frame in host.frames.values())
    channels = {channel.name: channel for channel in info.channels}
    assert channels["state"].count == TICKS
    assert channels["state"].rate == pytest.approx(TICKS / info.duration)
    assert channels["snapshot"].count == 2
    assert info.size == path.stat().st_size

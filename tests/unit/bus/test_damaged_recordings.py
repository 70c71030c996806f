"""A flipped bit in a whole file costs what stood there, not the file: the rest is read, and which ticks are missing is told."""

from __future__ import annotations

import asyncio
import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from elys.bus import topics
from elys.bus.export import export_npz
from elys.bus.exports.model import export_glb
from elys.bus.exports.tables import export_csv
from elys.bus.messages.commands import CommandReply, CommandRequest, Seek, StepTicks
from elys.bus.messages.state_frame import StateFrame, pack_frame, unpack_frame
from elys.bus.player import Player
from elys.bus.recording import Recording, opened_to_show
from elys.bus.recording_info import recording_info
from elys.bus.recording_parts import cut, merge
from elys.bus.recording_recovery import recover
from elys.bus.run_comparison import compare
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.bus.transports.mcap_index import SCENE_INDEX_NAME, STATE_INDEX_NAME, IndexBuilder
from elys.bus.transports.mcap_mending import needs_mending
from elys.common.errors import RecordingError
from tests.recorded_sessions import altered
from tests.unit.bus.told_recordings import TICKS, frame_at, write_told


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_told(tmp_path_factory.mktemp("told") / "whole.mcap", chunk=3000)


class Hole:
    """A copy of a recording with one bit flipped in the chunk that has the frame of a tick."""

    def __init__(self, whole: Path, path: Path, tick: int) -> None:
        self.path = path
        with Recording(whole) as recording:
            place = recording.place(tick)
            self.offset, self.length = recording.reader.chunk_place(place.chunk)
            self.inside = [k for k in range(TICKS + 1) if recording.place(k).chunk == place.chunk]
        flipped(whole, path, self.offset + self.length - 40)
        with Recording(path, checked=True) as recording:
            self.left = recording.tick.tolist()
        gone = sorted(set(range(TICKS + 1)) - set(self.left))
        self.first, self.last = gone[0], gone[-1]

    @property
    def named(self) -> str:
        return f"ticks {self.first} to {self.last}"


def flipped(whole: Path, path: Path, place: int) -> Path:
    data = bytearray(whole.read_bytes())
    data[place] ^= 4
    path.write_bytes(data)
    return path


@pytest.fixture
def hole(whole: Path, tmp_path: Path) -> Hole:
    return Hole(whole, tmp_path / "hole.mcap", 70)


def warnings_in(caplog: Any) -> list[str]:
    return [record.getMessage() for record in caplog.records]


def test_only_what_needs_the_damaged_part_is_missing(hole: Hole, whole: Path, caplog: Any) -> None:
    caplog.clear()
    with Recording(hole.path, checked=True) as recording, Recording(whole) as source:
        assert not recording.reader.mended
        assert set(hole.inside) <= set(range(hole.first, hole.last + 1))
        assert hole.left == [*range(hole.first), *range(hole.last + 1, TICKS + 1)]
        for position, tick in enumerate(hole.left):
            assert recording.frame_body(position) == source.frame_body(tick)
            assert recording.mirror_at(position).to_snapshot().entities == source.mirror_at(tick).to_snapshot().entities
    (warning,) = warnings_in(caplog)
    assert f"{hole.named} ({hole.first / 60:.3f} s to {hole.last / 60:.3f} s)" in warning
    assert f"`elys recover {hole.path}` writes a whole file" in warning


def test_info_says_it_under_health(hole: Hole) -> None:
    info = recording_info(hole.path)
    assert not info.complete and not info.health.complete
    assert (
        hole.named in info.health.damage[0]
        and f"{hole.length} bytes from byte {hole.offset} on" in info.health.damage[0]
    )
    assert hole.named in info.health.sentence and "elys recover" in info.health.sentence
    assert info.health.missing_ticks == hole.last - hole.first + 1


def test_it_is_exported_compared_cut_and_merged_without_it(
    hole: Hole, whole: Path, tmp_path: Path, caplog: Any
) -> None:
    export_npz(hole.path, tmp_path / "o.npz")
    assert np.load(tmp_path / "o.npz")["tick"].tolist() == hole.left
    export_csv(hole.path, tmp_path / "o.csv")
    export_glb(hole.path, tmp_path / "o.glb")
    compared = compare(whole, hole.path)
    assert (compared.instants, compared.differs) == (len(hole.left), False)
    cut(hole.path, tmp_path / "part.mcap", selection_of(1.0, 1.5))
    merge([hole.path, whole], tmp_path / "both.mcap")
    with Recording(tmp_path / "both.mcap") as both:
        assert both.tick.tolist() == list(range(TICKS + 1))
    assert sum("elys recover" in text for text in warnings_in(caplog)) == 6  # each that read it said so, once


def selection_of(start: float, end: float) -> Any:
    from elys.bus.exports.selection import Selection

    return Selection(start=start, end=end)


def test_recover_names_the_ticks_and_the_mended_file_is_whole(hole: Hole, tmp_path: Path) -> None:
    report = recover(hole.path, tmp_path / "mended.mcap")
    assert report.missing == ((hole.first, hole.last),)
    with Recording(report.path, checked=True) as mended:
        assert (mended.lost, mended.tick.tolist()) == ((), hole.left)
    assert recover(report.path).is_whole


def test_without_its_summary_the_same_ticks_are_named(hole: Hole, caplog: Any) -> None:
    hole.path.write_bytes(hole.path.read_bytes()[:-50])
    caplog.clear()
    with Recording(hole.path) as recording:
        assert recording.reader.mended
        assert recording.tick.tolist() == hole.left
        for position in range(len(recording)):
            recording.frame_body(position)
    (warning,) = warnings_in(caplog)
    assert hole.named in warning and "elys recover" in warning


async def replay(path: Path, **options: Any) -> tuple[Player, Session, Session, list[StateFrame]]:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="replay", kind="replay", epoch=99)
    player = Player(opened_to_show(path), host, **options)
    viewer = await Session.join(broker.connect(), kind="render")
    frames: list[StateFrame] = []
    viewer.subscribe(topics.STATE, lambda frame, _: frames.append(frame))
    return player, host, viewer, frames


def test_a_replay_goes_on_behind_the_hole(hole: Hole) -> None:
    async def run() -> None:
        player, host, viewer, frames = await replay(hole.path, rate=20.0)
        running = asyncio.create_task(player.run())
        async with asyncio.timeout(30.0):
            while not frames or frames[-1].tick < TICKS:
                await asyncio.sleep(0.005)

            async def do(command: Any) -> int:
                request = CommandRequest(origin=viewer.node.id, command=command)
                reply = await viewer.request(topics.COMMAND, request)
                assert isinstance(reply, CommandReply) and reply.accepted, reply
                return player.tick

            assert {frame.tick for frame in frames} <= set(hole.left)
            middle = (hole.first + hole.last) / 2
            assert await do(Seek(time=(middle - 0.5) / 60)) in (hole.first - 1, hole.last + 1)
            assert await do(Seek(time=(hole.first - 1) / 60)) == hole.first - 1
            while player.playing:
                await asyncio.sleep(0.005)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await viewer.close()
        await host.close()

    asyncio.run(run())


def test_a_seek_into_the_hole_shows_what_is_beside_it_and_stays_paused(hole: Hole) -> None:
    async def run() -> None:
        player, host, viewer, frames = await replay(hole.path, playing=False)
        running = asyncio.create_task(player.run())
        async with asyncio.timeout(30.0):
            while not frames:
                await asyncio.sleep(0.005)

            async def do(command: Any) -> int:
                reply = await viewer.request(topics.COMMAND, CommandRequest(origin=viewer.node.id, command=command))
                assert isinstance(reply, CommandReply) and reply.accepted, reply
                return player.tick

            assert await do(Seek(time=hole.inside[0] / 60)) in (hole.first - 1, hole.last + 1)
            await do(Seek(time=(hole.first - 1) / 60))
            assert await do(StepTicks(count=1)) == hole.last + 1
            assert await do(StepTicks(count=-1)) == hole.first - 1
            assert not player.playing
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await viewer.close()
        await host.close()

    asyncio.run(run())


@pytest.mark.parametrize("name", [STATE_INDEX_NAME, SCENE_INDEX_NAME, "elys/state_keys.v2"])
def test_a_damaged_index_costs_nothing(whole: Path, tmp_path: Path, name: str) -> None:
    with Recording(whole) as recording:
        offset, length = recording.reader.attachments[name]
    path = flipped(whole, tmp_path / "index.mcap", offset + length - 10)
    with Recording(path, checked=True) as recording:
        assert recording.tick.tolist() == list(range(TICKS + 1))
        assert recording.frame(TICKS).state_hash == frame_at(TICKS, 0).state_hash
        assert needs_mending(recording.reader)


def places(size: int, count: int) -> Iterator[int]:
    yield from np.linspace(8, size - 9, count).astype(int).tolist()


def test_wherever_a_bit_is_flipped_what_is_read_is_what_was_written(whole: Path, tmp_path: Path) -> None:
    read = 0
    for place in places(whole.stat().st_size, 60):
        path = flipped(whole, tmp_path / "flipped.mcap", place)
        try:
            info = recording_info(path)
        except RecordingError as error:  # what everything else needs is hit: the scene, or the metadata
            assert "flipped.mcap" in str(error)
            continue
        read += 1
        with Recording(path, checked=True) as recording, Recording(whole) as source:
            ticks = recording.tick.tolist()
            for position, tick in enumerate(ticks):
                assert recording.frame_body(position) == source.frame_body(tick), place
        missing = TICKS + 1 - len(ticks)
        assert not missing or info.health.damage or not info.complete, place
    assert read > 40


@pytest.mark.parametrize("time", [np.inf, 1e300, np.nan, -1.0])
def test_frames_whose_time_is_no_time_are_left_out(whole: Path, tmp_path: Path, time: float) -> None:
    def forge(message: Any) -> bytes:
        if message.channel == topics.STATE.name and (frame := unpack_frame(message.body)).tick == TICKS:
            return pack_frame(dataclasses.replace(frame, simulation_time=time))
        return message.body  # type: ignore[no-any-return]

    path = altered(whole, tmp_path / "forged.mcap", forge)
    compared = compare(path, whole, curves=2)
    assert (compared.instants, compared.differs) == (TICKS, False)


@pytest.mark.parametrize("time", [np.inf, 1e300, np.nan, -1.0])
def test_an_index_whose_times_are_none_is_not_believed(
    whole: Path, tmp_path: Path, caplog: Any, monkeypatch: pytest.MonkeyPatch, time: float
) -> None:
    right = IndexBuilder.frames

    def forge(builder: IndexBuilder) -> Any:
        index = right(builder)
        index["time"][-1] = time
        return index

    with monkeypatch.context() as forging:
        forging.setattr(IndexBuilder, "frames", forge)
        path = write_told(tmp_path / "forged.mcap", chunk=3000)
    caplog.clear()
    assert compare(path, whole, curves=2).instants == TICKS + 1
    assert warnings_in(caplog) == [f"the index of {path} names times that are none: reading the whole file instead"]

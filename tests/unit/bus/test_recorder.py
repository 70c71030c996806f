"""What was published is in the recording, bit for bit: through the pipe, from outside, and after hard ends."""

from __future__ import annotations

import asyncio
import json
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from elys.bus import codec, topics
from elys.bus.messages.session import LogLine
from elys.bus.messages.state_frame import HEADER, pack_frame
from elys.bus.mirror import SceneMirror
from elys.bus.recorder import record_pipe, record_session
from elys.bus.recording import Recording
from elys.bus.recording_pipe import FRAME_HEAD, FrameKind, PipeReader, frame_head
from elys.bus.session import Session
from elys.bus.tap import RecordingTap
from elys.bus.topics import Encoding
from elys.bus.transports.loopback import LoopbackBroker
from elys.bus.transports.mcap import McapWriter, recorded_channels
from elys.bus.transports.mcap_reading import McapReader
from elys.common.errors import RecordingError

Host = Callable[..., Any]


class PipeRecording:
    """A recorder at the end of a pipe, on a thread of its own."""

    def __init__(self, path: Path) -> None:
        self.reading, self.writing = os.pipe()
        self.failure: RecordingError | None = None
        self._path = path
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        try:
            record_pipe(self.reading, self._path)
        except RecordingError as error:
            self.failure = error
        finally:
            os.close(self.reading)

    def join(self) -> None:
        self._thread.join(30)
        assert not self._thread.is_alive()


async def host_session() -> tuple[LoopbackBroker, Session]:
    broker = LoopbackBroker()
    return broker, await Session.host(broker.listen(), name="yard", kind="simulation", epoch=7)


def tapped(session: Session, host: Any, descriptor: int, **options: Any) -> RecordingTap:
    return RecordingTap(
        session,
        descriptor,
        take_snapshot=host.truth.to_snapshot,
        assets=host.assets,
        **{"lossless": True, **options},
    )


async def test_every_frame_scene_and_asset_is_in_the_recording(tmp_path: Path, random_host: Host) -> None:
    path = tmp_path / "f.mcap"
    _, session = await host_session()
    host = random_host(session)
    pipe = PipeRecording(path)
    tap = tapped(session, host, pipe.writing)
    for number in range(300):
        await tap.ready()
        host.publish_tick(resync=number == 150)
    session.publish(topics.LOG, LogLine(node="n", level="info", text="done", time=1.0))
    tap.close()
    pipe.join()
    await session.close()

    with Recording(path) as recording:
        assert not recording.reader.mended
        assert recording.tick.tolist() == list(range(1, 301))
        for position, frame in enumerate(host.frames.values()):
            assert recording.frame_body(position) == pack_frame(frame)
        for position in (299, 0, 150, 149, 40, 200):
            mirror = recording.mirror_at(position)
            assert mirror.to_snapshot().components == host.scenes[position + 1].components
            assert mirror.roots == recording.frame(position).entity.tolist()
        assert sorted(recording.asset_references()) == sorted(host.assets.references())
        for reference in recording.asset_references():
            assert recording.asset(reference) == host.assets.get(reference)
        assert recording.reader.message_counts()["events"] == 30
        assert recording.reader.message_counts()["log"] == 1
    assert tap.lost == 0


async def test_other_tools_read_the_file_whole(tmp_path: Path, random_host: Host) -> None:
    path = tmp_path / "f.mcap"
    _, session = await host_session()
    host = random_host(session)
    pipe = PipeRecording(path)
    tap = tapped(session, host, pipe.writing)
    for _ in range(20):
        host.publish_tick()
    tap.close()
    pipe.join()
    await session.close()
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        channels = {channel.topic: channel for channel in summary.channels.values()}
        assert set(channels) == set(recorded_channels())
        assert channels["delta"].message_encoding == "json"
        assert summary.schemas[channels["delta"].schema_id].encoding == "jsonschema"
        assert channels["state"].message_encoding == "elys.state.v2"
        layout = json.loads(summary.schemas[channels["state"].schema_id].data)["layout"]
        assert layout["frame"]["header"]["bytes"] == HEADER.size
        headers = [message.data[: HEADER.size] for _, _, message in reader.iter_messages(topics=["state"])]
    assert headers == [pack_frame(frame)[: HEADER.size] for frame in host.frames.values()]


async def test_a_session_is_recorded_from_outside(tmp_path: Path, random_host: Host) -> None:
    from elys.bus.asset_service import serve_assets

    path = tmp_path / "f.mcap"
    broker, session = await host_session()
    host = random_host(session)
    serve_assets(session, host.assets)
    joined = await Session.join(broker.connect(), kind="recorder")
    stop = asyncio.Event()
    recording_task = asyncio.create_task(record_session(joined, path, stop))
    for number in range(200):
        host.publish_tick(resync=number == 100)
        await asyncio.sleep(0.001)
    session.publish_payload(topics.STATE, b"garbage")
    session.publish_payload(topics.DELTA, codec.with_prefix(b"{not json", Encoding.JSON))
    await asyncio.sleep(0.5)
    stop.set()
    await recording_task
    await joined.close()
    await session.close()

    with Recording(path) as recording:
        ticks = recording.tick.tolist()
        assert ticks == list(range(ticks[0], 201)) and ticks[0] < 20
        for position, tick in enumerate(ticks):
            assert recording.frame_body(position) == pack_frame(host.frames[tick])
        assert recording.mirror_at(len(ticks) - 1).to_snapshot().components == host.scenes[200].components
        assert set(recording.asset_references()) == set(host.assets.references())


async def test_the_recorders_death_leaves_the_session_alone(
    tmp_path: Path, random_host: Host, caplog: pytest.LogCaptureFixture
) -> None:
    _, session = await host_session()
    host = random_host(session)
    reading, writing = os.pipe()
    tap = tapped(session, host, writing, queue_size=10_000)
    os.close(reading)
    for _ in range(200):
        await tap.ready()
        host.publish_tick()
    tap.close()
    await session.close()
    assert not tap.alive
    assert caplog.text.count("the recorder is gone") == 1


async def test_at_full_speed_a_slow_recorder_makes_the_run_wait(tmp_path: Path, random_host: Host) -> None:
    _, session = await host_session()
    host = random_host(session)
    reading, writing = os.pipe()
    tap = tapped(session, host, writing, queue_size=100_000)
    waits = 0
    while waits == 0:
        ready = asyncio.create_task(tap.ready())
        await asyncio.wait([ready], timeout=0.05)
        if not ready.done():
            waits += 1
            ready.cancel()
        else:
            host.publish_tick()
    published = host.tick
    threading.Thread(target=lambda: [None for _ in iter(lambda: os.read(reading, 1 << 16), b"")]).start()
    for _ in range(100):
        await tap.ready()
        host.publish_tick()
    tap.close()
    assert published > 10
    assert tap.lost == 0
    await session.close()


async def test_in_real_time_a_slow_recorder_costs_state_frames_only(
    tmp_path: Path, random_host: Host, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "f.mcap"
    _, session = await host_session()
    host = random_host(session)
    reading, writing = os.pipe()
    tap = tapped(session, host, writing, queue_size=100_000, lossless=False)
    while tap.lost < 50:
        await tap.ready()
        host.publish_tick(edits=False)
    thread = threading.Thread(target=record_pipe, args=(reading, path))
    thread.start()
    tap.close()
    thread.join(30)
    await session.close()
    assert "cannot keep up" in caplog.text
    with Recording(path) as recording:
        assert len(recording) == pytest.approx(host.tick - tap.lost, abs=tap.lost * 0.2)
        assert recording.reader.message_counts()["events"] == host.tick // 10


async def test_a_killed_recording_is_mended_up_to_the_open_chunk(
    tmp_path: Path, random_host: Host, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "f.mcap"
    _, session = await host_session()
    host = random_host(session)
    pipe = PipeRecording(path)
    tap = tapped(session, host, pipe.writing)
    for _ in range(60):
        host.publish_tick()
        await asyncio.sleep(0.01)
    tap.close()
    pipe.join()
    await session.close()
    whole = path.read_bytes()
    with Recording(path) as recording:
        chunk_count = recording.reader.chunk_count
        frames = [recording.frame_body(position) for position in range(len(recording))]
    assert chunk_count >= 2
    for part in (0.95, 0.7, 0.5):
        path.write_bytes(whole[: int(len(whole) * part)])
        try:
            with Recording(path) as recording:
                assert recording.reader.mended
                assert [recording.frame_body(p) for p in range(len(recording))] == frames[: len(recording)]
        except RecordingError as error:
            assert "nothing that can be read" in str(error) or "no state frame" in str(error)
    assert "was never finished" in caplog.text


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "is empty"),
        (b"PK\x03\x04 something else", "is no recording"),
        (b"\x89MCAP0\r\n", "nothing that can be read"),
        (b"\x89MCAP0\r\n" + b"\xff" * 1000, "nothing that can be read"),
        (b"\x89MCAP0\r\n" + b"\0" * 1000 + b"\x89MCAP0\r\n", "nothing that can be read"),
    ],
)
def test_what_is_no_recording_is_said_in_a_sentence(tmp_path: Path, content: bytes, sentence: str) -> None:
    path = tmp_path / "f.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=sentence):
        Recording(path)
    with pytest.raises(RecordingError, match="cannot be opened"):
        Recording(tmp_path / "missing.mcap")
    with pytest.raises(RecordingError, match=r"cannot be (opened|read)"):
        Recording(tmp_path)


async def test_flipped_bytes_cost_a_sentence_at_most(tmp_path: Path, random_host: Host) -> None:
    import random

    path = tmp_path / "f.mcap"
    _, session = await host_session()
    host = random_host(session)
    pipe = PipeRecording(path)
    tap = tapped(session, host, pipe.writing)
    for _ in range(30):
        host.publish_tick()
    tap.close()
    pipe.join()
    await session.close()
    whole = path.read_bytes()
    source = random.Random(1)
    for _ in range(150):
        damaged = bytearray(whole)
        for _ in range(source.randrange(1, 6)):
            damaged[source.randrange(8, len(damaged))] = source.randrange(256)
        path.write_bytes(damaged)
        try:
            with Recording(path) as recording:
                for position in range(len(recording)):
                    recording.frame(position)
                recording.mirror_at(len(recording) - 1)
                for _ in recording.reader.messages():
                    pass
        except RecordingError:
            pass


def test_a_foreign_mcap_file_is_named_as_such(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("x", "json", writer.register_schema("x", "jsonschema", b"{}"))
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    with McapReader(path) as reader:
        assert reader.message_counts() == {"x": 1}
    with pytest.raises(RecordingError, match="no recording of ELYS"):
        Recording(path)


def test_garbage_in_the_pipe_is_refused(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.write(writing, b"\x07" * FRAME_HEAD.size)
    os.close(writing)
    with pytest.raises(RecordingError, match="no stream of a session"):
        record_pipe(reading, tmp_path / "f.mcap")
    os.close(reading)


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    from elys.bus.recorder_files import Recorder

    with pytest.raises(RecordingError, match="cannot be written: No such file"):
        Recorder(tmp_path / "nowhere" / "f.mcap", session="s", scene="")


@pytest.mark.parametrize("step", [1, 7, 4096])
def test_frames_come_out_of_a_pipe_however_it_is_cut(step: int) -> None:
    sent = [
        (FrameKind.BEGIN, "s", b"Yard"),
        (FrameKind.MESSAGE, "state", bytes(5000)),
        (FrameKind.ASSET, "a" * 40, b""),
    ]
    stream = b"".join(frame_head(kind, name, len(content), 3) + content for kind, name, content in sent)
    stream += frame_head(FrameKind.MESSAGE, "delta", 100, 4) + b"half of it"
    reading, writing = os.pipe()
    reader = PipeReader(reading)
    seen = []
    for start in range(0, len(stream), step):
        os.write(writing, stream[start : start + step])
        seen += [frame[:3] for frame in reader.read(0.0)]
    os.close(writing)
    assert list(reader.read(1.0)) == []
    assert seen == sent and reader.ended
    os.close(reading)


def write_run(writer: McapWriter, *, epoch: int, ticks: int) -> None:
    mirror = SceneMirror()
    mirror.epoch, mirror.sequence = epoch, 0
    writer.write("snapshot", codec.encode_body(mirror.to_snapshot(), Encoding.JSON), log_time=1)
    for tick in range(1, ticks + 1):
        header = HEADER.pack(epoch, tick, tick / 60, 0, 0, 0, 0, 1)
        writer.write("state", header, log_time=tick)


def test_of_several_runs_the_longest_is_the_timeline(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "f.mcap"
    writer = McapWriter(path, session="s")
    for epoch, ticks in ((1, 5), (2, 20), (3, 10)):
        write_run(writer, epoch=epoch, ticks=ticks)
    writer.close()
    with Recording(path) as recording:
        assert recording.tick.tolist() == list(range(1, 21))
        assert recording.mirror_at(19).epoch == 2
        assert list(recording.messages_of(19, 19)) == []
    assert "holds 3 runs" in caplog.text


def test_a_recording_without_scene_or_frames_says_which(tmp_path: Path) -> None:
    path = tmp_path / "f.mcap"
    writer = McapWriter(path, session="s")
    writer.write("log", b"{}", log_time=1)
    writer.close()
    with pytest.raises(RecordingError, match="holds no state frame"):
        Recording(path)
    writer = McapWriter(path, session="s", overwrites=True)
    writer.write("state", HEADER.pack(1, 1, 0.0, 0, 0, 0, 0, 1), log_time=1)
    writer.close()
    with pytest.raises(RecordingError, match="holds no scene"):
        Recording(path)


def test_a_recording_of_the_version_before_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "before.mcap"
    monkeypatch.setattr("elys.bus.transports.mcap.PROTOCOL_VERSION", 2)
    writer = McapWriter(path, session="s")
    write_run(writer, epoch=1, ticks=2)
    writer.close()
    with Recording(path) as recording:
        assert len(recording) >= 2 and recording.mirror_at(0).revision == 0


def test_a_recording_of_another_version_names_both(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "f.mcap"
    monkeypatch.setattr("elys.bus.transports.mcap.PROTOCOL_VERSION", 99)
    writer = McapWriter(path, session="s")
    write_run(writer, epoch=1, ticks=2)
    writer.close()
    with pytest.raises(RecordingError, match="protocol version 99; this one reads version"):
        Recording(path)


async def test_the_files_of_single_sounds_are_in_the_recording(tmp_path: Path, random_host: Host) -> None:
    """No scene names them: the events that tell the sounds do."""
    from elys.bus.asset_service import serve_assets
    from elys.bus.messages.session import EventBatch
    from elys.bus.messages.sounds import Sound, event_of

    broker, session = await host_session()
    host = random_host(session)
    serve_assets(session, host.assets)
    pipe = PipeRecording(tmp_path / "inside.mcap")
    tap = tapped(session, host, pipe.writing)
    joined = await Session.join(broker.connect(), kind="recorder")
    stop = asyncio.Event()
    recording_task = asyncio.create_task(record_session(joined, tmp_path / "outside.mcap", stop))
    reference = host.assets.put(b"RIFF\x04\0\0\0WAVE", kind="sound")
    for number in range(60):
        host.publish_tick()
        if number == 30:
            batch = EventBatch(epoch=session.epoch, tick=31, events=(event_of(Sound(sound=reference)),))
            session.publish(topics.EVENTS, batch)
        await asyncio.sleep(0.001)
    await asyncio.sleep(0.5)
    stop.set()
    await recording_task
    await asyncio.to_thread(tap.close)
    pipe.join()
    await joined.close()
    await session.close()
    for name in ("inside.mcap", "outside.mcap"):
        with Recording(tmp_path / name) as recording:
            assert recording.asset(reference) == b"RIFF\x04\0\0\0WAVE", name

"""Recordings in several files, with an end, of some topics; and what is left out because it says nothing new."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from elys.bus import topics
from elys.bus.message_sieve import MessageSieve, with_fewer_digits
from elys.bus.messages.physics import ContactBatch, Diagnostics, Touches
from elys.bus.messages.state_frame import pack_frame
from elys.bus.recorder import record_pipe
from elys.bus.recorder_files import Recorder
from elys.bus.recording import Recording
from elys.bus.recording_plan import RecordingPlan, files_of, from_json, recording_plan, to_json
from elys.bus.recording_storage import describe, state_storage
from elys.bus.session import Session
from elys.bus.tap import RecordingTap
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.errors import RecordingError
from tests.unit.bus.told_recordings import messages

Host = Callable[..., Any]


async def recorded(path: Path, random_host: Host, plan: RecordingPlan, ticks: int = 300) -> Any:
    """A host whose session was recorded through a pipe."""
    session = await Session.host(LoopbackBroker().listen(), name="yard", kind="simulation", epoch=7)
    host = random_host(session)
    reading, writing = os.pipe()
    thread = threading.Thread(target=lambda: (record_pipe(reading, path, plan), os.close(reading)))
    thread.start()
    tap = RecordingTap(session, writing, take_snapshot=host.truth.to_snapshot, assets=host.assets, lossless=True)
    for number in range(ticks):
        await tap.ready()
        host.publish_tick(resync=number == 150)
    tap.close()
    thread.join(30)
    assert not thread.is_alive()
    await session.close()
    return host


async def test_each_file_of_many_is_whole(tmp_path: Path, random_host: Host) -> None:
    path = tmp_path / "it.mcap"
    host = await recorded(path, random_host, RecordingPlan(rotate_bytes=130_000))
    files = files_of(path)
    assert len(files) > 2 and not path.exists()
    told: list[bytes] = []
    for file in files:
        with Recording(file) as recording:
            assert not recording.reader.mended
            told += [recording.frame_body(position) for position in range(len(recording))]
            for position in (0, len(recording) - 1):
                scene = recording.mirror_at(position).to_snapshot()
                assert scene.components == host.scenes[int(recording.tick[position])].components
            for reference in recording.asset_references():
                assert recording.asset(reference) == host.assets.get(reference)
    assert told == [pack_frame(frame) for frame in host.frames.values()]
    with Recording(files[-1]) as recording:
        assert set(recording.asset_references()) == set(host.assets.references())


async def test_old_files_go_and_others_stay(tmp_path: Path, random_host: Host) -> None:
    path = tmp_path / "it.mcap"
    (tmp_path / "it.007.mcap").write_bytes(b"of another run")
    host = await recorded(path, random_host, RecordingPlan(rotate_bytes=130_000, keep_files=2))
    mine, *others = files_of(path)
    assert mine.read_bytes() == b"of another run" and len(others) == 2
    assert int(others[0].stem.rpartition(".")[2]) > 8
    with Recording(others[-1]) as recording:
        assert recording.tick[-1] == host.tick


def told_to(recorder: Recorder, *, first: int, last: int) -> None:
    for channel, body, now in messages(first=first, last=last):
        recorder.message(channel, body, time_ns=now)


def test_a_name_that_somebody_took_meanwhile_is_passed_over(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "it.mcap", session="s", scene="", plan=RecordingPlan(rotate_seconds=1.0))
    (tmp_path / "it.001.mcap").write_bytes(b"of another run")
    (tmp_path / "it.002.mcap").touch()  # has just been taken
    told_to(recorder, first=0, last=90)
    recorder.close()
    names = ["it.000.mcap", "it.001.mcap", "it.002.mcap", "it.003.mcap"]
    assert [file.name for file in files_of(tmp_path / "it.mcap")] == names
    assert (tmp_path / names[1]).read_bytes() == b"of another run" and not (tmp_path / names[2]).stat().st_size
    with Recording(tmp_path / names[3]) as recording:
        assert recording.tick[-1] == 90


def test_where_there_can_be_no_next_file_every_call_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recorder = Recorder(tmp_path / "it.mcap", session="s", scene="", plan=RecordingPlan(rotate_seconds=1.0))
    told_to(recorder, first=0, last=30)

    def refuse(*_: Any, **__: Any) -> None:
        raise RecordingError("the next cannot be written")

    monkeypatch.setattr("elys.bus.recorder_files.McapWriter", refuse)
    for _ in range(2):
        with pytest.raises(RecordingError, match="the next cannot be written"):
            told_to(recorder, first=90, last=90)
        with pytest.raises(RecordingError, match="the next cannot be written"):
            recorder.keep_time()
    with pytest.raises(RecordingError, match="is finished and takes no more"):
        recorder.asset("late", b"")
    recorder.close()
    with Recording(tmp_path / "it.000.mcap") as recording:
        assert not recording.reader.mended and recording.tick.tolist() == list(range(31))


async def test_a_limit_ends_a_recording_cleanly(
    tmp_path: Path, random_host: Host, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "it.mcap"
    limit = 150_000
    host = await recorded(path, random_host, RecordingPlan(limit_bytes=limit))
    assert "has reached its limit of 0.15 MB and ends here" in caplog.text
    assert 0.7 * limit < path.stat().st_size <= 1.02 * limit
    with Recording(path) as recording:
        assert not recording.reader.mended and 10 < len(recording) < 300
        assert recording.frame_body(9) == pack_frame(host.frames[10])


async def test_chosen_topics_come_with_states_and_scene(tmp_path: Path, random_host: Host) -> None:
    path = tmp_path / "it.mcap"
    await recorded(path, random_host, recording_plan(topic_names="events"), ticks=40)
    with Recording(path) as recording:
        counts = recording.reader.message_counts()
        assert counts["state"] == 40 and counts["events"] == 4 and counts["snapshot"] == 1 and counts["delta"] == 5
        assert counts["status"] == 0


async def test_a_compact_recording_says_so(tmp_path: Path, random_host: Host) -> None:
    path = tmp_path / "it.mcap"
    host = await recorded(path, random_host, RecordingPlan(compact=True), ticks=30)
    with Recording(path) as recording:
        assert recording.frame(29).state_hash == host.frames[30].state_hash
        storage = state_storage(recording)
        assert storage.compact and storage.position_error <= 0.5e-3 and storage.rotation_error <= 0.01
        assert "within 0.42 mm" in describe(storage)
        assert recording.reader.metadata["elys"]["position_error_m"] == "0.000423"


def test_plans_are_read_as_people_write_them() -> None:
    plan = recording_plan(compact=True, rotate="512MB", keep_files=3, limit="2.5 GB", topic_names="events, log")
    assert (plan.rotate_bytes, plan.rotate_seconds, plan.keep_files) == (512_000_000, 0.0, 3)
    assert plan.limit_bytes == 2_500_000_000 and plan.takes("log") and plan.takes("delta") and not plan.takes("profile")
    assert recording_plan(rotate="10min").rotate_seconds == 600.0
    assert from_json(to_json(plan)) == plan


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ({"rotate": "much"}, "'much' is neither a size nor a time"),
        ({"rotate": "5kb"}, "too small for a recording"),
        ({"rotate": "0.1s"}, "too short for a recording"),
        ({"limit": "10min"}, "no size to end at"),
        ({"keep_files": 3}, "say --rotate"),
        ({"topic_names": "events,weather"}, "'weather' is no topic that is recorded; there are state, delta"),
        ({"topic_names": "debug_lines"}, "is no topic that is recorded"),
    ],
)
def test_plans_that_cannot_be_are_refused(words: dict[str, Any], sentence: str) -> None:
    with pytest.raises(RecordingError, match=sentence):
        recording_plan(**words)


def diagnostics(tick: int, kinetic: float) -> bytes:
    return msgspec.json.encode(
        Diagnostics(
            tick=tick,
            kinetic=kinetic,
            potential=0.0,
            momentum=(0.0, 0.0, 0.0),
            angular_momentum=(0.0, 0.0, 0.0),
            deepest_overlap=0.0,
            deepest=(0, 0),
            residual=0.0,
            restless=(0, 0),
            joint_error=0.0,
            joint_angle_error=0.0,
            joint=0,
            turned_joint=0,
            bodies=1,
            awake=0,
            contacts=0,
            islands=0,
        )
    )


def test_diagnostics_are_kept_when_they_change_and_when_time_goes_back() -> None:
    sieve = MessageSieve(compact=False)
    said = [(1, 2.0), (2, 2.0), (3, 2.5), (4, 2.5), (3, 2.5), (4, 2.5), (5, 2.0)]
    kept = [sieve.kept("diagnostics", diagnostics(*each), 0) is not None for each in said]
    assert kept == [True, False, True, False, True, False, True]
    assert sieve.kept("diagnostics", b"something else", 0) == b"something else"


def test_profiles_are_thinned_where_nothing_moves() -> None:
    sieve = MessageSieve(compact=False)
    step, kept = 16_666_667, []
    for tick in range(120):
        sieve.kept(topics.STATE.name, bytes(56) + (bytes([tick]) if tick < 60 else b"still"), tick * step)
        total = 9.0 if tick == 100 else 1.0
        profile = msgspec.json.encode({"tick": tick, "total": total, "stages": {}})
        if sieve.kept(topics.PROFILE.name, profile, tick * step) is not None:
            kept.append(tick)
    assert kept[:61] == list(range(61)) and 100 in kept
    assert len(kept) == pytest.approx(61 + 4 + 1, abs=1)


def test_fewer_digits_are_near_the_others() -> None:
    import numpy as np

    source = np.random.default_rng(1)
    count = 2000
    touches = Touches(
        entity_a=tuple(range(count)),
        entity_b=tuple(range(count)),
        body_a=tuple(range(count)),
        body_b=tuple(range(count)),
        point=tuple(map(tuple, (source.normal(size=(count, 3)) * 100.0).tolist())),
        normal=tuple(map(tuple, source.normal(size=(count, 3)).tolist())),
        depth=tuple((source.normal(size=count) * 1e-5).tolist()),
        normal_impulse=tuple((10.0 ** source.uniform(-12, 12, count)).tolist()),
        speed=tuple(source.normal(size=count).tolist()),
    )
    exact = ContactBatch(epoch=1, tick=5, begun=touches)
    body = msgspec.json.encode(exact)
    short = with_fewer_digits(body)
    seen = msgspec.json.decode(short, type=ContactBatch)
    assert len(short) < 0.6 * len(body)
    for name, error in (("point", 1e-3), ("normal", 1e-2), ("depth", 1e-5), ("speed", 1e-5)):
        assert np.allclose(getattr(seen.begun, name), getattr(touches, name), rtol=0.0, atol=error)
    assert np.allclose(seen.begun.normal_impulse, touches.normal_impulse, rtol=1e-4, atol=1e-5)
    assert seen.begun.entity_a == touches.entity_a and seen.tick == 5
    assert with_fewer_digits(b"") == b"" and with_fewer_digits(b"[1.23456789]") == b"[1.23456]"

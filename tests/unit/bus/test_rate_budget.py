"""A recording that may not grow faster than so: it does not, its states stay even, and all that happened is in it."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from elys.bus import codec, topics
from elys.bus.messages.session import Event, EventBatch
from elys.bus.messages.state_frame import BODY_SIZE, FORKED, HEADER
from elys.bus.mirror import SceneMirror
from elys.bus.rate_budget import RateBudget
from elys.bus.recorder_files import Recorder
from elys.bus.recording import Recording
from elys.bus.recording_info import recording_info
from elys.bus.recording_plan import RecordingPlan, recording_plan
from elys.bus.recording_storage import describe
from elys.bus.topics import Encoding
from elys.common.errors import RecordingError

BODIES, RATE, SECONDS = 100, 60, 20  # 5.5 kB a tick that nothing packs, 330 kB/s


def frame(tick: int, *, flags: int = 1, seed: int = 0) -> bytes:
    chance = np.random.default_rng(tick + seed)
    columns = chance.integers(0, 256, BODIES * (BODY_SIZE - 4), np.uint8).tobytes()
    return (
        HEADER.pack(1, tick, tick / RATE, 0, 0, tick, BODIES, flags)
        + columns
        + np.arange(BODIES, dtype="<u4").tobytes()
    )


def record(path: Path, plan: RecordingPlan) -> None:
    """Events in each tick beside noise, as fast as it goes, but of `SECONDS` by the clock of the messages."""
    mirror = SceneMirror()
    mirror.epoch, mirror.sequence = 1, 0
    recorder = Recorder(path, session="s", scene="", plan=plan)
    recorder.message(topics.SNAPSHOT.name, codec.encode_body(mirror.to_snapshot(), Encoding.JSON), time_ns=1)
    for tick in range(SECONDS * RATE):
        now = 10**9 + tick * 10**9 // RATE
        recorder.message(topics.STATE.name, frame(tick), time_ns=now)
        events = EventBatch(epoch=1, tick=tick, events=(Event(kind="hit", entity=1, values={}),))
        recorder.message(topics.EVENTS.name, codec.encode_body(events, Encoding.JSON), time_ns=now)
        recorder.message(topics.PROFILE.name, msgspec.json.encode({"tick": tick, "total": 1.0}), time_ns=now)
    recorder.close()


def test_it_stays_below_its_rate_and_says_so(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    limit = 100_000
    record(tmp_path / "all.mcap", RecordingPlan())
    record(tmp_path / "thin.mcap", RecordingPlan(limit_rate=limit))
    sizes = [(tmp_path / name).stat().st_size for name in ("all.mcap", "thin.mcap")]
    assert sizes[0] > 2.5 * limit * SECONDS
    assert 0.4 * limit * SECONDS < sizes[1] < 1.2 * limit * SECONDS + 200_000  # that is the summary
    with Recording(tmp_path / "thin.mcap") as recording:
        counts = recording.reader.message_counts()
        assert counts["events"] == SECONDS * RATE
        steps = np.diff(recording.tick)
        assert recording.tick[0] == 0 and 4.0 < SECONDS * RATE / len(recording) < 12.0
        # After the first seconds states come evenly: some powers of two apart, and never further than a quarter of a second.
        assert set(steps.tolist()) <= {1, 2, 4, 8, 16} and (steps[len(steps) // 2 :] >= 2).all()
        position = len(recording) // 2
        assert recording.frame_body(position) == frame(int(recording.tick[position]))
        assert 0 < counts["profile"] < len(recording)
    assert caplog.text.count("is thinned to stay below 0.1 MB/s") == 1
    info = recording_info(tmp_path / "thin.mcap")
    assert "thinned to stay below 0.1 MB/s" in describe(info.states)
    assert info.health.missing_ticks > 0 and "ticks are missing" in info.health.sentence
    assert "thinned" not in describe(recording_info(tmp_path / "all.mcap").states)


def test_what_fits_is_kept_whole(tmp_path: Path) -> None:
    record(tmp_path / "it.mcap", RecordingPlan(limit_rate=10_000_000))
    info = recording_info(tmp_path / "it.mcap")
    assert info.ticks == SECONDS * RATE and info.states.limit_rate == 0


def test_each_file_of_many_says_that_it_was_thinned(tmp_path: Path) -> None:
    record(tmp_path / "it.mcap", RecordingPlan(limit_rate=100_000, rotate_seconds=5.0))
    files = sorted(tmp_path.glob("it.*.mcap"))
    assert len(files) > 2
    assert [recording_info(file).states.limit_rate for file in files] == [100_000] * len(files)
    assert sum(file.stat().st_size for file in files) < 1.2 * 100_000 * SECONDS + 200_000 * len(files)


def test_where_there_is_room_again_all_is_kept() -> None:
    budget = RateBudget(1000.0)
    size = 0
    for tick in range(600):
        size += 100 * budget.takes("state", frame(tick), tick * 10**9 // RATE, size)
    assert budget.level > 1
    for tick in range(600, 6000):
        assert budget.takes("events", b"", tick * 10**9 // RATE, size)
        budget.takes("state", frame(tick), tick * 10**9 // RATE, size)
    assert budget.level == 0


def test_where_history_takes_another_way_the_state_is_kept() -> None:
    """The first of a fork says what it makes void, and whether time goes on is seen."""
    budget = RateBudget(1000.0)
    budget.level = 8
    for tick in range(3):
        kept = budget.takes("state", frame(tick), 0, 0)
        assert kept == (tick == 0)
    turns = [frame(2, flags=0), frame(1, flags=0), frame(2, flags=1 | FORKED), frame(3, flags=1)]
    assert all(budget.takes("state", body, 0, 0) for body in turns)
    assert not budget.takes("state", frame(4), 0, 0)


def test_rates_as_people_write_them() -> None:
    assert recording_plan(limit_rate="5MB/s").limit_rate == 5_000_000
    assert recording_plan(limit_rate="200 kb/s").limit_rate == 200_000
    for text in ("5MB", "5MB/min", "5/s", "x", "1kB/s", "10min/s"):
        with pytest.raises(RecordingError, match=r"is no rate|too slow"):
            recording_plan(limit_rate=text)

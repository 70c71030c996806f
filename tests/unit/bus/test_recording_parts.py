"""Cut and merged recordings have the frames, scenes and messages of their sources, bit for bit, and stand for themselves."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from elys.bus.exports.selection import Selection
from elys.bus.messages.state_frame import pack_frame
from elys.bus.recording import Recording
from elys.bus.recording_info import recording_info
from elys.bus.recording_parts import cut, gaps_in, merge
from elys.bus.transports.mcap import McapWriter
from elys.common.errors import RecordingError
from tests.unit.bus.told_recordings import (
    DESPAWNED,
    EDITED,
    RATE,
    SPAWNED,
    TICKS,
    frame_at,
    messages,
    poses,
    write_told,
)


@pytest.fixture
def told(tmp_path: Path) -> Path:
    return write_told(tmp_path / "told.mcap")


def assert_part(part: Path, whole: Path, first: int, last: int) -> None:
    """Every frame and scene of a part is that of the whole recording at the same tick."""
    with Recording(part) as made, Recording(whole) as source:
        assert made.tick.tolist() == list(range(first, last + 1))
        for position, tick in enumerate(made.tick.tolist()):
            there = int(np.searchsorted(source.tick, tick))
            assert made.frame_body(position) == source.frame_body(there)
            assert made.log_time(position) == source.log_time(there)
            if tick in (first, last, SPAWNED, EDITED, DESPAWNED) or tick % 10 == 9:
                assert made.mirror_at(position).to_snapshot() == source.mirror_at(there).to_snapshot()
        for reference in made.asset_references():
            assert made.asset(reference) == source.asset(reference)
        assert set(made.asset_references()) == set(source.asset_references())


@pytest.mark.parametrize(
    ("first", "last"), [(0, TICKS), (20, 60), (SPAWNED, EDITED), (EDITED + 1, DESPAWNED - 1), (50, 50)]
)
def test_a_cut_is_what_was_there_then(told: Path, tmp_path: Path, first: int, last: int) -> None:
    out = tmp_path / "part.mcap"
    report = cut(told, out, Selection(start=first / RATE, end=last / RATE))
    assert report.ticks == last - first + 1
    assert_part(out, told, first, last)
    info = recording_info(out)
    assert info.complete and not info.health.sentence
    assert info.sources is not None and info.sources.made_by == "cut"
    (source,) = info.sources.of
    assert (source.file, source.first_tick, source.last_tick) == ("told.mcap", first, last)
    counts = {channel.name: channel.count for channel in info.channels}
    # One snapshot at the beginning, the deltas within, and every event of its ticks.
    assert counts["snapshot"] == 1
    assert counts["delta"] == sum(first < tick <= last for tick in (SPAWNED, EDITED, DESPAWNED))
    assert counts["events"] == counts["log"] == sum(tick % 10 == 0 for tick in range(first, last + 1))


def test_a_cut_keeps_what_is_said_of_the_simulation(tmp_path: Path) -> None:
    writer = McapWriter(tmp_path / "fork.mcap", session="told", scene="Told")
    writer.add_metadata("elys.build", {"numba": "1"})
    writer.add_metadata("elys.lineage", {"parent": "other.mcap", "time": "1.5"})
    for channel, body, now in messages():
        writer.write(channel, body, log_time=now)
    writer.write("exact", b"state", log_time=now)
    writer.close()
    cut(tmp_path / "fork.mcap", tmp_path / "part.mcap", Selection(start=1.0))
    assert recording_info(tmp_path / "part.mcap").lineage == {"parent": "other.mcap", "time": "1.5"}
    with Recording(tmp_path / "part.mcap") as part:
        assert part.reader.metadata["elys.build"] == {"numba": "1"}
        assert [message.body for message in part.reader.messages(("exact",))] == [b"state"]


def test_a_cut_of_a_cut_knows_both(told: Path, tmp_path: Path) -> None:
    cut(told, tmp_path / "a.mcap", Selection(start=0.5, end=1.5))
    cut(tmp_path / "a.mcap", tmp_path / "b.mcap", Selection(start=1.0))
    sources = recording_info(tmp_path / "b.mcap").sources
    assert sources is not None
    (parent,) = sources.of
    assert parent.sources is not None
    assert (parent.file, parent.sources.of[0].file) == ("a.mcap", "told.mcap")
    assert_part(tmp_path / "b.mcap", told, 60, 90)


def test_others_read_a_cut(told: Path, tmp_path: Path) -> None:
    cut(told, tmp_path / "part.mcap", Selection(start=1.0))
    with (tmp_path / "part.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = Counter(channel.topic for _, channel, _ in reader.iter_messages())
        assert found["state"] == TICKS - 60 + 1
        assert {record.name for record in reader.iter_metadata()} >= {"elys", "elys.sources"}


@pytest.mark.parametrize("second", [40, 61, 60])
def test_parts_that_follow_one_another_make_the_whole(told: Path, tmp_path: Path, second: int) -> None:
    write_told(tmp_path / "a.mcap", last=60)
    write_told(tmp_path / "b.mcap", first=second)
    report = merge([tmp_path / "b.mcap", tmp_path / "a.mcap"], tmp_path / "c.mcap")
    assert_part(tmp_path / "c.mcap", told, 0, TICKS)
    assert report.duplicates == 2 * sum(second <= tick <= 60 and tick % 10 == 0 for tick in range(TICKS + 1))
    counts = {channel.name: channel.count for channel in recording_info(tmp_path / "c.mcap").channels}
    assert counts["events"] == counts["log"] == TICKS // 10 + 1


def test_what_two_recorders_missed_is_filled_from_each_other(told: Path, tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    everything = list(messages())
    for name in ("a", "b"):
        writer = McapWriter(tmp_path / f"{name}.mcap", session="told", scene="Told")
        for channel, body, now in everything:
            keeps = channel == "snapshot" or random.random() < 0.7
            if keeps:
                writer.write(channel, body, log_time=now)
        writer.close()
    report = merge([tmp_path / "a.mcap", tmp_path / "b.mcap"], tmp_path / "c.mcap")
    kept: dict[str, set[bytes]] = {}
    with Recording(tmp_path / "c.mcap") as made:
        for name in ("a", "b"):
            with Recording(tmp_path / f"{name}.mcap") as part:
                for message in part.reader.messages(("state", "events", "log")):
                    kept.setdefault(message.channel, set()).add(message.body)
        assert {m.body for m in made.reader.messages(("events",))} == kept["events"]
        assert {m.body for m in made.reader.messages(("log",))} == kept["log"]
        ticks = made.tick.tolist()
        assert len(ticks) == len(set(ticks)) == report.ticks == len(kept["state"])
        assert 0.85 * TICKS < len(ticks) < TICKS
        assert report.gaps == gaps_in(ticks)
        for position, tick in enumerate(ticks):
            sequence = 1 + sum(tick >= edit for edit in (SPAWNED, EDITED, DESPAWNED))
            assert made.frame_body(position) == pack_frame(frame_at(tick, sequence))


def test_what_cannot_be_put_together_is_said(told: Path, tmp_path: Path) -> None:
    other = write_told(tmp_path / "other.mcap", epoch=8)
    with pytest.raises(RecordingError, match="is of another run than"):
        merge([told, other], tmp_path / "c.mcap")
    with pytest.raises(RecordingError, match="is named twice"):
        merge([told, told], tmp_path / "c.mcap")
    before = told.read_bytes()
    for attempt in (lambda: merge([other, told], told), lambda: cut(told, told, Selection(end=1.0))):
        with pytest.raises(RecordingError, match="choose another name with -o"):
            attempt()
    with pytest.raises(RecordingError, match="has no tick between 7 s and inf s"):
        cut(told, tmp_path / "c.mcap", Selection(start=7.0))
    assert told.read_bytes() == before
    assert not (tmp_path / "c.mcap").exists()


def test_health_says_what_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "holes.mcap"
    writer = McapWriter(path, session="told", scene="Told")
    tick = -1
    for channel, body, now in messages():
        tick += channel == "state"
        if (channel == "state" and tick in (10, 11, 50)) or (
            channel == "delta" and len(poses(tick)) == 3 and tick > 30
        ):
            continue
        writer.write(channel, body, log_time=now - (50 * 10**9 if tick == 70 else 0))
    writer.close()
    health = recording_info(path).health
    assert health.complete
    assert health.missing_ticks == 3 and health.gaps == ((9, 12), (49, 51))
    assert health.out_of_order >= 1
    assert "3 ticks are missing, first between 9 and 12 and in 1 more place" in health.sentence


def test_health_of_a_cut_off_file(tmp_path: Path) -> None:
    write_told(tmp_path / "killed.mcap", finished=False)
    info = recording_info(tmp_path / "killed.mcap")
    assert not info.complete and "elys recover" in info.health.sentence

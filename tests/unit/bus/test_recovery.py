"""Whatever is left of a file becomes a whole one that others open, with every message that can be read; the rest is said."""

from __future__ import annotations

import fcntl
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from elys.bus.recording import Recording
from elys.bus.recording_info import recording_info
from elys.bus.recording_recovery import recover
from elys.common.errors import RecordingError
from tests.unit.bus.told_recordings import IMAGE, TICKS, write_told


def read_by_others(path: Path) -> list[tuple[str, bytes, int]]:
    """All messages, as the official reader sees them, with checksums looked at and every message through its index."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        found = [(c.topic, m.data, m.log_time) for _, c, m in reader.iter_messages(log_time_order=False)]
        assert summary.statistics.message_count == len(found)
        state = [c.id for c in summary.channels.values() if c.topic == "state"]
        indexed = sum(bool(set(chunk.message_index_offsets) & set(state)) for chunk in summary.chunk_indexes)
        assert indexed == len({message.place.chunk for message in Recording(path).reader.messages(("state",))})
        return found


@pytest.mark.parametrize("cut_at", [0.5, 0.6, 0.77, 0.9, 0.999])  # what stands before the states is a third
def test_a_cut_file_becomes_whole(tmp_path: Path, cut_at: float) -> None:
    whole = write_told(tmp_path / "told.mcap", chunk=4000)
    data = whole.read_bytes()
    damaged = tmp_path / "cut.mcap"
    damaged.write_bytes(data[: int(cut_at * len(data))])
    with Recording(damaged) as left:
        frames = {tick: left.frame_body(position) for position, tick in enumerate(left.tick.tolist())}
    report = recover(damaged)
    assert report.path == tmp_path / "cut.recovered.mcap" and not report.is_whole
    assert report.ticks == len(frames)
    found = read_by_others(report.path)
    assert len(found) == report.messages
    assert found == read_by_others(whole)[: len(found)]
    info = recording_info(report.path)
    assert info.complete and info.sources is not None and info.sources.made_by == "recover"
    with Recording(report.path) as mended, Recording(whole) as source:
        assert not mended.reader.mended
        for position, body in enumerate(frames.values()):
            assert mended.frame_body(position) == body
        for position in range(0, len(mended), 7):
            assert mended.mirror_at(position).to_snapshot() == source.mirror_at(position).to_snapshot()
        assert IMAGE in [mended.asset(reference) for reference in mended.asset_references()]
    assert recover(report.path).is_whole
    assert damaged.read_bytes() == data[: int(cut_at * len(data))]


def test_what_a_kill_leaves_loses_nothing_that_was_flushed(tmp_path: Path) -> None:
    report = recover(write_told(tmp_path / "killed.mcap", finished=False, chunk=4000))
    assert (report.ticks, report.lost) == (TICKS + 1, ())


def test_one_damaged_chunk_is_left_out_and_said(tmp_path: Path) -> None:
    whole = write_told(tmp_path / "told.mcap", chunk=4000)
    with Recording(whole) as recording:
        number = recording.place(60).chunk
        offset, length = recording.reader.chunk_place(number)
        gone = sum(recording.place(position).chunk == number for position in range(len(recording)))
        hit = recording.reader.chunk(number)
    data = bytearray(whole.read_bytes())
    data[offset + length // 2] ^= 0xFF
    whole.write_bytes(data)
    report = recover(whole, tmp_path / "out.mcap")
    assert report.ticks == TICKS + 1 - gone
    (sentence,) = report.lost
    assert f"{length} bytes from byte {offset} on" in sentence
    assert not {(m.channel, m.body) for m in hit if m.channel == "state"} & {
        (topic, body) for topic, body, _ in read_by_others(tmp_path / "out.mcap")
    }


def test_a_damaged_summary_costs_nothing(tmp_path: Path) -> None:
    whole = write_told(tmp_path / "told.mcap", chunk=4000)
    before = read_by_others(whole)
    data = bytearray(whole.read_bytes())
    data[-60] ^= 0xFF
    whole.write_bytes(data)
    report = recover(whole, tmp_path / "out.mcap")
    assert read_by_others(tmp_path / "out.mcap") == before
    assert report.ticks == TICKS + 1


def test_in_place_keeps_the_damaged_file(tmp_path: Path) -> None:
    path = write_told(tmp_path / "told.mcap", finished=False)
    before = path.read_bytes()
    report = recover(path, in_place=True)
    assert report.path == path and report.backup == tmp_path / "told.mcap.bak"
    assert report.backup.read_bytes() == before
    assert not Recording(path).reader.mended
    assert sorted(file.name for file in tmp_path.iterdir()) == ["told.mcap", "told.mcap.bak"]


def test_nothing_that_is_there_is_overwritten(tmp_path: Path) -> None:
    path = write_told(tmp_path / "told.mcap", finished=False)
    for name, options in (("told.recovered.mcap", {}), ("told.mcap.bak", {"in_place": True}), ("o.mcap", {})):
        other = tmp_path / name
        other.write_text("precious")
        target = other if name == "o.mcap" else None
        with pytest.raises(RecordingError, match="is there already"):
            recover(path, target, **options)
        assert other.read_text() == "precious"


def test_what_is_being_recorded_is_not_replaced(tmp_path: Path) -> None:
    path = write_told(tmp_path / "told.mcap", finished=False)
    before = path.read_bytes()
    with path.open("rb") as recorder:
        fcntl.flock(recorder, fcntl.LOCK_EX)
        with pytest.raises(RecordingError, match="is being recorded by another process"):
            recover(path, in_place=True)
    assert path.read_bytes() == before


def test_a_whole_file_is_left_alone(tmp_path: Path) -> None:
    path = write_told(tmp_path / "told.mcap")
    assert recover(path).is_whole
    assert [file.name for file in tmp_path.iterdir()] == ["told.mcap"]


def test_every_byte_that_is_lost_at_the_end_is_counted(tmp_path: Path) -> None:
    whole = write_told(tmp_path / "told.mcap", chunk=4000).read_bytes()
    with Recording(tmp_path / "told.mcap") as recording:
        offset, length = recording.reader.chunk_place(recording.reader.chunk_count - 1)
    for beyond in np.linspace(1, length - 1, 5).astype(int).tolist():
        path = tmp_path / f"{beyond}.mcap"
        path.write_bytes(whole[: offset + beyond])
        assert recover(path).lost == (f"the last {beyond} bytes, where it was cut off",)

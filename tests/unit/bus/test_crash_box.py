"""What is kept for a crash: the last seconds and no more, a recording of them, and nothing where all went well."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from elys.bus.crash_box import LENGTH, CrashBox, remove_orphans
from elys.bus.crash_rescue import _frames_in, rescue
from elys.bus.last_seconds import MOST_ROOM, ROOM, SECONDS, room_for
from elys.bus.recording import Recording
from elys.bus.recording_pipe import FrameKind, frame_head
from elys.common.errors import ElysError
from elys.verbs.moments import guard_seconds
from tests.unit.bus.told_recordings import RATE, messages

TOLD = 600  # ticks


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ELYS_RUNTIME_DIR", str(tmp_path / "runtime"))
    return tmp_path / "runtime"


@contextlib.contextmanager
def filled(place: Path, *, seconds: float, room: int = 1 << 30) -> Iterator[tuple[CrashBox, list[bytes]]]:
    """A box that was told a session as a simulation tells it, and the session's frames; closed afterwards."""
    box, frames = CrashBox(place, seconds=seconds, room=room), []
    box.begin(lambda: [frame_head(FrameKind.BEGIN, "told", 4, 0), b"Told"])
    tick = 0
    for channel, body, now in messages(epoch=7, first=0, last=TOLD):
        if channel == "snapshot":
            head = frame_head(FrameKind.MESSAGE, channel, len(body), now)
            box.scene(lambda head=head, body=body: [head, body])
        elif channel == "delta":
            box.delta(channel, body, now)
        else:
            box.message(channel, body, now)
        if channel == "state":
            frames.append(body)
            box.end_tick(tick, RATE)
            tick += 1
    box._jobs.put(None)
    box._thread.join()
    try:
        yield box, frames
    finally:
        box.close()


def open_files() -> list[str]:
    """What this process has descriptors of."""
    return [str(link.readlink()) for link in Path("/proc/self/fd").iterdir() if link.is_symlink()]


def test_what_was_said_last_becomes_a_recording(runtime: Path, tmp_path: Path) -> None:
    with filled(tmp_path / "problem", seconds=2.0) as (box, frames):
        path = rescue(box.folder, tmp_path / "problem")
        again = rescue(box.folder, tmp_path / "problem")
    assert path == tmp_path / f"problem-{TOLD}.mcap" and again == tmp_path / f"problem-{TOLD}-2.mcap"
    with Recording(path) as recording:
        assert not recording.reader.mended
        count = len(recording)
        assert 2.0 * RATE <= count <= 2.6 * RATE + 1
        assert [recording.frame_body(position) for position in range(count)] == frames[-count:]
        assert recording.mirror_at(0).epoch == 7
    assert list(runtime.iterdir()) == []  # the box was closed in peace


def test_it_takes_no_more_room_than_it_may(runtime: Path, tmp_path: Path) -> None:
    room = 20_000
    with filled(tmp_path / "problem", seconds=100.0, room=room) as (box, _):
        said = [LENGTH.unpack(file.read_bytes()[:8])[0] for file in box.folder.glob("said-*")]
        assert len(said) > 2 and 0.5 * room < sum(said) < 1.5 * room
        path = rescue(box.folder, tmp_path / "problem")
        assert path is not None
        with Recording(path) as recording:
            assert recording.tick[-1] == TOLD and 10 < len(recording) < TOLD


def test_where_it_cannot_be_written_nothing_is_kept_and_nobody_suffers(runtime: Path, tmp_path: Path) -> None:
    with filled(tmp_path / "problem", seconds=2.0) as (box, _):
        for file in box.folder.iterdir():
            file.unlink()
        box.folder.rmdir()
        while box._spare:  # the next file is a new one
            os.close(box._spare.pop().descriptor)
        for tick in range(TOLD, 2 * TOLD):
            box.message("log", b"{}", tick)
            box.end_tick(tick, RATE)
        assert not box.alive
        box.end_tick(2 * TOLD, RATE)
        assert not any(str(runtime) in name for name in open_files())
    assert list(runtime.iterdir()) == []


def test_steps_back_are_kept_as_long_as_steps_forth(runtime: Path, tmp_path: Path) -> None:
    """Each of them took a file of its own, until the process had no descriptors left."""
    with filled(tmp_path / "problem", seconds=2.0) as (box, _):
        back = list(reversed(range(TOLD - 400, TOLD)))
        for moment, tick in enumerate([*back, TOLD - 400, *reversed(back)]):  # it waits there, and plays again
            box.message("log", b"{}", (1 << 62) + moment)
            box.end_tick(tick, RATE)
            if tick == TOLD - 400:
                assert len(list(box.folder.glob("said-*"))) <= 7
                kept = [frame.time - (1 << 62) for frame in _frames_in(box.folder) if frame.name == "log"]
                assert max(kept) == moment and 2.0 * RATE <= len(kept) <= 2.6 * RATE + 1
        assert box.alive and len(list(box.folder.glob("said-*"))) <= 7


def test_before_anything_was_said_there_is_nothing_to_keep(runtime: Path, tmp_path: Path) -> None:
    box = CrashBox(tmp_path / "problem", seconds=2.0, room=1000)
    assert rescue(box.folder, tmp_path / "problem") is None
    box.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["runtime"]


def test_what_nobody_waits_for_any_more_is_removed(runtime: Path) -> None:
    for name in ("last-dead", "last-alive", "last-young"):
        (runtime / name).mkdir(parents=True)
        (runtime / name / "lock").touch()
        (runtime / name / "said-0").write_text("frames")
        if name != "last-young":
            os.utime(runtime / name, (1.0, 1.0))
    with (runtime / "last-alive" / "lock").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        remove_orphans(runtime)
    assert sorted(path.name for path in runtime.iterdir()) == ["last-alive", "last-young"]


def test_how_much_is_kept_is_chosen_within_bounds() -> None:
    assert guard_seconds("30s") == 30.0 and guard_seconds("1min") == 60.0
    for text in ("0.5", "11min", "-3s"):
        with pytest.raises(ElysError, match="the guard keeps 1 s to 600 s"):
            guard_seconds(text)
    assert room_for(1.0) == room_for(SECONDS) == ROOM
    assert room_for(2 * SECONDS) == 2 * ROOM and room_for(600.0) == MOST_ROOM


def test_a_tick_that_was_not_written_to_its_end_does_not_count(runtime: Path, tmp_path: Path) -> None:
    """The kill came before its length was told: what stands there is half new and half of an earlier use of the file."""
    with filled(tmp_path / "problem", seconds=2.0) as (box, frames):
        last = box._said[-1]
        torn = [frame_head(FrameKind.MESSAGE, "state", len(frames[-1]), 1 << 62), frames[-1][:100]]
        os.pwritev(last.descriptor, torn, LENGTH.size + last.size)
        path = rescue(box.folder, tmp_path / "problem")
    assert path is not None
    with Recording(path) as recording:
        assert recording.tick[-1] == TOLD
        assert recording.frame_body(len(recording) - 1) == frames[-1]


def test_a_file_that_is_damaged_costs_what_stands_behind_the_damage(runtime: Path, tmp_path: Path) -> None:
    with filled(tmp_path / "problem", seconds=2.0) as (box, _):
        (box.folder / "commands-0").write_bytes(b"\xff" * 100)
        newest = box._said[-1]
        os.pwrite(newest.descriptor, b"\xff", LENGTH.size)
        path = rescue(box.folder, tmp_path / "problem")
    assert path is not None
    with Recording(path) as recording:
        assert len(recording) >= 1.5 * RATE and recording.tick[-1] < TOLD


@pytest.mark.parametrize("name", ["pwritev", "writev"])
def test_what_was_not_written_to_its_end_ends_the_keeping(
    runtime: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """As when the disk is full after half of it."""
    with filled(tmp_path / "problem", seconds=2.0) as (box, _):
        write = getattr(os, name)
        monkeypatch.setattr(os, name, lambda *given: write(*given) - 1)
        box.delta("delta", b"{}", 1)
        box.message("log", b"{}", 1)
        box.end_tick(TOLD, RATE)
        assert not box.alive


def test_a_fault_in_what_is_packed_ends_the_keeping_and_not_the_thread(runtime: Path, tmp_path: Path) -> None:
    def put() -> None:
        raise ValueError("unforeseen")

    box = CrashBox(tmp_path / "problem", seconds=2.0, room=1000)
    box.assets(put)
    box.exact(lambda: [b"state"])
    box.close()
    assert box._jobs.empty()
    assert list(runtime.iterdir()) == []


def test_an_asset_that_has_no_room_bars_no_other(
    runtime: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("elys.bus.crash_box.ROOM_FOR_ASSETS", 100)
    box = CrashBox(tmp_path / "problem", seconds=2.0, room=1000)
    for reference, size in (("first", 40), ("large", 101), ("second", 60), ("third", 1)):
        box.asset(reference, bytes(size), 1)
    assert [frame.name for frame in _frames_in(box.folder)] == ["first", "second"]
    box.close()

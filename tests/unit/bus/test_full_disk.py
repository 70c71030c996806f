"""A disk that is full ends a recording with what fitted: whole, for every MCAP reader, and not a chunk less than need be."""

from __future__ import annotations

import errno
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from elys.bus.messages.state_frame import BODY_SIZE, HEADER
from elys.bus.recording import Recording
from elys.bus.transports import recording_file
from elys.bus.transports.mcap import McapWriter
from elys.bus.transports.mcap_index import IndexBuilder
from elys.bus.transports.recording_file import RecordingFile
from elys.common.errors import RecordingError
from tests.unit.bus.told_recordings import TICKS, messages, write_told

DISK = 600_000  # [bytes], of which a tmpfs makes whole pages


@pytest.fixture
def file_limit() -> Iterator[None]:
    """Files of this process may be changed in how long they may become."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


def told_until_full(path: Path) -> tuple[str, int]:
    """Tells a recorder of a session until it refuses; what it said, and how many ticks it was told."""
    writer = McapWriter(path, session="told", scene="Told")
    told = 0
    with pytest.raises(RecordingError) as refused:
        for message in noise(10_000):
            tell(writer, *message)
            told += 1
    with pytest.raises(RecordingError, match="cannot be written any further"):
        writer.write("log", b"{}", log_time=1)
    writer.close()
    return str(refused.value), told


def noise(ticks: int) -> Iterator[tuple[str, bytes, int]]:
    """A scene, and frames that nothing packs: what they take is known."""
    (scene,) = (message for message in messages(epoch=7, first=0, last=0) if message[0] == "snapshot")
    yield scene
    chance = np.random.default_rng(3)
    for tick in range(ticks):
        columns = (
            chance.integers(0, 256, 20 * (BODY_SIZE - 4), np.uint8).tobytes() + np.arange(20, dtype="<u4").tobytes()
        )
        yield "state", HEADER.pack(7, tick, tick / 60.0, 0, 0, tick, 20, 1) + columns, 10**9 + tick


def tell(writer: McapWriter, channel: str, body: bytes, now: int) -> None:
    """In chunks of a few frames, as time would make them."""
    writer.write(channel, body, log_time=now)
    if writer._chunk_bytes > 10_000:
        writer._flush()


def check_whole(path: Path, told: int) -> int:
    """The file is finished and holds ticks without a gap; returns how many."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        states = sum(channel.topic == "state" for _, channel, _ in reader.iter_messages())
    with Recording(path) as recording:
        assert not recording.reader.mended
        assert recording.tick.tolist() == list(range(len(recording)))
        assert 0 < len(recording) == states <= told
        for position in (0, len(recording) // 2, len(recording) - 1):
            assert HEADER.unpack_from(recording.frame_body(position))[1] == position
        return len(recording)


def test_a_file_that_may_not_grow_ends_whole(tmp_path: Path, file_limit: None) -> None:
    """There is no room kept for what is no disk: chunks make way for the end."""
    path = tmp_path / "it.mcap"
    resource.setrlimit(resource.RLIMIT_FSIZE, (DISK, resource.RLIM_INFINITY))
    said, told = told_until_full(path)
    assert "File too large; what fitted is whole" in said
    count = check_whole(path, told)
    assert path.stat().st_size > 0.9 * DISK and count > 0.6 * told


def test_what_has_no_room_for_anything_leaves_nothing(tmp_path: Path, file_limit: None) -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))
    with pytest.raises(RecordingError, match="File too large; nothing of it fitted"):
        McapWriter(tmp_path / "it.mcap", session="s")
    assert list(tmp_path.iterdir()) == []


def test_the_end_that_has_no_room_takes_it_from_chunks(tmp_path: Path, file_limit: None) -> None:
    writer = McapWriter(tmp_path / "it.mcap", session="told", scene="Told")
    for message in noise(300):
        tell(writer, *message)
    writer._flush()
    resource.setrlimit(resource.RLIMIT_FSIZE, (writer._writer.size + 10_000, resource.RLIM_INFINITY))
    with pytest.raises(RecordingError, match="what fitted is whole"):
        writer.close()
    assert 150 < check_whole(tmp_path / "it.mcap", 300) < 300


def test_rather_than_lose_most_of_it_a_recording_stays_without_its_end(tmp_path: Path, file_limit: None) -> None:
    path = tmp_path / "it.mcap"
    writer = McapWriter(path, session="told", scene="Told")
    for channel, body, now in messages(epoch=7, first=0, last=TICKS):
        writer.write(channel, body, log_time=now)
    writer._flush()
    resource.setrlimit(resource.RLIMIT_FSIZE, (writer._writer.size + 1000, resource.RLIM_INFINITY))
    with pytest.raises(RecordingError, match="what fitted can be read"):
        writer.close()
    with Recording(path) as recording:
        assert recording.reader.mended
        assert recording.tick.tolist() == list(range(TICKS + 1))


@pytest.mark.parametrize("failures", [1, 10**6])
@pytest.mark.parametrize("ends", ["keep_time", "close"])
def test_a_disk_that_fails_costs_no_chunk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failures: int, ends: str
) -> None:
    """Less in the file would make no room: what is there is kept, also where it cannot be given an end."""
    path, ticks, count = tmp_path / "it.mcap", 100, 0
    writer = McapWriter(path, session="told", scene="Told")
    for message in noise(ticks):
        tell(writer, *message)
    writer._flush()

    def fail(_: int) -> None:
        nonlocal count
        count += 1
        if count <= failures:
            raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "fsync", fail)
    writer._synced = -1.0  # it is time
    with pytest.raises(RecordingError, match="what fitted is whole" if failures == 1 else "what fitted can be read"):
        getattr(writer, ends)()
    assert count <= 3
    with Recording(path) as recording:
        assert recording.reader.mended == (failures > 1)
        assert recording.tick.tolist() == list(range(ticks))


def test_an_end_that_no_chunk_makes_room_for_costs_few(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody else takes what is given back."""
    path, ticks, tries = tmp_path / "it.mcap", 300, 0
    writer = McapWriter(path, session="told", scene="Told")
    for message in noise(ticks):
        tell(writer, *message)
    writer._flush()

    def refuse() -> None:
        nonlocal tries
        tries += 1
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(writer._writer, "finish", refuse)
    with pytest.raises(RecordingError, match="what fitted can be read"):
        writer.close()
    assert tries == 3  # by itself, with all chunks, and with those that leave room
    with Recording(path) as recording:
        assert recording.reader.mended and 200 < len(recording) < ticks


def test_on_a_disk_that_is_full_every_chunk_that_was_written_stays(tmp_path: Path) -> None:
    """A real one, of a file system of its own, where this user may mount one."""
    code = f"""
import os, sys
from pathlib import Path
from tests.unit.bus.test_full_disk import check_whole, told_until_full
path = Path(sys.argv[1], "it.mcap")
said, told = told_until_full(path)
assert "No space left on device; what fitted is whole" in said, said
count = check_whole(path, told)
assert count > told - 20, (count, told)
assert path.stat().st_size > 0.9 * {DISK}
free = os.statvfs(path).f_bavail * os.statvfs(path).f_bsize  # what was kept for the end and not used is free again
assert free + path.stat().st_size > {DISK} - 3 * 4096, (free, path.stat().st_size)
"""
    script = f'mount -t tmpfs -o size={DISK} full "$1" && exec "$2" -c "$3" "$1"'
    words = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", script, "sh", str(tmp_path), sys.executable]
    try:
        trial = subprocess.run([*words, "pass"], capture_output=True, text=True, check=False)
    except FileNotFoundError:
        pytest.skip("there is no unshare")
    if trial.returncode:
        pytest.skip(f"nothing can be mounted here: {trial.stderr.strip()}")
    done = subprocess.run([*words, code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_without_room_kept_for_the_end_a_disk_is_written_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a file system that has nothing of the kind."""
    monkeypatch.setattr(recording_file, "_allocate", lambda *_: 95)  # EOPNOTSUPP
    path = write_told(tmp_path / "it.mcap")
    assert check_whole(path, TICKS + 1) == TICKS + 1


def test_a_file_is_as_it_was_after_what_was_refused(tmp_path: Path, file_limit: None) -> None:
    path = tmp_path / "it"
    file = RecordingFile(os.open(path, os.O_WRONLY | os.O_CREAT))
    file.append(b"abc", b"", memoryview(b"def"), room=100)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, resource.RLIM_INFINITY))
    with pytest.raises(OSError, match="File too large"):
        file.append(b"x" * 7, b"y" * 7)
    assert file.size == 6 and path.read_bytes() == b"abcdef"
    file.append(b"ghij")
    file.close()
    file.close()
    assert path.read_bytes() == b"abcdefghij"


def test_a_fork_that_did_not_fit_makes_nothing_void(tmp_path: Path) -> None:
    """What a lost frame made void is found again by who reads."""
    index = IndexBuilder()
    frames = [(1, tick, float(tick), 0, 0, 0, 0, (tick + 1) << 4) for tick in (0, 1, 2)] + [
        (1, 1, 1.0, 0, 0, 0, 0, (2 << 4) | 8)
    ]
    for place, frame in enumerate(frames):
        index.add("state", HEADER.pack(*frame), chunk=place, message=0)
    assert index.frames()["tick"].tolist() == [0, 1]
    assert index.cut(4)
    assert not index.cut(3)

"""What a shell becomes when a simulation has ended without a word: `python -m elys.bus.crash_rescue FOLDER PLACE`.

Out of the files of a `CrashBox` it makes a recording, PLACE-TICK.mcap, and removes them.
"""

from __future__ import annotations

import logging
import shutil
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

from elys.bus import codec, topics
from elys.bus.crash_box import LENGTH, SAID
from elys.bus.log import start_logging
from elys.bus.messages.state_frame import HEADER
from elys.bus.recorder_files import Recorder
from elys.bus.recording_names import free_name
from elys.bus.recording_pipe import FRAME_HEAD, FrameKind, PipeFrame, frame_at
from elys.bus.topics import Encoding
from elys.bus.transports.mcap import recorded_channels
from elys.common.errors import ElysError, RecordingError

_log = logging.getLogger(__name__)


def rescue(folder: Path, place: Path) -> Path | None:
    """Makes the recording; None where nothing had happened yet.

    Raises:
        RecordingError: it cannot be written.
    """
    frames = sorted(_frames_in(folder), key=lambda frame: frame.time)  # in a file, and of one time, as they came
    begin = next((frame for frame in frames if frame.kind is FrameKind.BEGIN), None)
    states = [frame for frame in frames if frame.kind is FrameKind.MESSAGE and frame.name == topics.STATE.name]
    if begin is None or not states:
        return None
    tick = HEADER.unpack_from(states[-1].content)[1]
    path = free_name(place.with_name(f"{place.name}-{tick}.mcap"))
    recorder = Recorder(path, session=begin.name, scene=begin.content.decode(errors="replace"))
    try:
        for frame in frames:
            if frame.kind is FrameKind.ASSET:
                recorder.asset(frame.name, frame.content)
            elif frame.kind is FrameKind.FACTS:
                recorder.facts(frame.name, codec.decode_body(frame.content, dict[str, str], Encoding.JSON))
        for frame in frames:
            if frame.kind is FrameKind.MESSAGE and frame.name in recorded_channels():
                recorder.message(frame.name, frame.content, time_ns=frame.time)
    finally:
        recorder.close()
    return path


def _frames_in(folder: Path) -> Iterator[PipeFrame]:
    for file in sorted(folder.iterdir()):
        data = file.read_bytes()
        if file.name.startswith(SAID):  # what follows is of an earlier use of the file
            data = data[LENGTH.size : LENGTH.size + LENGTH.unpack_from(data.ljust(LENGTH.size, b"\0"))[0]]
        try:
            yield from _frames_of(data)
        except RecordingError as error:
            _log.debug("the rest of %s cannot be read: %s", file.name, error)  # the other files can


def _frames_of(data: bytes) -> Iterator[PipeFrame]:
    offset = 0
    while (frame := frame_at(data, offset)) is not None:
        offset += FRAME_HEAD.size + data[offset + 1] + len(frame.content)
        yield frame


def main(folder: Path, place: Path) -> int:
    """Rescues, says where to, and removes the files."""
    start_logging()
    for ignored in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(ignored, signal.SIG_IGN)
    try:
        path = rescue(folder, place)
    except (ElysError, OSError) as error:
        _log.warning("the simulation ended without a word, and its last seconds could not be kept: %s", error)
        return 1
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    if path is not None:
        _log.warning(
            "the simulation ended without a word; its last seconds are in %s: look at them with `elys play %s`",
            path,
            path,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(*map(Path, sys.argv[1:3])))

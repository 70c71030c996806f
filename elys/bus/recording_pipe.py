"""The stream between a simulation and the recorder process beside it: frames over a pipe.

    frame    u8 kind, u8 name length, u32 content length, u64 wall clock [ns]; then the name and the content
    BEGIN    name: the session's, content: the scene's name
    MESSAGE  name: the channel, content: the body without the protocol prefix
    ASSET    name: its reference, content: its bytes
    FACTS    name: of a metadata record, content: a JSON object of strings

The end of the stream is the end of the recording, however it came: the recorder then finishes the file.
"""

from __future__ import annotations

import enum
import os
import select
import struct
from collections.abc import Iterator
from typing import Final, NamedTuple

from elys.common.errors import RecordingError

FRAME_HEAD: Final = struct.Struct("<BBIQ")
MAX_CONTENT: Final = 1 << 30  # [bytes]
_READ_SIZE: Final = 1 << 20


class FrameKind(enum.IntEnum):
    """What a frame carries."""

    BEGIN = 1
    MESSAGE = 2
    ASSET = 3
    FACTS = 4


class PipeFrame(NamedTuple):
    """One frame of the stream."""

    kind: FrameKind
    name: str
    content: bytes
    time: int  # [ns]


def frame_head(kind: FrameKind, name: str, size: int, time: int) -> bytes:
    """What stands before `size` bytes of content."""
    encoded = name.encode()
    return FRAME_HEAD.pack(kind, len(encoded), size, time) + encoded


class PipeReader:
    """Takes frames out of a pipe's bytes as they come; half a frame at the end of a killed writer is left out."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._buffer = bytearray()
        self.ended = False

    def read(self, timeout: float) -> Iterator[PipeFrame]:
        """The frames that are whole after waiting for more bytes, at most `timeout` seconds; sets `ended` at the end.

        Raises:
            RecordingError: these bytes are not such a stream.
        """
        ready, _, _ = select.select([self._descriptor], [], [], timeout)
        if ready:
            data = os.read(self._descriptor, _READ_SIZE)
            self.ended = not data
            self._buffer += data
        offset = 0
        while (frame := frame_at(self._buffer, offset)) is not None:
            offset += FRAME_HEAD.size + self._buffer[offset + 1] + len(frame.content)
            yield frame
        del self._buffer[:offset]


def frame_at(buffer: bytes | bytearray, offset: int) -> PipeFrame | None:
    """The frame that begins there; None if it is not whole. Raises RecordingError if there is none."""
    if len(buffer) < offset + FRAME_HEAD.size:
        return None
    kind, name_length, size, time = FRAME_HEAD.unpack_from(buffer, offset)
    if kind not in FrameKind.__members__.values() or size > MAX_CONTENT:
        raise RecordingError("what came through the pipe is no stream of a session")
    start = offset + FRAME_HEAD.size + name_length
    if len(buffer) < start + size:
        return None
    name = bytes(buffer[start - name_length : start]).decode(errors="replace")
    return PipeFrame(FrameKind(kind), name, bytes(memoryview(buffer)[start : start + size]), time)

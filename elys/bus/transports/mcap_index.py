"""Where frames and scene stand in a recording: built while writing, kept as attachments, rebuilt by reading if they are lost."""

from __future__ import annotations

import struct
from array import array
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.bus import topics
from elys.bus.messages.state_frame import FORKED, HEADER, TOLD_AGAIN, instant_of, is_whole
from elys.bus.state_packing.frames import HEAD_SIZE, Kind, head_of
from elys.common.errors import RecordingError

SNAPSHOT_CHANNEL: Final = topics.SNAPSHOT.name
STATE_CHANNEL: Final = topics.STATE.name
DELTA_CHANNEL: Final = topics.DELTA.name
STATE_INDEX_NAME: Final = "elys/state_index.v1"
SCENE_INDEX_NAME: Final = "elys/scene_index.v1"
# `chunk` and `message`: the chunk's number in the file, and the message's in the chunk.
STATE_INDEX: Final = np.dtype(
    [
        ("epoch", "<u8"),
        ("tick", "<u8"),
        ("time", "<f8"),
        ("delta_sequence", "<u8"),
        ("body_count", "<u4"),
        ("chunk", "<u4"),
        ("message", "<u4"),
    ]
)
_ENTRY: Final = struct.Struct("<QQdQIII")  # the same, for one
LATEST: Final = 2.0**64 / 1e9  # [s], the last time that MCAP's nanoseconds can tell
SCENE_INDEX: Final = np.dtype(
    [("epoch", "<u8"), ("sequence", "<i8"), ("is_snapshot", "?"), ("chunk", "<u4"), ("message", "<u4")]
)


class _Head(msgspec.Struct):
    """What both a snapshot and a delta start with, as far as the index wants it."""

    epoch: int
    sequence: int


_heads: Final = msgspec.json.Decoder(_Head)


class IndexBuilder:
    """Collects an entry for each state frame, snapshot and delta; what is none of them, or is damaged, gets none.

    Frames that a rewound simulation told again have none, unless there are no others, nor have those that a fork made void.
    """

    def __init__(self) -> None:
        # As in the file: there are sixty a second, for as long as somebody records.
        self._frames = bytearray()
        self._instants = array("q")  # of each of them
        self._told_again = bytearray()
        self._last_fork = -1  # chunk of the last frame that made others void
        self._scene: list[tuple[int, int, bool, int, int]] = []

    def add_stored(self, channel: str, body: bytes, chunk: int, message: int, *, is_packed: bool) -> None:
        """Looks at a message as it stands in a file; `is_packed` says that the file packs frames."""
        if channel != STATE_CHANNEL or not is_packed:
            self.add(channel, body, chunk, message)
            return
        try:
            kind = head_of(body).kind
        except RecordingError:
            return
        if kind is Kind.VERBATIM:
            self.add(channel, body[: HEADER.size] + body[HEAD_SIZE:], chunk, message)
        else:
            self._add_frame(body, chunk, message)

    def add(self, channel: str, body: bytes | memoryview, chunk: int, message: int) -> None:
        """Looks at a message, a frame as on the bus, at its place."""
        if channel == STATE_CHANNEL:
            if is_whole(body):
                self._add_frame(body, chunk, message)
        elif channel in (SNAPSHOT_CHANNEL, DELTA_CHANNEL):
            try:
                head = _heads.decode(body)
            except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
                return
            if 0 <= head.epoch < 1 << 64 and -1 <= head.sequence < 1 << 63:
                self._scene.append((head.epoch, head.sequence, channel == SNAPSHOT_CHANNEL, chunk, message))

    def _add_frame(self, body: bytes | memoryview, chunk: int, message: int) -> None:
        epoch, tick, time, _, sequence, _, count, flags = HEADER.unpack_from(body)
        if not 0.0 <= time < LATEST:  # nor what is no number
            return
        if flags & TOLD_AGAIN:
            self._told_again += _ENTRY.pack(epoch, tick, time, sequence, count, chunk, message)
            return
        instant = instant_of(flags)
        if flags & FORKED:
            self._drop_void(epoch, tick, instant)
            self._last_fork = chunk
        self._frames += _ENTRY.pack(epoch, tick, time, sequence, count, chunk, message)
        self._instants.append(instant)

    def _drop_void(self, epoch: int, tick: int, instant: int) -> None:
        """Drops what a fork made void by a frame of this instant; ticks count where instants are not told."""
        frames, instants = self._frames, self._instants
        while frames:
            its_epoch, its_tick, *_ = _ENTRY.unpack_from(frames, len(frames) - _ENTRY.size)
            is_told = instant >= 0 and instants[-1] >= 0
            if its_epoch != epoch or not (instants[-1] >= instant if is_told else its_tick > tick):
                return
            self._pop()

    def cut(self, chunk_count: int) -> bool:
        """Forgets what stands in later chunks than so many; False if frames are missing now that one of those made void."""
        while self._frames and _ENTRY.unpack_from(self._frames, len(self._frames) - _ENTRY.size)[5] >= chunk_count:
            self._pop()
        told_again = np.frombuffer(self._told_again, STATE_INDEX)
        self._told_again = bytearray(told_again[told_again["chunk"] < chunk_count].tobytes())
        self._scene = [entry for entry in self._scene if entry[3] < chunk_count]
        return self._last_fork < chunk_count

    def _pop(self) -> None:
        del self._frames[-_ENTRY.size :]
        self._instants.pop()

    @property
    def size(self) -> int:
        """What it takes in the file [bytes]."""
        return len(self._frames) + len(self._scene) * SCENE_INDEX.itemsize

    def frames(self) -> NDArray[np.void]:
        """[F] STATE_INDEX, in the order of the file."""
        return np.frombuffer(bytearray(self._frames or self._told_again), STATE_INDEX)

    def scene(self) -> NDArray[np.void]:
        """[S] SCENE_INDEX, in the order of the file."""
        return np.array(self._scene, SCENE_INDEX)

"""Sessions on disk: MCAP files, written so that a hard kill costs little, and read even when one did.

    channel     one per recorded topic, named like it, plus "snapshot"; messages in the order in which they came
    body        as on the bus without the protocol prefix: JSON with its schema; state frames packed, see `elys.bus.state_packing`
    log_time    wall clock of the recorder [ns]; tick and simulation time stand in the messages themselves
    video/NAME  pictures of views, where they were asked for: foxglove.CompressedVideo
    attachment  every asset the scene names, by its reference; at the end indexes of state frames, keys and the scene
    exact       now and then the whole state of a simulation, so that it can be run again: see `elys.bus.messages.exact_state`
    metadata    "elys": versions of protocol and program, session, start

Chunks close by time as well as by size and reach the disk once a second, so that a kill of everything at once loses no more
than the open chunk, and a power cut no more than a second. On a disk that is full the file ends with its last whole chunk, and
with its summary.
"""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

import elys
from elys.bus import topics
from elys.bus.compressed_video import SCHEMA_NAME, video_schema
from elys.bus.messages.exact_state import EXACT_HEADER
from elys.bus.messages.scene import Snapshot
from elys.bus.state_packing import compact as steps
from elys.bus.state_packing.frames import STATE_ENCODING, Kind, head_of
from elys.bus.state_packing.schema import state_schema
from elys.bus.state_packing.stream import FramePacker
from elys.bus.topics import PROTOCOL_VERSION, Encoding
from elys.bus.transports.mcap_frames import STATE_KEYS, STATE_KEYS_NAME
from elys.bus.transports.mcap_index import (
    SCENE_INDEX_NAME,
    SNAPSHOT_CHANNEL,
    STATE_CHANNEL,
    STATE_INDEX_NAME,
    IndexBuilder,
)
from elys.bus.transports.mcap_writing import ChunkedWriter
from elys.bus.transports.recording_file import RecordingFile, says_full
from elys.common.components import declarations
from elys.common.components.schema import component_schema
from elys.common.errors import RecordingError

PROFILE: Final = "elys"
METADATA_NAME: Final = "elys"
EXACT_ENCODING: Final = "elys.exact.v1"
EXACT_CHANNEL: Final = topics.EXACT.name
COMPONENTS_NAME: Final = "elys/components.schema.json"

_CHUNK_SECONDS: Final = 0.15  # a kill costs this, and the time it takes to pack and write a chunk
_CHUNK_SIZE: Final = 4 << 20  # [bytes]
_SYNC_SECONDS: Final = 1.0
_KEY: Final = struct.Struct("<III")  # an entry of STATE_KEYS
_log = logging.getLogger(__name__)


class McapWriter:
    """Writes one recording. `close` makes it whole; without it a reader can still mend the file.

    With `compact` state frames are kept in small steps instead of bits, see `elys.bus.state_packing.compact`.

    Raises:
        RecordingError: the file cannot be written, at the start or later (a full disk), or holds something and is not to be
            written over.
    """

    def __init__(
        self, path: Path, *, session: str, scene: str = "", compact: bool = False, overwrites: bool = False
    ) -> None:
        self.path = path
        self.message_count = 0
        self._index = IndexBuilder()
        self._compact = compact
        self._packer = FramePacker(compact=compact)
        self._keys = bytearray()  # STATE_KEYS
        self._is_entry = True  # whether the open chunk has no frame yet
        self._chunk_number = 0
        self._message_number = 0  # in the open chunk
        self._chunk_bytes = 0
        self._chunk_opened = self._synced = time.monotonic()
        self._closed = False
        self._failure: RecordingError | None = None
        descriptor = open_alone(path)
        if path.is_file() and os.fstat(descriptor).st_size and not overwrites:
            os.close(descriptor)
            raise RecordingError(f"{path} is there already")
        self._file = RecordingFile(descriptor)
        self._file.empty()
        self._writer = ChunkedWriter(self._file)
        with self._ending_if_full():
            self._begin(session, scene)

    def write(self, channel: str, body: bytes | memoryview, *, log_time: int) -> None:
        """Adds a message in the order of the calls; `body` is without the protocol prefix, a state frame as on the bus."""
        self._check()
        self._index.add(channel, body, self._chunk_number, self._message_number)
        if channel == STATE_CHANNEL:
            packed = self._pack(body)
            if packed is None:
                return
            body = packed
        if self._message_number == 0:
            self._chunk_opened = time.monotonic()
        number = self.message_count & 0xFFFFFFFF
        self._writer.add_message(self._channels[channel], body, time=log_time, sequence=number)
        self.message_count += 1
        self._message_number += 1
        self._chunk_bytes += len(body)
        if self._chunk_bytes >= _CHUNK_SIZE:
            self._flush()
        else:
            self.keep_time()

    def _pack(self, body: bytes | memoryview) -> bytes | None:
        packed = self._packer.pack(body, is_entry=self._is_entry)
        if packed is None:
            _log.debug("not recorded: a state frame of %d bytes has no header", len(body))
            return None
        self._is_entry = False
        head = head_of(packed)
        if head.kind is Kind.KEY:
            self._keys += _KEY.pack(head.number, self._chunk_number, self._message_number)
        return packed

    def add_video(self, channel: str) -> None:
        """Makes a channel for pictures of that name, see `elys.bus.compressed_video`; once is enough."""
        if channel not in self._channels:
            schema = self._writer.add_schema(SCHEMA_NAME, "jsonschema", video_schema())
            self._channels[channel] = self._writer.add_channel(channel, "json", schema)

    def attach(self, name: str, data: bytes, *, media_type: str) -> None:
        """Adds a file of its own."""
        self._check()
        with self._ending_if_full():
            now = time.time_ns()
            self._writer.add_attachment(name, data, media_type=media_type, time=now, created=now)

    @property
    def expected_size(self) -> int:
        """How large the file would be, were it closed now [bytes]; the open chunk counts as if it did not pack."""
        return self._writer.size + self._chunk_bytes + self._writer.summary_size + self._indexes_size

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Adds facts by name."""
        self._check()
        with self._ending_if_full():
            self._writer.add_metadata(name, values)

    def seconds_until_due(self) -> float:
        """How long `keep_time` may wait."""
        due = self._synced + _SYNC_SECONDS
        if self._message_number:
            due = min(due, self._chunk_opened + _CHUNK_SECONDS)
        return max(0.0, due - time.monotonic())

    def keep_time(self) -> None:
        """Closes the chunk if it has been open long enough, and brings the file to the disk once a second."""
        self._check()
        now = time.monotonic()
        if self._message_number and now - self._chunk_opened >= _CHUNK_SECONDS:
            self._flush()
        if now - self._synced >= _SYNC_SECONDS:
            self._synced = now
            with self._ending_if_full():
                self._file.sync()

    def close(self) -> None:
        """Writes the index and the summary. A second call does nothing."""
        if self._closed:
            return
        self._flush()
        with self._ending_if_full():
            self._finish()
        self._closed = True
        self._file.close()

    # --- inside ----------------------------------------------------------------------------------------------------

    def _finish(self, *, has_all_frames: bool = True) -> None:
        start = self._writer.size
        self._writer.room = 0  # it is used now
        try:
            if has_all_frames:  # else who reads looks for them
                self._attach(STATE_INDEX_NAME, self._index.frames().tobytes())
            self._attach(SCENE_INDEX_NAME, self._index.scene().tobytes())
            self._attach(STATE_KEYS_NAME, bytes(self._keys))
            self._writer.finish()
            self._file.sync()
        except OSError:
            self._writer.drop_from(start)
            raise

    @contextlib.contextmanager
    def _ending_if_full(self) -> Iterator[None]:
        """Where the system refuses, the recording ends here, with what is in it; every further call says so again."""
        try:
            yield
        except OSError as error:
            self._closed = True
            fitted = self._end_with_what_fitted(error)
            text = f"the recording {self.path} cannot be written any further: {error.strerror}; {fitted}"
            self._failure = RecordingError(text)
            raise self._failure from error

    def _check(self) -> None:
        if self._failure is not None:
            raise self._failure
        if self._closed:
            raise RecordingError(f"the recording {self.path} is finished and takes no more")

    def _end_with_what_fitted(self, error: OSError) -> str:
        """Makes the file whole with the chunks that are in it, and says whether it could.

        Where a full disk has no room for the end, the last chunks make way: as many as take what it needs at most, and once, as
        more would make no room if those did not. Nothing makes way for a disk that fails.
        """
        writer = self._writer
        writer.drop_open_chunk()
        count, end = writer.chunk_count, self._file.size
        try:
            refusal = self._refusal_of_end(count) if count else error
            if refusal is not None and says_full(error) and says_full(refusal):
                fewer = min(writer.chunks_before(end - writer.summary_size - self._indexes_size), count - 1)
                if fewer >= max(
                    1, count // 3
                ):  # rather than lose more it stays without an end, and is mended by who reads
                    writer.drop_chunks(fewer)
                    refusal = self._refusal_of_end(fewer)
        finally:
            with contextlib.suppress(OSError):  # said already
                self._file.close()
        if refusal is None:
            return "what fitted is whole"
        if writer.chunk_count:
            return "what fitted can be read, and `elys recover` makes it whole"
        if self.path.is_file():
            self.path.unlink()  # nothing in it can be shown
        return "nothing of it fitted"

    def _refusal_of_end(self, count: int) -> OSError | None:
        """Ends the file behind so many chunks; why not, if it cannot be."""
        has_all_frames = self._index.cut(count)
        keys = np.frombuffer(self._keys, STATE_KEYS)
        self._keys = bytearray(keys[keys["chunk"] < count].tobytes())
        try:
            self._finish(has_all_frames=has_all_frames)
        except OSError as error:
            _log.debug("the end of %s cannot be written after %d chunks: %s", self.path, count, error)
            return error
        return None

    @property
    def _indexes_size(self) -> int:
        return self._index.size + len(self._keys) + 1200

    def _begin(self, session: str, scene: str) -> None:
        # This class closes chunks, so that it knows in which one each frame stands.
        self._writer.begin(profile=PROFILE, library=f"elys {elys.__version__}")
        self._writer.add_metadata(METADATA_NAME, _metadata(session, scene, compact=self._compact))
        self._attach(COMPONENTS_NAME, _component_schemas(), "application/schema+json")
        self._channels = {name: self._register(name) for name in recorded_channels()}
        self._flush()

    def _attach(self, name: str, data: bytes, media_type: str = "application/octet-stream") -> None:
        self._writer.add_attachment(name, data, media_type=media_type, time=time.time_ns(), created=0)

    def _flush(self) -> None:
        self._writer.room = self._indexes_size
        with self._ending_if_full():
            self._writer.flush()
        if self._message_number:
            self._chunk_number += 1
        self._message_number = self._chunk_bytes = 0
        self._is_entry = True

    def _register(self, name: str) -> int:
        if name == STATE_CHANNEL:
            schema = self._writer.add_schema("elys.StateFrame", "jsonschema", state_schema())
            return self._writer.add_channel(name, STATE_ENCODING, schema)
        if name == EXACT_CHANNEL:
            schema = self._writer.add_schema("elys.ExactState", EXACT_ENCODING, _exact_layout())
            return self._writer.add_channel(name, EXACT_ENCODING, schema)
        struct = Snapshot if name == SNAPSHOT_CHANNEL else topics.topic_named(name).message
        schema = self._writer.add_schema(f"elys.{struct.__name__}", "jsonschema", json_schema(struct))
        return self._writer.add_channel(name, "json", schema)


def recorded_channels() -> tuple[str, ...]:
    """The channels of a recording: the snapshot, the exact state and every recorded topic."""
    recorded = tuple(topic.name for topic in topics.TOPICS if topic.recorded)
    assert all(topic.encoding in (Encoding.JSON, Encoding.STATE) for topic in topics.TOPICS if topic.recorded)
    return (SNAPSHOT_CHANNEL, EXACT_CHANNEL, *recorded)


def open_alone(path: Path) -> int:
    """A descriptor of the file as it is, which nobody else writes meanwhile.

    Raises:
        RecordingError: it cannot be written, or is being written.
    """
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise RecordingError(f"the recording {path} cannot be written: {error.strerror}") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise RecordingError(f"{path} is being recorded by another process: choose another name") from None
    except OSError as error:  # a file system that has no locks
        _log.debug("%s is not locked: %s", path, error)
    return descriptor


def _metadata(session: str, scene: str, *, compact: bool) -> dict[str, str]:
    errors = {
        "position_error_m": f"{steps.POSITION_ERROR:.3g}",
        "rotation_error_degrees": f"{steps.ROTATION_ERROR:.3g}",
        "linear_velocity_error_m_s": f"{steps.LINEAR_ERROR:.3g}",
        "angular_velocity_error_rad_s": f"{steps.ANGULAR_ERROR:.3g}",
    }
    return {
        "protocol": str(PROTOCOL_VERSION),
        "elys": elys.__version__,
        "session": session,
        "scene": scene,
        "started_ns": str(time.time_ns()),
        "state": "compact" if compact else "lossless",
        **(errors if compact else {}),
    }


def json_schema(struct: type[Any]) -> bytes:
    """The JSON Schema of a message."""
    # Viewers want the object itself at the top of its schema, not a reference to it.
    (reference,), definitions = msgspec.json.schema_components((struct,), ref_template="#/$defs/{name}")
    name = reference["$ref"].rpartition("/")[2]
    return msgspec.json.encode({**definitions[name], "$defs": definitions})


def _component_schemas() -> bytes:
    return msgspec.json.encode({name: component_schema(name) for name in declarations()})


def _exact_layout() -> bytes:
    names = ["epoch", "instant", "changes", "tick", "simulation_time", "state_hash", "fork", "flags"]
    return msgspec.json.encode(
        {
            "description": "little-endian: the header, then the state of a simulation as ELYS of the same version reads it",
            "header": {"format": EXACT_HEADER.format, "names": names, "bytes": EXACT_HEADER.size},
            "flags": {"1": "what led here is not in commands and steps"},
        }
    )

"""Sessions on disk: MCAP files, written so that a hard kill costs little, and read even when one did.

    channel     one per recorded topic, named like it, plus "snapshot"; messages in the order in which they came
    body        as on the bus without the protocol prefix: JSON with its schema, or the packed state frame
    log_time    wall clock of the recorder [ns]; tick and simulation time stand in the messages themselves
    video/NAME  pictures of views, where they were asked for: foxglove.CompressedVideo
    attachment  every asset the scene names, by its reference; at the end indexes of the state frames and the scene
    metadata    "elys": versions of protocol and program, session, start

Chunks close by time as well as by size and reach the disk once a second, so that a kill of everything at once loses no more
than the open chunk, and a power cut no more than a second.
"""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, Final

import msgspec
from mcap.writer import CompressionType, Writer

import elys
from elys.bus import topics
from elys.bus.compressed_video import SCHEMA_NAME, video_schema
from elys.bus.messages.scene import Snapshot
from elys.bus.messages.state_frame import COLUMNS, HEADER, LOCAL_COLUMNS, TAIL_HEADER, WEIGHT_COLUMNS
from elys.bus.topics import PROTOCOL_VERSION, Encoding
from elys.bus.transports.mcap_index import (
    SCENE_INDEX_NAME,
    SNAPSHOT_CHANNEL,
    STATE_CHANNEL,
    STATE_INDEX_NAME,
    IndexBuilder,
)
from elys.common.components import declarations
from elys.common.components.schema import component_schema
from elys.common.errors import RecordingError

PROFILE: Final = "elys"
METADATA_NAME: Final = "elys"
STATE_ENCODING: Final = "elys.state.v1"
COMPONENTS_NAME: Final = "elys/components.schema.json"

_CHUNK_SECONDS: Final = 0.2
_CHUNK_SIZE: Final = 1 << 20  # [bytes]
_SYNC_SECONDS: Final = 1.0
_log = logging.getLogger(__name__)


class McapWriter:
    """Writes one recording. `close` makes it whole; without it a reader can still mend the file.

    Raises:
        RecordingError: the file cannot be written, at the start or later (a full disk).
    """

    def __init__(self, path: Path, *, session: str, scene: str = "") -> None:
        self.path = path
        self.message_count = 0
        self._index = IndexBuilder()
        self._chunk_number = 0
        self._message_number = 0  # in the open chunk
        self._chunk_bytes = 0
        self._chunk_opened = self._synced = time.monotonic()
        self._closed = False
        self._file = open_alone(path)
        try:
            with _disk_errors(path):
                if path.is_file():
                    self._file.truncate(0)
                self._begin(session, scene)
        except RecordingError:
            with contextlib.suppress(OSError):  # what could not be written cannot be written now either
                self._file.close()
            raise

    def write(self, channel: str, body: bytes | memoryview, *, log_time: int) -> None:
        """Adds a message in the order of the calls; `body` is without the protocol prefix."""
        self._index.add(channel, body, self._chunk_number, self._message_number)
        if self._message_number == 0:
            self._chunk_opened = time.monotonic()
        self._writer.add_message(
            self._channels[channel], log_time, body, log_time, sequence=self.message_count & 0xFFFFFFFF
        )
        self.message_count += 1
        self._message_number += 1
        self._chunk_bytes += len(body)
        if self._chunk_bytes >= _CHUNK_SIZE:
            self._flush()
        else:
            self.keep_time()

    def add_video(self, channel: str) -> None:
        """Makes a channel for pictures of that name, see `elys.bus.compressed_video`; once is enough."""
        if channel not in self._channels:
            schema = self._writer.register_schema(SCHEMA_NAME, "jsonschema", video_schema())
            self._channels[channel] = int(self._writer.register_channel(channel, "json", schema))

    def attach(self, name: str, data: bytes, *, media_type: str) -> None:
        """Adds a file of its own."""
        with _disk_errors(self.path):
            self._writer.add_attachment(time.time_ns(), time.time_ns(), name, media_type, data)

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Adds facts by name."""
        with _disk_errors(self.path):
            self._writer.add_metadata(name, values)

    def seconds_until_due(self) -> float:
        """How long `keep_time` may wait."""
        due = self._synced + _SYNC_SECONDS
        if self._message_number:
            due = min(due, self._chunk_opened + _CHUNK_SECONDS)
        return max(0.0, due - time.monotonic())

    def keep_time(self) -> None:
        """Closes the chunk if it has been open long enough, and brings the file to the disk once a second."""
        now = time.monotonic()
        if self._message_number and now - self._chunk_opened >= _CHUNK_SECONDS:
            self._flush()
        if now - self._synced >= _SYNC_SECONDS:
            self._synced = now
            with _disk_errors(self.path):
                os.fsync(self._file.fileno())

    def close(self) -> None:
        """Writes the index and the summary. A second call does nothing."""
        if self._closed:
            return
        self._closed = True
        try:
            self._flush()
            with _disk_errors(self.path):
                self._attach_index(STATE_INDEX_NAME, self._index.frames().tobytes())
                self._attach_index(SCENE_INDEX_NAME, self._index.scene().tobytes())
                self._writer.finish()
                self._file.flush()
                os.fsync(self._file.fileno())
        finally:
            with _disk_errors(self.path):
                self._file.close()

    def _begin(self, session: str, scene: str) -> None:
        # This class closes chunks, so that it knows in which one each frame stands.
        self._writer = Writer(self._file, chunk_size=1 << 62, compression=CompressionType.ZSTD)
        self._writer.start(profile=PROFILE, library=f"elys {elys.__version__}")
        self._writer.add_metadata(METADATA_NAME, _metadata(session, scene))
        self._writer.add_attachment(0, time.time_ns(), COMPONENTS_NAME, "application/schema+json", _component_schemas())
        self._channels = {name: self._register(name) for name in recorded_channels()}
        self._flush()

    def _attach_index(self, name: str, data: bytes) -> None:
        self._writer.add_attachment(0, time.time_ns(), name, "application/octet-stream", data)

    def _flush(self) -> None:
        with _disk_errors(self.path):
            self._writer.flush()
        if self._message_number:
            self._chunk_number += 1
        self._message_number = self._chunk_bytes = 0

    def _register(self, name: str) -> int:
        if name == STATE_CHANNEL:
            schema = self._writer.register_schema("elys.StateFrame", STATE_ENCODING, _state_layout())
            return int(self._writer.register_channel(name, STATE_ENCODING, schema))
        struct = Snapshot if name == SNAPSHOT_CHANNEL else topics.topic_named(name).message
        schema = self._writer.register_schema(f"elys.{struct.__name__}", "jsonschema", _json_schema(struct))
        return int(self._writer.register_channel(name, "json", schema))


def recorded_channels() -> tuple[str, ...]:
    """The channels of a recording: the snapshot and every recorded topic."""
    recorded = tuple(topic.name for topic in topics.TOPICS if topic.recorded)
    assert all(topic.encoding in (Encoding.JSON, Encoding.STATE) for topic in topics.TOPICS if topic.recorded)
    return (SNAPSHOT_CHANNEL, *recorded)


def open_alone(path: Path) -> BinaryIO:
    """The file as it is, to be written by nobody else meanwhile; RecordingError if it cannot be written, or is being written."""
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
    return os.fdopen(descriptor, "wb")


@contextlib.contextmanager
def _disk_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise RecordingError(f"the recording {path} cannot be written any further: {error.strerror}") from error


def _metadata(session: str, scene: str) -> dict[str, str]:
    return {
        "protocol": str(PROTOCOL_VERSION),
        "elys": elys.__version__,
        "session": session,
        "scene": scene,
        "started_ns": str(time.time_ns()),
    }


def _json_schema(struct: type[Any]) -> bytes:
    # Viewers want the object itself at the top of its schema, not a reference to it.
    (reference,), definitions = msgspec.json.schema_components((struct,), ref_template="#/$defs/{name}")
    name = reference["$ref"].rpartition("/")[2]
    return msgspec.json.encode({**definitions[name], "$defs": definitions})


def _component_schemas() -> bytes:
    return msgspec.json.encode({name: component_schema(name) for name in declarations()})


def _state_layout() -> bytes:
    header = ["epoch", "tick", "simulation_time", "published_at", "delta_sequence", "state_hash", "body_count", "flags"]
    return msgspec.json.encode(
        {
            "description": "little-endian: the header, then one column after the other, a row per body",
            "header": {"format": HEADER.format, "names": header, "bytes": HEADER.size},
            "columns": [{"name": name, "dtype": dtype, "width": width} for name, dtype, width in COLUMNS],
            "flags": {"1": "playing", "2": "a tail follows"},
            "tail": {
                "header": {
                    "format": TAIL_HEADER.format,
                    "names": ["local_count", "weight_count"],
                    "bytes": TAIL_HEADER.size,
                },
                "columns": [
                    {"name": name, "dtype": dtype, "width": width, "rows": rows}
                    for rows, columns in (("local_count", LOCAL_COLUMNS), ("weight_count", WEIGHT_COLUMNS))
                    for name, dtype, width in columns
                ],
            },
            "units": {
                "simulation_time": "s",
                "published_at": "ns",
                "position": "m",
                "rotation": "x y z w",
                "linear_velocity": "m/s",
                "angular_velocity": "rad/s",
            },
        }
    )

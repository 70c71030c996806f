"""A recording as an MCAP file that Foxglove and Rerun draw as it is: scene, frames and log in protobuf, everything else in JSON.

Times are those of the simulation, counted from when the recording began: a session that ran faster than real time plays as long
as it simulated. Needs foxglove-sdk (extra `foxglove`).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from mcap.writer import CompressionType, Writer

import elys
from elys.bus import codec, topics
from elys.bus.compressed_video import SCHEMA_NAME, VIDEO_PREFIX, video_schema
from elys.bus.exports.files import whole_file
from elys.bus.exports.selection import (
    EVERYTHING,
    NamedEntities,
    Progress,
    Selection,
    no_progress,
    selected_positions,
    selected_scenes,
)
from elys.bus.exports.urdf import URDF_ENCODING, URDF_SCHEMA, URDF_TOPIC, urdf_message
from elys.bus.messages.session import LogLine
from elys.bus.recording import Recording
from elys.bus.recording_names import is_recording
from elys.bus.topics import Encoding
from elys.bus.transports.mcap import json_schema
from elys.bus.transports.mcap_reading import RecordedMessage
from elys.common.errors import MessageError, RecordingError

_LATEST: Final = ((1 << 32) - 1) * 1_000_000_000  # [ns] that their moments can say; only a file of nonsense says more
_CHUNK_SIZE: Final = 1 << 20  # [bytes]
_MISSING: Final = "Foxglove's messages need foxglove-sdk: pip install 'elys[foxglove]'"
# What is plotted or read as text there; the scene is told in messages of its own.
_COPIED: Final = (topics.STATUS, topics.EVENTS, topics.CONTACTS, topics.COMMANDS, topics.PROFILE, topics.DIAGNOSTICS)


class FoxgloveReport(NamedTuple):
    """What was written."""

    frames: int
    entities: int
    messages: int


def export_foxglove(
    source: Path, target: Path, selection: Selection = EVERYTHING, progress: Progress = no_progress
) -> FoxgloveReport:
    """Writes the file.

    Raises:
        RecordingError: the source is no recording, holds nothing of what is selected, the target cannot be written, or
            foxglove-sdk is not installed.
    """
    try:
        from elys.bus.exports.foxglove_scene import FoxgloveScene, FrameTransforms
    except ImportError as error:
        raise RecordingError(_MISSING) from error
    if source.exists() and target.exists() and source.samefile(target):
        raise RecordingError(f"{target} is read here and cannot be written as well: choose another name")
    if is_recording(target):
        raise RecordingError(f"{target} is a recording, and would be lost: choose another name")
    with Recording(source, checked=True) as recording, whole_file(target) as part, part.open("wb") as file:
        positions = selected_positions(recording, selection)
        writing = _Writing(Writer(file, chunk_size=_CHUNK_SIZE, compression=CompressionType.ZSTD))
        scene, transforms = FoxgloveScene(recording.asset), FrameTransforms()
        named = NamedEntities(selection)
        drawn: list[int] = []
        base = recording.log_time(int(positions[0])) - _nanoseconds(recording.time[positions[0]])
        for place, (mirror, _, changed) in enumerate(selected_scenes(recording, positions, progress)):
            now = min(max(base + _nanoseconds(recording.time[positions[place]]), 0), _LATEST)
            if changed or not place:
                named.look(mirror)
            if scene.may_differ(mirror) or changed or not place:
                update = scene.follow(mirror, now, named.chosen)
                if update is not None:
                    writing.scene(update, now)
                if scene.drawn != drawn:
                    drawn = list(scene.drawn)
                    writing.urdf(scene.urdf(mirror), now)
            writing.transforms(transforms.encode(*scene.frames(mirror), now), now)
            for message in _said(recording, positions, place):
                writing.message(message, now)
        named.check(source)
        writing.finish()
        return FoxgloveReport(len(positions), len(drawn), writing.count)


def _nanoseconds(seconds: float) -> int:
    return round(min(max(float(seconds), -1e10), 1e10) * 1e9)


def _said(recording: Recording, positions: np.ndarray[Any, Any], place: int) -> Iterator[RecordedMessage]:
    """What was said after a sample and before the next."""
    first = int(positions[place])
    last = int(positions[place + 1]) - 1 if place + 1 < len(positions) else first
    return recording.messages_of(first, max(first, last))


class _Writing:
    """The file's channels, each made when it is first needed."""

    def __init__(self, writer: Writer) -> None:
        from elys.bus.exports.foxglove_scene import schemas

        self.count = 0
        self._writer = writer
        self._schemas = schemas()
        self._channels: dict[str, int] = {}
        writer.start(profile="", library=f"elys {elys.__version__}")

    def scene(self, body: bytes, now: int) -> None:
        from elys.bus.exports.foxglove_scene import SCENE_TOPIC

        self._protobuf(SCENE_TOPIC, body, now)

    def transforms(self, body: bytes, now: int) -> None:
        from elys.bus.exports.foxglove_scene import TRANSFORM_TOPIC

        self._protobuf(TRANSFORM_TOPIC, body, now)

    def urdf(self, text: str, now: int) -> None:
        self._add(URDF_TOPIC, URDF_ENCODING, URDF_SCHEMA, urdf_message(text), now)

    def message(self, message: RecordedMessage, now: int) -> None:
        """What else was recorded, as it is; lines of the log as Foxglove has them."""
        if message.channel == topics.LOG.name:
            self._log(message, now)
        elif message.channel.startswith(VIDEO_PREFIX):
            self._add("/" + message.channel, "json", (SCHEMA_NAME, "jsonschema", video_schema()), message.body, now)
        elif message.channel in _TOPICS:
            struct = _TOPICS[message.channel].message
            schema = (f"elys.{struct.__name__}", "jsonschema", json_schema(struct))
            self._add("/" + message.channel, "json", schema, message.body, now)

    def finish(self) -> None:
        self._writer.finish()

    def _log(self, message: RecordedMessage, now: int) -> None:
        from elys.bus.exports.foxglove_scene import LOG_TOPIC, log_message

        try:
            line = codec.decode_body(message.body, LogLine, Encoding.JSON)
        except MessageError:
            return
        self._protobuf(LOG_TOPIC, log_message(now, line.level, line.text, line.node), now)

    def _protobuf(self, topic: str, body: bytes, now: int) -> None:
        schema = self._schemas[topic]
        self._add(topic, "protobuf", (schema.name, schema.encoding, schema.data), body, now)

    def _add(self, topic: str, encoding: str, schema: tuple[str, str, bytes], body: bytes, now: int) -> None:
        if topic not in self._channels:
            number = self._writer.register_schema(*schema)
            self._channels[topic] = self._writer.register_channel(topic, encoding, number)
        self._writer.add_message(self._channels[topic], now, body, now)
        self.count += 1


_TOPICS: Final = {topic.name: topic for topic in _COPIED}

"""Mending: what can be read of a file that was cut off or is damaged, as a finished one that every MCAP reader opens.

Messages, attachments and metadata are taken as they are, chunk by chunk, so that nothing is told in another way than it was.
"""

from __future__ import annotations

import io
import logging
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Message, Schema
from mcap.writer import CompressionType, Writer

from elys.bus.state_packing.frames import Kind, head_of
from elys.bus.transports.mcap_frames import STATE_KEYS, STATE_KEYS_NAME
from elys.bus.transports.mcap_index import SCENE_INDEX_NAME, STATE_CHANNEL, STATE_INDEX_NAME, IndexBuilder
from elys.bus.transports.mcap_reading import UNREADABLE, McapReader
from elys.bus.transports.mcap_records import RecordedMessage, records_in
from elys.common.errors import RecordingError

_INDEXES: Final = (STATE_INDEX_NAME, SCENE_INDEX_NAME, STATE_KEYS_NAME)
_DEFINITIONS: Final = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel}
_log = logging.getLogger(__name__)


@dataclass(slots=True)
class Mending:
    """What was mended.

    Attributes:
        messages, chunks: that were kept. lost: sentences about what was not. beyond: bytes at the end that belong to nothing.
    """

    messages: int = 0
    chunks: int = 0
    beyond: int = 0
    lost: list[str] = field(default_factory=list)


def needs_mending(reader: McapReader) -> bool:
    """Whether a file was never finished, or has a chunk or an attachment that cannot be read."""
    if reader.mended:
        return True
    try:
        for number in range(reader.chunk_count):
            reader.chunk(number)
        for name in reader.attachments:
            reader.attachment(name)
    except RecordingError as error:
        _log.info("%s", error)
        return True
    return False


def mend(reader: McapReader, target: Path, metadata: dict[str, dict[str, str]]) -> Mending:
    """Writes what can be read of a file, and more metadata, as a whole one.

    Raises:
        OSError: the target cannot be written.
    """
    mending = Mending(lost=[part.sentence for part in reader.damage], beyond=reader.size - reader.whole_size)
    with target.open("wb") as file:
        # Chunks stay what they were: this class closes them, none closes by its size.
        writer = Writer(file, chunk_size=1 << 62, compression=CompressionType.ZSTD)
        writer.start(profile="elys", library="elys recover")
        for name, values in {**reader.metadata, **metadata}.items():
            writer.add_metadata(name, values)
        for name in reader.attachments:
            if name not in _INDEXES:
                _copy_attachment(reader, name, writer, mending)
        copying = _ChunkCopying(writer, reader, mending)
        for record in reader.definitions:
            copying.define(record)
        for number in range(reader.chunk_count):
            copying.chunk(number)
            writer.flush()
        copying.finish()
        writer.finish()
    return mending


class _ChunkCopying:
    """Writes the records of chunks, with schemas and channels under new numbers, and the indexes of what it wrote."""

    def __init__(self, writer: Writer, reader: McapReader, mending: Mending) -> None:
        self._writer = writer
        self._reader = reader
        self._mending = mending
        self._index = IndexBuilder()
        self._keys: list[tuple[int, int, int]] = []  # number, chunk, message
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, int] = {}
        self._lost_frames = 0

    def chunk(self, number: int) -> None:
        """Writes what stands in a chunk, or says why not."""
        mending, lost = self._mending, self._mending.lost
        try:
            records = _parsed(self._reader.chunk_records(number))
            messages = self._reader.chunk(number)
        except (RecordingError, *UNREADABLE) as error:
            offset, length = self._reader.chunk_place(number)
            lost.append(f"{length} bytes from byte {offset} on ({error.__cause__ or error})")
            return
        for record in records:
            if not isinstance(record, Message):
                self.define(record)
        numbers = [record for record in records if isinstance(record, Message)]
        if any(record.channel_id not in self._channels for record in numbers):
            lost.append(f"{len(messages)} messages of channels that are described in a part that is lost")
            return
        place = 0
        for record, message in zip(numbers, messages, strict=True):
            if not self._is_readable(message):
                self._lost_frames += 1
                continue
            channel = self._channels[record.channel_id]
            self._writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
            self._note(message, place)
            place += 1
        mending.chunks += place > 0
        mending.messages += place

    def define(self, record: Any) -> None:
        """Writes a schema or a channel, once."""
        if isinstance(record, Schema):
            if record.id not in self._schemas:
                self._schemas[record.id] = self._writer.register_schema(record.name, record.encoding, record.data)
        elif record.id not in self._channels:
            schema = self._schemas.get(record.schema_id, 0)
            self._channels[record.id] = self._writer.register_channel(
                record.topic, record.message_encoding, schema, record.metadata
            )

    def finish(self) -> None:
        """Writes where things stand, and says which frames were lost."""
        keys = np.array(self._keys, STATE_KEYS)
        for name, array in zip(_INDEXES, (self._index.frames(), self._index.scene(), keys), strict=True):
            if name != STATE_KEYS_NAME or self._reader.packs_frames:
                self._writer.add_attachment(0, time.time_ns(), name, "application/octet-stream", array.tobytes())
        if self._lost_frames:
            self._mending.lost.append(f"{self._lost_frames} frames that were told against others that are lost")

    def _is_readable(self, message: RecordedMessage) -> bool:
        """Whether a message can be had: a packed frame only with those that it was told against."""
        if message.channel != STATE_CHANNEL or not self._reader.packs_frames:
            return True
        try:
            self._reader.message_at(message.place)
        except RecordingError:
            return False
        return True

    def _note(self, message: RecordedMessage, place: int) -> None:
        is_packed, chunk = self._reader.packs_frames, self._mending.chunks
        self._index.add_stored(message.channel, message.body, chunk, place, is_packed=is_packed)
        if is_packed and message.channel == STATE_CHANNEL and (head := head_of(message.body)).kind is Kind.KEY:
            self._keys.append((head.number, chunk, place))


def _parsed(data: bytes) -> list[Any]:
    """Schemas, channels and messages of a chunk. Raises UNREADABLE before anything of a damaged one is written."""
    found: list[Any] = []
    for opcode, start, end in records_in(data):
        stream = ReadDataStream(io.BytesIO(data[start:end]))
        if opcode in _DEFINITIONS:
            found.append(_DEFINITIONS[opcode].read(stream))
        elif opcode == Opcode.MESSAGE:
            found.append(Message.read(stream, end - start))
    return found


def _copy_attachment(reader: McapReader, name: str, writer: Writer, mending: Mending) -> None:
    try:
        found = reader.attachment_record(name)
    except RecordingError as error:
        mending.lost.append(str(error))
        return
    assert isinstance(found, Attachment)
    writer.add_attachment(found.create_time, found.log_time, found.name, found.media_type, found.data)

"""Writing MCAP: records as the library has them, in chunks that are neither copied about nor searched longer than it pays.

The library's own writer copies each chunk six times and packs it at zstd's third level; of states that are packed already, and of
messages in JSON, the first level makes less in half the time.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Sequence
from typing import Any, BinaryIO, Final

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC: Final = b"\x89MCAP0\r\n"
_LEVEL: Final = 1  # of zstd
_MESSAGE: Final = struct.Struct("<BQHIQQ")
_CHUNK: Final = struct.Struct("<BQQQQII4sQ")
_FOOTER: Final = struct.Struct("<BQQQ")


class ChunkedWriter:
    """An MCAP file; whoever writes decides when a chunk ends (`flush`). `size` [bytes] is without the open chunk."""

    def __init__(self, file: BinaryIO, *, profile: str, library: str) -> None:
        self._file = file
        self.size = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._counts: Counter[int] = Counter()
        self._times: tuple[int, int] | None = None  # first and last [ns]
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._compressor = zstandard.ZstdCompressor(level=_LEVEL)
        self._open: list[bytes | memoryview] = []  # the chunk's records
        self._open_size = 0
        self._open_times: tuple[int, int] | None = None
        self._open_index: dict[int, list[tuple[int, int]]] = {}  # time and place of messages by channel
        self._put(MAGIC, _bytes(Header(profile=profile, library=library)))

    @property
    def summary_size(self) -> int:
        """About what `finish` adds [bytes]."""
        known = sum(len(schema.data) + 100 for schema in self._schemas)
        indexed = 80 + 12 * len(self._channels)
        return known + 1000 + indexed * len(self._chunks) + 150 * len(self._attachments)

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Makes a schema known and returns its number."""
        schema = Schema(id=len(self._schemas) + 1, data=data, encoding=encoding, name=name)
        self._schemas.append(schema)
        self._add(_bytes(schema))
        return len(self._schemas)

    def add_channel(self, topic: str, encoding: str, schema: int) -> int:
        """Makes a channel for messages of a schema, and returns its number."""
        number = len(self._channels) + 1
        channel = Channel(id=number, topic=topic, message_encoding=encoding, metadata={}, schema_id=schema)
        self._channels.append(channel)
        self._add(_bytes(channel))
        return number

    def add_message(self, channel: int, body: bytes | memoryview, *, time: int, sequence: int) -> None:
        """Puts a message into the open chunk; `body` is kept, not copied, until the chunk ends."""
        self._open_index.setdefault(channel, []).append((time, self._open_size))
        self._open_times = _spanning(self._open_times, time, time)
        self._counts[channel] += 1
        size = _MESSAGE.size - 9 + len(body)
        self._add(_MESSAGE.pack(Opcode.MESSAGE, size, channel, sequence, time, time))
        self._add(body)

    def add_attachment(self, name: str, data: bytes, *, media_type: str, time: int, created: int) -> None:
        """Adds a file of its own."""
        record = Attachment(create_time=created, log_time=time, name=name, media_type=media_type, data=data)
        written = _bytes(record)
        index = AttachmentIndex(
            offset=self.size,
            length=len(written),
            log_time=time,
            create_time=created,
            data_size=len(data),
            name=name,
            media_type=media_type,
        )
        self._attachments.append(index)
        self._put(written)

    def add_metadata(self, name: str, metadata: dict[str, str]) -> None:
        """Adds names and texts."""
        written = _bytes(Metadata(name=name, metadata=metadata))
        self._metadata.append(MetadataIndex(offset=self.size, length=len(written), name=name))
        self._put(written)

    def flush(self) -> None:
        """Ends the open chunk, if it has any message, and hands everything to the system."""
        if self._open_times is not None:
            self._end_chunk(*self._open_times)
        self._file.flush()

    def finish(self) -> None:
        """Ends the file: index, statistics, footer."""
        self.flush()
        self._put(_bytes(DataEnd(data_section_crc=0)))
        start = self.size
        groups = (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        )
        parts: list[bytes] = []
        offsets: list[SummaryOffset] = []
        place = start
        for opcode, records in groups:
            data = _bytes(*records)
            parts.append(data)
            if data:
                offsets.append(SummaryOffset(group_opcode=opcode, group_start=place, group_length=len(data)))
            place += len(data)
        summary = b"".join((*parts, _bytes(*offsets)))
        checksum = zlib.crc32(_FOOTER.pack(Opcode.FOOTER, 20, start, place), zlib.crc32(summary))
        footer = Footer(summary_start=start, summary_offset_start=place, summary_crc=checksum)
        self._put(summary, _bytes(footer), MAGIC)
        self._file.flush()

    # --- inside ----------------------------------------------------------------------------------------------------

    def _add(self, data: bytes | memoryview) -> None:
        self._open.append(data)
        self._open_size += len(data)

    def _put(self, *pieces: bytes | memoryview) -> None:
        for piece in pieces:
            self._file.write(piece)
            self.size += len(piece)

    def _end_chunk(self, first: int, last: int) -> None:
        checksum = 0
        packing = self._compressor.compressobj(size=self._open_size)
        packed: list[bytes] = []
        for piece in self._open:
            checksum = zlib.crc32(piece, checksum)
            packed.append(packing.compress(piece))
        packed.append(packing.flush())
        packed_size = sum(map(len, packed))
        offset, size, index = self.size, self._open_size, self._open_index
        self._open, self._open_size, self._open_times, self._open_index = [], 0, None, {}
        self._times = _spanning(self._times, first, last)
        length = _CHUNK.size - 9 + packed_size
        self._put(_CHUNK.pack(Opcode.CHUNK, length, first, last, size, checksum, 4, b"zstd", packed_size), *packed)
        end, offsets = self.size, {}
        for channel, records in index.items():
            offsets[channel] = self.size
            self._put(_bytes(MessageIndex(channel_id=channel, records=records)))
        self._chunks.append(
            ChunkIndex(
                chunk_length=end - offset,
                chunk_start_offset=offset,
                compression="zstd",
                compressed_size=packed_size,
                message_end_time=last,
                message_index_length=self.size - end,
                message_index_offsets=offsets,
                message_start_time=first,
                uncompressed_size=size,
            )
        )

    def _statistics(self) -> Statistics:
        first, last = self._times or (0, 0)
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=self._counts.total(),
            message_end_time=last,
            message_start_time=first,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )


def _bytes(*records: Any) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    data: bytes = builder.end()
    return data


def _spanning(times: Sequence[int] | None, first: int, last: int) -> tuple[int, int]:
    return (first, last) if times is None else (min(times[0], first), max(times[1], last))

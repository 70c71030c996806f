"""Writing MCAP: records as the library has them, in chunks that are neither copied about nor searched longer than it pays.

The library's own writer copies each chunk six times and packs it at zstd's third level; of states that are packed already, and of
messages in JSON, the first level makes less in half the time.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

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

from elys.bus.transports.recording_file import RecordingFile

MAGIC: Final = b"\x89MCAP0\r\n"
_LEVEL: Final = 1  # of zstd
_MESSAGE: Final = struct.Struct("<BQHIQQ")
_CHUNK: Final = struct.Struct("<BQQQQII4sQ")
_FOOTER: Final = struct.Struct("<BQQQ")
# Of a ChunkIndex: times, place and length of the chunk, bytes of the map of offsets; behind that the length of message indexes.
_INDEX: Final = struct.Struct("<9xQQQQI")
_LENGTH: Final = struct.Struct("<Q")
_COUNT: Final = struct.Struct("<HI")  # channel, and messages of it


class _Written(NamedTuple):
    """A chunk in the file. Kept small: there are seven a second, for as long as somebody records."""

    record: bytes  # its ChunkIndex
    counts: bytes  # _COUNT of each channel that has messages in it

    @property
    def times(self) -> tuple[int, int]:
        """[ns] of its first message and its last."""
        first, last, *_ = _INDEX.unpack_from(self.record)
        return first, last

    @property
    def start(self) -> int:
        """Where it begins in the file."""
        return int(_INDEX.unpack_from(self.record)[2])

    @property
    def end(self) -> int:
        """Where it and its message indexes end in the file."""
        _, _, start, length, offsets = _INDEX.unpack_from(self.record)
        return int(start + length + _LENGTH.unpack_from(self.record, _INDEX.size + offsets)[0])


class ChunkedWriter:
    """An MCAP file; whoever writes decides when a chunk ends (`flush`). `size` [bytes] is without the open chunk.

    `room` [bytes] is what is to come before the end beside the summary: with it, room for the end is kept in the file. What
    raises OSError has changed nothing in it, and `finish`, if need be after `drop_chunks`, makes a whole file of what is there.
    """

    def __init__(self, file: RecordingFile) -> None:
        self._file = file
        self.room = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[_Written] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._compressor = zstandard.ZstdCompressor(level=_LEVEL)
        self._open: list[bytes | memoryview] = []  # the chunk's records
        self._open_size = 0
        self._open_times: tuple[int, int] | None = None
        self._open_index: dict[int, list[tuple[int, int]]] = {}  # time and place of messages by channel

    def begin(self, *, profile: str, library: str) -> None:
        """Writes what stands before everything else."""
        self._put(MAGIC, _bytes(Header(profile=profile, library=library)))

    @property
    def size(self) -> int:
        """[bytes] without the open chunk."""
        return self._file.size

    @property
    def chunk_count(self) -> int:
        """How many chunks are in the file."""
        return len(self._chunks)

    @property
    def summary_size(self) -> int:
        """What `finish` adds at most [bytes], were there another chunk."""
        known = sum(len(schema.data) + 150 for schema in self._schemas)
        indexed = 80 + 12 * len(self._channels)
        named = sum(len(index.name) + 120 for index in (*self._attachments, *self._metadata))
        return known + 1000 + indexed * (len(self._chunks) + 1) + named

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
        self._put(written)
        self._attachments.append(index)

    def add_metadata(self, name: str, metadata: dict[str, str]) -> None:
        """Adds names and texts."""
        written = _bytes(Metadata(name=name, metadata=metadata))
        index = MetadataIndex(offset=self.size, length=len(written), name=name)
        self._put(written)
        self._metadata.append(index)

    def flush(self) -> None:
        """Ends the open chunk, if it has any message, and hands it to the system."""
        if self._open_times is not None:
            self._end_chunk(*self._open_times)

    def drop_open_chunk(self) -> None:
        """Forgets what is not in the file yet."""
        self._open, self._open_size, self._open_times, self._open_index = [], 0, None, {}

    def chunks_before(self, size: int) -> int:
        """How many chunks end within the first `size` bytes."""
        return sum(chunk.end <= size for chunk in self._chunks)

    def drop_chunks(self, count: int) -> None:
        """Leaves `count` chunks in the file; the others, and what came after them, go."""
        if count < len(self._chunks):
            self.drop_from(self._chunks[count].start)

    def drop_from(self, end: int) -> None:
        """Takes everything away that was written from there on [bytes]."""
        del self._chunks[self.chunks_before(end) :]
        self._attachments = [index for index in self._attachments if index.offset < end]
        self._metadata = [index for index in self._metadata if index.offset < end]
        self._file.cut_back(end)

    def finish(self) -> None:
        """Ends the file: index, statistics, footer."""
        self.flush()
        data_end = _bytes(DataEnd(data_section_crc=0))
        start = self.size + len(data_end)
        groups = (
            (Opcode.SCHEMA, _bytes(*self._schemas)),
            (Opcode.CHANNEL, _bytes(*self._channels)),
            (Opcode.STATISTICS, _bytes(self._statistics())),
            (Opcode.CHUNK_INDEX, b"".join(chunk.record for chunk in self._chunks)),
            (Opcode.ATTACHMENT_INDEX, _bytes(*self._attachments)),
            (Opcode.METADATA_INDEX, _bytes(*self._metadata)),
        )
        parts: list[bytes] = []
        offsets: list[SummaryOffset] = []
        place = start
        for opcode, data in groups:
            parts.append(data)
            if data:
                offsets.append(SummaryOffset(group_opcode=opcode, group_start=place, group_length=len(data)))
            place += len(data)
        summary = b"".join((*parts, _bytes(*offsets)))
        checksum = zlib.crc32(_FOOTER.pack(Opcode.FOOTER, 20, start, place), zlib.crc32(summary))
        footer = Footer(summary_start=start, summary_offset_start=place, summary_crc=checksum)
        self._file.append(data_end, summary, _bytes(footer), MAGIC)

    # --- inside ----------------------------------------------------------------------------------------------------

    def _add(self, data: bytes | memoryview) -> None:
        self._open.append(data)
        self._open_size += len(data)

    def _put(self, *pieces: bytes | memoryview) -> None:
        self._file.append(*pieces, room=self.room + self.summary_size)

    def _end_chunk(self, first: int, last: int) -> None:
        checksum = 0
        packing = self._compressor.compressobj(size=self._open_size)
        packed: list[bytes] = []
        for piece in self._open:
            checksum = zlib.crc32(piece, checksum)
            packed.append(packing.compress(piece))
        packed.append(packing.flush())
        packed_size = sum(map(len, packed))
        offset, size = self.size, self._open_size
        length = _CHUNK.size - 9 + packed_size
        head = _CHUNK.pack(Opcode.CHUNK, length, first, last, size, checksum, 4, b"zstd", packed_size)
        place = end = offset + len(head) + packed_size
        offsets, counts, indexes = {}, b"", []
        for channel, records in self._open_index.items():
            offsets[channel] = place
            counts += _COUNT.pack(channel, len(records))
            indexes.append(_bytes(MessageIndex(channel_id=channel, records=records)))
            place += len(indexes[-1])
        self._put(head, *packed, *indexes)
        self.drop_open_chunk()
        index = ChunkIndex(
            chunk_length=end - offset,
            chunk_start_offset=offset,
            compression="zstd",
            compressed_size=packed_size,
            message_end_time=last,
            message_index_length=place - end,
            message_index_offsets=offsets,
            message_start_time=first,
            uncompressed_size=size,
        )
        self._chunks.append(_Written(_bytes(index), counts))

    def _statistics(self) -> Statistics:
        counts: Counter[int] = Counter()
        for chunk in self._chunks:
            counts.update(dict(_COUNT.iter_unpack(chunk.counts)))
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=dict(counts),
            chunk_count=len(self._chunks),
            message_count=counts.total(),
            message_end_time=max((chunk.times[1] for chunk in self._chunks), default=0),
            message_start_time=min((chunk.times[0] for chunk in self._chunks), default=0),
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

"""What a recording is made of: records, chunks of them, and the messages in those, with nothing believed of their lengths."""

from __future__ import annotations

import io
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel

MAX_CHUNK_SIZE: Final = 512 << 20  # [bytes] of a chunk unpacked
MAX_RECORDS: Final = 1 << 18  # of a chunk: half a GiB of nothing but their heads could hold 17 million
RECORD: Final = struct.Struct("<BQ")
_CHUNK_HEAD: Final = struct.Struct("<QQQI")
_MESSAGE: Final = struct.Struct("<HIQQ")


class Place(NamedTuple):
    """Where a message stands: the number of its chunk in the file and its own in the chunk."""

    chunk: int
    message: int


BEGINNING: Final = Place(0, 0)


class RecordedMessage(NamedTuple):
    """A message as it was written, with its place; `body` has no protocol prefix."""

    channel: str
    body: bytes
    log_time: int  # [ns]
    place: Place


class DamagedPart(NamedTuple):
    """Bytes of a file that cannot be read."""

    chunk: int  # the number of the chunk that they are, or that follows where they have none
    is_chunk: bool
    offset: int
    length: int
    why: str

    @property
    def sentence(self) -> str:
        """The same for a person."""
        return f"{self.length} bytes from byte {self.offset} on ({self.why})"


@dataclass(slots=True)
class ChunkFacts:
    offset: int
    length: int
    channels: frozenset[int] | None  # None: not known


@dataclass(slots=True)
class Contents:
    """What a file holds, from its summary or found record by record."""

    channels: dict[int, str] = field(default_factory=dict)
    encodings: dict[str, str] = field(default_factory=dict)  # of messages, by channel
    chunks: list[ChunkFacts] = field(default_factory=list)
    counts: Counter[int] = field(default_factory=Counter)
    attachments: dict[str, tuple[int, int]] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    start_time: int = 0
    end_time: int = 0
    definitions: list[Any] = field(default_factory=list)  # schemas and channels as the summary repeats them
    damage: list[DamagedPart] = field(default_factory=list)  # what could not be read
    whole_size: int = 0  # [bytes] up to the end of the last whole record


def unpacked_chunk(raw: bytes) -> bytes:
    """The records in a chunk record; ValueError, struct.error or ZstdError if it is damaged."""
    view = memoryview(raw)[RECORD.size :]
    _, _, size, checksum = _CHUNK_HEAD.unpack_from(view)
    place = _CHUNK_HEAD.size
    (name_length,) = struct.unpack_from("<I", view, place)
    compression = bytes(view[place + 4 : place + 4 + name_length])
    place += 4 + name_length
    (packed_size,) = struct.unpack_from("<Q", view, place)
    packed = view[place + 8 : place + 8 + packed_size]
    if size > MAX_CHUNK_SIZE:
        raise ValueError(f"a chunk claims to unpack to {size} bytes")
    data = _decompressed(compression, packed, size)
    if len(data) != size or (checksum and zlib.crc32(data) != checksum):
        raise ValueError("a chunk's checksum or size is wrong")
    return data


def _decompressed(compression: bytes, packed: memoryview, size: int) -> bytes:
    if compression == b"":
        return bytes(packed)
    if compression != b"zstd":
        raise ValueError(f"compressed with {compression!r}: only zstd is read here")
    if zstandard.frame_content_size(packed) not in (-1, size):
        raise ValueError("a chunk unpacks to another size than it says")
    return zstandard.ZstdDecompressor().decompress(packed, max_output_size=max(size, 1))


def records_in(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Opcode, start and end of each record's content; ValueError where they do not fit, or are too many."""
    offset = count = 0
    while offset < len(data):
        count += 1
        if count > MAX_RECORDS:
            raise ValueError(f"a chunk holds more than {MAX_RECORDS} records")
        opcode, length = RECORD.unpack_from(data, offset)
        start = offset + RECORD.size
        if start + length > len(data):
            raise ValueError("a record reaches beyond its chunk")
        yield opcode, start, start + length
        offset = start + length


def messages_in(data: bytes, number: int, channels: dict[int, str]) -> Iterator[RecordedMessage]:
    """The messages of the chunk of that number."""
    ordinal = 0
    for opcode, start, end in records_in(data):
        if opcode != Opcode.MESSAGE:
            continue
        channel, _, log_time, _ = _MESSAGE.unpack_from(data, start)
        body = data[start + _MESSAGE.size : end]
        yield RecordedMessage(channels[channel], body, log_time, Place(number, ordinal))
        ordinal += 1


def channels_in(data: bytes) -> Iterator[Any]:
    """The records of channels in a chunk."""
    for opcode, start, end in records_in(data):
        if opcode == Opcode.CHANNEL:
            yield Channel.read(ReadDataStream(io.BytesIO(data[start:end])))

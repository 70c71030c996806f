"""What stands in a chunk of an MCAP file: unpacking it, and its records one after the other."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Final

import zstandard

RECORD: Final = struct.Struct("<BQ")  # opcode, and the length of what follows
MAX_RECORDS: Final = 1 << 18  # of a chunk: half a GiB of nothing but their heads could hold 17 million


def decompress(compression: bytes, packed: memoryview, size: int) -> bytes:
    """The records of a chunk of `size` bytes; ValueError or ZstdError where it has not that many."""
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

"""Arrays of integers as byte planes: first the highest byte of each, then the next ones, every plane packed for itself.

Where numbers resemble one another their high bytes do, and pack well; their low bytes are noise, and are kept as they are.

    plane of n bytes   u8 how: 0 all are zero, 1 the n bytes follow, 2 u32 length and a zstd frame of so many bytes follow
"""

from __future__ import annotations

import struct
from typing import Any, Final

import numpy as np
import zstandard
from numpy.typing import NDArray

from elys.common.errors import RecordingError

ZERO: Final = 0
PLAIN: Final = 1
PACKED: Final = 2
_SMALLEST_PACKED: Final = (
    128  # [bytes] below it a plane is not worth a frame of its own; a chunk's compression finds the rest
)
_LOOKED_AT: Final = 1024  # bytes of a plane by which it is told whether it is noise
_NOISE: Final = 1.15 / 256.0  # how often two of them are equal, of those that do not pack: a little above chance
# Planes hold no words to be found again, but few values among many: the shorter the search, the smaller and the sooner.
_SEARCH: Final = zstandard.ZstdCompressionParameters.from_level(
    1, strategy=zstandard.STRATEGY_FAST, window_log=17, hash_log=8, min_match=7, target_length=0
)
_LENGTH: Final = struct.Struct("<BI")


class PlaneWriter:
    """Collects a message: numbers and arrays one after the other."""

    def __init__(self) -> None:
        self._parts: list[bytes | memoryview] = []
        self._compressor = zstandard.ZstdCompressor(compression_params=_SEARCH)

    def byte(self, value: int) -> None:
        """Adds one byte."""
        self._parts.append(bytes((value,)))

    def plain(self, data: bytes | memoryview) -> None:
        """Adds bytes as they are."""
        self._parts.append(data)

    def words(self, values: NDArray[Any]) -> None:
        """Adds unsigned integers of 1, 2, 4 or 8 bytes each, plane by plane, rows of a table one after the other."""
        width = values.itemsize
        flat = values.reshape(-1)
        for place in reversed(range(width)):
            self._plane((flat >> flat.dtype.type(8 * place)).astype(np.uint8))

    def bits(self, flags: NDArray[np.bool_]) -> None:
        """Adds booleans, eight in a byte, the first in the lowest bit."""
        self._plane(np.packbits(flags, bitorder="little"))

    def take(self) -> bytes:
        """What was collected since the last time."""
        parts, self._parts = self._parts, []
        return b"".join(parts)

    def _plane(self, plane: NDArray[np.uint8]) -> None:
        if not len(plane):
            return
        if not plane.any():
            self.byte(ZERO)
            return
        if len(plane) >= _SMALLEST_PACKED and not _is_noise(plane):
            packed = self._compressor.compress(plane.data)
            if len(packed) + 4 < len(plane):
                self._parts.append(_LENGTH.pack(PACKED, len(packed)))
                self._parts.append(packed)
                return
        self.byte(PLAIN)
        self._parts.append(plane.data)


def _is_noise(plane: NDArray[np.uint8]) -> bool:
    """Whether the bytes of a plane are spread so evenly that packing them would be in vain."""
    sample = plane[:: max(1, len(plane) // _LOOKED_AT)]
    counts = np.bincount(sample, minlength=256)
    size = len(sample)
    return bool(counts @ counts - size <= _NOISE * size * (size - 1))


class PlaneReader:
    """Takes a message apart; believes nothing that it says of its own lengths. Raises RecordingError."""

    def __init__(self, message: bytes | memoryview, offset: int) -> None:
        self._message = memoryview(message)
        self._offset = offset
        self._decompressor = zstandard.ZstdDecompressor()

    def byte(self) -> int:
        """The next byte."""
        return self.plain(1)[0]

    def plain(self, size: int) -> memoryview:
        """The next so many bytes."""
        start, self._offset = self._offset, self._offset + size
        if self._offset > len(self._message):
            raise RecordingError("a state frame is damaged: it ends in the middle")
        return self._message[start : self._offset]

    def words(self, count: int, width: int) -> NDArray[Any]:
        """The next `count` unsigned integers of `width` bytes."""
        flat = np.empty((count, width), np.uint8)
        for place in reversed(range(width)):
            flat[:, place] = self._plane(count)
        return flat.reshape(-1).view(f"<u{width}")

    def bits(self, count: int) -> NDArray[np.bool_]:
        """The next `count` booleans."""
        return np.unpackbits(self._plane((count + 7) // 8), count=count, bitorder="little").view(np.bool_)

    def end(self) -> None:
        """Says that nothing may follow."""
        if self._offset != len(self._message):
            raise RecordingError("a state frame is damaged: more follows than it has columns")

    def _plane(self, size: int) -> NDArray[np.uint8]:
        if not size:
            return np.empty(0, np.uint8)
        how = self.byte()
        if how == ZERO:
            return np.zeros(size, np.uint8)
        if how == PLAIN:
            return np.frombuffer(self.plain(size), np.uint8)
        if how != PACKED:
            raise RecordingError(f"a state frame is damaged: a plane is packed in a way {how}")
        (length,) = struct.unpack("<I", self.plain(4))
        packed = self.plain(length)
        try:
            if zstandard.frame_content_size(packed) != size:
                raise RecordingError("a state frame is damaged: a plane unpacks to another size than its column has")
            data = self._decompressor.decompress(packed, max_output_size=size)
        except zstandard.ZstdError as error:
            raise RecordingError(f"a state frame is damaged: {error}") from error
        if len(data) != size:
            raise RecordingError("a state frame is damaged: a plane unpacks to another size than its column has")
        return np.frombuffer(data, np.uint8)

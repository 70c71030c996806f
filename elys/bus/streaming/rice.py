"""Whole numbers in about as many bits as they need, by Rice's code (Rice and Plaunt 1971) with an escape.

Of each number the low k bits stand as they are, the rest in unary. Small ones are frequent, for most bodies go on as was guessed;
those that hit something are far off, and would take very long: from 2^k * 8 on they stand whole, at the end.

    u8     k
    u8     w, how many bits a whole one has
    u32    size [bytes] of the next part
    unary  of each number so many zeros as it is times 2^k, 8 at most, and a one
    low    k bits of each
    whole  w bits of each of those that are 8 times 2^k or more

Bits are taken from the lowest of a byte upwards, and each part begins with a new byte.
"""

from __future__ import annotations

import struct
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.state_packing.planes import PlaneReader, PlaneWriter
from elys.common.errors import MessageError

ESCAPE: Final = 8
_HEAD: Final = struct.Struct("<BBI")
_WIDTH: Final = 32
_LENGTHS: Final = np.arange(_WIDTH + 1)
_MIDDLES: Final = np.where(_LENGTHS > 0, 1.5 * 2.0 ** (_LENGTHS - 1.0), 0.0)  # of the numbers of so many bits
Words = NDArray[np.uint32]


def write(out: PlaneWriter, words: NDArray[Any]) -> None:
    """Adds unsigned integers below 2^32, in the order of a flat table; nothing where there are none."""
    values = words.reshape(-1).astype(np.uint32, copy=False)
    if not len(values):
        return
    low, width = _best_widths(values)
    times = np.minimum(values >> np.uint32(low), np.uint32(ESCAPE)) if low < _WIDTH else np.zeros_like(values)
    ends = np.cumsum(times.astype(np.int64) + 1) - 1
    unary = np.zeros(int(ends[-1]) + 1, np.bool_)
    unary[ends] = True
    packed = np.packbits(unary, bitorder="little")
    out.plain(_HEAD.pack(low, width, len(packed)))
    out.plain(packed.data)
    _write_bits(out, values, low)
    _write_bits(out, values[times == ESCAPE], width)


def read(packed: PlaneReader, count: int) -> Words:
    """The next `count` numbers.

    Raises:
        RecordingError, MessageError: they are damaged.
    """
    if not count:
        return np.zeros(0, np.uint32)
    low, width, size = _HEAD.unpack(packed.plain(_HEAD.size))
    if low > _WIDTH or width > _WIDTH or size > (ESCAPE + 1) * count // 8 + 1:
        raise MessageError("numbers of a streamed frame have more bits than there are")
    ends = np.flatnonzero(np.unpackbits(np.frombuffer(packed.plain(size), np.uint8), bitorder="little"))
    times = np.diff(ends, prepend=-1) - 1
    if len(ends) != count or times.max() > ESCAPE:
        raise MessageError("numbers of a streamed frame are others than there should be")
    values = (times.astype(np.uint64) << np.uint64(low)).astype(np.uint32) | _read_bits(packed, count, low)
    far = np.flatnonzero(times == ESCAPE)
    if len(far):
        values[far] = _read_bits(packed, len(far), width)
    return values


def _best_widths(values: Words) -> tuple[int, int]:
    """How many low bits make it shortest, about; and how many a whole one takes. Judged by how long numbers are."""
    lengths = np.bincount(np.frexp(values.astype(np.float64))[1], minlength=_WIDTH + 1)
    most = int(np.flatnonzero(lengths)[-1])
    low = _LENGTHS[: most + 1, None]
    times = np.minimum(_MIDDLES / 2.0**low, ESCAPE) + 1.0 + np.where(low + 3 < _LENGTHS, most, 0)
    return int(np.argmin((times * lengths).sum(axis=1) + low[:, 0] * len(values))), most


def _write_bits(out: PlaneWriter, values: Words, width: int) -> None:
    if width and len(values):
        words = values.astype("<u4").view(np.uint8).reshape(len(values), 4)
        bits = np.unpackbits(words, axis=1, count=width, bitorder="little")
        out.plain(np.packbits(bits, bitorder="little").data)


def _read_bits(packed: PlaneReader, count: int, width: int) -> Words:
    if not width or not count:
        return np.zeros(count, np.uint32)
    stored = np.frombuffer(packed.plain((count * width + 7) // 8), np.uint8)
    bits = np.unpackbits(stored, count=count * width, bitorder="little").reshape(count, width)
    padded = np.zeros((count, _WIDTH), np.uint8)
    padded[:, :width] = bits
    return np.packbits(padded, axis=1, bitorder="little").view("<u4").reshape(-1).astype(np.uint32)

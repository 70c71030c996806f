"""One state frame as it stands in a recording (`elys.state.v2`): told whole, or against a frame before it.

    0    56  the header as on the bus
    56    1  u8  what it is: 1 key, 2 refresh, 3 difference, 4 verbatim; + 128 for a compact frame
    57    1  u8  what follows, bits: 1 entity ids, 2 rows, 4 which rows (else all), 8 the tail
    58    2  u16 zero
    60    4  u32 number of the frame in the file
    64    4  u32 number of the frame that it is told against; a key's own
    68       entity ids, which rows, the rows, the tail

A key is told against nothing, a refresh against the last key, a difference against the frame before.
"""

from __future__ import annotations

import enum
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import BODY_SIZE, HAS_TAIL, HEADER, is_whole
from elys.bus.state_packing.bodies import Bodies, aligned, bytes_of, changed_rows, no_bodies
from elys.bus.state_packing.compact import (
    Codes,
    aligned_codes,
    bodies_from,
    changed_codes,
    no_codes,
    pack_codes,
    unpack_codes,
)
from elys.bus.state_packing.lossless import pack_bodies, unpack_bodies
from elys.bus.state_packing.numbers import folded, from_ordered, ordered, unfolded
from elys.bus.state_packing.planes import PlaneReader, PlaneWriter
from elys.common.errors import RecordingError

STATE_ENCODING: Final = "elys.state.v2"
MOST_BODIES: Final = 1 << 20  # in a frame that is packed: what unpacks to more is stored as it is, or is no frame
COMPACT: Final = 128
_HEAD: Final = struct.Struct("<BBHII")
HEAD_SIZE: Final = HEADER.size + _HEAD.size
_IDS, _ROWS, _SOME, _TAIL = 1, 2, 4, 8
_TAIL_HEAD: Final = struct.Struct("<BI")  # whether it is told against the tail before, words
MOST_TAIL: Final = 1 << 24  # [words] of a tail that is packed
_MOSTLY: Final = 0.8  # of the rows: who counts the few that did not change pays more than they cost
_LONGEST: Final = 1.0  # [s] between frames, above which where a body went says nothing


class Kind(enum.IntEnum):
    """What a stored frame is told against."""

    KEY = 1
    REFRESH = 2
    DIFFERENCE = 3
    VERBATIM = 4  # the frame as it was on the bus, header and all, whatever it is


class Head(NamedTuple):
    """What can be said of a stored frame without unpacking it."""

    kind: Kind
    is_compact: bool
    told: int
    number: int
    base: int


class _Packing(NamedTuple):
    """How rows of one sort are told."""

    zeros: Callable[..., Any]
    aligned: Callable[..., Any]
    changed: Callable[..., NDArray[np.bool_]]
    pack: Callable[..., None]
    unpack: Callable[..., Any]


_EXACT: Final = _Packing(no_bodies, aligned, changed_rows, pack_bodies, unpack_bodies)
_IN_STEPS: Final = _Packing(no_codes, aligned_codes, changed_codes, pack_codes, unpack_codes)


@dataclass(frozen=True, slots=True)
class Told:
    """A frame that others can be told against: as it is on the bus, and as columns, or as codes where it is compact."""

    number: int
    body: bytes | memoryview
    rows: Bodies | Codes | None  # None: no others can be told against it

    @property
    def time(self) -> float:
        """[s] of simulation."""
        return float(HEADER.unpack_from(self.body)[2])

    @property
    def count(self) -> int:
        """How many bodies it has."""
        return int(HEADER.unpack_from(self.body)[6])

    @property
    def tail(self) -> memoryview:
        """What follows the bodies."""
        return memoryview(self.body)[HEADER.size + self.count * BODY_SIZE :]


def head_of(stored: bytes | memoryview) -> Head:
    """What a stored frame is; RecordingError if it is none."""
    if len(stored) < HEAD_SIZE:
        raise RecordingError(f"a stored state frame has at least {HEAD_SIZE} bytes, this one {len(stored)}")
    kind, told, _, number, base = _HEAD.unpack_from(stored, HEADER.size)
    if kind & ~COMPACT not in Kind.__members__.values():
        raise RecordingError(f"a state frame is damaged: it is of a kind {kind}")
    return Head(Kind(kind & ~COMPACT), bool(kind & COMPACT), told, number, base)


# --- packing -------------------------------------------------------------------------------------------------------


def pack_verbatim(body: bytes | memoryview, *, number: int) -> bytes:
    """A frame as it is, however damaged: at least a header."""
    head = _HEAD.pack(Kind.VERBATIM, 0, 0, number, number)
    return b"".join((memoryview(body)[: HEADER.size], head, memoryview(body)[HEADER.size :]))


def pack_told(
    out: PlaneWriter,
    body: bytes | memoryview,
    rows: Bodies | Codes | None,
    *,
    number: int,
    kind: Kind,
    base: Told | None,
) -> tuple[bytes, Told]:
    """A whole frame of at most MOST_BODIES, told against `base`, which is None for a key; and what others are told against.

    `rows` are its bodies, as codes in a compact recording, and of the same sort as the base's; None if it `is_same` as the base.
    """
    told = 0
    if rows is None:
        assert base is not None and base.rows is not None
        kept: Bodies | Codes = base.rows.without_change()
    else:
        with np.errstate(all="ignore"):
            elapsed = _elapsed(body, base if kind is Kind.DIFFERENCE else None)
            told, kept = _pack_rows(out, rows, None if base is None else base.rows, elapsed)
            told |= pack_tail(out, Told(number, body, None).tail, b"" if base is None else base.tail)
    code = kind | (COMPACT if isinstance(kept, Codes) else 0)
    head = _HEAD.pack(code, told, 0, number, number if base is None else base.number)
    stored = b"".join((memoryview(body)[: HEADER.size], head, out.take()))
    return stored, Told(number, body, kept)


def is_same(body: bytes | memoryview, other: bytes | memoryview) -> bool:
    """Whether all but the header is, bit for bit."""
    if len(body) != len(other):
        return False
    bits, other_bits = (np.frombuffer(frame, np.uint8, offset=HEADER.size) for frame in (body, other))
    return np.array_equal(bits[:4096], other_bits[:4096]) and np.array_equal(bits, other_bits)


def _elapsed(header: bytes | memoryview, base: Told | None) -> float:
    if base is None:
        return 0.0
    elapsed = float(HEADER.unpack_from(header)[2]) - base.time
    return elapsed if 0.0 < elapsed < _LONGEST else 0.0


def _steps(entity: NDArray[np.uint32]) -> NDArray[np.uint32]:
    return folded(np.diff(entity.view(np.int32), prepend=np.int32(0)))


def _pack_rows(out: PlaneWriter, now: Any, base: Any, elapsed: float) -> tuple[int, Any]:
    """Which bits say what was told; and the rows as the decoder has them then."""
    packing, told, before = _EXACT if isinstance(now, Bodies) else _IN_STEPS, 0, base
    if base is None or not np.array_equal(now.entity, base.entity):
        told = _IDS
        out.words(_steps(now.entity))
        before = packing.zeros(now.body_count, now.entity) if base is None else packing.aligned(base, now.entity)
    changed = packing.changed(now, before)
    count = int(np.count_nonzero(changed))
    if not count:
        return told, before.without_change()
    rows: Any = slice(None)
    if count < _MOSTLY * now.body_count:
        told |= _SOME
        out.bits(changed)
        rows = np.flatnonzero(changed)
    packing.pack(out, now.rows(rows), before.rows(rows), elapsed)
    return told | _ROWS, now.with_change(before if elapsed else None)


def pack_tail(out: PlaneWriter, tail: bytes | memoryview, before: bytes | memoryview) -> int:
    """Tells what is animated, against what it was; the bit that says so, 0 where there is nothing to tell."""
    if not len(tail) or tail == before:
        return 0
    values = np.frombuffer(tail, np.float32)
    is_alike = len(before) == len(tail)
    out.plain(_TAIL_HEAD.pack(is_alike, len(values)))
    numbers = ordered(values)
    out.words(folded(numbers - ordered(np.frombuffer(before, np.float32)) if is_alike else numbers))
    return _TAIL


# --- unpacking -----------------------------------------------------------------------------------------------------


def unpack_told(stored: bytes | memoryview, base: Told | None) -> Told:
    """The frame again; `base` is the one that its head names, and is not looked at where it names none.

    Raises:
        RecordingError: it is damaged, or was told against another one.
    """
    head = head_of(stored)
    if head.kind is Kind.VERBATIM:
        view = memoryview(stored)
        return Told(head.number, b"".join((view[: HEADER.size], view[HEAD_SIZE:])), None)
    if head.kind is Kind.KEY:
        base = None
    elif base is None or base.number != head.base or not isinstance(base.rows, Codes if head.is_compact else Bodies):
        raise RecordingError(
            f"frame {head.number} cannot be read: frame {head.base}, which it is told against, is not there"
        )
    with np.errstate(all="ignore"):
        return _unpack(memoryview(stored), head, base)


def _unpack(stored: memoryview, head: Head, base: Told | None) -> Told:
    header = stored[: HEADER.size]
    count, flags = HEADER.unpack_from(header)[6:]
    if count > MOST_BODIES:
        raise RecordingError(f"a state frame is damaged: it says that it has {count} bodies")
    packed = PlaneReader(stored, HEAD_SIZE)
    elapsed = _elapsed(header, base if head.kind is Kind.DIFFERENCE else None)
    rows = _unpack_rows(packed, head, count, None if base is None else base.rows, elapsed)
    if base is not None and not head.told & (_IDS | _ROWS):
        columns: list[Any] = [memoryview(base.body)[HEADER.size : HEADER.size + count * BODY_SIZE]]
    else:
        columns = bytes_of(bodies_from(rows) if isinstance(rows, Codes) else rows)
    tail: Any = b""
    if head.told & _TAIL:
        tail = unpack_tail(packed, b"" if base is None else base.tail)
    elif flags & HAS_TAIL and base is not None:
        tail = base.tail
    packed.end()
    body = b"".join((header, *columns, tail))
    if not is_whole(body):
        raise RecordingError("a state frame is damaged: its columns do not have as many rows as it says")
    return Told(head.number, body, rows)


def _unpack_rows(packed: PlaneReader, head: Head, count: int, base: Any, elapsed: float) -> Any:
    packing, before = _IN_STEPS if head.is_compact else _EXACT, base
    if head.told & _IDS:
        entity = np.cumsum(unfolded(packed.words(count, 4)), dtype=np.int32).view(np.uint32)
        before = packing.zeros(count, entity) if base is None else packing.aligned(base, entity)
    elif base is None or base.body_count != count:
        raise RecordingError("a state frame is damaged: it does not say which bodies it has")
    if not head.told & _ROWS:
        return before.without_change()
    if not head.told & _SOME:
        return packing.unpack(packed, before, elapsed).with_change(before if elapsed else None)
    rows = np.flatnonzero(packed.bits(count))
    told = packing.unpack(packed, before.rows(rows), elapsed)
    return before.replaced(rows, told).with_change(before if elapsed else None)


def unpack_tail(packed: PlaneReader, before: bytes | memoryview) -> bytes:
    """What `pack_tail` told; RecordingError if it is damaged."""
    is_alike, count = _TAIL_HEAD.unpack(packed.plain(_TAIL_HEAD.size))
    if count > MOST_TAIL or (is_alike and len(before) != 4 * count):
        raise RecordingError("a state frame is damaged: what is animated is not as much as it says")
    numbers = unfolded(packed.words(count, 4))
    if is_alike:
        numbers = ordered(np.frombuffer(before, np.float32)) + numbers
    return bytes(from_ordered(numbers, np.float32).tobytes())

"""Rows of bodies as bytes: told against what the viewer has of them, in steps of its choice.

A level L is a precision: its steps are 2^L times those of a compact recording (see `elys.bus.state_packing.compact`). A group is
rows of one level:

    u8     level
    u8     which rows: 0 all, 1 a bit for each row of the table (a plane, as in recordings), 2 gaps between them
    u32    n, how many
    rows   bits, or n numbers: the first row, then how many are left out before each next one
    3 n    linear velocity, 3 n angular velocity, n which component is the largest, 3 n the others, 3 n position: numbers in
           Rice's code, in steps of the level, against the same before or a guess

A body that only gravity moves is marked (`FALLS` beside its largest component), and taken to go on falling.
"""

from __future__ import annotations

import struct
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.state_packing.compact import ANGULAR_STEPS, F4, Codes, rotation_codes, rotation_of
from elys.bus.state_packing.numbers import folded, unfolded
from elys.bus.state_packing.planes import PlaneReader, PlaneWriter
from elys.bus.streaming import rice
from elys.bus.streaming.motion import FALLS, turned_on
from elys.common.errors import MessageError

COARSEST: Final = 7  # level: steps of 62 mm
_ALL, _BITS, _GAPS = 0, 1, 2
_FEW: Final = 16  # a row in so many: gaps take less than bits
_MOST_STEPS: Final = 23170  # of a component of a rotation
_GROUP: Final = struct.Struct("<BBI")
Rows = NDArray[np.intp]
Seconds = NDArray[np.float64]
Fall = NDArray[np.float64]  # [3, 1] steps of linear velocity in a second


def coarse(codes: Codes, level: int) -> Codes:
    """The same in steps of a level, still counted in the finest ones."""
    if not level:
        return codes
    rotation = _rounded(codes.rotation.astype(np.int32), level) << level
    np.clip(rotation, -_MOST_STEPS, _MOST_STEPS, out=rotation)
    position, linear, angular = (_rounded(c, level) << level for c in (codes.position, codes.linear, codes.angular))
    return Codes(position, codes.largest, rotation.astype(np.int16), linear, angular, codes.entity)


def pack_group(
    out: PlaneWriter, level: int, rows: Rows, now: Codes, before: Codes, elapsed: Seconds, fall: Fall, row_count: int
) -> None:
    """Tells the `rows` of a table of `row_count`: `now` (coarse), of which the viewer had `before` so many seconds earlier.

    `fall` is what `motion.fall_in_steps` makes of the frame's gravity.
    """
    _pack_rows(out, level, rows, row_count)
    linear, linear_before = _steps(now.linear, _guessed_linear(before, elapsed, fall), level)
    angular, angular_before = _steps(now.angular, before.angular, level)
    rice.write(out, folded(linear - linear_before))
    rice.write(out, folded(angular - angular_before))
    rice.write(out, now.largest ^ before.largest)
    guess = _guessed_rotation(before, now.angular, now.largest, elapsed)
    rotation, turned = _steps(now.rotation.astype(np.int32), guess.astype(np.int32), level)
    rice.write(out, folded(rotation - turned))
    position, moved = _steps(now.position, _guessed_position(before, now.linear, elapsed), level)
    rice.write(out, folded(position - moved))


def unpack_group(
    packed: PlaneReader, before_of: Codes, elapsed_of: Seconds, fall: Fall, row_count: int
) -> tuple[Rows, Codes]:
    """The rows that `pack_group` told, of a viewer that has `before_of` of all rows of its table.

    Raises:
        RecordingError, MessageError: it is damaged.
    """
    level, rows = _unpack_rows(packed, row_count)
    before, elapsed, count = before_of.rows(rows), elapsed_of[rows], len(rows)
    linear = _told(packed, count, _guessed_linear(before, elapsed, fall), level)
    angular = _told(packed, count, before.angular, level)
    largest = (before.largest ^ rice.read(packed, count).astype(np.uint8)) & np.uint8(15)
    told = unfolded(rice.read(packed, 3 * count)).reshape(3, count)
    guess = _guessed_rotation(before, angular, largest, elapsed).astype(np.int32)
    rotation = (_rounded(guess, level) + told) << level
    np.clip(rotation, -_MOST_STEPS, _MOST_STEPS, out=rotation)
    position = _told(packed, count, _guessed_position(before, linear, elapsed), level)
    return rows, Codes(position, largest, rotation.astype(np.int16), linear, angular, before.entity)


# --- rows ----------------------------------------------------------------------------------------------------------


def _pack_rows(out: PlaneWriter, level: int, rows: Rows, row_count: int) -> None:
    count = len(rows)
    if count == row_count:
        out.plain(_GROUP.pack(level, _ALL, count))
    elif count * _FEW < row_count:
        out.plain(_GROUP.pack(level, _GAPS, count))
        rice.write(out, np.diff(rows, prepend=-1) - 1)
    else:
        out.plain(_GROUP.pack(level, _BITS, count))
        flags = np.zeros(row_count, np.bool_)
        flags[rows] = True
        out.bits(flags)


def _unpack_rows(packed: PlaneReader, row_count: int) -> tuple[int, Rows]:
    level, how, count = _GROUP.unpack(packed.plain(_GROUP.size))
    if level > COARSEST or count > row_count:
        raise MessageError(f"a streamed frame tells {count} of {row_count} bodies at level {level}")
    if how == _ALL and count == row_count:
        return level, np.arange(row_count)
    if how == _BITS:
        rows = np.flatnonzero(packed.bits(row_count))
    elif how == _GAPS:
        rows = np.cumsum(rice.read(packed, count).astype(np.int64) + 1) - 1
    else:
        raise MessageError(f"a streamed frame tells its rows in a way {how}")
    if len(rows) != count or (count and not 0 <= rows[-1] < row_count):
        raise MessageError("a streamed frame tells other rows than it says")
    return level, rows


# --- steps ---------------------------------------------------------------------------------------------------------


def _rounded(steps: NDArray[np.int32], level: int) -> NDArray[np.int32]:
    """Finest steps in steps of a level."""
    if not level:
        return steps
    return np.asarray((steps + np.int32(1 << (level - 1))) >> np.int32(level))


def _steps(
    now: NDArray[np.int32], before: NDArray[np.int32], level: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    return now >> np.int32(level), _rounded(before, level)


def _told(packed: PlaneReader, count: int, before: NDArray[np.int32], level: int) -> NDArray[np.int32]:
    told = unfolded(rice.read(packed, 3 * count)).reshape(3, count)
    return np.asarray((_rounded(before, level) + told) << np.int32(level))


def _guessed_linear(before: Codes, elapsed: Seconds, fall: Fall) -> NDArray[np.int32]:
    """As fast as before, and by what it fell faster."""
    falls = (before.largest & FALLS) > 0
    if not falls.any():
        return before.linear
    faster = np.rint(fall * np.where(falls, elapsed, 0.0)).astype(np.int64)
    return np.asarray(before.linear + faster).astype(np.int32)


def _guessed_position(before: Codes, linear: NDArray[np.int32], elapsed: Seconds) -> NDArray[np.int32]:
    """Where the mean of both velocities leads: of their steps two make one of a place, so that the halves cancel."""
    way = (before.linear.astype(np.float64) + linear) * elapsed
    return np.asarray(before.position + np.rint(way).astype(np.int64)).astype(np.int32)


def _guessed_rotation(
    before: Codes, angular: NDArray[np.int32], largest: NDArray[np.uint8], elapsed: Seconds
) -> NDArray[np.int16]:
    """Codes of where the mean of both angular velocities turns them."""
    half = (before.angular + angular).astype(F4) * (elapsed * (0.25 / ANGULAR_STEPS)).astype(F4)
    return rotation_codes(turned_on(rotation_of(before), half), largest & np.uint8(3))

"""Bodies as whole numbers of small steps: what a compact recording keeps of them, and how such numbers are told.

    position          steps of 2^-11 m, so that a place is at most 0.423 mm from where it was
    rotation          which component is the largest, whether it is negative, and the other three, divided by its sign, in
                      steps of 1 / 23170: at most 0.0086 degrees
    linear velocity   steps of 2^-10 m/s: at most 0.85 mm/s
    angular velocity  steps of 2^-9 rad/s: at most 1.7 mrad/s

Guesses are made from such numbers and told in such numbers, so that errors do not add up.

    linear velocity   3 n words, against the same before
    angular velocity  3 n words, against the same before
    rotation          n bytes (1 number of the largest component, + 4 where it is negative), xor the same before, then 3 n half
                      words against where the mean of both angular velocities turns it
    position          3 n words, against where the mean of both linear velocities leads it
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.state_packing.bodies import Bodies, Rows, rows_before
from elys.bus.state_packing.numbers import folded, unfolded
from elys.bus.state_packing.planes import PlaneReader, PlaneWriter

POSITION_STEPS: Final = 2048.0  # [1/m]
ROTATION_STEPS: Final = 23170.0
LINEAR_STEPS: Final = 1024.0  # [s/m]
ANGULAR_STEPS: Final = 512.0  # [s]
POSITION_ERROR: Final = 0.5 / POSITION_STEPS * 3.0**0.5  # [m]
ROTATION_ERROR: Final = 0.0086  # [degrees]: 2 sqrt(3) steps / 2 at worst, where all four components are 1/2
LINEAR_ERROR: Final = 0.5 / LINEAR_STEPS * 3.0**0.5  # [m/s]
ANGULAR_ERROR: Final = 0.5 / ANGULAR_STEPS * 3.0**0.5  # [rad/s]
_MOST: Final = float((1 << 29) - 1)  # steps; a body farther or faster is kept exactly, with all of its frame
_OTHERS: Final = np.array(((1, 0, 0, 0), (2, 2, 1, 1), (3, 3, 3, 2)), np.uint8)  # [3, 4] which they are, by the largest
# [4, 4] where each component stands among (the others, the largest), by the largest
_PLACE: Final = np.array(((3, 0, 0, 0), (0, 3, 1, 1), (1, 1, 3, 2), (2, 2, 2, 3)), np.uint8)
F4: Final = np.float32


class Codes(NamedTuple):
    """Columns of N bodies in steps."""

    position: NDArray[np.int32]  # [3, N]
    largest: NDArray[np.uint8]  # [N] 0 to 3, + 4 where it is negative
    rotation: NDArray[np.int16]  # [3, N]
    linear: NDArray[np.int32]  # [3, N]
    angular: NDArray[np.int32]  # [3, N]
    entity: NDArray[np.uint32]  # [N]

    @property
    def body_count(self) -> int:
        """N."""
        return len(self.entity)

    def rows(self, rows: Rows) -> Codes:
        """Some of them."""
        if isinstance(rows, slice):
            return self
        return Codes._make(column.take(rows, axis=-1) for column in self)

    def replaced(self, rows: Rows, told: Codes) -> Codes:
        """The same with other rows in these places."""
        columns: list[Any] = [column.copy() for column in self[:5]]
        for column, told_column in zip(columns, told[:5], strict=True):
            column[..., rows] = told_column
        return Codes._make((*columns, self.entity))

    def with_change(self, before: Codes | None) -> Codes:
        """Itself: codes remember no change."""
        return self

    def without_change(self) -> Codes:
        """Itself: codes remember no change."""
        return self


def codes_of(bodies: Bodies) -> Codes | None:
    """Bodies in steps; None where one is too far, too fast, turned by no rotation or no number at all."""
    position, linear, angular = (
        _in_steps(column, steps)
        for column, steps in (
            (bodies.position, POSITION_STEPS),
            (bodies.linear, LINEAR_STEPS),
            (bodies.angular, ANGULAR_STEPS),
        )
    )
    length = np.sqrt(_squares(bodies.rotation))
    if position is None or linear is None or angular is None or not np.all(np.abs(length - F4(1.0)) < 0.1):
        return None
    rotation: NDArray[np.float32] = (bodies.rotation / length).astype(F4, copy=False)
    size = np.abs(rotation)
    largest = np.where(size[1] > size[0], np.uint8(1), np.uint8(0))
    size[0] = np.maximum(size[0], size[1])
    for component in (2, 3):
        largest[size[component] > size[0]] = component
        size[0] = np.maximum(size[0], size[component])
    negative = _at(rotation, largest) < 0.0
    codes = rotation_codes(rotation, largest)
    return Codes(position, largest + np.uint8(4) * negative, codes, linear, angular, bodies.entity)


def have_codes(bodies: Bodies) -> NDArray[np.bool_]:
    """[N] whether a body is near, slow and well-formed enough for `codes_of`."""
    with np.errstate(all="ignore"):
        good: NDArray[np.bool_] = np.abs(np.sqrt(_squares(bodies.rotation)) - F4(1.0)) < 0.1
        for column, steps in (
            (bodies.position, POSITION_STEPS),
            (bodies.linear, LINEAR_STEPS),
            (bodies.angular, ANGULAR_STEPS),
        ):
            good &= (np.abs(column) * steps <= _MOST - 1.0).all(axis=0)
    return good


def bodies_from(codes: Codes) -> Bodies:
    """What a reader gets to see of them."""
    return Bodies(
        codes.position.astype(np.float64) * (1.0 / POSITION_STEPS),
        rotation_of(codes),
        (codes.linear * (1.0 / LINEAR_STEPS)).astype(F4),
        (codes.angular * (1.0 / ANGULAR_STEPS)).astype(F4),
        codes.entity,
    )


def no_codes(count: int, entity: NDArray[np.uint32]) -> Codes:
    """Rows of zeros: what bodies are told against that were not there before."""

    def zeros(dtype: type) -> NDArray[np.generic]:
        return np.zeros((3, count), dtype)

    return Codes(zeros(np.int32), np.zeros(count, np.uint8), zeros(np.int16), zeros(np.int32), zeros(np.int32), entity)  # type: ignore[arg-type]


def aligned_codes(before: Codes, entity: NDArray[np.uint32]) -> Codes:
    """Rows of `before` in the order of `entity`; zeros for those that were not there."""
    rows, was_there = rows_before(entity, before.entity)
    if not was_there.any():
        return no_codes(len(entity), entity)
    found = before.rows(rows)
    for column in found[:5]:
        column[..., ~was_there] = 0
    return found._replace(entity=entity)


def changed_codes(now: Codes, before: Codes) -> NDArray[np.bool_]:
    """[N] whether any code of a row is another."""
    changed: NDArray[np.bool_] = now.largest != before.largest
    columns: Any = ((now[place], before[place]) for place in (0, 2, 3, 4))
    for column, earlier in columns:
        for row, earlier_row in zip(column, earlier, strict=True):
            changed |= row != earlier_row
    return changed


def pack_codes(out: PlaneWriter, now: Codes, before: Codes, elapsed: float) -> None:
    """Tells all rows of `now` against the same of `before`, which were `elapsed` seconds earlier (0: not to be guessed from)."""
    out.words(folded(now.linear - before.linear))
    out.words(folded(now.angular - before.angular))
    out.words(now.largest ^ before.largest)
    out.words(folded(now.rotation - _guessed_rotation(before, now.angular, now.largest, elapsed)))
    out.words(folded(now.position - _guessed_position(before, now.linear, elapsed)))


def unpack_codes(packed: PlaneReader, before: Codes, elapsed: float) -> Codes:
    """The rows that `pack_codes` told."""
    count = before.body_count
    linear = before.linear + unfolded(packed.words(3 * count, 4)).reshape(3, count)
    angular = before.angular + unfolded(packed.words(3 * count, 4)).reshape(3, count)
    largest = (before.largest ^ packed.words(count, 1)) & np.uint8(7)
    told = unfolded(packed.words(3 * count, 2)).reshape(3, count)
    rotation = _guessed_rotation(before, angular, largest, elapsed) + told
    told = unfolded(packed.words(3 * count, 4)).reshape(3, count)
    position = _guessed_position(before, linear, elapsed) + told
    return Codes(position, largest, rotation, linear, angular, before.entity)


# --- steps ---------------------------------------------------------------------------------------------------------


def _in_steps(column: NDArray[np.floating], steps: float) -> NDArray[np.int32] | None:
    scaled = column * column.dtype.type(steps)
    np.rint(scaled, out=scaled)
    return scaled.astype(np.int32) if max(scaled.max(initial=0.0), -scaled.min(initial=0.0)) <= _MOST else None


def _squares(rotation: NDArray[np.float32]) -> NDArray[np.float32]:
    x, y, z, w = rotation
    squares: NDArray[np.float32] = ((x * x + y * y) + z * z) + w * w
    return squares


def _at(rotation: NDArray[np.float32], component: NDArray[np.uint8]) -> NDArray[np.float32]:
    """The `component` [n] or [k, n] of each rotation."""
    count = rotation.shape[1]
    place = component.astype(np.intp)
    place *= count
    place += np.arange(count)
    return rotation.reshape(-1).take(place)


def rotation_codes(rotation: NDArray[np.float32], largest: NDArray[np.uint8]) -> NDArray[np.int16]:
    """[3, n] the components that are not the `largest`, divided by its sign."""
    others = _at(rotation, _OTHERS.take(largest, axis=1))
    others *= np.where(_at(rotation, largest) < 0.0, F4(-ROTATION_STEPS), F4(ROTATION_STEPS))
    return np.rint(others, out=others).astype(np.int16)


def rotation_of(codes: Codes) -> NDArray[np.float32]:
    """[4, n] unit quaternions."""
    others = codes.rotation * F4(1.0 / ROTATION_STEPS)
    x, y, z = others
    rest = F4(1.0) - ((x * x + y * y) + z * z)
    components = np.empty((4, codes.body_count), F4)
    components[:3] = others
    components[3] = np.sqrt(np.maximum(rest, F4(0.0)))
    components *= np.where(codes.largest & np.uint8(4), F4(-1.0), F4(1.0))
    return _at(components, _PLACE.take(codes.largest & np.uint8(3), axis=1)).reshape(4, codes.body_count)


def _guessed_rotation(
    before: Codes, angular: NDArray[np.int32], largest: NDArray[np.uint8], elapsed: float
) -> NDArray[np.int16]:
    """[3, n] codes of where the mean of both angular velocities turns a body, to first order: q + dt/2 (w, 0) q."""
    if not elapsed:
        return before.rotation
    x, y, z, w = rotation_of(before)
    wx, wy, wz = (before.angular + angular).astype(F4) * F4(elapsed * 0.25 / ANGULAR_STEPS)
    guess = np.empty((4, before.body_count), F4)
    guess[0] = x + ((wx * w + wy * z) - wz * y)
    guess[1] = y + ((wy * w + wz * x) - wx * z)
    guess[2] = z + ((wz * w + wx * y) - wy * x)
    guess[3] = w - ((wx * x + wy * y) + wz * z)
    guess /= np.sqrt(_squares(guess))
    return rotation_codes(guess, largest & np.uint8(3))


def _guessed_position(before: Codes, linear: NDArray[np.int32], elapsed: float) -> NDArray[np.int32]:
    """[3, n] codes of where the mean of both linear velocities leads."""
    if not elapsed:
        return before.position
    way = (before.linear + linear) * (elapsed * 0.5 * POSITION_STEPS / LINEAR_STEPS)
    guess: NDArray[np.int32] = before.position + np.rint(way).astype(np.int32)
    return guess

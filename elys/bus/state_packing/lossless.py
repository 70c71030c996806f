"""Columns of bodies to the last bit: each number as its difference to a guess that the decoder makes as well.

Guesses are elementwise sums, products and square roots of float64 and float32, which every processor rounds alike. How good
they are decides the size, never the bits: what differs from a guess is told as the difference of the bits.

    linear velocity   u8 mode (ABSOLUTE, LAST, LINE), 3 n words
    angular velocity  u8 mode (ABSOLUTE, LAST), 3 n words
    rotation          u8 mode (ABSOLUTE, LAST, TURNED), 3 n words of x y z, then n words of w
    position          u8 mode (SHORT, LONG, MIXED), if MIXED a bit for each of 3 n numbers whether it is SHORT, then the words of
                      those that are, then the long words of the others
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.state_packing.bodies import Bodies
from elys.bus.state_packing.numbers import finite, folded, from_ordered, from_turned, ordered, turned, unfolded
from elys.bus.state_packing.planes import PlaneReader, PlaneWriter
from elys.common.errors import RecordingError

ABSOLUTE: Final = 0  # the number's own bits, the sign moved to their end
LAST: Final = 1  # against the same number before
LINE: Final = 2  # against where it would be if it went on as it did
TURNED: Final = 3  # against where the mean of both angular velocities turns it
SHORT: Final = 0  # positions that moved by a float32: the solver's displacements are such
LONG: Final = 1
MIXED: Final = 2

_NOISE_BITS: Final = (
    24.5  # of a difference, above which the number itself is shorter: its exponent packs, its sign does not
)
_LOOKED_AT: Final = 1500  # numbers by which a mode is chosen
F4: Final = np.float32


def pack_bodies(out: PlaneWriter, now: Bodies, before: Bodies, elapsed: float) -> None:
    """Tells all rows of `now` against the same of `before`, which were `elapsed` seconds earlier (0: not to be guessed from)."""
    _pack_floats(out, now.linear, {LAST: before.linear, **_line(before)})
    _pack_floats(out, now.angular, {LAST: before.angular})
    turned_by = {TURNED: _turned_rotation(before, now.angular, elapsed)} if elapsed else {}
    _pack_floats(out, now.rotation[:3], {LAST: before.rotation[:3], **turned_by})
    out.words(folded(ordered(now.rotation[3]) - ordered(_last_of_unit(now.rotation, before.rotation[3]))))
    _pack_position(out, now, before, elapsed)


def unpack_bodies(packed: PlaneReader, before: Bodies, elapsed: float) -> Bodies:
    """The rows that `pack_bodies` told."""
    linear = _unpack_floats(packed, {LAST: before.linear, **_line(before)})
    angular = _unpack_floats(packed, {LAST: before.angular})
    turned_by = {TURNED: _turned_rotation(before, angular, elapsed)} if elapsed else {}
    rotation = np.empty((4, before.body_count), F4)
    rotation[:3] = _unpack_floats(packed, {LAST: before.rotation[:3], **turned_by})
    guess = ordered(_last_of_unit(rotation, before.rotation[3]))
    rotation[3] = from_ordered(guess + unfolded(packed.words(before.body_count, 4)), F4)
    position = _unpack_position(packed, linear, before, elapsed)
    return Bodies(position, rotation, linear, angular, before.entity)


# --- velocities and rotations --------------------------------------------------------------------------------------


def _line(before: Bodies) -> dict[int, NDArray[np.float32]]:
    return {} if before.change is None else {LINE: finite(before.linear + before.change)}


def _turned_rotation(before: Bodies, angular: NDArray[np.float32], elapsed: float) -> NDArray[np.float32]:
    """[3, n] x y z after `elapsed` seconds, to first order: q + dt/2 (w, 0) q."""
    wx, wy, wz = (before.angular + angular) * F4(elapsed * 0.25)
    x, y, z, w = before.rotation
    guess = np.empty_like(before.rotation[:3])
    guess[0] = x + ((wx * w + wy * z) - wz * y)
    guess[1] = y + ((wy * w + wz * x) - wx * z)
    guess[2] = z + ((wz * w + wx * y) - wy * x)
    return finite(guess)


def _last_of_unit(rotation: NDArray[np.float32], sign: NDArray[np.float32]) -> NDArray[np.float32]:
    """[n] w of unit quaternions of which x y z are known, with the sign of these numbers."""
    x, y, z = rotation[:3].astype(np.float64)
    rest = 1.0 - ((x * x + y * y) + z * z)
    return np.copysign(np.sqrt(np.where(rest > 0.0, rest, 0.0)).astype(F4), sign)


def _pack_floats(out: PlaneWriter, values: NDArray[np.float32], guesses: dict[int, NDArray[np.float32]]) -> None:
    sample = (slice(None), slice(None, None, max(1, values.size // _LOOKED_AT)))
    looked_at = ordered(values[sample])
    best, least = ABSOLUTE, _NOISE_BITS
    for mode, guess in guesses.items():
        size = float(np.log2(folded(looked_at - ordered(guess[sample])) + 1.0).mean()) if values.size else 0.0
        if size < least:
            best, least = mode, size
    out.byte(best)
    out.words(turned(values) if best == ABSOLUTE else folded(ordered(values) - ordered(guesses[best])))


def _unpack_floats(packed: PlaneReader, guesses: dict[int, NDArray[np.float32]]) -> NDArray[np.float32]:
    mode = packed.byte()
    shape = guesses[LAST].shape
    words = packed.words(shape[0] * shape[1], 4).reshape(shape)
    if mode == ABSOLUTE:
        return from_turned(words)
    if mode not in guesses:
        raise RecordingError(f"a state frame is damaged: it tells a column in a way {mode} that it has no grounds for")
    return from_ordered(ordered(guesses[mode]) + unfolded(words), F4)


# --- positions -----------------------------------------------------------------------------------------------------


def _guessed_way(linear: NDArray[np.float32], before: Bodies, elapsed: float) -> NDArray[np.float64]:
    """[3, n] m: how far the mean of both velocities leads."""
    if not elapsed:
        return np.zeros(linear.shape)
    return finite((linear.astype(np.float64) + before.linear) * (elapsed * 0.5))


def _short(way: NDArray[np.float64]) -> NDArray[np.float32]:
    return finite(way.astype(F4))


def _pack_position(out: PlaneWriter, now: Bodies, before: Bodies, elapsed: float) -> None:
    way = now.position - before.position
    short = way.astype(F4)
    is_short = ((before.position + short).view(np.int64) == now.position.view(np.int64)) & np.isfinite(short)
    guess = _guessed_way(now.linear, before, elapsed)
    if is_short.all():
        out.byte(SHORT)
        out.words(folded(ordered(short) - ordered(_short(guess))))
        return
    is_long = ~is_short
    if is_long.all():
        out.byte(LONG)
    else:
        out.byte(MIXED)
        out.bits(is_short.reshape(-1))
        out.words(folded(ordered(short[is_short]) - ordered(_short(guess[is_short]))))
    there = finite(before.position[is_long] + guess[is_long])
    out.words(folded(ordered(now.position[is_long]) - ordered(there)))


def _unpack_position(
    packed: PlaneReader, linear: NDArray[np.float32], before: Bodies, elapsed: float
) -> NDArray[np.float64]:
    shape = before.position.shape
    size = shape[0] * shape[1]
    mode = packed.byte()
    if mode not in (SHORT, LONG, MIXED):
        raise RecordingError(f"a state frame is damaged: it tells positions in a way {mode}")
    is_short = packed.bits(size) if mode == MIXED else np.full(size, mode == SHORT)
    guess = _guessed_way(linear, before, elapsed).reshape(-1)
    last = before.position.reshape(-1)
    position = np.empty(size)
    short: Any = ordered(_short(guess[is_short])) + unfolded(packed.words(int(np.count_nonzero(is_short)), 4))
    position[is_short] = last[is_short] + from_ordered(short, F4)
    is_long = ~is_short
    there = ordered(finite(last[is_long] + guess[is_long]))
    position[is_long] = from_ordered(there + unfolded(packed.words(int(np.count_nonzero(is_long)), 8)), np.float64)
    return position.reshape(shape)

"""Curves: a number over time, as cubic Hermite pieces between keys.

A key is a time [s] from 0 on, the value there, and the slopes [1/s] with which the curve arrives and leaves. Before the first key
and after the last one the curve keeps their values.
"""

from __future__ import annotations

import bisect
import itertools
from typing import Final

CurveKey = tuple[float, float, float, float]  # time [s], value, slope before, slope after [1/s]
Curve = tuple[CurveKey, ...]  # times rise

MAX_KEYS: Final = 16
KEY_WIDTH: Final = 4
UNUSED: Final = -1.0  # the time of a stored key that is none
UNUSED_KEY: Final[CurveKey] = (UNUSED, 0.0, 0.0, 0.0)


def value_at(curve: Curve, time: float) -> float:
    """The curve at a time [s]; 0 where it has no keys.

    Cubic Hermite interpolation on an arbitrary interval: https://en.wikipedia.org/wiki/Cubic_Hermite_spline.
    """
    if not curve:
        return 0.0
    after = bisect.bisect_right(curve, time, key=lambda key: key[0])
    if after == 0:
        return curve[0][1]
    if after == len(curve):
        return curve[-1][1]
    (start, first, _, leaving), (end, second, arriving, _) = curve[after - 1], curve[after]
    span = end - start
    s = (time - start) / span
    square, cube = s * s, s * s * s
    return (
        (2.0 * cube - 3.0 * square + 1.0) * first
        + (cube - 2.0 * square + s) * span * leaving
        + (3.0 * square - 2.0 * cube) * second
        + (cube - square) * span * arriving
    )


def repeated_value_at(curve: Curve, time: float) -> float:
    """The same of a curve that begins anew, at 0 s, when it has come to its last key."""
    end = curve[-1][0] if curve else 0.0
    return value_at(curve, time % end if end > 0.0 else time)


def stored_keys(curve: Curve) -> tuple[float, ...]:
    """All numbers of a curve, one key after the other, with keys that are none behind them: MAX_KEYS times KEY_WIDTH."""
    return tuple(itertools.chain(*curve, *(UNUSED_KEY,) * (MAX_KEYS - len(curve))))


def curve_of(numbers: list[float]) -> Curve:
    """The inverse of `stored_keys`."""
    keys = [tuple(numbers[first : first + KEY_WIDTH]) for first in range(0, len(numbers), KEY_WIDTH)]
    return tuple((key[0], key[1], key[2], key[3]) for key in keys if key[0] >= 0.0)

"""Single-precision numbers as people wrote them: the shortest decimal that a float32 stands for.

0.1 kept as a float32 is 0.100000001490116...; read back as a Python float it would show all those digits in every scene file
and every widget. The shortest decimal that rounds to the same float32 is 0.1 again, so what a person wrote is what they get.
Every decimal of up to 6 digits survives, and 9 digits tell any two float32 apart: those are the lengths tried.
"""

from __future__ import annotations

import math
from itertools import chain
from typing import Final

import numpy as np
from numpy.typing import NDArray

FLOAT32_MAX: Final = 3.4028235e38  # its shortest decimal, which lies a little above: what is greater overflows
_EXACT_INTEGERS: Final = float(1 << 24)  # below this a whole float32 is its own shortest decimal
_DIGITS: Final = (6, 7, 8, 9)
_POWERS_OF_TEN: Final = np.array([float(10**exponent) for exponent in range(23)])  # all that float64 holds exactly
_SMALLEST_SCALABLE: Final = 1e-13  # 9 digits of what is smaller, or 6 of what is larger, need a power that it does not
_LARGEST_SCALABLE: Final = 1e27


def shortest_decimal(value: float) -> float:
    """The float64 nearest to the shortest decimal that rounds to the float32 `value`."""
    if not math.isfinite(value) or (value.is_integer() and abs(value) < _EXACT_INTEGERS):
        return value
    return float(str(np.float32(value)))


def shortest_decimals(values: NDArray[np.float32]) -> NDArray[np.float64]:
    """`shortest_decimal` of every element, in the same shape."""
    single = np.ascontiguousarray(values, np.float32).reshape(-1)
    result = single.astype(np.float64)
    magnitude = np.abs(result)
    is_own_decimal = (result == np.rint(result)) & (magnitude < _EXACT_INTEGERS)
    is_scalable = (magnitude > _SMALLEST_SCALABLE) & (magnitude < _LARGEST_SCALABLE)
    pending = np.flatnonzero(is_scalable & ~is_own_decimal)
    for digit_count in _DIGITS:
        if not pending.size:
            break
        candidates = _rounded(result[pending], digit_count)
        fits = candidates.astype(np.float32) == single[pending]
        result[pending[fits]] = candidates[fits]
        pending = pending[~fits]
    extremes = np.flatnonzero(np.isfinite(result) & ~is_own_decimal & ~is_scalable)
    for index in chain(pending.tolist(), extremes.tolist()):
        result[index] = float(str(single[index]))
    return result.reshape(np.shape(values))


def _rounded(values: NDArray[np.float64], digit_count: int) -> NDArray[np.float64]:
    """`values` rounded to so many significant digits.

    A whole number below 2^53 divided or multiplied by an exact power of ten is the correctly rounded decimal (Clinger 1990).
    """
    places = digit_count - 1 - np.floor(np.log10(np.abs(values))).astype(np.int64)
    scale = _POWERS_OF_TEN[np.abs(places)]
    is_fraction = places >= 0
    digits = np.rint(np.where(is_fraction, values * scale, values / scale))
    return np.asarray(np.where(is_fraction, digits / scale, digits * scale))

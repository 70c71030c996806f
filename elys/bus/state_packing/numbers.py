"""Numbers as integers that compress: what is near in value becomes near in bits, and small differences become small numbers.

Everything here is a bijection of bits, whatever they are (NaN with its payload, -0.0), and works on whole arrays. Arithmetic
wraps around on purpose.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.uint32]
Array = NDArray[Any]

_ONE: Any = {2: np.uint16(1), 4: np.uint32(1), 8: np.uint64(1)}
_TOP: Any = {2: np.int16(15), 4: np.int32(31), 8: np.int64(63)}
_MAGNITUDE: Any = {4: np.int32(0x7FFFFFFF), 8: np.int64(0x7FFFFFFFFFFFFFFF)}
_SIGNED: Any = {2: np.int16, 4: np.int32, 8: np.int64}
_UNSIGNED: Any = {2: np.uint16, 4: np.uint32, 8: np.uint64}


def ordered(values: Array) -> Array:
    """Floats as signed integers of their width that rise as they rise: neighbours differ by one. -0.0 is not 0.0."""
    bits = values.view(_SIGNED[values.itemsize])
    result: Array = bits ^ ((bits >> _TOP[values.itemsize]) & _MAGNITUDE[values.itemsize])
    return result


def from_ordered(numbers: Array, dtype: Any) -> Array:
    """The floats that `ordered` made these of."""
    result: Array = (numbers ^ ((numbers >> _TOP[numbers.itemsize]) & _MAGNITUDE[numbers.itemsize])).view(dtype)
    return result


def folded(numbers: Array) -> Array:
    """Signed integers as unsigned ones, small where they were near 0: 0, -1, 1, -2, ... become 0, 1, 2, 3, ..."""
    width = numbers.itemsize
    result: Array = ((numbers << numbers.dtype.type(1)) ^ (numbers >> _TOP[width])).view(_UNSIGNED[width])
    return result


def unfolded(words: Array) -> Array:
    """The signed integers that `folded` made these of."""
    width = words.itemsize
    one = _ONE[width]
    result: Array = ((words >> one) ^ (~(words & one) + one)).view(_SIGNED[width])
    return result


def turned(values: NDArray[np.float32]) -> Words:
    """Bits of floats with the sign moved to the end, so that the first byte is the whole exponent."""
    bits = values.view(np.uint32)
    return (bits << np.uint32(1)) | (bits >> np.uint32(31))


def from_turned(words: Words) -> NDArray[np.float32]:
    """The floats that `turned` made these of."""
    return ((words >> np.uint32(1)) | (words << np.uint32(31))).view(np.float32)


def finite(values: Array) -> Array:
    """The same with 0 for what is no number: what NaN an operation makes is the processor's choice, and must decide nothing."""
    is_number = np.isfinite(values)
    return values if is_number.all() else np.where(is_number, values, values.dtype.type(0))

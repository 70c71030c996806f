"""What the array functions agree on: which precision they compute in."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.floating[Any]]


def as_floats(*values: ArrayLike) -> tuple[Floats, ...]:
    """The values as float arrays of one precision: float32 if all arrays among them are, else float64."""
    arrays = [np.asarray(value) for value in values]
    dtype = np.float32 if all(array.dtype == np.float32 for array in arrays) else np.float64
    return tuple(array.astype(dtype, copy=False) for array in arrays)

"""Boxes along the axes, given by their lower and upper corners (..., 3). An empty box has its lower above its upper corner."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from elys.common.math.arrays import Floats, as_floats


def bounds_of_points(points: ArrayLike) -> tuple[Floats, Floats]:
    """Corners (3,) of the smallest box around points (N, 3); of none: (+inf, -inf)."""
    (p,) = as_floats(points)
    if len(p) == 0:
        return np.full(3, np.inf, dtype=p.dtype), np.full(3, -np.inf, dtype=p.dtype)
    return p.min(axis=0), p.max(axis=0)


def transform_bounds(affine: ArrayLike, lower: ArrayLike, upper: ArrayLike) -> tuple[Floats, Floats]:
    """Corners (..., 3) of the smallest boxes around boxes that transforms (..., 3, 4) took along."""
    m, low, high = as_floats(affine, lower, upper)
    # Arvo, "Transforming axis-aligned bounding boxes", Graphics Gems I: each axis adds the smaller and the larger product.
    a = m[..., :3] * low[..., None, :]
    b = m[..., :3] * high[..., None, :]
    return m[..., 3] + np.minimum(a, b).sum(axis=-1), m[..., 3] + np.maximum(a, b).sum(axis=-1)


def union_bounds(lower: ArrayLike, upper: ArrayLike) -> tuple[Floats, Floats]:
    """Corners (3,) of the smallest box around boxes (N, 3); of none: (+inf, -inf)."""
    low, high = as_floats(lower, upper)
    return bounds_of_points(low)[0], bounds_of_points(high)[1]

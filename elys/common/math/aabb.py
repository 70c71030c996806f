"""Boxes along the axes, given by their lower and upper corners (..., 3). An empty box has its lower above its upper corner."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

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


def overlaps(lower_a: ArrayLike, upper_a: ArrayLike, lower_b: ArrayLike, upper_b: ArrayLike) -> NDArray[np.bool_]:
    """Whether boxes share at least a point (...)."""
    low_a, high_a, low_b, high_b = as_floats(lower_a, upper_a, lower_b, upper_b)
    return np.asarray(((low_a <= high_b) & (low_b <= high_a)).all(axis=-1))


def ray_distance(origin: ArrayLike, direction: ArrayLike, lower: ArrayLike, upper: ArrayLike) -> Floats:
    """How far along rays (..., 3) boxes are first met, in lengths of `direction`: 0 from inside, +inf for a miss (...)."""
    o, d, low, high = as_floats(origin, direction, lower, upper)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        a, b = (low - o) / d, (high - o) / d
    # 0 / 0: the ray runs within the slab's face, which belongs to the box.
    enter = np.where(np.isnan(a) | np.isnan(b), -np.inf, np.minimum(a, b)).max(axis=-1)
    leave = np.where(np.isnan(a) | np.isnan(b), np.inf, np.maximum(a, b)).min(axis=-1)
    return np.asarray(np.where((enter <= leave) & (leave >= 0), np.maximum(enter, 0), np.inf))

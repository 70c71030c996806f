"""Boxes along the axes: `Aabb` holds many at once; the functions take their lower and upper corners (..., 3).

An empty box has its lower above its upper corner; it overlaps and holds nothing, and merging it changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from elys.common.math.arrays import Floats, as_floats
from elys.common.math.slabs import BoxRay, BoxSweep, checked, ray_between_slabs, sweep_between_slabs

_AXES = np.eye(3)
_CORNERS = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])


@dataclass(frozen=True, slots=True, eq=False, init=False)
class Aabb:
    """Axis-aligned boxes, closed: what touches overlaps. Shapes broadcast against each other over the leading dimensions.

    `Aabb((0, 0, 0), (1, 1, 1))` is one box; corners (N, 3) are N boxes, and each method then answers with N rows.
    """

    lower: Floats  # (..., 3) [m]
    upper: Floats  # (..., 3) [m]

    def __init__(self, lower: ArrayLike, upper: ArrayLike) -> None:
        low, high = np.broadcast_arrays(*as_floats(lower, upper))
        if low.ndim == 0 or low.shape[-1] != 3:
            raise ValueError(f"the corners of boxes are arrays (..., 3), not {low.shape}")
        object.__setattr__(self, "lower", low)
        object.__setattr__(self, "upper", high)

    @classmethod
    def from_center(cls, center: ArrayLike, half_extents: ArrayLike) -> Aabb:
        """Boxes around centres (..., 3) that reach `half_extents` (..., 3) to both sides [m]."""
        middle, half = as_floats(center, half_extents)
        return cls(middle - half, middle + half)

    @classmethod
    def from_points(cls, points: ArrayLike) -> Aabb:
        """The smallest boxes around points (..., N, 3); around none an empty box."""
        (p,) = as_floats(points)
        if p.shape[-2] == 0:
            shape = (*p.shape[:-2], 3)
            return cls(np.full(shape, np.inf, p.dtype), np.full(shape, -np.inf, p.dtype))
        return cls(p.min(axis=-2), p.max(axis=-2))

    @property
    def center(self) -> Floats:
        """(..., 3) [m]; 0 for an empty box."""
        empty = self.is_empty[..., None]
        return 0.5 * (np.where(empty, 0, self.lower) + np.where(empty, 0, self.upper))

    @property
    def half_extents(self) -> Floats:
        """(..., 3) from the centre to each side [m]; 0 for an empty box."""
        empty = self.is_empty[..., None]
        return 0.5 * (np.where(empty, 0, self.upper) - np.where(empty, 0, self.lower))

    @property
    def is_empty(self) -> NDArray[np.bool_]:
        """(...) where the lower corner is above the upper one."""
        return np.asarray((self.lower > self.upper).any(axis=-1))

    @property
    def volume(self) -> Floats:
        """(...) [m^3], 0 for an empty box."""
        return np.where(self.is_empty, 0, np.prod(2 * self.half_extents, axis=-1))

    @property
    def corners(self) -> Floats:
        """(..., 8, 3) [m]."""
        span = (self.upper - self.lower)[..., None, :]
        return self.lower[..., None, :] + span * _CORNERS.astype(self.lower.dtype)

    def contains_point(self, point: ArrayLike) -> NDArray[np.bool_]:
        """(...) whether points (..., 3) lie inside or on the surface."""
        (p,) = as_floats(point)
        return np.asarray(((self.lower <= p) & (p <= self.upper)).all(axis=-1))

    def contains(self, other: Aabb) -> NDArray[np.bool_]:
        """(...) whether the other boxes lie inside; an empty one lies in every box."""
        inside = ((self.lower <= other.lower) & (other.upper <= self.upper)).all(axis=-1)
        return inside | other.is_empty

    def overlaps(self, other: Aabb) -> NDArray[np.bool_]:
        """(...) whether boxes share at least a point."""
        apart = (self.lower > other.upper) | (other.lower > self.upper)
        return ~(apart.any(axis=-1) | self.is_empty | other.is_empty)

    def closest_point(self, point: ArrayLike) -> Floats:
        """(..., 3) the nearest point of the box to points (..., 3): the point itself where it is inside."""
        (p,) = as_floats(point)
        return np.clip(p, self.lower, self.upper)

    def distance(self, point: ArrayLike) -> Floats:
        """(...) how far points (..., 3) are outside, 0 inside [m]."""
        return np.asarray(np.linalg.norm(np.asarray(point) - self.closest_point(point), axis=-1))

    def merged(self, other: Aabb) -> Aabb:
        """The smallest boxes around both."""
        return Aabb(np.minimum(self.lower, other.lower), np.maximum(self.upper, other.upper))

    def union(self) -> Aabb:
        """The smallest box around all of them."""
        return Aabb(*union_bounds(self.lower.reshape(-1, 3), self.upper.reshape(-1, 3)))

    def intersection(self, other: Aabb) -> Aabb:
        """What both share; empty where they do not overlap."""
        return Aabb(np.maximum(self.lower, other.lower), np.minimum(self.upper, other.upper))

    def expanded(self, margin: ArrayLike) -> Aabb:
        """Boxes that reach farther by `margin`, one length or (..., 3) [m]."""
        return Aabb(self.lower - np.asarray(margin), self.upper + np.asarray(margin))

    def transformed(self, affine: ArrayLike) -> Aabb:
        """The smallest boxes around these boxes taken along by transforms (..., 3, 4)."""
        return Aabb(*transform_bounds(affine, self.lower, self.upper))

    def raycast(self, origin: ArrayLike, direction: ArrayLike, max_distance: ArrayLike = np.inf) -> BoxRay:
        """Where rays from `origin` (..., 3) along `direction` (..., 3), of any length but 0, enter and leave.

        A ray that begins inside enters at 0 with a normal against its direction; see BoxRay.
        """
        offset = self.center - checked("origin", origin)
        ray = ray_between_slabs(offset, self.half_extents, direction, _AXES, max_distance)
        return ray.without(self.is_empty)

    def sweep(self, displacement: ArrayLike, other: Aabb) -> BoxSweep:
        """When these boxes, moved by `displacement` (..., 3) [m], first touch boxes that stand still; see BoxSweep."""
        reach = self.half_extents + other.half_extents
        swept = sweep_between_slabs(other.center - self.center, reach, displacement, _AXES)
        return swept.without(self.is_empty | other.is_empty)


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

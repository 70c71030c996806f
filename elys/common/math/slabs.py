"""Rays and moving boxes against boxes, as a point that travels between pairs of parallel planes.

Two boxes that move without turning overlap exactly while their centres are close enough along each of the directions that
can separate them (Gottschalk, Lin, Manocha, "OBBTree", 1996): three for boxes of the same axes, fifteen for turned ones. A
ray is the case of a box without extent.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from elys.common.math.arrays import Floats, as_floats


class BoxRay(NamedTuple):
    """What rays meet of boxes. Where `hit` is false the distances are infinite and the normal is 0."""

    hit: NDArray[np.bool_]  # (...)
    entry: Floats  # (...) distance to the first common point, 0 for a ray that begins inside [m]
    exit: Floats  # (...) distance to the last common point [m]
    normal: Floats  # (..., 3) of the face through which the ray enters; against the ray where it begins inside

    def without(self, missed: NDArray[np.bool_]) -> BoxRay:
        """The same, with nothing hit where `missed` (...)."""
        hit = self.hit & ~missed
        entry, leave = (np.where(hit, distance, np.inf) for distance in (self.entry, self.exit))
        return BoxRay(hit, entry, leave, np.where(hit[..., None], self.normal, 0))


class BoxSweep(NamedTuple):
    """When moving boxes touch boxes that stand still. Where `hit` is false the fraction is infinite and the normal is 0."""

    hit: NDArray[np.bool_]  # (...)
    fraction: Floats  # (...) of the displacement at the first touch, 0 where the boxes overlap before
    normal: Floats  # (..., 3) unit, out of the still box; the shallowest way out where they overlap before

    def without(self, missed: NDArray[np.bool_]) -> BoxSweep:
        """The same, with nothing hit where `missed` (...)."""
        hit = self.hit & ~missed
        return BoxSweep(hit, np.where(hit, self.fraction, np.inf), np.where(hit[..., None], self.normal, 0))


def ray_between_slabs(
    offset: Floats, reach: Floats, direction: ArrayLike, axes: Floats, max_distance: ArrayLike
) -> BoxRay:
    """Rays against boxes whose centres lie at `offset` (..., 3) from the origins and which reach `reach` (..., K) along unit
    axes (..., K, 3)."""
    d = checked("direction", direction)
    length = np.linalg.norm(d, axis=-1, keepdims=True)
    if not (length > 0).all():
        raise ValueError("a ray needs a direction: one of them has length 0")
    d = d / length
    limit = np.asarray(max_distance, np.float64)
    if not (limit >= 0).all():
        raise ValueError("a ray ends at a distance of 0 m or more")
    entry, leave, normal = _crossing(checked("origin", offset), reach, d, axes)
    inside = entry <= 0
    hit = (entry <= leave) & (leave >= 0) & (entry <= limit)
    normal = np.where(inside[..., None], -d, normal)
    return BoxRay(hit, np.maximum(entry, 0), np.minimum(leave, limit), normal).without(~hit)


def sweep_between_slabs(offset: Floats, reach: Floats, displacement: ArrayLike, axes: Floats) -> BoxSweep:
    """Boxes that move by `displacement` (..., 3) against boxes whose centres lie at `offset` (..., 3) from theirs and which
    they overlap while closer than `reach` (..., K) along each of the axes (..., K, 3). An axis of length 0 tells nothing."""
    entry, leave, normal = _crossing(offset, reach, checked("displacement", displacement), axes)
    hit = (entry <= leave) & (leave >= 0) & (entry <= 1)
    away = -np.einsum("...kj,...j->...k", axes, offset)
    depth = np.where((axes != 0).any(axis=-1), reach - abs(away), np.inf)
    shallowest = np.expand_dims(depth.argmin(axis=-1), -1)
    side = np.where(np.take_along_axis(away, shallowest, -1) < 0, -1, 1)
    out = side * np.take_along_axis(np.broadcast_to(axes, (*depth.shape, 3)), shallowest[..., None], -2)[..., 0, :]
    normal = np.where((entry <= 0)[..., None], out, normal)
    return BoxSweep(hit, np.maximum(entry, 0), normal).without(~hit)


def checked(name: str, values: ArrayLike) -> Floats:
    """Vectors (..., 3); ValueError when they are of another shape or not finite."""
    (v,) = as_floats(values)
    if v.ndim == 0 or v.shape[-1] != 3 or not np.isfinite(v).all():
        raise ValueError(f"{name} must be finite numbers of shape (..., 3)")
    return v


def _crossing(offset: Floats, reach: Floats, motion: Floats, axes: Floats) -> tuple[Floats, Floats, Floats]:
    """Times (...) of entry and exit as multiples of `motion`, and the normal (..., 3) of the last plane entered."""
    distance = np.einsum("...kj,...j->...k", axes, offset)
    speed = np.einsum("...kj,...j->...k", axes, motion)
    distance, speed, reach = np.broadcast_arrays(distance, speed, reach)
    still = speed == 0
    rate = np.where(still, 1, abs(speed))
    ahead = np.where(speed < 0, -distance, distance)
    inside = abs(distance) <= reach
    entry = np.where(still, np.where(inside, -np.inf, np.inf), (ahead - reach) / rate)
    leave = np.where(still, np.where(inside, np.inf, -np.inf), (ahead + reach) / rate)
    last = np.expand_dims(entry.argmax(axis=-1), -1)
    toward = np.where(np.take_along_axis(speed, last, -1) > 0, -1, 1)
    axis = np.take_along_axis(np.broadcast_to(axes, (*entry.shape, 3)), last[..., None], -2)[..., 0, :]
    return entry.max(axis=-1), leave.min(axis=-1), toward * axis

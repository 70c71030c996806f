"""Boxes that are turned: `Obb` holds many at once, by centres, rotations and half extents."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from elys.common.math import quaternion
from elys.common.math.aabb import Aabb
from elys.common.math.arrays import Floats, as_floats
from elys.common.math.slabs import BoxRay, BoxSweep, checked, ray_between_slabs, sweep_between_slabs

_SIGNS = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])

# Edges closer to parallel than this span no direction of their own: the faces' directions separate such boxes as well.
_PARALLEL = 1e-6


@dataclass(frozen=True, slots=True, eq=False, init=False)
class Obb:
    """Oriented boxes, closed: what touches overlaps. Shapes broadcast against each other over the leading dimensions.

    Other boxes may be `Obb` or `Aabb`.
    """

    center: Floats  # (..., 3) [m]
    rotation: Floats  # (..., 4) world_from_box, x y z w
    half_extents: Floats  # (..., 3) along the box's own axes [m]

    def __init__(self, center: ArrayLike, rotation: ArrayLike, half_extents: ArrayLike) -> None:
        middle, turn, half = as_floats(center, rotation, half_extents)
        if middle.shape[-1:] != (3,) or turn.shape[-1:] != (4,) or half.shape[-1:] != (3,):
            shapes = f"{middle.shape}, {turn.shape} and {half.shape}"
            raise ValueError(
                f"turned boxes are centres (..., 3), rotations (..., 4), half extents (..., 3), not {shapes}"
            )
        if not (half >= 0).all():
            raise ValueError("the half extents of a box are 0 m or more")
        object.__setattr__(self, "center", middle)
        object.__setattr__(self, "rotation", quaternion.normalize(turn))
        object.__setattr__(self, "half_extents", half)

    @classmethod
    def from_aabb(cls, box: Aabb) -> Obb:
        """The same boxes, not turned."""
        return cls(box.center, quaternion.IDENTITY.astype(box.lower.dtype), box.half_extents)

    @classmethod
    def from_points(cls, points: ArrayLike) -> Obb:
        """Small boxes around points (..., N, 3), N at least 1: along the principal axes of the points, or along the world's
        where that is smaller. Close to the smallest there is, never larger than the axis-aligned one."""
        p = checked("points", points)
        if p.ndim < 2 or p.shape[-2] == 0:
            raise ValueError("a turned box needs at least one point")
        return _smallest_around(p, [_principal_axes(p), np.broadcast_to(np.eye(3), (*p.shape[:-2], 3, 3))])

    @property
    def axes(self) -> Floats:
        """(..., 3, 3) the box's x, y and z axes in world space, one a row."""
        return np.swapaxes(quaternion.to_matrix(self.rotation), -1, -2)

    @property
    def volume(self) -> Floats:
        """(...) [m^3]."""
        return np.asarray(np.prod(2 * self.half_extents, axis=-1))

    @property
    def corners(self) -> Floats:
        """(..., 8, 3) [m]."""
        local = self.half_extents[..., None, :] * _SIGNS.astype(self.half_extents.dtype)
        return self.center[..., None, :] + local @ self.axes

    @property
    def bounds(self) -> Aabb:
        """The smallest axis-aligned boxes around them."""
        return Aabb.from_center(self.center, (self.half_extents[..., None] * abs(self.axes)).sum(axis=-2))

    def to_local(self, point: ArrayLike) -> Floats:
        """Points (..., 3) of the world as the boxes see them, from their centres along their axes."""
        (p,) = as_floats(point)
        return quaternion.rotate(quaternion.conjugate(self.rotation), p - self.center)

    def contains_point(self, point: ArrayLike) -> NDArray[np.bool_]:
        """(...) whether points (..., 3) lie inside or on the surface."""
        return np.asarray((abs(self.to_local(point)) <= self.half_extents).all(axis=-1))

    def contains(self, other: Obb | Aabb) -> NDArray[np.bool_]:
        """(...) whether other boxes lie inside, to within rounding."""
        inner = _as_obb(other)
        offset = np.einsum("...ij,...j->...i", self.axes, inner.center - self.center)
        reach = (abs(self.axes @ np.swapaxes(inner.axes, -1, -2)) * inner.half_extents[..., None, :]).sum(axis=-1)
        scale = np.maximum(abs(offset) + reach, self.half_extents)
        rounding = 8 * np.finfo(scale.dtype).eps * scale
        return np.asarray((abs(offset) + reach <= self.half_extents + rounding).all(axis=-1))

    def overlaps(self, other: Obb | Aabb) -> NDArray[np.bool_]:
        """(...) whether boxes share at least a point, by the fifteen directions that can separate two boxes."""
        offset, reach, axes = _separation(self, _as_obb(other))
        return np.asarray((abs(np.einsum("...kj,...j->...k", axes, offset)) <= reach).all(axis=-1))

    def closest_point(self, point: ArrayLike) -> Floats:
        """(..., 3) the nearest point of the box to points (..., 3): the point itself where it is inside."""
        local = np.clip(self.to_local(point), -self.half_extents, self.half_extents)
        return self.center + quaternion.rotate(self.rotation, local)

    def distance(self, point: ArrayLike) -> Floats:
        """(...) how far points (..., 3) are outside, 0 inside [m]."""
        return np.asarray(np.linalg.norm(np.maximum(abs(self.to_local(point)) - self.half_extents, 0), axis=-1))

    def merged(self, other: Obb | Aabb) -> Obb:
        """Small boxes around both: the smallest of those along either's axes and along their corners' principal axes."""
        second = _as_obb(other)
        corners = np.broadcast_arrays(self.corners, second.corners)
        points = np.concatenate(corners, axis=-2)
        shape = (*points.shape[:-2], 3, 3)
        candidates = [np.broadcast_to(box.axes, shape) for box in (self, second)]
        return _smallest_around(points, [*candidates, _principal_axes(points)])

    def expanded(self, margin: ArrayLike) -> Obb:
        """Boxes that reach farther by `margin`, one length or (..., 3) along their own axes [m]."""
        return Obb(self.center, self.rotation, self.half_extents + np.asarray(margin))

    def transformed(self, position: ArrayLike, rotation: ArrayLike, scale: ArrayLike = 1.0) -> Obb:
        """The boxes scaled by factors (...), then turned by quaternions (..., 4), then moved by (..., 3) [m]."""
        p, q, s = as_floats(position, rotation, scale)
        factor = s[..., None]
        center = p + quaternion.rotate(q, factor * self.center)
        return Obb(center, quaternion.multiply(q, self.rotation), abs(factor) * self.half_extents)

    def raycast(self, origin: ArrayLike, direction: ArrayLike, max_distance: ArrayLike = np.inf) -> BoxRay:
        """Where rays from `origin` (..., 3) along `direction` (..., 3), of any length but 0, enter and leave.

        A ray that begins inside enters at 0 with a normal against its direction; see BoxRay.
        """
        offset = self.center - checked("origin", origin)
        return ray_between_slabs(offset, self.half_extents, direction, self.axes, max_distance)

    def sweep(self, displacement: ArrayLike, other: Obb | Aabb) -> BoxSweep:
        """When these boxes, moved by `displacement` (..., 3) [m] without turning, first touch others; see BoxSweep."""
        offset, reach, axes = _separation(self, _as_obb(other))
        return sweep_between_slabs(offset, reach, displacement, axes)


def _as_obb(box: Obb | Aabb) -> Obb:
    return Obb.from_aabb(box) if isinstance(box, Aabb) else box


def _separation(a: Obb, b: Obb) -> tuple[Floats, Floats, Floats]:
    """From a's centre to b's (..., 3), and along fifteen axes (..., 15, 3) how close the centres of touching boxes are."""
    axes_a, axes_b = np.broadcast_arrays(a.axes, b.axes)
    crossed = np.cross(axes_a[..., :, None, :], axes_b[..., None, :, :]).reshape(*axes_a.shape[:-2], 9, 3)
    length = np.linalg.norm(crossed, axis=-1, keepdims=True)
    crossed = np.where(length > _PARALLEL, crossed / np.maximum(length, _PARALLEL), 0)
    axes = np.concatenate([axes_a, axes_b, crossed], axis=-2)
    reach = (abs(axes @ np.swapaxes(axes_a, -1, -2)) * a.half_extents[..., None, :]).sum(axis=-1)
    reach = reach + (abs(axes @ np.swapaxes(axes_b, -1, -2)) * b.half_extents[..., None, :]).sum(axis=-1)
    return b.center - a.center, reach, axes


def _principal_axes(points: Floats) -> Floats:
    """(..., 3, 3) right-handed unit axes, one a row, of points (..., N, 3)."""
    away = points - points.mean(axis=-2, keepdims=True)
    axes = np.swapaxes(np.linalg.eigh(np.swapaxes(away, -1, -2) @ away)[1], -1, -2).copy()
    axes[..., 2, :] = np.cross(axes[..., 0, :], axes[..., 1, :])
    return axes


def _smallest_around(points: Floats, candidates: list[Floats]) -> Obb:
    """Boxes around points (..., N, 3) along those of the candidate axes (..., 3, 3) that make each the smallest."""
    axes = np.stack(candidates, axis=-3)
    along = np.einsum("...cij,...nj->...cni", axes, points)
    low, high = along.min(axis=-2), along.max(axis=-2)
    # Flat point sets have no volume along any axes: the surface decides there.
    x, y, z = np.moveaxis(high - low, -1, 0)
    best = np.lexsort((x * y + y * z + z * x, x * y * z), axis=-1)[..., :1, None]
    low, high = (np.take_along_axis(side, best, -2)[..., 0, :] for side in (low, high))
    chosen = np.take_along_axis(axes, best[..., None], -3)[..., 0, :, :]
    center = np.einsum("...i,...ij->...j", 0.5 * (low + high), chosen)
    return Obb(center, quaternion.from_matrix(np.swapaxes(chosen, -1, -2)), 0.5 * (high - low))

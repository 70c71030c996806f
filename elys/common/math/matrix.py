"""Affine transforms (..., 3, 4): the upper rows of a 4x4 matrix whose last row is 0 0 0 1, columns times vectors.

Named by both spaces: `world_from_parent` takes points of the parent's space to the world's, and
`multiply_affine(world_from_parent, parent_from_local)` is `world_from_local`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from elys.common.math import quaternion
from elys.common.math.arrays import Floats, as_floats


def compose_affine(position: ArrayLike, rotation: ArrayLike, scale: ArrayLike) -> Floats:
    """(..., 3, 4) that scales, then turns, then moves: positions (..., 3), unit quaternions (..., 4), scales (..., 3)."""
    p, q, s = as_floats(position, rotation, scale)
    linear = quaternion.to_matrix(q) * s[..., None, :]
    shape = np.broadcast_shapes(linear.shape[:-2], p.shape[:-1])
    affine = np.empty((*shape, 3, 4), dtype=linear.dtype)
    affine[..., :3] = linear
    affine[..., 3] = p
    return affine


def multiply_affine(outer: ArrayLike, inner: ArrayLike) -> Floats:
    """(..., 3, 4): `inner` first, then `outer`."""
    a, b = as_floats(outer, inner)
    product = a[..., :3] @ b
    product[..., 3] += a[..., 3]
    return product


def inverse_affine(affine: ArrayLike) -> Floats:
    """(..., 3, 4) that undoes `affine`; raises numpy's LinAlgError where a scale is 0."""
    (m,) = as_floats(affine)
    x, y, z = m[..., 0], m[..., 1], m[..., 2]
    # Cramer's rule: at 3x3 five times as fast over many as LAPACK, which takes them one by one.
    rows = np.stack((np.cross(y, z), np.cross(z, x), np.cross(x, y)), axis=-2)
    determinant = np.sum(rows[..., 0, :] * x, axis=-1)[..., None, None]
    if not np.all(determinant):
        raise np.linalg.LinAlgError("a transform with a scale of 0 has no inverse")
    inverted = np.empty_like(m)
    inverted[..., :3] = rows / determinant
    inverted[..., 3] = -np.einsum("...ij,...j->...i", inverted[..., :3], m[..., 3])
    return inverted


def decompose_affine(affine: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Position (..., 3), rotation (..., 4) and scale (..., 3) whose composition is `affine`.

    Shear, which these three cannot hold, is lost: the axes keep their lengths, and x its direction. A mirrored transform gets a
    negative scale along x.
    """
    (m,) = as_floats(affine)
    linear = m[..., :3]
    scale = np.linalg.norm(linear, axis=-2)
    mirrored = np.sum(np.cross(linear[..., 0], linear[..., 1]) * linear[..., 2], axis=-1) < 0
    signed = scale.copy()
    signed[..., 0] = np.where(mirrored, -scale[..., 0], scale[..., 0])
    return m[..., 3], quaternion.from_matrix(_orthonormal_axes(linear, signed)), signed


def _orthonormal_axes(linear: Floats, scale: Floats) -> Floats:
    """The rotation (..., 3, 3) nearest to the axes of `linear`, the first kept (Gram and Schmidt); lost axes are made up."""
    axes = linear / np.where(scale == 0, 1, scale)[..., None, :]
    other = _unit_or(axes[..., 2], axes[..., 1], (0, 0, 1))
    x = _unit_or(axes[..., 0], np.cross(axes[..., 1], axes[..., 2]), _perpendicular(other))
    y = axes[..., 1] - x * np.sum(x * axes[..., 1], axis=-1, keepdims=True)
    y = _unit_or(y, np.cross(axes[..., 2], x), _perpendicular(x))
    return np.stack((x, y, np.cross(x, y)), axis=-1)


def _unit_or(vector: Floats, second: Floats, third: ArrayLike) -> Floats:
    """The first of three choices that has a length, at length 1."""
    chosen = np.broadcast_to(np.asarray(third, dtype=vector.dtype), vector.shape)
    for candidate in (second, vector):
        length = np.linalg.norm(candidate, axis=-1, keepdims=True)
        chosen = np.where(length > 1e-6, candidate / np.where(length > 0, length, 1), chosen)
    return chosen


def _perpendicular(unit: Floats) -> Floats:
    other = np.where(np.abs(unit[..., :1]) < 0.9, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)).astype(unit.dtype)
    crossed = np.cross(unit, other)
    return np.asarray(crossed / np.linalg.norm(crossed, axis=-1, keepdims=True), dtype=unit.dtype)


def affine_to_mat4(affine: ArrayLike) -> Floats:
    """The whole matrix (..., 4, 4), row by row; GL wants its transpose."""
    (m,) = as_floats(affine)
    whole = np.zeros((*m.shape[:-2], 4, 4), dtype=m.dtype)
    whole[..., :3, :] = m
    whole[..., 3, 3] = 1
    return whole


def transform_points(affine: ArrayLike, points: ArrayLike) -> Floats:
    """Points (..., 3) taken along by transforms (..., 3, 4)."""
    m, p = as_floats(affine, points)
    moved: Floats = np.einsum("...ij,...j->...i", m[..., :3], p) + m[..., 3]
    return moved


def perspective(field_of_view: float, aspect: float, near: float, far: float) -> NDArray[np.float64]:
    """clip_from_view (4, 4) as GL has it: looking along -z, depth -1 at `near` and 1 at `far` [m].

    `field_of_view` is the vertical opening angle [rad], `aspect` width over height.
    """
    focal = 1.0 / np.tan(field_of_view / 2.0)
    matrix = np.zeros((4, 4))
    matrix[0, 0] = focal / aspect
    matrix[1, 1] = focal
    matrix[2, 2] = (far + near) / (near - far)
    matrix[2, 3] = 2.0 * far * near / (near - far)
    matrix[3, 2] = -1.0
    return matrix


def orthographic(height: float, aspect: float, near: float, far: float) -> NDArray[np.float64]:
    """clip_from_view (4, 4) of a parallel view `height` [m] high, as `perspective` has it otherwise."""
    matrix = np.eye(4)
    matrix[0, 0] = 2.0 / (height * aspect)
    matrix[1, 1] = 2.0 / height
    matrix[2, 2] = 2.0 / (near - far)
    matrix[2, 3] = (far + near) / (near - far)
    return matrix


def look_at(eye: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 1.0, 0.0)) -> NDArray[np.float64]:
    """view_from_world (3, 4) of a camera at `eye` (3,) that looks at `target`, upright along `up`."""
    rotation = look_rotation(np.subtract(target, eye), up)
    world_from_view = compose_affine(np.asarray(eye, dtype=np.float64), rotation, np.ones(3))
    return inverse_affine(world_from_view).astype(np.float64, copy=False)


def look_rotation(direction: ArrayLike, up: ArrayLike = (0.0, 1.0, 0.0)) -> NDArray[np.float64]:
    """The quaternion (4,) that turns -z to `direction` (3,) with y towards `up`, as cameras and lights need it."""
    forward = np.asarray(direction, dtype=np.float64)
    length = np.linalg.norm(forward)
    backward = -forward / length if length > 0 else np.array((0.0, 0.0, 1.0))
    right = np.cross(np.asarray(up, dtype=np.float64), backward)
    if np.linalg.norm(right) < 1e-9:
        right = _perpendicular(backward)
    right /= np.linalg.norm(right)
    axes = np.stack((right, np.cross(backward, right), backward), axis=-1)
    return quaternion.from_matrix(axes).astype(np.float64, copy=False)


def depth_levels(parents: NDArray[np.integer]) -> list[NDArray[np.intp]]:
    """The rows of each depth of a hierarchy, the roots' first; `parents` (N,) holds each row's parent row, negative for none."""
    count = len(parents)
    # Pointer doubling: each round a row looks twice as far up, so a chain of n costs log2 n rounds. Row `count`
    # stands above all roots.
    ancestor = np.append(np.where(parents < 0, count, parents), count).astype(np.intp)
    depth = np.append(parents >= 0, False).astype(np.intp)
    while (ancestor != count).any():
        depth += depth[ancestor]
        ancestor = ancestor[ancestor]
    depth = depth[:count]
    order = np.argsort(depth, kind="stable")
    return np.split(order, np.cumsum(np.bincount(depth))[:-1]) if count else []


def propagate_affine(
    parents: NDArray[np.integer],
    parent_from_local: ArrayLike,
    *,
    levels: Sequence[NDArray[np.intp]] | None = None,
) -> Floats:
    """world_from_local (N, 3, 4) of a hierarchy given by each row's parent row (N,) and local transforms (N, 3, 4).

    `levels` are `depth_levels(parents)`, for who keeps them while the hierarchy stays the same.
    """
    (local,) = as_floats(parent_from_local)
    world = local.copy()
    for rows in (depth_levels(parents) if levels is None else levels)[1:]:
        world[rows] = multiply_affine(world[parents[rows]], local[rows])
    return world

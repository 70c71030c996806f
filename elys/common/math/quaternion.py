"""Rotations as unit quaternions x y z w, arrays of shape (..., 4).

Everything broadcasts over the leading dimensions. Products read like matrices: `multiply(b, a)` turns by a, then by b.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from elys.common.math.arrays import Floats, as_floats

IDENTITY: Final[NDArray[np.float64]] = np.array((0.0, 0.0, 0.0, 1.0))
IDENTITY.setflags(write=False)

_SERIES_TERMS: Final = 10  # each is a twentieth of the one before, or less


def multiply(left: ArrayLike, right: ArrayLike) -> Floats:
    """Hamilton's product (..., 4): the rotation `right` followed by `left`."""
    a, b = as_floats(left, right)
    ax, ay, az, aw = (a[..., i] for i in range(4))
    bx, by, bz, bw = (b[..., i] for i in range(4))
    return np.stack(
        (
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ),
        axis=-1,
    )


def conjugate(rotation: ArrayLike) -> Floats:
    """The inverse (..., 4) of unit quaternions."""
    (q,) = as_floats(rotation)
    return q * np.array((-1, -1, -1, 1), dtype=q.dtype)


def inverse(rotation: ArrayLike) -> Floats:
    """The inverse (..., 4) of quaternions of any length but 0."""
    (q,) = as_floats(rotation)
    squared_length: Floats = np.sum(q * q, axis=-1, keepdims=True)
    return conjugate(q) / squared_length


def normalize(rotation: ArrayLike) -> Floats:
    """Scaled to unit length; what has no length becomes the identity."""
    (q,) = as_floats(rotation)
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    safe = np.where(length > 0, length, 1)
    return np.where(length > 0, q / safe, IDENTITY.astype(q.dtype))


def rotate(rotation: ArrayLike, vector: ArrayLike) -> Floats:
    """Vectors (..., 3) turned by unit quaternions (..., 4)."""
    q, v = as_floats(rotation, vector)
    # v + 2 w (u x v) + 2 u x (u x v), with u the vector part.
    twice = 2 * np.cross(q[..., :3], v)
    return v + q[..., 3:] * twice + np.cross(q[..., :3], twice)


def from_axis_angle(axis: ArrayLike, angle: ArrayLike) -> Floats:
    """Turns by `angle` [rad] (...) about `axis` (..., 3), which needs no unit length."""
    a, half = as_floats(axis, angle)
    half = half * 0.5
    length = np.linalg.norm(a, axis=-1, keepdims=True)
    unit = a / np.where(length > 0, length, 1)
    xyz = unit * np.sin(half)[..., None]
    return np.concatenate((xyz, np.broadcast_to(np.cos(half)[..., None], (*xyz.shape[:-1], 1))), axis=-1)


def from_euler(angles: ArrayLike) -> Floats:
    """From angles x y z [rad] (..., 3): first about the x axis, then y, then z, all fixed in the parent."""
    (a,) = as_floats(angles)
    sx, sy, sz = (np.sin(a[..., i] * 0.5) for i in range(3))
    cx, cy, cz = (np.cos(a[..., i] * 0.5) for i in range(3))
    return np.stack(
        (
            sx * cy * cz - cx * sy * sz,
            cx * sy * cz + sx * cy * sz,
            cx * cy * sz - sx * sy * cz,
            cx * cy * cz + sx * sy * sz,
        ),
        axis=-1,
    )


def to_euler(rotation: ArrayLike) -> Floats:
    """Angles x y z [rad] (..., 3) that `from_euler` turns into the same rotation; at y = +-90 degrees z is 0."""
    (q,) = as_floats(rotation)
    x, y, z, w = (q[..., i] for i in range(4))
    sine_y = np.clip(2 * (w * y - x * z), -1, 1)
    locked = np.abs(sine_y) > 1 - 1e-7
    about_x = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    about_z = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    # Looking straight up or down, x and z turn about the same line: all of it is given to x.
    locked_x = 2 * np.arctan2(x, w)
    locked_x = np.remainder(locked_x + np.pi, 2 * np.pi) - np.pi
    return np.stack(
        (np.where(locked, locked_x, about_x), np.arcsin(sine_y), np.where(locked, 0, about_z)), axis=-1
    ).astype(q.dtype, copy=False)


def to_matrix(rotation: ArrayLike) -> Floats:
    """Rotation matrices (..., 3, 3) of unit quaternions."""
    (q,) = as_floats(rotation)
    x, y, z, w = (q[..., i] for i in range(4))
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def from_matrix(matrix: ArrayLike) -> Floats:
    """Unit quaternions (..., 4) with w >= 0 of rotation matrices (..., 3, 3)."""
    (m,) = as_floats(matrix)
    # Bar-Itzhack: 4 times the outer product of the quaternion with itself is linear in the matrix. Its longest column is the
    # one that suffers least from cancellation.
    m00, m01, m02, m10, m11, m12, m20, m21, m22 = (m[..., i, j] for i in range(3) for j in range(3))
    columns = np.stack(
        (
            np.stack((1 + m00 - m11 - m22, m01 + m10, m02 + m20, m21 - m12), axis=-1),
            np.stack((m01 + m10, 1 - m00 + m11 - m22, m12 + m21, m02 - m20), axis=-1),
            np.stack((m02 + m20, m12 + m21, 1 - m00 - m11 + m22, m10 - m01), axis=-1),
            np.stack((m21 - m12, m02 - m20, m10 - m01, 1 + m00 + m11 + m22), axis=-1),
        ),
        axis=-2,
    )
    longest = np.argmax(np.diagonal(columns, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(columns, longest[..., None, None], axis=-2)[..., 0, :]
    return normalize(np.where(q[..., 3:] < 0, -q, q))


def nlerp(start: ArrayLike, end: ArrayLike, fraction: ArrayLike) -> Floats:
    """Between two rotations on the short way, `fraction` (...) of it, at a speed that is only nearly even."""
    a, b, t = as_floats(start, end, fraction)
    b = np.where(np.sum(a * b, axis=-1, keepdims=True) < 0, -b, b)
    t = t[..., None]
    return normalize(a * (1 - t) + b * t)


def slerp(start: ArrayLike, end: ArrayLike, fraction: ArrayLike) -> Floats:
    """Between two rotations on the short way, `fraction` (...) of it from 0 to 1, at an even speed.

    Takes sums, products, quotients and roots alone, whose bits are the same on every machine; sines are not. Two halvings leave
    an angle of at most pi/8, over which the series of Eberly (A Fast and Accurate Algorithm for Computing SLERP, 2011) is exact
    to rounding.
    """
    a, b, t = as_floats(start, end, fraction)
    t = t[..., None]
    b = np.where(_dot(a, b) < 0, -b, b)
    for _ in range(2):
        middle = _unit(a + b)
        is_late = t > 0.5
        a, b = np.where(is_late, middle, a), np.where(is_late, b, middle)
        t = np.where(is_late, 2 * t - 1, 2 * t)
    below = _dot(a, b) - 1
    return _unit(_sine_share(1 - t, below) * a + _sine_share(t, below) * b)


def _sine_share(fraction: Floats, below: Floats) -> Floats:
    """sin(t angle) / sin(angle) of an angle whose cosine is 1 + `below`."""
    squared, series = fraction * fraction, np.ones_like(fraction)
    for term in range(_SERIES_TERMS, 0, -1):
        series = 1 + series * below * (squared / (term * (2 * term + 1)) - term / (2 * term + 1))
    return fraction * series


def _dot(a: Floats, b: Floats) -> Floats:
    """Added in a written order, which a reduction does not promise."""
    product = a * b
    return (product[..., 0:1] + product[..., 1:2]) + (product[..., 2:3] + product[..., 3:4])


def _unit(q: Floats) -> Floats:
    squared = _dot(q, q)
    return q / np.sqrt(np.where(squared > 0, squared, 1))

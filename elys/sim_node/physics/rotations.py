"""Quaternions x y z w, in rows: the array side of kernels/rotation.py."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


def multiply(a: Array, b: Array) -> Array:
    """The quaternions a b (N, 4): first b's turn, then a's."""
    ax, ay, az, aw = a.T
    bx, by, bz, bw = b.T
    return np.stack(
        [
            aw * bx + bw * ax + ay * bz - az * by,
            aw * by + bw * ay + az * bx - ax * bz,
            aw * bz + bw * az + ax * by - ay * bx,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        axis=1,
    )


def conjugate(q: Array) -> Array:
    """The opposite turns (N, 4)."""
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def rotate(q: Array, v: Array) -> Array:
    """The vectors v (N, 3), turned."""
    t = 2.0 * np.cross(q[:, :3], v)
    return np.asarray(v + q[:, 3:] * t + np.cross(q[:, :3], t))


def matrices(q: Array) -> Array:
    """Rotation matrices (N, 3, 3)."""
    axes = np.broadcast_to(np.eye(3), (len(q), 3, 3))
    return np.stack([rotate(q, axes[:, k]) for k in range(3)], axis=2)


def quaternions(matrix: Array) -> Array:
    """Quaternions (N, 4) of proper rotation matrices (N, 3, 3), the real part not negative.

    Of the four ways to read a quaternion from a matrix the one that divides by the largest number is taken (Shepperd, 1978).
    """
    m = matrix
    diagonal = np.stack([m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]], axis=1)
    squares = np.concatenate(
        [1.0 + 2.0 * diagonal - diagonal.sum(1, keepdims=True), 1.0 + diagonal.sum(1)[:, None]], axis=1
    )
    off = np.empty((len(m), 4, 4))
    for k in range(4):
        off[:, k, k] = squares[:, k]
    for a, b, value in (
        (0, 1, m[:, 1, 0] + m[:, 0, 1]),
        (0, 2, m[:, 2, 0] + m[:, 0, 2]),
        (1, 2, m[:, 2, 1] + m[:, 1, 2]),
        (0, 3, m[:, 2, 1] - m[:, 1, 2]),
        (1, 3, m[:, 0, 2] - m[:, 2, 0]),
        (2, 3, m[:, 1, 0] - m[:, 0, 1]),
    ):
        off[:, a, b] = off[:, b, a] = value
    largest = squares.argmax(1)
    q = off[np.arange(len(m)), largest]
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    return np.where(q[:, 3:] < 0.0, -q, q)

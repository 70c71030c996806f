"""How bodies turn from one state frame to the next."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.common.math import quaternion

# Cosine of half the turn above which a chord does for the arc: below 0.1 rad they are 1e-5 rad apart at most, at half the cost.
_SMALL_TURN: Final = 0.99875
FAST_TURN: Final = 2.0  # [rad] between two frames from which on a body may have gone the long way round


def rotations_between(
    start: NDArray[np.float32],
    end: NDArray[np.float32],
    share: NDArray[np.float64] | float,
    *,
    turn: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Rotations (N, 4) at `share` (N,), or one for all, of the way from `start` to `end`, beyond 1 as the way goes on, at an even
    speed.

    The way is the short one, but for bodies that spin fast: `turn` (N, 3) [rad] along the axis of the turn, which the angular
    velocities promise, says how many times they went round.
    """
    # (4, N): numpy is quick along rows
    columns, ends = start.T.copy(), end.T.copy()
    alike = _along(columns, ends)
    part = np.asarray(share, np.float32)
    columns *= 1 - part
    ends *= np.where(alike < 0, -part, part)
    columns += ends
    squared = _along(columns, columns)
    columns /= np.sqrt(np.where(squared > 0, squared, 1))
    found = columns.T
    large = np.flatnonzero(np.abs(alike) < _SMALL_TURN)
    if len(large):
        found[large] = quaternion.slerp(start[large], end[large], np.broadcast_to(part, alike.shape)[large])
    if turn is not None:
        fast = np.flatnonzero(np.einsum("ij,ij->i", turn, turn) > FAST_TURN**2)
        if len(fast):
            shares = np.broadcast_to(np.asarray(share, np.float64), alike.shape)[fast]
            found[fast] = _spun(
                start[fast].astype(np.float64), end[fast].astype(np.float64), shares, turn[fast].astype(np.float64)
            )
    return found


def _along(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    """Dot products (N,) of columns (4, N)."""
    product = a * b
    product[0] += product[1]
    product[2] += product[3]
    return np.asarray(product[0] + product[2])


def _spun(
    start: NDArray[np.float64], end: NDArray[np.float64], share: NDArray[np.float64], turn: NDArray[np.float64]
) -> NDArray[np.float64]:
    """About the axis that leads from start to end, by the angle nearest to the promised one of all that lead there."""
    between = quaternion.normalize(quaternion.multiply(end, quaternion.conjugate(start)))
    sine = np.linalg.norm(between[:, :3], axis=1)
    # Whole turns leave no axis behind: they were about the promised one.
    axis = np.where(sine[:, None] > 1e-6, between[:, :3], turn)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(np.einsum("ij,ij->i", between[:, :3], axis), between[:, 3])
    promised = np.einsum("ij,ij->i", turn, axis)
    angle += 2.0 * np.pi * np.rint((promised - angle) / (2.0 * np.pi))
    return np.asarray(quaternion.multiply(quaternion.from_axis_angle(axis, angle * share), start))

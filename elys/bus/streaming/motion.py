"""Where bodies are a little after they were told of, and how far that is from the truth.

Sender and receiver work this out for themselves and must come to the same bits, so there is nothing here but additions,
products, quotients and roots, each rounded to the type that is named: no library of functions, no sums of another's order.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.state_packing.compact import (
    ANGULAR_STEPS,
    F4,
    LINEAR_STEPS,
    POSITION_STEPS,
    Codes,
    rotation_of,
)

LONGEST: Final = 0.25  # [s] for which a body is taken to go on as it did
_MOST_TURN: Final = F4(1.2)  # [rad] of half a turn in that time; who spins faster is shown as it was
ARM: Final = 0.5  # [m] from its middle at which a body's rotation counts as much as its position
FALLS: Final = np.uint8(8)  # beside the largest component of a body's rotation: nothing but gravity moves it
_FINEST: Final = np.finfo(np.float64).tiny
Vectors = NDArray[np.float64]
Rotations = NDArray[np.float32]


def elapsed_since(time: NDArray[np.float64], now: float) -> NDArray[np.float64]:
    """[N] s from then to now for which motion is guessed: none backwards in time, LONGEST at most."""
    elapsed = now - time
    np.minimum(elapsed, LONGEST, out=elapsed)
    np.maximum(elapsed, 0.0, out=elapsed)
    return elapsed


def fall_in_steps(gravity: tuple[float, float, float]) -> Vectors:
    """[3, 1] steps of linear velocity that gravity [m/s^2] adds in a second."""
    return np.array(gravity, np.float64).reshape(3, 1) * LINEAR_STEPS


def moved_on(codes: Codes, elapsed: NDArray[np.float64], fall: Vectors) -> tuple[Vectors, Rotations]:
    """[3, N] m and [4, N] x y z w: where bodies are so many seconds later, if nothing happens to them."""
    way = codes.linear * elapsed
    falling = np.where(codes.largest & FALLS, elapsed, 0.0)
    way += (falling * falling * 0.5) * fall
    steps = codes.position + way * (POSITION_STEPS / LINEAR_STEPS)
    rotation = rotation_of(codes)
    spinning = np.flatnonzero((codes.angular != 0).any(axis=0) & (elapsed > 0.0))
    if len(spinning):
        share = (elapsed[spinning] * (0.5 / ANGULAR_STEPS)).astype(F4)
        rotation[:, spinning] = turned_on(rotation[:, spinning], codes.angular[:, spinning].astype(F4) * share)
    return steps * (1.0 / POSITION_STEPS), rotation


def turned_on(rotation: Rotations, half: NDArray[np.float32]) -> Rotations:
    """[4, N] rotations after a turn of twice `half` [3, N] rad, in the world's axes.

    (axis tan(h), 1) is that turn but for its length; tan(h) = h (15 - h^2) / (15 - 6 h^2) is Padé's approximation, off by
    2e-4 at 1 rad. What turns farther than it holds is left as it is.
    """
    square = (half[0] * half[0] + half[1] * half[1]) + half[2] * half[2]
    square = np.where(square > _MOST_TURN * _MOST_TURN, F4(0.0), square)
    holds = (square > F4(0.0)).astype(F4)
    scale = (F4(15.0) - square) / (F4(15.0) - F4(6.0) * square) * holds
    wx, wy, wz = half * scale
    x, y, z, w = rotation
    turned = np.empty_like(rotation)
    turned[0] = x + ((wx * w + wy * z) - wz * y)
    turned[1] = y + ((wy * w + wz * x) - wx * z)
    turned[2] = z + ((wz * w + wx * y) - wy * x)
    turned[3] = w - ((wx * x + wy * y) + wz * z)
    turned /= np.sqrt(((turned[0] * turned[0] + turned[1] * turned[1]) + turned[2] * turned[2]) + turned[3] * turned[3])
    return turned


def distances(shown: Vectors, true: Vectors) -> NDArray[np.float64]:
    """[N] m between places."""
    x, y, z = shown - true
    return np.asarray(np.sqrt((x * x + y * y) + z * z))


def angles(shown: Rotations, true: Rotations) -> NDArray[np.float64]:
    """[N] rad between rotations: a chord c on the sphere of quaternions is an angle of 4 asin(c / 2)."""
    one, other = shown.astype(np.float64), true.astype(np.float64)
    one /= np.sqrt((one * one).sum(axis=0) + _FINEST)
    other /= np.sqrt((other * other).sum(axis=0) + _FINEST)
    near, far = one - other, one + other
    chord = np.sqrt(np.minimum((near * near).sum(axis=0), (far * far).sum(axis=0)))
    return np.asarray(4.0 * np.arcsin(np.minimum(chord * 0.5, 1.0)))

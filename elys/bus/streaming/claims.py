"""How far from the truth a viewer can be showing anything, whatever has come of what is on its way to it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.streaming.flight import Sent
from elys.bus.streaming.held import Held, Told
from elys.bus.streaming.motion import angles, distances, elapsed_since, moved_on
from elys.bus.streaming.truth import Truth

_ROUNDED_UP = 1.0 + 2.0**-20  # errors travel as float32


class Claim(NamedTuple):
    """No body is farther off than that."""

    position: float  # [m]
    rotation: float  # [rad]

    def or_worse(self, other: Claim) -> Claim:
        """What holds of both."""
        return Claim(max(self.position, other.position), max(self.rotation, other.rotation))


def claims(
    truth: Truth,
    off: tuple[NDArray[np.float64], NDArray[np.float64]],
    told: Told,
    shown: Held,
    base: Held | None,
    flight: Iterable[Sent],
) -> tuple[Claim, Claim]:
    """What holds at the truth's instant once `told` has come: if all before it have, and whichever have.

    `off` [N] m, [N] rad is how far `shown` is without it. Whoever it tells of is shown as it says; any other body as the base
    has it, or as one of the frames on their way told, for of several the latest that came counts.
    """
    is_told = np.zeros(truth.count, np.bool_)
    is_told[told.rows] = True
    of_told = _claim(truth, told, None)
    rest = shown.is_known & ~is_told
    settled = of_told.or_worse(Claim(off[0][rest].max(initial=0.0), off[1][rest].max(initial=0.0)))
    opened = settled
    if base is not None:
        position, rotation = moved_on(base.codes, elapsed_since(base.time, truth.time), truth.fall)
        known = base.is_known & ~is_told
        distance, angle = distances(position, truth.position)[known], angles(rotation, truth.rotation)[known]
        opened = opened.or_worse(Claim(distance.max(initial=0.0), angle.max(initial=0.0)))
    for sent in flight:
        other = sent.told
        if other.table != truth.table:
            other = other.moved_to(truth.table, truth.entities)
        opened = opened.or_worse(_claim(truth, other, is_told))
    return _rounded(settled), _rounded(opened)


def _claim(truth: Truth, told: Told, left_out: NDArray[np.bool_] | None) -> Claim:
    rows, codes = told.rows, told.codes
    if left_out is not None:
        kept = np.flatnonzero(~left_out[rows])
        rows, codes = rows[kept], codes.rows(kept)
    position, rotation = moved_on(codes, elapsed_since(np.full(len(rows), told.time), truth.time), truth.fall)
    return Claim(
        distances(position, truth.position[:, rows]).max(initial=0.0),
        angles(rotation, truth.rotation[:, rows]).max(initial=0.0),
    )


def _rounded(claim: Claim) -> Claim:
    """A hair more, so that it holds after it was rounded to float32, and for float32 rotations."""
    return Claim(claim.position * _ROUNDED_UP + 1e-7, claim.rotation * _ROUNDED_UP + 2e-6)

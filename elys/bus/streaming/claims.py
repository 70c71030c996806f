"""How far from the truth a viewer can be showing anything, whatever has come of what is on its way to it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.state_packing.compact import Codes
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
    settled = _claim(truth, told.rows, told.codes, np.full(len(told.rows), told.time))
    rest = shown.is_known & ~is_told
    settled = settled.or_worse(Claim(off[0][rest].max(initial=0.0), off[1][rest].max(initial=0.0)))
    return _rounded(settled), _rounded(settled.or_worse(_of_others(truth, is_told, base, flight)))


def _of_others(truth: Truth, is_told: NDArray[np.bool_], base: Held | None, flight: Iterable[Sent]) -> Claim:
    """The worst that the base or any frame on its way says of those who are not told anew; all looked at together."""
    rows, codes, times = [], [], []
    if base is not None:
        kept = np.flatnonzero(base.is_known & ~is_told)
        rows, codes, times = [kept], [base.codes.rows(kept)], [base.time[kept]]
    for sent in flight:
        other = sent.told
        if other.table != truth.table:
            other = other.moved_to(truth.table, truth.entities)
        kept = np.flatnonzero(~is_told[other.rows])
        if len(kept):
            rows.append(other.rows[kept])
            codes.append(other.codes.rows(kept))
            times.append(np.full(len(kept), other.time))
    if not rows:
        return Claim(0.0, 0.0)
    joined = Codes._make(np.concatenate(column, axis=-1) for column in zip(*codes, strict=True))
    return _claim(truth, np.concatenate(rows), joined, np.concatenate(times))


def _claim(truth: Truth, rows: NDArray[np.intp], codes: Codes, times: NDArray[np.float64]) -> Claim:
    """How far these are off, who were there at these times."""
    if not len(rows):
        return Claim(0.0, 0.0)
    position, rotation = moved_on(codes, elapsed_since(times, truth.time), truth.fall)
    return Claim(
        float(distances(position, truth.position[:, rows]).max()),
        float(angles(rotation, truth.rotation[:, rows]).max()),
    )


def _rounded(claim: Claim) -> Claim:
    """A hair more, so that it holds after it was rounded to float32, and for float32 rotations."""
    return Claim(claim.position * _ROUNDED_UP + 1e-7, claim.rotation * _ROUNDED_UP + 2e-6)

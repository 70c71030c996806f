"""Errors of recorded runs, by what they mean, from which cases choose: each takes a run and gives one number, 0 for exact."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from elys.common.math import quaternion
from elys.samples.hard_cases.case import CaseMeasure, CaseRun

Array = np.ndarray[Any, Any]

FALLEN: Final = 0.25  # of its own start, a body that went so far has left its place [m]


def drift_under(bound: float, prefix: str, *, known_miss: str = "") -> CaseMeasure:
    """The farthest that a body whose name begins so ever is from its start, horizontally [mm]."""

    def of(run: CaseRun) -> float:
        return 1000.0 * float(np.linalg.norm(_moved(run, prefix)[:, :, [0, 2]], axis=2).max())

    return CaseMeasure(name="drift", unit="mm", bound=bound, of=of, known_miss=known_miss)


def moved_under(bound: float, prefix: str, *, known_miss: str = "") -> CaseMeasure:
    """The same in any direction."""

    def of(run: CaseRun) -> float:
        return 1000.0 * float(np.linalg.norm(_moved(run, prefix), axis=2).max())

    return CaseMeasure(name="moved", unit="mm", bound=bound, of=of, known_miss=known_miss)


def none_fallen(prefix: str, *, far: float = FALLEN, known_miss: str = "") -> CaseMeasure:
    """How many bodies whose names begin so ended farther than `far` [m] from their places."""

    def of(run: CaseRun) -> float:
        return float((np.linalg.norm(_moved(run, prefix)[-1], axis=1) > far).sum())

    return CaseMeasure(name="fallen", unit="bodies", bound=0, of=of, known_miss=known_miss)


def overlap_under(bound: float, *, last: float = 1.0, known_miss: str = "") -> CaseMeasure:
    """The deepest contact of the last seconds [mm]."""

    def of(run: CaseRun) -> float:
        return 1000.0 * float(run.overlap[run.time > run.time[-1] - last - 1e-9].max())

    return CaseMeasure(name="overlap", unit="mm", bound=bound, of=of, known_miss=known_miss)


def energy_gain_under(bound: float, *, known_miss: str = "") -> CaseMeasure:
    """By how much the energy ever exceeds what there was at the start, of the largest kinetic energy there was [%].

    Of what falls, rubs and hits without motors energy can only be lost.
    """

    def of(run: CaseRun) -> float:
        scale = max(float(run.kinetic.max()), 1e-12)
        return 100.0 * float(run.energy.max() - run.energy[0]) / scale

    return CaseMeasure(name="energy gain", unit="%", bound=bound, of=of, known_miss=known_miss)


def joint_gap_under(bound: float, *, known_miss: str = "") -> CaseMeasure:
    """The farthest that joined anchors ever were apart [mm]."""

    def of(run: CaseRun) -> float:
        return 1000.0 * float(run.joint_gap.max())

    return CaseMeasure(name="joint gap", unit="mm", bound=bound, of=of, known_miss=known_miss)


def no_problems(*, known_miss: str = "") -> CaseMeasure:
    """How often physics told that something went wrong."""
    return CaseMeasure(
        name="problems", unit="told", bound=0, of=lambda run: float(len(run.problems)), known_miss=known_miss
    )


def tilt(rotation: Array, axis: tuple[float, float, float] = (0.0, 1.0, 0.0)) -> Array:
    """Angles (T,) between a body's own `axis` and the world's y, from rotations (T, 4) [rad]."""
    turn = quaternion.normalize(np.asarray(rotation, np.float64))
    along = quaternion.rotate(turn, np.broadcast_to(np.asarray(axis, np.float64), (len(turn), 3)))
    # The arc cosine is blind near 0: half the angle by its sine is not.
    return np.asarray(2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(along - (0.0, 1.0, 0.0), axis=1), 0.0, 1.0)))


def angle_about_z(rotation: Array) -> Array:
    """Angles (T,) of what turns about z alone, counted over turns, from rotations (T, 4) [rad]."""
    return np.asarray(np.unwrap(2.0 * np.arctan2(rotation[:, 2], rotation[:, 3]), period=2.0 * np.pi))


def crossing(time: Array, value: Array) -> float:
    """When a value (T,) first rises through 0, between two moments (T,) [s]; infinity where it never does."""
    rises = np.flatnonzero((value[:-1] < 0.0) & (value[1:] >= 0.0))
    if not len(rises):
        return float("inf")
    at = rises[0]
    return float(time[at] - value[at] * (time[at + 1] - time[at]) / (value[at + 1] - value[at]))


def at_time(run: CaseRun, seconds: float) -> int:
    """The recorded moment nearest to a time [s]."""
    return int(np.abs(run.time - seconds).argmin())


def _moved(run: CaseRun, prefix: str) -> Array:
    """Ways (T, B, 3) of the bodies whose names begin so, from where they started [m]."""
    motion = run.motion.position[:, run.places(prefix)]
    return np.asarray(motion - motion[0])

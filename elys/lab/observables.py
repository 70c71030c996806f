"""How wrong a motion is, by quantities that keep their meaning when trajectories part.

Contact is chaotic: after some bounces two exact solutions of nearly the same start have nothing in common, and where a body
ends says nothing. What is compared here stays comparable: budgets, rest, times. Some errors have the truth built in (what is
0 in every exact solution), the others are taken against a reference.

Every error is also told as a share of what is typical of the scene, so that metres, joules and seconds can be weighed.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from elys.common.errors import ElysError
from elys.lab.motion import Motion

Array = np.ndarray[Any, Any]

AT_REST: Final = 0.05  # [m/s] what is slower rests, [rad/s] and turns more slowly than twice that
REST_WINDOW: Final = 1.0  # [s] over which what rests must not drift
PARTED: Final = 0.05  # of the scene's size: trajectories that stand farther apart have parted


class Scales(NamedTuple):
    """What is typical of a scene."""

    length: float  # size of a body in the middle of all [m]
    energy: float  # [J]
    momentum: float  # [kg m/s]
    time: float  # [s]


class ObservableError(msgspec.Struct, frozen=True):
    """An error of a motion: by how much, when, and what makes it. Not a number (null in JSON) where that is unknown."""

    name: str
    value: float
    unit: str
    relative: float  # as a share of what is typical
    time: float  # [s] when it is largest
    culprit: str = ""  # the body, pair or joint that makes it

    @property
    def is_finite(self) -> bool:
        """Whether it can be told at all."""
        return math.isfinite(self.relative)

    @property
    def is_known(self) -> bool:
        """Whether the motion tells what it takes: other engines tell no contacts."""
        return not math.isnan(self.value)


class _Worst(NamedTuple):
    value: float
    time: float = 0.0
    culprit: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Observable:
    """Something that is measured of a motion; `of` gives its error, given the reference to compare with."""

    name: str
    unit: str
    text: str
    scale: Callable[[Scales], float]
    of: Callable[[Motion, Motion, Scales], _Worst]
    needs_reference: bool = True


def scales_of(reference: Motion) -> Scales:
    """What is typical of a scene: the size of its bodies, what it takes to lift them by that, and how it moves itself."""
    mass = float(reference.mass.sum())
    length = float(np.median(reference.size)) or 1.0
    moved = float(reference.kinetic.max()) + float(np.ptp(reference.potential))
    lifted = mass * reference.gravity * length
    carried = float((np.linalg.norm(reference.linear_velocity, axis=2) @ reference.mass).max())
    fallen = mass * math.sqrt(reference.gravity * length)
    return Scales(length, max(moved, lifted) or 1.0, max(carried, fallen) or 1.0, reference.duration)


def errors_of(motion: Motion, reference: Motion, scales: Scales) -> list[ObservableError]:
    """All errors of a motion against a reference; infinite ones where it did not stay in numbers."""
    errors = []
    for observable in OBSERVABLES:
        worst = observable.of(motion, reference, scales) if motion.is_finite else _Worst(math.inf, 0.0, motion.lost)
        relative = worst.value / observable.scale(scales)
        errors.append(
            ObservableError(observable.name, worst.value, observable.unit, relative, worst.time, worst.culprit)
        )
    return errors


def divergence_time(motion: Motion, reference: Motion, scales: Scales) -> float:
    """When the first body stands farther off the reference than a twentieth of a body [s]; infinity for never."""
    parted = _distances(motion, reference).max(1) > PARTED * scales.length
    return float(motion.time[int(np.argmax(parted))]) if parted.any() else math.inf


def _distances(motion: Motion, reference: Motion) -> Array:
    """How far each body stands off the reference, (T, N) [m]."""
    return np.linalg.norm(motion.position - reference.position, axis=2)


def is_resting(motion: Motion) -> Array:
    """Which bodies rest when, (T, N)."""
    slow = np.linalg.norm(motion.linear_velocity, axis=2) < AT_REST
    return np.asarray(slow & (np.linalg.norm(motion.angular_velocity, axis=2) < 2.0 * AT_REST))


def _worst_of(values: Array, motion: Motion) -> _Worst:
    """The largest of values (T,) and when it is."""
    moment = int(np.argmax(values))
    return _Worst(float(values[moment]), float(motion.time[moment]))


def _worst_body(values: Array, motion: Motion) -> _Worst:
    """The largest of values (T, N), when it is and whose."""
    moment, body = np.unravel_index(int(np.argmax(values)), values.shape)
    return _Worst(float(values[moment, body]), float(motion.time[moment]), motion.names[body])


def _energy_gain(motion: Motion, reference: Motion, scales: Scales) -> _Worst:
    # What the reference gains too comes from motors, moving platforms and springs, and is no error.
    gain = motion.energy - np.minimum.accumulate(motion.energy)
    meant = reference.energy - np.minimum.accumulate(reference.energy)
    return _worst_of(np.maximum(gain - np.maximum.accumulate(meant), 0.0), motion)


def _energy(motion: Motion, reference: Motion, scales: Scales) -> _Worst:
    return _worst_of(np.abs(motion.energy - reference.energy), motion)


def _momentum(motion: Motion, reference: Motion, scales: Scales) -> _Worst:
    return _worst_of(np.linalg.norm(motion.momentum - reference.momentum, axis=1), motion)


def _overlap(motion: Motion, reference: Motion, scales: Scales) -> _Worst:
    after_start = motion.overlap.copy()
    after_start[0] = 0.0  # as it was built
    moment = int(np.argmax(after_start))
    return _Worst(float(after_start[moment]), float(motion.time[moment]), motion.overlap_between[moment])


def _joint_violation(motion: Motion, reference: Motion, scales: Scales) -> _Worst:
    moment = int(np.argmax(motion.joint_error))
    return _Worst(float(motion.joint_error[moment]), float(motion.time[moment]), motion.joint[moment])


def _drift_at_rest(motion: Motion, reference: Motion, scales: Scales) -> _Worst:
    window = motion.time > motion.time[-1] - REST_WINDOW - 1e-9
    resting = is_resting(motion)[window].all(0) & is_resting(reference)[window].all(0)
    if not resting.any():
        return _Worst(0.0)
    positions = motion.position[window]
    return _worst_body(
        np.linalg.norm(positions - positions[0], axis=2) * resting, motion._replace(time=motion.time[window])
    )


def _rest_pose(motion: Motion, reference: Motion, scales: Scales) -> _Worst:
    """Where what rests at the end rests: each body where trajectories have not parted, else how high all lie."""
    resting = is_resting(motion)[-1] & is_resting(reference)[-1]
    if not resting.any():
        return _Worst(0.0)
    end = motion.duration
    if math.isinf(divergence_time(motion, reference, scales)):
        distance = _distances(motion, reference)[-1] * resting
        return _Worst(float(distance.max()), end, motion.names[int(np.argmax(distance))])
    # Where exactly the heap lies is chance by then; how high it is, is not.
    height = [float(run.potential[-1]) / (float(run.mass.sum()) * (run.gravity or 1.0)) for run in (motion, reference)]
    return _Worst(abs(height[0] - height[1]), end)


def settling_time(motion: Motion) -> tuple[float, int]:
    """When the last body came to rest for good [s], and which; the end where one never does."""
    moving = ~is_resting(motion)
    last = len(motion.time) - 1 - np.argmax(moving[::-1], axis=0)
    last[~moving.any(0)] = -1
    body = int(np.argmax(last))
    return float(motion.time[min(int(last[body]) + 1, len(motion.time) - 1)]), body


def _settling(motion: Motion, reference: Motion, scales: Scales) -> _Worst:
    own, body = settling_time(motion)
    return _Worst(abs(own - settling_time(reference)[0]), own, motion.names[body])


def _stick_or_slip(motion: Motion, reference: Motion, scales: Scales) -> _Worst:
    own, meant = is_resting(motion)[-1], is_resting(reference)[-1]
    other = np.flatnonzero(own != meant)
    culprit = motion.names[int(other[0])] if len(other) else ""
    return _Worst(abs(int(own.sum()) - int(meant.sum())) / len(own), motion.duration, culprit)


def _contact_timing(motion: Motion, reference: Motion, scales: Scales) -> _Worst:
    """First contacts, while trajectories are still together: who touches whom later is chance.

    A contact is told at the end of the tick that it falls into: up to there a late one is in time.
    """
    if motion.first_contacts is None or reference.first_contacts is None:
        return _Worst(math.nan)
    horizon = divergence_time(motion, reference, scales)
    tick, fine = 1.0 / motion.setting.tick_rate, 1.0 / reference.setting.tick_rate
    worst = _Worst(0.0)
    for pair, meant in reference.first_contacts.items():
        if meant > horizon or pair not in motion.first_contacts:
            continue
        own = motion.first_contacts[pair]
        error = max(own - (meant + tick), meant - fine - own, 0.0)
        if error > worst.value:
            worst = _Worst(error, meant, " on ".join(pair))
    return worst


OBSERVABLES: Final[tuple[Observable, ...]] = (
    Observable(
        name="energy gain",
        unit="J",
        text="energy out of nothing: the most by which the sum rose, beyond what motors and platforms gave",
        scale=lambda scales: scales.energy,
        of=_energy_gain,
    ),
    Observable(
        name="energy",
        unit="J",
        text="kinetic and potential energy of everything, against the reference at the same moment",
        scale=lambda scales: scales.energy,
        of=_energy,
    ),
    Observable(
        name="momentum",
        unit="kg m/s",
        text="momentum of everything, against the reference at the same moment",
        scale=lambda scales: scales.momentum,
        of=_momentum,
    ),
    Observable(
        name="overlap",
        unit="m",
        text="the deepest overlap of two bodies",
        scale=lambda scales: scales.length,
        of=_overlap,
        needs_reference=False,
    ),
    Observable(
        name="joint violation",
        unit="m",
        text="the farthest that a joint's parts stood off each other",
        scale=lambda scales: scales.length,
        of=_joint_violation,
        needs_reference=False,
    ),
    Observable(
        name="drift at rest",
        unit="m",
        text="how far a body crept in the last second that should have stood still",
        scale=lambda scales: scales.length,
        of=_drift_at_rest,
        needs_reference=False,
    ),
    Observable(
        name="rest pose",
        unit="m",
        text="where a body lies in the end; once trajectories have parted, how high the centre of all lies",
        scale=lambda scales: scales.length,
        of=_rest_pose,
    ),
    Observable(
        name="settling",
        unit="s",
        text="when the last body came to rest",
        scale=lambda scales: scales.time,
        of=_settling,
    ),
    Observable(
        name="stick or slip",
        unit="of bodies",
        text="bodies that slide at the end and should stand, or the other way round",
        scale=lambda scales: 1.0,
        of=_stick_or_slip,
    ),
    Observable(
        name="contact timing",
        unit="s",
        text="by how much two bodies first touched before or after their tick, while trajectories were together",
        scale=lambda scales: scales.time,
        of=_contact_timing,
    ),
)


def require_observables(names: Sequence[str], *, more: Sequence[str] = ()) -> None:
    """Raises ElysError where one of `names` is none, nor one of `more`."""
    known = [*(observable.name for observable in OBSERVABLES), *more]
    for name in names:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            remedy = f"did you mean '{close[0]}'?" if close else f"there are {', '.join(known)}"
            raise ElysError(f"there is no observable '{name}'; {remedy}")

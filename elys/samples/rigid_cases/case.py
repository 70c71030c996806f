"""What a hard case is: a scene, what makes it hard, and how wrong a recorded trajectory of it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from elys.samples.rigid_cases.scene import RigidScene

Array = np.ndarray[Any, Any]

TIME_STEP: Final = 1.0 / 60.0  # [s]


class Trajectory(NamedTuple):
    """How N bodies moved, at T moments; the first is the start."""

    time: Array  # (T,) [s]
    position: Array  # (T, N, 3) [m]
    rotation: Array  # (T, N, 4) x y z w
    linear_velocity: Array  # (T, N, 3) [m/s]
    angular_velocity: Array  # (T, N, 3) in world axes [rad/s]

    def final(self, seconds: float) -> Trajectory:
        """The last `seconds`."""
        kept = self.time > self.time[-1] - seconds - 1e-9
        return Trajectory(*(column[kept] for column in self))


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """One error of a case: 0 is exact, above `bound` is a miss."""

    name: str
    unit: str  # of `bound` and of what `of` returns
    bound: float
    of: Callable[[RigidScene, Trajectory], float]

    def is_met(self, value: float) -> bool:
        """Whether an error is good enough; what is not a number is not."""
        return bool(value <= self.bound)


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidCase:
    """A scene with a known end. The error of a case is the worst over its seeds."""

    name: str
    title: str
    difficulty: str  # what makes it hard
    build: Callable[[int], RigidScene]  # seed -> scene
    duration: float  # [s]
    measures: tuple[Measure, ...]
    seeds: tuple[int, ...] = (0,)
    stride: int = 1  # steps from one recorded moment to the next

    @property
    def step_count(self) -> int:
        """Steps of TIME_STEP, a whole number of strides."""
        return round(self.duration / TIME_STEP / self.stride) * self.stride

    def errors(self, scene: RigidScene, trajectory: Trajectory) -> dict[str, float]:
        """Each measure's value; infinity where the motion is not finite."""
        if not all(np.isfinite(column).all() for column in trajectory):
            return {measure.name: float("inf") for measure in self.measures}
        return {measure.name: float(measure.of(scene, trajectory)) for measure in self.measures}

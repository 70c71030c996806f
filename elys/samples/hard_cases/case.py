"""What a hard case is: a scene document, what makes it hard, the answer, and how wrong a recorded run of it is."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from elys.common.scene import SceneDocument
from elys.samples.rigid_cases import Trajectory

Array = np.ndarray[Any, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseRun:
    """What was recorded of one run, at T moments of which the first is the start.

    `motion` has a column for each entity that collides or is moved, in the order of `names`; those that physics does not move
    stand still in it.
    """

    seed: int
    names: tuple[str, ...]
    motion: Trajectory
    energy: Array  # (T,) of all dynamic bodies, kinetic and in gravity [J]
    kinetic: Array  # (T,) the kinetic part [J]
    momentum: Array  # (T, 3) of all dynamic bodies [kg m/s]
    overlap: Array  # (T,) of the deepest contact, 0 where none is [m]
    joint_gap: Array  # (T,) by which anchors that shall be at one place are farthest apart [m]
    problems: tuple[str, ...] = ()  # what physics told to be wrong, in order

    @property
    def time(self) -> Array:
        """(T,) [s]."""
        return self.motion.time

    def place(self, name: str) -> int:
        """The column of an entity."""
        return self.names.index(name)

    def places(self, prefix: str) -> list[int]:
        """The columns of all entities whose names begin so, in the order of `names`."""
        return [place for place, name in enumerate(self.names) if name.startswith(prefix)]

    def position(self, name: str) -> Array:
        """(T, 3) [m]."""
        return np.asarray(self.motion.position[:, self.place(name)])

    def velocity(self, name: str) -> Array:
        """(T, 3) [m/s]."""
        return np.asarray(self.motion.linear_velocity[:, self.place(name)])

    def rotation(self, name: str) -> Array:
        """(T, 4) x y z w."""
        return np.asarray(self.motion.rotation[:, self.place(name)])

    def spin(self, name: str) -> Array:
        """(T, 3) about the world's axes [rad/s]."""
        return np.asarray(self.motion.angular_velocity[:, self.place(name)])

    def is_finite(self) -> bool:
        """Whether everything that was recorded is a finite number."""
        scalars = (self.energy, self.kinetic, self.momentum, self.overlap, self.joint_gap)
        return all(bool(np.isfinite(column).all()) for column in (*self.motion, *scalars))


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseMeasure:
    """One error of a case: 0 is exact, above `bound` is a miss."""

    name: str
    unit: str  # of `bound` and of what `of` returns
    bound: float
    of: Callable[[CaseRun], float]
    known_miss: str = ""  # why ELYS does not reach the bound yet; "" where it does

    def is_met(self, value: float) -> bool:
        """Whether an error is good enough; what is not a number is not."""
        return bool(value <= self.bound)


@dataclass(frozen=True, slots=True, kw_only=True)
class HardCase:
    """A scene whose end is known. The error of a case is the worst over its seeds."""

    name: str
    title: str
    difficulty: str  # what makes it hard
    answer: str  # what is exact or converged, and where that comes from
    build: Callable[[int], SceneDocument]  # seed -> scene
    duration: float  # [s]
    measures: tuple[CaseMeasure, ...]
    picture_time: float  # when the picture of the docs is taken [s]
    seeds: tuple[int, ...] = (0,)
    stride: int = 1  # ticks from one recorded moment to the next
    sleeping: bool = True  # whether bodies may fall asleep
    small: HardCase | None = None  # the same, shorter or of fewer bodies, where the whole takes long

    @property
    def quick(self) -> HardCase:
        """The case at a size for every change of the code."""
        return self.small if self.small is not None else self

    def tick_count(self, tick_rate: int) -> int:
        """Ticks of the whole duration, a whole number of strides."""
        return round(self.duration * tick_rate / self.stride) * self.stride

    def errors(self, run: CaseRun) -> dict[str, float]:
        """Each measure's value; infinity where the run is not finite."""
        if not run.is_finite():
            return {measure.name: float("inf") for measure in self.measures}
        return {measure.name: float(measure.of(run)) for measure in self.measures}


Scene = Callable[[], SceneDocument]


def always(build: Scene) -> Callable[[int], SceneDocument]:
    """A scene in which nothing is left to chance, as `HardCase.build`."""

    @functools.wraps(build)
    def of_seed(seed: int) -> SceneDocument:
        return build()

    return of_seed

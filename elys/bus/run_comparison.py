"""Two recorded runs side by side: when, where and by how much they part.

Frames are compared at the instants that both have, by simulation time; entities by their ids, which a fork shares with what it
was forked from, and two runs of one scene with each other. What a compact recording may be off by counts as no difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import StateFrame
from elys.bus.recording import Recording
from elys.common.errors import RecordingError

HORIZONS: Final = (0.001, 0.01, 0.1)  # [m]
SAMPLES: Final = 1500  # instants of which a curve is told at most
_COLUMNS: Final = ("position", "rotation", "linear_velocity", "angular_velocity")
Progress = Callable[[float, float], None]  # seconds of simulation done, and in all


class BodyDifference(msgspec.Struct, frozen=True, kw_only=True):
    """How far a body is from itself in the other run."""

    entity: int
    name: str
    first_tick: int  # at which anything of it differs, beyond what the recordings may be off by
    first_time: float  # [s]
    largest: float  # [m] of position
    largest_time: float  # [s]
    final: float  # [m] at the last instant at which both have it


class LoneBody(msgspec.Struct, frozen=True, kw_only=True):
    """A body that one of the runs has, and the other at the same instant has not."""

    entity: int
    name: str
    only_in: str  # the file
    tick: int  # the first
    time: float  # [s]


class Horizon(msgspec.Struct, frozen=True, kw_only=True):
    """When the farthest body is first farther off than a distance; NaN: never."""

    distance: float  # [m]
    time: float  # [s]
    after: float  # [s] since the first difference


class Curve(msgspec.Struct, frozen=True, kw_only=True):
    """How far a body is off over time."""

    name: str
    time: list[float]  # [s]
    distance: list[float]  # [m]


class Comparison(msgspec.Struct, frozen=True, kw_only=True):
    """What two recordings have in common, and where they part."""

    a: str
    b: str
    instants: int  # that were compared
    first_time: float  # [s]
    last_time: float  # [s]
    differs: bool
    first_tick: int = -1  # that differs; -1: none
    first_difference: float = math.nan  # [s] its time
    first_of: str = ""  # what differs there
    horizons: list[Horizon] = []
    bodies: list[BodyDifference] = []  # those that differ, the farthest first
    lone: list[LoneBody] = []
    curves: list[Curve] = []  # of the farthest, and of the largest distance of all


def compare(a: Path, b: Path, *, curves: int = 0, progress: Progress | None = None) -> Comparison:
    """Compares two recordings; with `curves` those of so many bodies.

    Raises:
        RecordingError: one cannot be read, or they have no instant in common.
    """
    with Recording(a, checked=True) as first, Recording(b, checked=True) as second:
        pairs = _common(first, second)
        if not pairs:
            raise RecordingError(
                f"{a} ({first.time[0]:.3f} s to {first.time[-1]:.3f} s) and {b} ({second.time[0]:.3f} s to "
                f"{second.time[-1]:.3f} s) have no instant in common"
            )
        tally = _Tally(first, second, stride=-(-len(pairs) // SAMPLES) if curves else 0)
        for number, (i, j) in enumerate(pairs):
            tally.add(first.frame(i), second.frame(j))
            if progress is not None and number % 60 == 0:
                start = float(first.time[pairs[0][0]])
                progress(float(first.time[i]) - start, float(first.time[pairs[-1][0]]) - start)
        return tally.result(curves)


def _common(a: Recording, b: Recording) -> list[tuple[int, int]]:
    """The last frames of each instant that both have."""

    def last_by_time(recording: Recording) -> dict[int, int]:
        return {round(float(time) * 1e9): place for place, time in enumerate(recording.time)}

    ours, theirs = last_by_time(a), last_by_time(b)
    return [(ours[time], theirs[time]) for time in ours if time in theirs]


class _Tally:
    """What has been seen so far."""

    def __init__(self, a: Recording, b: Recording, *, stride: int) -> None:
        self._recordings = (a, b)
        self._bounds = {name: a.bounds.get(name, 0.0) + b.bounds.get(name, 0.0) for name in _COLUMNS}
        self._is_exact = not (a.bounds or b.bounds)
        self._stride = stride
        self._instants = 0
        self._span = (math.nan, math.nan)
        self._first: tuple[int, float, str] | None = None
        self._largest_of_all = 0.0
        self._exceeded: dict[float, float] = {}
        self._bodies: dict[int, list[float]] = {}  # first tick, its time, largest, its time, final
        self._lone: dict[tuple[int, int], tuple[int, float]] = {}
        self._samples: list[tuple[float, NDArray[np.uint32], NDArray[np.float64]]] = []

    def add(self, a: StateFrame, b: StateFrame) -> None:
        """Two frames of one instant."""
        time = a.simulation_time
        self._span = (time if self._instants == 0 else self._span[0], time)
        common, rows_a, rows_b = np.intersect1d(a.entity, b.entity, assume_unique=True, return_indices=True)
        self._note_lone(a, b, common)
        distance = np.linalg.norm(a.position[rows_a] - b.position[rows_b], axis=1)
        distance[~(distance > self._bounds["position"])] = 0.0
        differs = self._differing(a, b, rows_a, rows_b)
        if differs.any() or len(common) < max(len(a.entity), len(b.entity)):
            count = int(differs.sum())
            self._note_first(a, f"{count} {'body' if count == 1 else 'bodies'}" if count else "which bodies there are")
        elif self._is_exact and a.state_hash != b.state_hash:
            self._note_first(a, "the state's hash, and nothing that is seen of bodies")
        for row in np.flatnonzero(differs):
            self._bodies.setdefault(int(common[row]), [a.tick, time, 0.0, time, 0.0])
        for entity, amount in zip(common[differs].tolist(), distance[differs].tolist(), strict=True):
            known = self._bodies[entity]
            if amount > known[2]:
                known[2:4] = [amount, time]
        self._note_final(common, distance)
        self._note_horizons(time, float(distance.max(initial=0.0)))
        if self._stride and self._instants % self._stride == 0:
            self._samples.append((time, common, distance))
        self._instants += 1

    def result(self, curves: int) -> Comparison:
        """All of it."""
        a, b = self._recordings
        names = _names(a) | _names(b)
        bodies = [
            BodyDifference(
                entity=entity,
                name=names.get(entity, ""),
                first_tick=int(first),
                first_time=since,
                largest=largest,
                largest_time=when,
                final=final,
            )
            for entity, (first, since, largest, when, final) in self._bodies.items()
        ]
        bodies.sort(key=lambda body: (-body.largest, body.entity))
        tick, since, what = self._first or (-1, math.nan, "")
        return Comparison(
            a=str(a.path),
            b=str(b.path),
            instants=self._instants,
            first_time=self._span[0],
            last_time=self._span[1],
            differs=self._first is not None,
            first_tick=tick,
            first_difference=since,
            first_of=what,
            horizons=[
                Horizon(distance=distance, time=when, after=when - since)
                for distance, when in ((d, self._exceeded.get(d, math.nan)) for d in HORIZONS)
            ],
            bodies=bodies,
            lone=[
                LoneBody(
                    entity=entity,
                    name=names.get(entity, ""),
                    only_in=str(self._recordings[side].path),
                    tick=at,
                    time=when,
                )
                for (entity, side), (at, when) in self._lone.items()
            ],
            curves=list(self._curves(bodies[:curves])) if curves else [],
        )

    def _differing(self, a: StateFrame, b: StateFrame, rows_a: Any, rows_b: Any) -> NDArray[np.bool_]:
        """[common] which bodies differ in anything, by more than the recordings may be off."""
        differs = np.zeros(len(rows_a), np.bool_)
        for name in _COLUMNS:
            ours, theirs = getattr(a, name)[rows_a], getattr(b, name)[rows_b]
            bound = self._bounds[name]
            if bound == 0.0:
                differs |= (ours != theirs).any(axis=1)
            elif name == "rotation":
                differs |= ~(_angles(ours, theirs) <= bound)
            else:
                differs |= ~(np.linalg.norm(ours.astype(np.float64) - theirs, axis=1) <= bound)
        return differs

    def _note_first(self, frame: StateFrame, what: str) -> None:
        self._first = self._first or (frame.tick, frame.simulation_time, what)

    def _note_lone(self, a: StateFrame, b: StateFrame, common: NDArray[np.uint32]) -> None:
        for side, frame in enumerate((a, b)):
            if len(frame.entity) > len(common):
                for entity in np.setdiff1d(frame.entity, common).tolist():
                    self._lone.setdefault((entity, side), (frame.tick, frame.simulation_time))

    def _note_final(self, common: NDArray[np.uint32], distance: NDArray[np.float64]) -> None:
        if self._bodies:
            amounts = dict(zip(common.tolist(), distance.tolist(), strict=True))
            for entity, known in self._bodies.items():
                known[4] = amounts.get(entity, known[4])

    def _note_horizons(self, time: float, largest: float) -> None:
        for distance in HORIZONS:
            if largest > distance:
                self._exceeded.setdefault(distance, time)

    def _curves(self, bodies: list[BodyDifference]) -> Iterator[Curve]:
        times = [time for time, _, _ in self._samples]
        farthest = [float(distance.max(initial=0.0)) for _, _, distance in self._samples]
        yield Curve(name="the farthest", time=times, distance=farthest)
        for body in bodies:
            found = [
                (time, float(distance[rows[0]]))
                for time, common, distance in self._samples
                if len(rows := np.flatnonzero(common == body.entity))
            ]
            yield Curve(
                name=body.name or f"entity {body.entity}", time=[t for t, _ in found], distance=[d for _, d in found]
            )


def _angles(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float64]:
    """[N] the angle between rotations [rad]; exact for small ones."""
    a, b = a.astype(np.float64), b.astype(np.float64)
    scalar = np.abs((a * b).sum(axis=1))
    vector = a[:, 3:] * b[:, :3] - b[:, 3:] * a[:, :3] - np.cross(a[:, :3], b[:, :3])
    angles: NDArray[np.float64] = 2.0 * np.arctan2(np.linalg.norm(vector, axis=1), scalar)
    return angles


def _names(recording: Recording) -> dict[int, str]:
    """Names of the entities at the beginning and at the end."""
    names: dict[int, str] = {}
    for place in (len(recording) - 1, 0):
        names |= {entity.id: entity.name for entity in recording.mirror_at(place).entities.values()}
    return names

"""What ticks and frames cost over time: the newest, the worst of the last minute, and the one somebody holds on to."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

KEPT: Final = 600  # ticks or frames that curves and figures are of
DRAWN_SAMPLES: Final = 200  # of curves
SPIKE_WINDOW: Final = 60.0  # [s] for which the worst one is kept
REST: Final = "between stages"  # what no stage accounts for

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Sample:
    """One tick or frame. Times are in ms, stages in the order in which they ran."""

    number: int
    at: float  # [s] when it came, by any steady clock
    total: float
    stages: Mapping[str, float]
    late: float = 0.0
    counts: Mapping[str, int] = field(default_factory=dict)

    @cached_property
    def own(self) -> dict[str, float]:
        """What each stage took without its parts [ms], and REST: together the total."""
        own = dict(self.stages)
        for name, cost in self.stages.items():
            if parent := within(name, self.stages):
                own[parent] -= cost
        own = {name: max(cost, 0.0) for name, cost in own.items()}
        own[REST] = max(self.total - sum(own.values()), 0.0)
        return own


class Bar(NamedTuple):
    """A stage in a flame strip [ms]; `depth` 1 lies within the one of depth 0 above it."""

    name: str
    start: float
    length: float
    depth: int


class Figures(NamedTuple):
    """Of the totals that are kept [ms], and how many of them took longer than the budget."""

    sample_count: int
    mean: float
    median: float
    p99: float
    longest: float
    over_budget: int


class ProfileTrack:
    """The last samples of one node or view. `budget` [ms] is what one may take; 0 where there is none."""

    def __init__(self, *, budget: float = 0.0, kept: int = KEPT) -> None:
        self.samples: deque[Sample] = deque(maxlen=kept)
        self.budget = budget
        self.held: Sample | None = None
        self._worst: deque[Sample] = deque()  # of the last minute, each cheaper and newer than the one before

    def add(self, sample: Sample) -> None:
        """Takes the newest one; one whose number runs backwards begins anew: a host was started again."""
        if self.samples and sample.number < self.samples[-1].number:
            self.samples.clear()
            self._worst.clear()
        self.samples.append(sample)
        while self._worst and self._worst[-1].total <= sample.total:
            self._worst.pop()
        self._worst.append(sample)
        while self._worst[0].at < sample.at - SPIKE_WINDOW:
            self._worst.popleft()

    @property
    def worst(self) -> Sample | None:
        """The dearest of the last minute."""
        return self._worst[0] if self._worst else None

    @property
    def chosen(self) -> Sample | None:
        """The one that is held, else the newest."""
        return self.held or (self.samples[-1] if self.samples else None)

    def hold(self, sample: Sample | None) -> None:
        """Shows this one until another is held; None for the newest again."""
        self.held = sample

    def nearest(self, number: float) -> Sample | None:
        """The sample whose number is nearest."""
        return min(self.samples, key=lambda sample: abs(sample.number - number), default=None)

    def drawn(self, limit: int = DRAWN_SAMPLES) -> list[Sample]:
        """At most `limit` samples for curves: of each stretch the dearest, so that no spike is lost."""
        samples = list(self.samples)
        stretch = -(-len(samples) // limit) or 1
        return [max(samples[i : i + stretch], key=_total) for i in range(0, len(samples), stretch)]

    def totals(self) -> Array:
        """(N,) [ms]."""
        return np.array([sample.total for sample in self.samples], np.float64)

    def figures(self) -> Figures | None:
        """None before the first sample."""
        if not self.samples:
            return None
        totals = self.totals()
        median, p99 = np.percentile(totals, (50.0, 99.0))
        over = int((totals > self.budget).sum()) if self.budget else 0
        return Figures(len(totals), float(totals.mean()), float(median), float(p99), float(totals.max()), over)

    def stage_names(self) -> list[str]:
        """Every stage of the kept samples, in the order in which they run."""
        names: dict[str, None] = {}
        for sample in self.samples:
            if names.keys() != sample.stages.keys():
                names |= dict.fromkeys(sample.stages)
        return [*names, REST]

    @staticmethod
    def stacked(names: Sequence[str], samples: Sequence[Sample]) -> Array:
        """(S + 1, N) [ms]: own times of N samples upon one another; row s is where stage s begins, the last row the top."""
        rows = np.zeros((len(names) + 1, len(samples)))
        for column, sample in enumerate(samples):
            rows[1:, column] = [sample.own.get(name, 0.0) for name in names]
        return np.cumsum(rows, axis=0)


def _total(sample: Sample) -> float:
    return sample.total


def within(name: str, stages: Mapping[str, Any]) -> str:
    """The stage that a stage is a part of: `physics.broadphase` of `simulate_physics`; "" for one that stands by itself."""
    group, dot, _ = name.partition(".")
    if not dot:
        return ""
    return next((other for other in stages if "." not in other and (other == group or other.endswith(f"_{group}"))), "")


def flame(sample: Sample) -> list[Bar]:
    """The stages in order, each where the one before it ended, parts below what they are parts of; REST at the end."""
    parts: dict[str, list[str]] = {}
    for name in sample.stages:
        if parent := within(name, sample.stages):
            parts.setdefault(parent, []).append(name)
    inner = {name for names in parts.values() for name in names}
    bars, start = [], 0.0
    for name, cost in sample.stages.items():
        if name in inner:
            continue
        bars.append(Bar(name, start, cost, 0))
        inside = start
        for part in parts.get(name, ()):
            bars.append(Bar(part, inside, sample.stages[part], 1))
            inside += sample.stages[part]
        start += cost
    if (rest := sample.total - start) > 0.0:
        bars.append(Bar(REST, start, rest, 0))
    return bars

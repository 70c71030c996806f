"""State frames on their way over links of several kinds: when a host publishes them, and when they come by another clock.

All of it is in virtual time and follows from a seed. The truth is known: at which moment the host was at which simulation time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

TICK_RATE: Final = 60.0  # [Hz]
ROUND: Final = 1e-3  # [s] within which only the newest of what comes is taken, as a loop does
OFFSET: Final = 1234.5  # [s] by which the clock here is ahead of the host's

Delay = Callable[[np.random.Generator, float], float]  # of what is sent at a time [s]: [s] on the way


class Come(NamedTuple):
    """A state that came."""

    tick: int
    simulation_time: float  # [s]
    published: float  # [s] by the host's clock
    playing: bool
    first: float  # [s] by the clock here, of the first that came in the same round
    came: float  # [s] by the clock here


class Course(NamedTuple):
    """What the host does: from which time [s] on, at which rate; 0 stands."""

    pieces: tuple[tuple[float, float], ...] = ((0.0, 1.0),)

    def simulation_time(self, time: float) -> float:
        """[s], exact."""
        total = 0.0
        for number, (start, rate) in enumerate(self.pieces):
            end = self.pieces[number + 1][0] if number + 1 < len(self.pieces) else math.inf
            total += max(min(time, end) - start, 0.0) * rate
        return total

    def time_of(self, simulation_time: float) -> float:
        """The first time [s] at which the host is there."""
        before = 0.0
        for number, (start, rate) in enumerate(self.pieces):
            end = self.pieces[number + 1][0] if number + 1 < len(self.pieces) else math.inf
            gone = (end - start) * rate if rate else 0.0
            if rate and simulation_time <= before + gone + 1e-12:
                return start + (simulation_time - before) / rate
            before += gone
        return math.inf


def steady(least: float, spread: float) -> Delay:
    """At least so long, and exponentially longer [s]."""
    return lambda rng, _: least + float(rng.exponential(spread))


def wireless(rng: np.random.Generator, _: float) -> float:
    """3 ms and some more, and one in twenty 30 to 60 ms."""
    extra = rng.uniform(0.03, 0.06) if rng.random() < 0.05 else rng.gamma(2.0, 0.0025)
    return 0.003 + float(extra)


def bunched(rng: np.random.Generator, time: float) -> float:
    """A radio that sleeps, and delivers ten times a second what has come meanwhile."""
    return 0.005 + math.ceil(time / 0.1) * 0.1 - time + float(rng.exponential(0.001))


def stalling(rng: np.random.Generator, _: float) -> float:
    """25 ms, and one in fifty is lost and comes 200 ms later, and all after it wait."""
    return 0.025 + float(rng.exponential(0.001)) + (0.2 if rng.random() < 0.02 else 0.0)


LINKS: Final[dict[str, Delay]] = {
    "one machine": steady(0.0003, 0.0002),
    "cable, 20 ms": steady(0.010, 0.0005),
    "wireless": wireless,
    "wireless, asleep between": bunched,
    "2 % lost, 200 ms each": stalling,
    "far, 300 ms": steady(0.150, 0.004),
}


def trace(
    delay: Delay,
    *,
    seconds: float = 30.0,
    course: Course | None = None,
    seed: int = 1,
    drift: float = 0.0,
    unevenness: float = 0.0005,
) -> list[Come]:
    """What comes in some seconds: in order, as over a stream, and of those in one round of the loop the newest.

    `drift` [s/s] is what the clock here goes faster than the host's; ticks are exponentially late by `unevenness` [s].
    """
    course = course or Course()
    rng = np.random.default_rng(seed)
    published = _published(course, seconds, rng, unevenness)
    arrivals: list[tuple[float, Come]] = []
    last = 0.0
    for tick, time, at, playing in published:
        last = max(last, at + delay(rng, at))
        arrivals.append((last, Come(tick, time, at, playing, 0.0, here(last, drift))))
    found: list[Come] = []
    first = math.nan
    for number, (at, come) in enumerate(arrivals):
        first = come.came if math.isnan(first) else first
        if number + 1 < len(arrivals) and arrivals[number + 1][0] - at < ROUND and arrivals[number + 1][1].playing:
            continue
        found.append(come._replace(first=first))
        first = math.nan
    return found


def here(time: float, drift: float = 0.0) -> float:
    """What the clock here says [s] at a time of the host's."""
    return OFFSET + time * (1.0 + drift)


def _published(
    course: Course, seconds: float, rng: np.random.Generator, unevenness: float
) -> list[tuple[int, float, float, bool]]:
    found, last, tick = [], 0.0, 0
    stands = [start for start, rate in course.pieces if rate == 0.0]
    while True:
        tick += 1
        due = course.time_of(tick / TICK_RATE)
        while stands and (stands[0] < due):
            at = stands.pop(0)
            if at < seconds:  # the tick before, told again as one at which time stands
                found.append((tick - 1, (tick - 1) / TICK_RATE, max(at, last) + 1e-4, False))
        if due > seconds:
            return found
        last = max(due + float(rng.exponential(unevenness)), last + 1e-5)
        found.append((tick, tick / TICK_RATE, last, True))


# --- watching ------------------------------------------------------------------------------------------------------


class Watcher(NamedTuple):
    """What takes states, and what is asked at each picture: which simulation time [s] is seen at `now` [s]."""

    take: Callable[[Come], object]
    seen_time: Callable[[float], float]


class Watched(NamedTuple):
    """What was seen, a row a picture."""

    now: np.ndarray  # [s] by the clock here
    seen: np.ndarray  # [s] of simulation
    age: np.ndarray  # [s] since the host was there, truly

    def stutter(self, skip: float = 10.0) -> float:
        """Standard deviation of the speed at which time is seen to go, after `skip` seconds."""
        rows = self.now[1:] > self.now[0] + skip
        return float(np.std((np.diff(self.seen) / np.diff(self.now))[rows]))

    def settled_age(self, skip: float = 10.0) -> np.ndarray:
        """Ages [s] after `skip` seconds."""
        return self.age[self.now > self.now[0] + skip]


def watched(
    states: list[Come], watcher: Watcher, *, course: Course | None = None, drift: float = 0.0, pace: float = 1.0 / 59.4
) -> Watched:
    """Looks each `pace` seconds, from the second state on until the last has come."""
    course = course or Course()
    rows, number, now = [], 0, states[1].came
    while now < states[-1].came:
        while number < len(states) and states[number].came <= now:
            watcher.take(states[number])
            number += 1
        seen = watcher.seen_time(now)
        rows.append((now, seen, (now - OFFSET) / (1.0 + drift) - course.time_of(seen)))
        now += pace
    return Watched(*np.array(rows).T)

"""How viewers went through time before: always one interval behind the newest frame, as fast as that takes.

Kept as what `python -m tests.benchmarks.clock` compares with.
"""

from __future__ import annotations

from tests.link_traces import Come

LOOKAHEAD = 0.1  # [s]
LONGEST_DELAY = 0.5  # [s]
FOLLOWING = 0.01
SHORTEST_WAY = 0.3


class TwoFrames:
    """The newest two frames."""

    def __init__(self) -> None:
        self._times = (0.0, 0.0)  # [s] of simulation
        self._published = self._arrived = self._first = self._delay = self._reached = 0.0
        self._interval = 1.0 / 60.0
        self._count = 0

    def take(self, come: Come) -> None:
        """Goes to a state from where things are."""
        seen = self.seen_time(come.came)
        before, self._count = self._times[1], self._count + 1
        gap = come.simulation_time - before
        delay = come.came - come.published
        follows = self._count > 1 and 0.0 < gap <= 0.5 and come.playing
        is_known = follows and self._delay <= delay <= self._delay + LONGEST_DELAY
        self._delay = self._delay + FOLLOWING * (delay - self._delay) if is_known else delay
        self._first = 0.0
        if follows:
            self._interval = min(max(come.published - self._published, 1e-3), 0.25)
            self._first = min(max((seen - before) / gap, 0.0), 1.0)
        self._times = (before if follows else come.simulation_time, come.simulation_time)
        in_time = come.published + self._delay + self._interval
        self._reached = max(in_time, come.came + SHORTEST_WAY * self._interval)
        self._published, self._arrived = come.published, come.came

    def seen_time(self, now: float) -> float:
        """The simulation time [s] that is seen."""
        if now < self._reached:
            share = max(now - self._arrived, 0.0) / (self._reached - self._arrived)
            share = self._first + (1.0 - self._first) * share
        else:
            last = 1.0 + min(1.0, LOOKAHEAD / self._interval)
            share = min(1.0 + (now - self._reached) / self._interval, last)
        return self._times[0] + (self._times[1] - self._times[0]) * share

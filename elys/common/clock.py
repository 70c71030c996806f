"""When the next tick is due: a fixed step on a monotonic clock."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from typing import Final

_MEASURED_SPAN: Final = 1.0  # [s] over which the realtime factor is measured


class FixedStepClock:
    """Counts ticks of one fixed length and says when each is due.

        while running:
            await asyncio.sleep(clock.seconds_until_due())
            for _ in range(clock.take_due()):
                tick(world)
                clock.advance()

    Deadlines are counted from one anchor, so they do not drift. What comes late is caught up, but at most `max_catch_up` ticks
    in one go: what is due beyond that is given up and counted in `lost_ticks`, and time goes on from there. While paused nothing
    is due, and resuming starts a new anchor, so a pause is never caught up.
    """

    def __init__(
        self,
        tick_rate: float,
        *,
        now: Callable[[], float] = time.monotonic,
        max_catch_up: int = 5,
        rate: float = 1.0,
        playing: bool = True,
        tick: int = 0,
    ) -> None:
        """A clock of `tick_rate` [Hz], of which `rate` seconds pass in one of `now` [s]; 0: as fast as it can."""
        if not tick_rate > 0.0:
            raise ValueError(f"a tick rate must be above 0 Hz, not {tick_rate}")
        if max_catch_up < 1:
            raise ValueError(f"at least one tick must be caught up, not {max_catch_up}")
        self._tick_rate = tick_rate
        self._now = now
        self._max_catch_up = max_catch_up
        self._rate = _checked_rate(rate)
        self._playing = playing
        self._tick = tick
        self._lost_ticks = 0
        self._anchor_time = now()
        self._anchor_tick = tick
        self._measured: deque[tuple[float, int]] = deque([(self._anchor_time, tick)])

    @property
    def tick(self) -> int:
        """Ticks done since the simulation's beginning."""
        return self._tick

    @property
    def tick_rate(self) -> float:
        """Ticks in a second of simulation [Hz]."""
        return self._tick_rate

    @property
    def step(self) -> float:
        """Simulated length of a tick [s]."""
        return 1.0 / self._tick_rate

    @property
    def lost_ticks(self) -> int:
        """Ticks that were due and given up, because the machine was too slow."""
        return self._lost_ticks

    @property
    def playing(self) -> bool:
        """Whether time goes on."""
        return self._playing

    @property
    def rate(self) -> float:
        """Simulated seconds asked for in one second; 0: as fast as it can."""
        return self._rate

    @property
    def realtime_factor(self) -> float:
        """Simulated seconds that passed in one second, over the last second or so; 0 while paused."""
        if not self._playing:
            return 0.0
        start_time, start_tick = self._measured[0]
        elapsed = self._now() - start_time
        return (self._tick - start_tick) / self._tick_rate / elapsed if elapsed > 0.0 else 0.0

    @property
    def deadline(self) -> float:
        """When the next tick is due, on the clock `now` [s]; +inf while paused."""
        if not self._playing:
            return math.inf
        if self._rate == 0.0:
            return self._anchor_time
        return self._anchor_time + (self._tick - self._anchor_tick + 1) / (self._tick_rate * self._rate)

    def seconds_until_due(self) -> float:
        """How long to sleep before the next tick [s]: 0 if it is due, +inf while paused."""
        return max(self.deadline - self._now(), 0.0)

    def lateness(self) -> float:
        """How long the next tick has been due [s]; 0 if it is not, or while it has no time at which it must be done."""
        return max(self._now() - self.deadline, 0.0) if self._playing and self._rate > 0.0 else 0.0

    def take_due(self) -> int:
        """How many ticks to do now, each followed by `advance`; gives up what is beyond `max_catch_up`."""
        if not self._playing:
            return 0
        if self._rate == 0.0:
            return 1
        per_second = self._tick_rate * self._rate
        behind = (self._now() - self._anchor_time) * per_second - (self._tick - self._anchor_tick)
        # A timer that fires at the deadline must find the tick due, whichever way the product was rounded.
        due = max(math.floor(behind + 1e-6), 0)
        if due > self._max_catch_up:
            lost = due - self._max_catch_up
            self._lost_ticks += lost
            self._anchor_time += lost / per_second
            due = self._max_catch_up
        return due

    def advance(self) -> None:
        """One tick was done: one that was due, or a single step while paused."""
        self._tick += 1
        if not self._playing:
            return
        now = self._now()
        self._measured.append((now, self._tick))
        while len(self._measured) > 2 and now - self._measured[1][0] >= _MEASURED_SPAN:
            self._measured.popleft()

    def play(self) -> None:
        """Goes on from now; nothing is due before one step from now."""
        if not self._playing:
            self._playing = True
            self._start_anew()

    def pause(self) -> None:
        """Nothing is due any more."""
        self._playing = False

    def set_rate(self, rate: float) -> None:
        """Changes how many seconds of simulation pass in one second, from now on; 0: as fast as it can."""
        self._rate = _checked_rate(rate)
        self._start_anew()

    def set_tick_rate(self, tick_rate: float) -> None:
        """Another length of ticks [Hz] from now on."""
        if not tick_rate > 0.0:
            raise ValueError(f"a tick rate must be above 0 Hz, not {tick_rate}")
        self._tick_rate = tick_rate
        self._start_anew()

    def seek(self, tick: int) -> None:
        """Goes on from another tick, now."""
        self._tick = tick
        self._start_anew()

    def _start_anew(self) -> None:
        self._anchor_time = self._now()
        self._anchor_tick = self._tick
        self._measured.clear()
        self._measured.append((self._anchor_time, self._tick))


def _checked_rate(rate: float) -> float:
    if not 0.0 <= rate < math.inf:
        raise ValueError(f"a rate must be a finite number of at least 0, not {rate}")
    return rate

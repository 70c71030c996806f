"""At which moment of the host's clock things are seen: a steady while ago, however unevenly states come.

    states come ──> Lateness ──> delay = a tick + what SHARE of ticks are known late at most
    now - quickest way - delay ──> the moment meant ──> the moment seen, which goes there a few per cent faster or slower

The moment is one of the host's clock and not of the simulation's: rates, pauses and an overloaded host then need no thought, for
states are stamped when they were. docs/clock.md has what comes of it.
"""

from __future__ import annotations

from collections import deque
from statistics import median
from typing import Final

from elys.bus.lateness import Lateness

SLEW: Final = 0.05  # by which time is seen to go faster or slower, to be as late as is meant
SLEW_TIME: Final = 0.5  # [s] within which a small difference has gone for the most part
LEAP: Final = 0.5  # [s] of difference above which time is not slewed but set
LONGEST_WAIT: Final = 0.25  # [s] beyond a tick that is waited for late states; what comes later finds things standing
STREAM_WAIT: Final = (
    0.08  # [s] the same of a stream, which leaves out what is late: with 50 ms and a tick it makes 150 ms
)
BRIDGED: Final = 0.25  # of a tick by which a state may be late and cost no delay: things go on as they did for so long
BRIDGED_AT_MOST: Final = 0.01  # [s] likewise
CLOCK_SET: Final = 1.0  # [s] by which stamps and arrivals disagree when somebody has set the host's clock
SHORTEST: Final = 1e-6  # [s] between two states
REMEMBERED: Final = 3  # intervals whose median is taken: another rate is known after two
ANOTHER_RATE: Final = 0.3  # of a rate by which it differs from one that is uneven only
LEARNED: Final = 0.02  # of what rates differ by otherwise, from state to state
EVENED: Final = 0.1  # of a stamp's deviation that is believed
UNEVEN: Final = 0.005  # [s] and a quarter of an interval: what is farther from an even course is no host's jitter


class Playout:
    """Hears when states were stamped and when they came; tells which moment to show. Without frames, without a clock.

    Attributes:
        longest_wait: [s] beyond a tick for late states.
    """

    def __init__(self) -> None:
        self.longest_wait = LONGEST_WAIT
        self._lateness = Lateness()
        self._intervals: deque[float] = deque(maxlen=REMEMBERED)  # [s] of the host's clock between two states
        self._slopes: deque[float] = deque(maxlen=REMEMBERED)  # [s] of it for one of the simulation
        self.slope = (
            0.0  # the same, evened: seconds of the host's clock for one of the simulation; 0 before that is known
        )
        self._last = (0.0, 0.0, 0.0, 0.0)  # stamp, even stamp, simulation time, arrival of the last state [s]
        self._tick = 1.0 / 60.0  # [s] of the host's clock for a tick, as they go now
        self._cursor = 0.0  # [s] of the host's clock
        self._at = 0.0  # [s] here, when it was there
        self._is_running = False  # the cursor stands where it is meant to be as soon as it is asked for
        self._is_after_pause = False

    @property
    def interval(self) -> float:
        """Seconds of the host's clock between two states that come, now."""
        return median(self._intervals) if self._intervals else 1.0 / 60.0

    @property
    def delay(self) -> float:
        """How long [s] after the quickest way a state is to be seen: a tick, and what some wait or others are left out."""
        bridged = min(BRIDGED * self._tick, BRIDGED_AT_MOST)
        return self._tick + min(max(self._lateness.usual - bridged, 0.0), self.longest_wait)

    def follow(
        self, stamp: float, simulation_time: float, *, ticks: int, first: float, came: float
    ) -> tuple[float, float]:
        """Takes the state `ticks` after the last one, of the same course of time; see `Lateness.note`.

        Returns the moments from which and until which things go there: `stamp` [s] without what makes the host's ticks uneven.
        """
        is_set = self._heed_clock(stamp, came)
        before, even_before, time_before, _ = self._last
        gap = simulation_time - time_before
        if is_set or self._is_after_pause:
            even, start, self._is_running = stamp, stamp - gap * (self.slope or 1.0), False
        else:
            self._learn_slope(max(stamp - before, 0.0) / gap)
            even, start = self._evened(stamp, even_before + self.slope * gap, self.slope * gap), even_before
            even = max(even, even_before + SHORTEST)
            self._intervals.append(even - even_before)
            self._tick = self.slope * gap / ticks
        self._lateness.note(even, came, first=first, missing=ticks - 1, spacing=self._tick)
        self._last, self._is_after_pause = (stamp, even, simulation_time, came), False
        return start, even

    def begin(self, stamp: float, simulation_time: float, *, came: float) -> float:
        """Takes a state that follows none, as the first and one after a seek. Returns `stamp`."""
        self._heed_clock(stamp, came)
        self._lateness.note(stamp, came)
        self._last = (stamp, stamp, simulation_time, came)
        self._is_running = self._is_after_pause = False
        return stamp

    def pause(self) -> None:
        """Time stands after the last state: the next one tells nothing of how fast it goes."""
        self._is_after_pause = True

    def forget(self) -> None:
        """Starts anew, as with another host."""
        self._lateness.forget()
        self._intervals.clear()
        self._slopes.clear()
        self.slope = 0.0
        self._is_running = self._is_after_pause = False

    def moment(self, now: float, *, end: float) -> float:
        """The moment [s] of the host's clock to show at `now` [s], `end` at the latest: nothing is known of what comes then."""
        elapsed, self._at = max(now - self._at, 0.0), max(now, self._at)
        meant = self._at - self._lateness.least - self.delay
        behind = meant - self._cursor - elapsed
        if not self._is_running or abs(behind) > LEAP:
            self._cursor, self._is_running = meant, True
        else:
            slewed = min(elapsed / SLEW_TIME, 1.0) * behind
            self._cursor += elapsed + min(max(slewed, -SLEW * elapsed), SLEW * elapsed)
        self._cursor = min(self._cursor, end)
        return self._cursor

    def age_of(self, moment: float, now: float) -> float:
        """How long ago [s] the host's clock showed `moment`, had the quickest state needed no time; no clocks need to agree."""
        return max(now - self._lateness.least - moment, 0.0) if self._lateness.is_known else 0.0

    def _learn_slope(self, slope: float) -> None:
        self._slopes.append(slope)
        now = median(self._slopes)
        if abs(now - self.slope) > ANOTHER_RATE * self.slope:
            self.slope = now
        else:
            self.slope += LEARNED * (now - self.slope)

    @staticmethod
    def _evened(stamp: float, predicted: float, length: float) -> float:
        bound = min(UNEVEN, 0.25 * length)
        return min(max(predicted + EVENED * (stamp - predicted), stamp - bound), stamp + bound)

    def _heed_clock(self, stamp: float, came: float) -> bool:
        """Forgets times that another clock told; whether it did."""
        is_set = self._lateness.is_known and abs((stamp - self._last[0]) - (came - self._last[3])) > CLOCK_SET
        if is_set:
            self._lateness.forget()
            self._is_running = False
        return is_set

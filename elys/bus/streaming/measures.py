"""How a stream does, measured where its frames arrive. No clocks need to agree."""

from __future__ import annotations

from collections import deque
from typing import Final

from elys.bus.messages.streaming import StreamReport
from elys.bus.streaming.claims import Claim
from elys.bus.streaming.wire import FrameHead

SPAN: Final = 5.0  # [s] over which rates and ages are told
_MILLI: Final = 1e3
_BASE_SPAN: Final = 30.0  # [s] in which the fastest frame is taken to have met no queue


def stream_text(report: StreamReport) -> str:
    """A report in a line, as people read it."""
    return (
        f"stream {report.rate / _MILLI:.0f} kB/s   {report.age_p95 * _MILLI:.0f} ms old at most   "
        f"off by {report.position_error * _MILLI:.3g} mm   {100.0 * report.loss:.1f} % late or lost"
    )


class Measures:
    """Tell it of every frame that came (`arrived`) and look now and then (`look`)."""

    def __init__(self) -> None:
        self.claim: Claim | None = None  # of the state that is shown
        self.head: FrameHead | None = None  # likewise
        self.tick = -1
        self._base: deque[tuple[float, float]] = (
            deque()
        )  # (second, least time between publishing and arrival, clocks and all)
        self._came: deque[tuple[float, int]] = deque()  # when, bytes
        self._ages: deque[tuple[float, float]] = deque()
        self._newest_at = 0.0  # by this side's clock: when the newest state was published
        self._losses: deque[tuple[float, int, int]] = deque()  # when, frames numbered, frames that did not come in turn

    def arrived(self, now: float, size: int) -> None:
        """Something came."""
        self._came.append((now, size))

    def shown(self, now: float, head: FrameHead, published_at: float, tick: int, claim: Claim) -> None:
        """A state is shown from now on, which the host published at its `published_at` [s]."""
        late = now - published_at
        second = float(int(now))
        if self._base and self._base[-1][0] == second:
            self._base[-1] = (second, min(self._base[-1][1], late))
        else:
            self._base.append((second, late))
        while self._base[0][0] < now - _BASE_SPAN:
            self._base.popleft()
        least = min(least for _, least in self._base)
        # The fastest frame took half the fastest round trip, and what it waited for being sent; this one that, and its lateness.
        self._newest_at = now - (late - least) - 0.5 * head.round_trip - head.hold
        self.head, self.claim, self.tick = head, claim, tick

    def counted(self, now: float, numbered: int, astray: int) -> None:
        """Notes how many frames there have been in all, and of those how many came late or not at all."""
        self._losses.append((now, numbered, astray))

    def age(self, now: float) -> float:
        """[s] since the newest state was published; 0 before there is any."""
        return 0.0 if self.head is None else max(now - self._newest_at, 0.0)

    def look(self, now: float) -> None:
        """Notes how old the state is now."""
        if self.head is not None:
            self._ages.append((now, self.age(now)))
        for line in (self._came, self._ages, self._losses):
            while line and line[0][0] < now - SPAN:
                line.popleft()

    @property
    def age_p95(self) -> float:
        """[s] that the state was not older than, 19 of 20 times in the last seconds."""
        ages = sorted(age for _, age in self._ages)
        return ages[min(int(len(ages) * 0.95), len(ages) - 1)] if ages else 0.0

    def rate(self, now: float) -> tuple[float, float]:
        """[B/s] and [1/s] that came."""
        if not self._came:
            return 0.0, 0.0
        span = max(min(now - self._came[0][0], SPAN), 0.25)
        return sum(size for _, size in self._came) / span, len(self._came) / span

    @property
    def loss(self) -> float:
        """Share of frames that came late or not at all."""
        if len(self._losses) < 2:
            return 0.0
        first, last = self._losses[0], self._losses[-1]
        return max(last[2] - first[2], 0) / (last[1] - first[1]) if last[1] > first[1] else 0.0

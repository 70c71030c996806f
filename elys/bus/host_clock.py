"""What the host's clock says, and how long a message is on the way to it and back: one estimate for all who show an age.

    this side    sent ─────────────────────────> came          (this side's monotonic clock)
    the host            ──────> host's clock ──>

The host read its clock somewhere between: half of the round trip is the most by which one can be wrong (RFC 5905, section 8). Of
the last pings that with the least of it counts, plus what the clocks may have gone apart since (section 10, the clock filter).
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any, Final, NamedTuple, Protocol

from elys.bus import topics
from elys.bus.messages.session import ClockReply, ClockRequest
from elys.common.errors import BusError

STAGES: Final = 8  # pings that are kept, as NSTAGE of RFC 5905
WANDER: Final = 200e-6  # [s/s] by which clocks go apart
QUICK_PINGS: Final = 4  # at first, so that there is something to choose from
QUICK_INTERVAL: Final = 0.1  # [s]
INTERVAL: Final = 2.0  # [s] between two pings later
PATIENCE: Final = 3.0  # [s] for an answer
LEAPS: Final = 0.25  # [s] beyond what is possible: somebody has set the host's clock


class _Ping(NamedTuple):
    came: float  # [s] here
    offset: float  # [s] from this side's clock to the host's
    round_trip: float  # [s]

    def error(self, now: float) -> float:
        """The most [s] by which the offset is wrong by now."""
        return self.round_trip / 2.0 + WANDER * (now - self.came)


class ClockFilter:
    """Chooses among the last pings. Without clocks and bus: all times are given."""

    def __init__(self) -> None:
        self._pings: deque[_Ping] = deque(maxlen=STAGES)

    def take(self, sent: float, host: float, came: float) -> None:
        """An answer in which the host's clock stood at `host` [s], to what was `sent` and `came` back by the clock here [s]."""
        ping = _Ping(came, host - (sent + came) / 2.0, max(came - sent, 0.0))
        best = self._best(came)
        if best is not None and abs(ping.offset - best.offset) > ping.error(came) + best.error(came) + LEAPS:
            self._pings.clear()
        self._pings.append(ping)

    def forget(self) -> None:
        """Starts anew, as with another host."""
        self._pings.clear()

    @property
    def round_trip(self) -> float | None:
        """The shortest [s] of the last; None before the first."""
        return min((ping.round_trip for ping in self._pings), default=None)

    @property
    def last_round_trip(self) -> float | None:
        """Of the last one [s]; None before the first."""
        return self._pings[-1].round_trip if self._pings else None

    def host_time(self, now: float) -> float | None:
        """What the host's clock says [s] when the one here says `now`; None before the first ping."""
        best = self._best(now)
        return now + best.offset if best is not None else None

    def error(self, now: float) -> float:
        """The most [s] by which that is wrong; infinite before the first ping."""
        best = self._best(now)
        return best.error(now) if best is not None else float("inf")

    def _best(self, now: float) -> _Ping | None:
        return min(self._pings, key=lambda ping: ping.error(now), default=None)


class Asker(Protocol):
    """Who is in a session, or may be."""

    @property
    def connected(self) -> bool:
        """Whether there is a host."""

    def request(self, query: Any, request: Any, *, timeout: float) -> Awaitable[Any]:
        """As `Session.request`."""


class HostClock:
    """The host's clock as it is known here. `run` keeps it so until it is cancelled."""

    def __init__(
        self,
        asker: Asker,
        *,
        clock: Callable[[], float] = time.monotonic,
        on_change: Callable[[], None] = lambda: None,
        interval: float = INTERVAL,
    ) -> None:
        self._asker = asker
        self._clock = clock
        self._on_change = on_change
        self._interval = interval
        self._filter = ClockFilter()
        self._epoch: int | None = None
        self.is_answered = False  # the last ping was

    @property
    def round_trip(self) -> float | None:
        """The shortest [s] of the last pings; None before the first, and while none comes back."""
        return self._filter.round_trip if self.is_answered else None

    @property
    def error(self) -> float:
        """The most [s] by which `age_of` is wrong; infinite before the first ping."""
        return self._filter.error(self._clock())

    def host_time(self, now: float | None = None) -> float | None:
        """What the host's wall clock says [s since 1970] at `now` [s] of the clock here; None before the first ping."""
        return self._filter.host_time(self._clock() if now is None else now)

    def age_of(self, stamp: float, now: float | None = None) -> float | None:
        """How long ago [s] the host's clock said `stamp` [s since 1970]; None before the first ping."""
        host_time = self.host_time(now)
        return max(host_time - stamp, 0.0) if host_time is not None else None

    async def run(self) -> None:
        """Pings: some at once, and then from time to time."""
        count = 0
        while True:
            await self.ping()
            self._on_change()
            count = count + 1 if self.is_answered else 0
            await asyncio.sleep(min(QUICK_INTERVAL, self._interval) if count < QUICK_PINGS else self._interval)

    async def ping(self) -> None:
        """Asks once."""
        if not self._asker.connected:
            self.forget()
            return
        sent = self._clock()
        try:
            reply: ClockReply = await self._asker.request(topics.CLOCK, ClockRequest(), timeout=PATIENCE)
        except BusError:
            self.is_answered = False
            return
        came = self._clock()
        if reply.epoch != self._epoch:  # another run, perhaps on another machine
            self._filter.forget()
            self._epoch = reply.epoch
        self._filter.take(sent, reply.wall_clock * 1e-9, came)
        self.is_answered = True

    def forget(self) -> None:
        """Starts anew."""
        self._filter.forget()
        self._epoch, self.is_answered = None, False

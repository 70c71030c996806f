"""How the link to the host does: round trip, age of what is known, frames that were skipped. Measured while somebody looks."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable
from typing import Final

from elys.bus import topics
from elys.bus.host_clock import HostClock
from elys.bus.messages.state_frame import StateFrame
from elys.bus.transports.transport import Closer
from elys.editor_node.seat import Seat

INTERVAL: Final = 1.0  # [s] between two pings
PATIENCE: Final = 3.0  # [s] without a look after which measuring ends


class LinkMeter:
    """`look` starts it; without further looks it ends by itself and costs nothing."""

    def __init__(
        self,
        seat: Seat,
        *,
        on_change: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
        interval: float = INTERVAL,
    ) -> None:
        self._host_clock = HostClock(seat, clock=clock)
        self._seat = seat
        self._on_change = on_change
        self._clock = clock
        self._interval = interval
        self._looked_at = -PATIENCE
        self._measuring: asyncio.Task[None] | None = None
        self._published_at: float | None = None  # [s] by the host's clock
        self._last_tick = -1
        self._skips: deque[tuple[float, int]] = deque()  # when [s], how many frames

    @property
    def is_measuring(self) -> bool:
        """Whether pings are sent."""
        return self._measuring is not None and not self._measuring.done()

    def look(self) -> None:
        """Somebody reads the figures: keeps them up to date for a while."""
        self._looked_at = self._clock()
        if not self.is_measuring:
            self._measuring = self._seat.start(self._measure())

    @property
    def round_trip(self) -> float | None:
        """The shortest [s] of the last pings; None before the first, and while none comes back."""
        return self._host_clock.round_trip

    @property
    def age(self) -> float | None:
        """How old [s] the newest state is by the host's clock; None before that is known."""
        return self._host_clock.age_of(self._published_at) if self._published_at is not None else None

    @property
    def age_error(self) -> float:
        """The most [s] by which `age` is wrong; infinite before anything is known."""
        return self._host_clock.error

    @property
    def dropped_per_second(self) -> float:
        """State frames that were published and not seen here, over the last second."""
        now = self._clock()
        while self._skips and now - self._skips[0][0] > 1.0:
            self._skips.popleft()
        return float(sum(count for _, count in self._skips))

    async def _measure(self) -> None:
        close = self._listen()
        try:
            while self._clock() - self._looked_at < PATIENCE:
                await self._host_clock.ping()
                self._on_change()
                await asyncio.sleep(self._interval)
        finally:
            close()
            self._published_at = None
            self._host_clock.forget()
            self._skips.clear()

    def _listen(self) -> Closer:
        self._last_tick = -1
        return self._seat.subscribe(topics.STATE, self._frame_arrived)

    def _frame_arrived(self, frame: StateFrame, _: str) -> None:
        now, self._published_at = self._clock(), frame.published_at * 1e-9
        skipped = frame.tick - self._last_tick - 1
        if frame.playing and self._last_tick >= 0 and skipped > 0:
            self._skips.append((now, skipped))
        self._last_tick = frame.tick

"""How the link to the host does: round trip, age of what is known, frames that were skipped. Measured while somebody looks."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable
from typing import Final

import elys
from elys.bus import topics
from elys.bus.messages.session import Hello
from elys.bus.messages.state_frame import StateFrame
from elys.bus.topics import PROTOCOL_VERSION
from elys.bus.transports.transport import Closer
from elys.common.errors import BusError
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
        self.round_trip: float | None = None  # [s] of the last ping; None before the first, and when none came back
        self._seat = seat
        self._on_change = on_change
        self._clock = clock
        self._interval = interval
        self._looked_at = -PATIENCE
        self._measuring: asyncio.Task[None] | None = None
        self._arrived_at: float | None = None
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
    def age(self) -> float | None:
        """How old [s] the newest state is: since it came, and half a round trip; no clocks need to agree."""
        if self._arrived_at is None:
            return None
        return self._clock() - self._arrived_at + (self.round_trip or 0.0) / 2.0

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
                await self._ping()
                self._on_change()
                await asyncio.sleep(self._interval)
        finally:
            close()
            self.round_trip = self._arrived_at = None
            self._skips.clear()

    def _listen(self) -> Closer:
        self._last_tick = -1
        return self._seat.subscribe(topics.STATE, self._frame_arrived)

    async def _ping(self) -> None:
        """The host answers a greeting at any time, and changes nothing for it."""
        if not self._seat.connected:
            self.round_trip = None
            return
        node = self._seat.node
        hello = Hello(protocol=PROTOCOL_VERSION, kind=node.kind, node=node.id, version=elys.__version__)
        start = self._clock()
        try:
            await self._seat.request(topics.HELLO, hello, timeout=PATIENCE)
        except BusError:
            self.round_trip = None
        else:
            self.round_trip = self._clock() - start

    def _frame_arrived(self, frame: StateFrame, _: str) -> None:
        now = self._arrived_at = self._clock()
        skipped = frame.tick - self._last_tick - 1
        if frame.playing and self._last_tick >= 0 and skipped > 0:
            self._skips.append((now, skipped))
        self._last_tick = frame.tick

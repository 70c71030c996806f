"""By which of a viewer's connections a frame goes.

TCP delivers in order: what comes after a lost packet waits until that one was sent again, a round trip or two. Frames need no
order, so a stream has several connections, and one that waits is left alone until it moves.
"""

from __future__ import annotations

from typing import Final

from elys.bus.streaming.flight import Sent
from elys.bus.streaming.rate import RateControl
from elys.bus.streaming.wire import LANES

_LATE: Final = 0.03  # [s], or a quarter of the round trip, beyond the fastest one: it waits for something


class LaneChoice:
    """Chooses among those that are `open` (bits)."""

    def __init__(self) -> None:
        self.open = 0
        self._used_at = [0.0] * LANES

    def is_stuck(self, sent: Sent, now: float, rate: RateControl) -> bool:
        """Whether a frame takes so long that its connection must be waiting."""
        trip = max(rate.fastest, rate.base_trip)
        return now - sent.at > trip + max(_LATE, 0.25 * trip)

    def best(self, pending: list[Sent], now: float, rate: RateControl) -> int | None:
        """Of those that move the one with least to carry; of equal ones that which has rested longest. None: none moves."""
        load = [0] * LANES
        stuck = [False] * LANES
        for sent in pending:
            load[sent.lane] += sent.size
            stuck[sent.lane] |= self.is_stuck(sent, now, rate)
        moving = [lane for lane in range(LANES) if self.open >> lane & 1 and not stuck[lane]]
        return min(moving, key=lambda lane: (load[lane], self._used_at[lane]), default=None)

    def used(self, lane: int, now: float) -> None:
        """Notes that one has carried a frame."""
        self._used_at[lane] = now

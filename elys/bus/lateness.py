"""How late messages come by the clock of who sends them, as a jitter buffer needs to know it."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

SPAN: Final = 8.0  # [s] that are looked back at: a clock that is 200 ppm wrong goes 1.6 ms in it
SHARE: Final = 0.97  # of messages that come no later than is told
MOST_KEPT: Final = 2048
MOST_MISSING: Final = 120  # of messages that were overtaken, between two that came


class Lateness:
    """Times on the way, of which only differences mean anything: nobody knows how the two clocks differ.

    The quickest message of the last SPAN is taken as one that did not wait (a minimum filter, as RFC 5905 has for clocks), all
    others for late by what they took longer. Those that were overtaken came with the one that overtook them, at the latest.
    """

    def __init__(self) -> None:
        self._taken: deque[tuple[float, float]] = deque(maxlen=MOST_KEPT)  # when it came [s], and after how long [s]
        self.least = math.inf  # [s] from the sender's clock to this one's, of the quickest
        self.usual = 0.0  # [s] later than the quickest come at most SHARE of them

    @property
    def is_known(self) -> bool:
        """Whether anything came."""
        return bool(self._taken)

    def note(
        self, stamp: float, came: float, *, first: float | None = None, missing: int = 0, spacing: float = 0.0
    ) -> None:
        """Takes a message that was stamped `stamp` [s] by the sender and `came` [s] by the clock here.

        So many are `missing` before it, which would have been stamped `spacing` [s] one after the other. They came from `first`
        [s] on, when this side began to keep messages until it had time for the newest: what it kept is not the way's lateness.
        """
        delay = came - stamp
        least = min(self.least, delay)
        for number in range(min(missing, MOST_MISSING), 0, -1):
            place = stamp - number * spacing
            self._taken.append((came, max((came if first is None else first) - place, least)))
        self._taken.append((came, delay))
        while came - self._taken[0][0] > SPAN:
            self._taken.popleft()
        self._measure()

    def forget(self) -> None:
        """Starts anew, as after another clock speaks."""
        self._taken.clear()
        self.least, self.usual = math.inf, 0.0

    def _measure(self) -> None:
        delays = np.fromiter((delay for _, delay in self._taken), float, len(self._taken))
        self.least = float(delays.min())
        rank = min(math.ceil(SHARE * len(delays)), len(delays)) - 1
        self.usual = float(np.partition(delays, rank)[rank]) - self.least

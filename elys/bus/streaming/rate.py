"""How much a link carries: learnt from how long frames take to be acknowledged.

What a bottleneck cannot carry waits in front of it, and the round trip grows; so the sender keeps it short, as TCP Vegas
(Brakmo and Peterson 1995) and LEDBAT (RFC 6817) do. A frame that was lost and sent again by TCP is late as well, without any
queue: it stops its own connection alone. So the *fastest* frame of a while counts, over all connections; a queue delays them
all. Where sending less does not make it shorter, it is not this stream's, and the longer round trip is taken for the link's
(as Copa competes, Arun and Balakrishnan 2018). Down at once, to what was delivered less a part (as BBR drains, Cardwell et al.
2016); up by half a look at first, after a queue quickly to where it was met, and slowly from there on.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

START: Final = 64_000.0  # [B/s]
LEAST: Final = 8_000.0  # [B/s]
MOST: Final = 16_000_000.0  # [B/s]
SHORTEST_LOOK: Final = 0.05  # [s] between two decisions
BASE_WINDOW: Final = 10.0  # [s] in which the shortest round trip is taken to have met no queue
QUEUE: Final = 0.025  # [s] of waiting, or a fifth of the round trip if that is more: there is a queue
LONG_QUEUE: Final = 0.1  # [s], or the whole round trip: it is out of hand
_DRAINED: Final = 0.85  # of what was delivered, while there is a queue
_CUT: Final = 0.5  # likewise, where it is out of hand
_FAST_RISE: Final = 1.5  # a look, before the first queue
_RETURN: Final = (
    1.2  # after it, until near what the link carried then: it was most likely not for good (as CUBIC, RFC 9438)
)
_RISE: Final = 1.05  # from there on
_NEAR: Final = 0.85  # of the rate at which the last queue was seen
_DELIVERED_FOR: Final = 1.5  # [s] in which the most that was delivered is what the link can
_IN_VAIN: Final = (
    4  # times in a row that less was sent, without the waiting growing shorter by a fifth: it is not this stream's
)
_SHORTER: Final = 0.8
_SILENCE: Final = 0.3  # [s], or three round trips, without an answer: the link stands still
_SETTLING: Final = (
    1.0  # [s] after a silence: on the few connections that stand by then, each lost packet looks like a queue
)
_FEWEST: Final = 3  # frames, of which one met no delay of its own
_QUIET: Final = 0.25  # of the rate: who sends less than that makes no queue
_GAIN: Final = 0.125  # of a new sample in the smoothed round trip (RFC 6298)
_SPARE: Final = 0.04  # [s] of sending that may be on its way beyond a round trip


class RateControl:
    """The rate [B/s] for one viewer; a pure function of what it is told and when."""

    def __init__(self, now: float) -> None:
        self.rate = START
        self.smoothed_trip = 0.2  # [s]
        self.fastest = 0.0  # [s] of the last look
        self.queues = 0  # how often one was seen
        self._is_rising_fast = True
        self._met_queue_at = 0.0  # [B/s]
        self._deliveries: deque[tuple[float, float]] = deque()  # (when, [B/s])
        self._base: deque[tuple[float, float]] = deque()  # (second, shortest round trip in it)
        self._samples: list[float] = []
        self._delivered = 0.0  # [B] since the last look
        self._looked_at = now
        self._quiet_until = now  # a decision must show before the next one
        self._answered_at = now
        self._silent_since: float | None = None
        self._before_silence = START
        self._falls: list[tuple[float, float]] = []  # in a row: rate before, the waiting [s]
        self._settled_at = -math.inf
        self._trusted_from = -math.inf  # frames sent earlier waited for other reasons than a queue

    @property
    def base_trip(self) -> float:
        """The round trip [s] without a queue, as far as one is known."""
        return min((trip for _, trip in self._base), default=self.smoothed_trip)

    @property
    def window(self) -> float:
        """Bytes that may be on their way."""
        return max(self.rate * (self.base_trip + _SPARE), 1500.0)

    @property
    def stands_still(self) -> bool:
        """Whether the link has gone silent."""
        return self._silent_since is not None

    def heard(self, now: float) -> None:
        """Something came from the viewer: the link goes."""
        if self._silent_since is not None:
            self._revive(now)
        self._answered_at = now

    def answered(self, now: float, trips: list[tuple[float, float]], size: float) -> None:
        """Takes an ack: when each frame that it tells anew was sent and how long that took [s], and their bytes."""
        self.heard(now)
        self._delivered += size
        for sent_at, trip in trips:
            if sent_at < self._trusted_from:
                continue
            self.smoothed_trip += _GAIN * (trip - self.smoothed_trip)
            self._samples.append(trip)
            second = math.floor(now)
            if self._base and self._base[-1][0] == second:
                self._base[-1] = (second, min(self._base[-1][1], trip))
            else:
                self._base.append((second, trip))
        while self._base and self._base[0][0] < now - BASE_WINDOW:
            self._base.popleft()

    def look(self, now: float, *, is_limited: bool, is_waiting: bool) -> None:
        """Decides anew where it is time to: `is_limited` if more would be sent, `is_waiting` if answers are due."""
        if is_waiting and now - self._answered_at > max(_SILENCE, 3.0 * self.smoothed_trip):
            self._go_silent(now)
            return
        if not is_waiting:
            self._answered_at = max(self._answered_at, now - self.smoothed_trip)
        elapsed = now - self._looked_at
        is_enough = len(self._samples) >= _FEWEST or (self._samples and elapsed > 1.0)
        if elapsed < max(SHORTEST_LOOK, min(self.smoothed_trip, 0.5)) or not is_enough:
            return
        self.fastest = min(self._samples)
        delivered = self._most_delivered(now, self._delivered / elapsed)
        self._samples.clear()
        self._delivered, self._looked_at = 0.0, now
        if now < self._quiet_until:
            return
        base = self.base_trip
        queue = self.fastest - base
        if not is_limited:  # what was delivered is what there was to send, and says nothing of the link
            if delivered < _QUIET * self.rate:
                return  # a queue that is not this stream's, or somebody who was busy
            delivered = self.rate
        limit = max(QUEUE, base / 5.0)
        if limit < queue <= max(LONG_QUEUE, base) and now < self._settled_at:
            return
        if queue <= limit:
            self._falls.clear()
        elif self._is_in_vain(now, queue):
            return
        if queue > max(LONG_QUEUE, base):
            self._fall(now, _CUT * min(delivered, self.rate), base + queue)
        elif queue > limit:
            self._fall(now, min(_DRAINED * delivered, 0.95 * self.rate), base + queue)
        elif is_limited and delivered > 0.5 * self.rate:
            self.rate = min(self.rate * self._rise(), MOST)

    def _is_in_vain(self, now: float, queue: float) -> bool:
        """Whether sending less does not help, so that others make the queue, or busy machines: then it belongs to the way."""
        self._falls.append((self.rate, queue))
        if len(self._falls) <= _IN_VAIN or queue < _SHORTER * self._falls[1][1]:
            return False
        self.rate = max(self.rate, self._falls[0][0] * _DRAINED)
        self._base.clear()
        self._base.append((math.floor(now), self.fastest))
        self._falls.clear()
        return True

    def _rise(self) -> float:
        if self._is_rising_fast:
            return _FAST_RISE
        return _RETURN if self.rate < _NEAR * self._met_queue_at else _RISE

    def _most_delivered(self, now: float, delivered: float) -> float:
        self._deliveries.append((now, delivered))
        while self._deliveries[0][0] < now - _DELIVERED_FOR:
            self._deliveries.popleft()
        return max(rate for _, rate in self._deliveries)

    def _fall(self, now: float, rate: float, trip: float) -> None:
        self.queues += 1
        self._is_rising_fast = False
        # What was met on the way down is the same queue; one that is met lower for long is another link.
        self._met_queue_at = max(self.rate, 0.8 * self._met_queue_at)
        self.rate = max(rate, LEAST)
        self._quiet_until = now + trip

    def _go_silent(self, now: float) -> None:
        if self._silent_since is None:
            self._silent_since, self._before_silence = now, self.rate
        self.rate = max(self.rate * 0.5, LEAST)
        self._answered_at = now  # half again after as long

    def _revive(self, now: float) -> None:
        """The link goes again, most likely as it did. If not, a queue that is out of hand tells within a round trip or two."""
        self._silent_since = None
        self.rate = max(self.rate, self._before_silence)
        self._settled_at = now + _SETTLING
        self._trusted_from = now  # what was sent before waited for the link
        self._samples.clear()
        self._delivered, self._looked_at = 0.0, now

"""A network in virtual time: several TCP connections over one bottleneck that loses packets, stands still and heals.

Each connection delivers in order, and sends what was lost again: a round trip and a quarter later at first, then after twice as
long each time, as TCP does. What is to be sent waits in front of the bottleneck. Nothing here knows what it carries.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

PACKET: Final = 1400  # [B]
FIRST_PATIENCE: Final = 0.2  # [s], or a round trip and a quarter if that is more, until a lost packet is sent again


@dataclass(kw_only=True)
class Conditions:
    """Of a link; may be changed while it is used."""

    delay: float = 0.05  # [s] one way
    loss: float = 0.02  # share of packets
    rate: float = 1e6  # [B/s] of the bottleneck, each way
    jitter: float = 0.0  # [s] that a packet may take longer
    drop: float = 0.0  # share of messages that are given up on the way, as a full queue does
    repeat: float = 0.0  # share of messages that come twice
    outages: tuple[tuple[float, float], ...] = ()  # from, to [s]


@dataclass
class _Way:
    """One direction."""

    conditions: Conditions
    random: np.random.Generator
    free_at: float = 0.0  # when the bottleneck has sent all that waits
    last: dict[int, float] = field(default_factory=dict)  # lane -> when its last message was delivered

    def arrival(self, lane: int, size: int, now: float) -> float:
        link = self.conditions
        self.free_at = max(self.free_at, now) + size / link.rate
        came = self.free_at
        for _ in range(max(1, -(-size // PACKET))):
            came = max(came, self._delivered(self.free_at))
        came += link.delay + self.random.random() * link.jitter
        self.last[lane] = max(self.last.get(lane, 0.0), came)
        return self.last[lane]

    def _delivered(self, sent: float) -> float:
        """When a packet gets through, being sent again for as long as it does not."""
        link = self.conditions
        patience = max(FIRST_PATIENCE if self._is_out(sent) else 0.0, 2.5 * link.delay)
        while self._is_out(sent) or self.random.random() < link.loss:
            sent += patience
            patience = max(2.0 * patience, FIRST_PATIENCE)
        return sent

    def _is_out(self, time: float) -> bool:
        return any(start <= time < end for start, end in self.conditions.outages)


class Network:
    """Plans what happens when, and lets it happen."""

    def __init__(self, conditions: Conditions, *, seed: int) -> None:
        self.conditions = conditions
        self.random = np.random.default_rng(seed)
        self.now = 0.0
        self.carried = [0, 0]  # [B] forth and back
        self._ways = (_Way(conditions, self.random), _Way(conditions, self.random))
        self._plan: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()

    def at(self, time: float, act: Callable[[], None]) -> None:
        """Plans something."""
        heapq.heappush(self._plan, (max(time, self.now), next(self._order), act))

    def every(self, interval: float, act: Callable[[], None]) -> None:
        """Plans it again and again, now first."""

        def again() -> None:
            act()
            self.at(self.now + interval, again)

        self.at(self.now, again)

    def send(
        self, way: int, lane: int, message: bytes, receive: Callable[[bytes], None], *, overhead: int = 100
    ) -> None:
        """Carries a message forth (0) or back (1)."""
        self.carried[way] += len(message) + overhead
        if self.random.random() < self.conditions.drop:
            return
        times = 2 if self.random.random() < self.conditions.repeat else 1
        for _ in range(times):
            self.at(self._ways[way].arrival(lane, len(message) + overhead, self.now), lambda: receive(message))

    def connected(self, lane: int, connect: Callable[[], None]) -> None:
        """Plans what happens when a new connection stands: two round trips, tried anew each second."""
        for way in self._ways:
            way.last.pop(lane, None)
        first = self.now
        while self._ways[0]._is_out(first) or self._ways[0]._is_out(first + 4 * self.conditions.delay):
            first += 1.0
        self.at(first + 4 * self.conditions.delay, connect)

    def run(self, until: float) -> None:
        """Lets time pass."""
        while self._plan and self._plan[0][0] <= until:
            self.now, _, act = heapq.heappop(self._plan)
            act()
        self.now = until

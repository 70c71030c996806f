"""The connections of one viewer's stream. When nothing comes any more new ones are tried, beside those that may only be waiting.

After an outage TCP sends again what was lost, but waits twice as long each time it failed, seconds at the end; a new connection
stands as soon as the link does.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

from elys.bus.mailbox import Mailbox
from elys.bus.streaming.wire import LANES
from elys.bus.topics import Delivery
from elys.bus.transports.transport import Closer, Transport
from elys.common.errors import BusError

COUNT: Final = 4
TRY_EVERY: Final = 0.06  # [s] between the beginnings of two tries while nothing comes: together they knock as often
TRY_SELDOM: Final = 2.0  # [s] the same after long
LONG: Final = 6.0  # [s] of silence
PATIENCE: Final = 1.0  # [s], or six round trips, that a try may take: greetings are three
_MOMENT: Final = 0.5  # [s]
_log = logging.getLogger(__name__)

# Blocks, that many seconds at most; with an event it knocks until a door opens, or the event is set.
Connect = Callable[[float, threading.Event | None], Transport]


@dataclass(slots=True)
class _Lane:
    transport: Transport
    stop: Closer
    opened_at: float
    heard_at: float


class Connections:
    """Opens lanes, hears what comes by them (`heard(payload)`, on the loop) and sends by one after the other."""

    def __init__(
        self,
        connect: Connect,
        key_of_lane: Callable[[int], str],
        *,
        heard: Callable[[bytes], None],
        opened: Callable[[], None],
        clock: Callable[[], float],
    ) -> None:
        self._connect = connect
        self._key_of_lane = key_of_lane
        self._heard = heard
        self._opened = opened
        self._clock = clock
        self._loop = asyncio.get_running_loop()
        self._lanes: dict[int, _Lane] = {}
        self._next = 0
        self._tries: set[asyncio.Task[None]] = set()
        self._tried_at = -TRY_EVERY
        self._closing: set[asyncio.Future[None]] = set()
        self._turn = 0
        self._silence = LONG
        self.heard_at = clock()
        self._has_heard = False  # before the first frame nobody may be there to send
        self._is_closed = threading.Event()
        # zenoh blocks while it opens, and while it closes what stands still: one must not wait for the other.
        self._threads = ThreadPoolExecutor(COUNT, thread_name_prefix="elys-stream")
        self._closers = ThreadPoolExecutor(LANES, thread_name_prefix="elys-stream-end")

    @property
    def bits(self) -> int:
        """Bit i: lane i is open."""
        return sum(1 << number for number in self._lanes)

    @property
    def count(self) -> int:
        """How many are open."""
        return len(self._lanes)

    @property
    def tries(self) -> int:
        """How many are being opened."""
        return len(self._tries)

    def tend(self, silence: float, trip: float) -> None:
        """Opens what is missing, and, if nothing has come for `silence` seconds, new ones in the place of the old."""
        now = self._clock()
        self._silence = silence
        is_silent = self._has_heard and now - self.heard_at > silence
        is_gone = now - self.heard_at > LONG
        standing = 0 if is_silent else len(self._lanes)
        pause = TRY_SELDOM if is_gone else TRY_EVERY if is_silent else 0.0
        if standing + len(self._tries) < COUNT and now - self._tried_at >= pause:
            self._tried_at = now
            patience = LONG if is_silent and not is_gone else max(PATIENCE, 6.0 * trip)
            task = self._loop.create_task(self._open(patience, knocks=is_silent))
            self._tries.add(task)
            task.add_done_callback(self._tries.discard)

    def send(self, key: str, payload: bytes) -> None:
        """By the lane whose turn it is; of those by which something came a moment ago, or that are new."""
        if not self._lanes:
            return
        newest = max(lane.heard_at for lane in self._lanes.values())
        fresh = [lane for lane in self._lanes.values() if lane.heard_at >= newest - _MOMENT]
        self._turn += 1
        lane = fresh[self._turn % len(fresh)]
        try:
            lane.transport.publish(key, payload, Delivery.LATEST)
        except BusError as error:
            _log.debug("an acknowledgement could not be sent: %s", error)

    async def close(self) -> None:
        """Closes all."""
        self._is_closed.set()
        for number in list(self._lanes):
            self._drop(number)
        await asyncio.gather(*self._tries, *self._closing, return_exceptions=True)
        for threads in (self._threads, self._closers):
            threads.shutdown(wait=False)

    async def _open(self, patience: float, *, knocks: bool) -> None:
        knocks_until = self._is_closed if knocks else None
        try:
            transport = await self._loop.run_in_executor(self._threads, self._connect, patience, knocks_until)
        except BusError as error:
            _log.debug("no further connection now: %s", error)
            return
        now = self._clock()
        # Those that wait carry what is of long ago; those that go are left alone.
        for old in [old for old, lane in self._lanes.items() if now - lane.heard_at > 2.0 * self._silence]:
            self._drop(old)
        if self._is_closed.is_set() or len(self._lanes) >= COUNT:
            self._end(transport)
            return
        number, self._next = self._next % LANES, self._next + 1
        mailbox = Mailbox(self._loop, lambda _, payload: self._arrived(number, payload), newest_only=False)
        stop = transport.subscribe(self._key_of_lane(number), mailbox.put)
        self._lanes[number] = _Lane(transport, stop, now, now)
        self._opened()

    def _arrived(self, number: int, payload: bytes) -> None:
        self.heard_at, self._has_heard = self._clock(), True
        if (lane := self._lanes.get(number)) is not None:
            lane.heard_at = self.heard_at
        self._heard(payload)

    def _drop(self, number: int) -> None:
        self._end(self._lanes.pop(number).transport)

    def _end(self, transport: Transport) -> None:
        closing = self._loop.run_in_executor(self._closers, transport.close)
        self._closing.add(closing)
        closing.add_done_callback(self._closing.discard)

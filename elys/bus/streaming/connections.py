"""The connections of one viewer's stream. When nothing comes any more new ones are tried, beside those that may only be waiting.

After an outage TCP sends again what was lost, but waits twice as long each time it failed, seconds at the end; a new connection
stands as soon as the link does.
"""

from __future__ import annotations

import asyncio
import logging
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
TRY_EVERY: Final = 0.25  # [s] between two tries while nothing comes
PATIENCE: Final = 3.0  # [s] that a try may take
MOST_TRIES: Final = 6  # at a time
_log = logging.getLogger(__name__)

Connect = Callable[[float], Transport]  # blocks, that many seconds at most


@dataclass(slots=True)
class _Lane:
    transport: Transport
    stop: Closer
    opened_at: float
    heard_at: float


class Connections:
    """Opens lanes, hears what comes by them (`heard(payload)`, on the loop) and sends by one after the other."""

    def __init__(
        self, connect: Connect, key_of_lane: Callable[[int], str], heard: Callable[[bytes], None], clock: Callable[[], float]
    ) -> None:
        self._connect = connect
        self._key_of_lane = key_of_lane
        self._heard = heard
        self._clock = clock
        self._loop = asyncio.get_running_loop()
        self._lanes: dict[int, _Lane] = {}
        self._next = 0
        self._tries: set[asyncio.Task[None]] = set()
        self._tried_at = -TRY_EVERY
        self._closing: set[asyncio.Future[None]] = set()
        self._turn = 0
        self.heard_at = clock()
        self._is_closed = False
        self._threads = ThreadPoolExecutor(MOST_TRIES + 2, thread_name_prefix="elys-stream")  # zenoh blocks

    @property
    def bits(self) -> int:
        """Bit i: lane i is open."""
        return sum(1 << number for number in self._lanes)

    @property
    def count(self) -> int:
        """How many are open."""
        return len(self._lanes)

    def tend(self, silence: float) -> None:
        """Opens what is missing, and, if nothing has come for `silence` seconds, new ones in the place of the old."""
        now = self._clock()
        is_silent = now - self.heard_at > silence
        is_missing = len(self._lanes) + len(self._tries) < COUNT
        if (is_missing or is_silent) and len(self._tries) < MOST_TRIES and now - self._tried_at >= TRY_EVERY:
            self._tried_at = now
            task = self._loop.create_task(self._open())
            self._tries.add(task)
            task.add_done_callback(self._tries.discard)

    def send(self, key: str, payload: bytes) -> None:
        """By the lane whose turn it is; of those by which something came since the last silence."""
        if not self._lanes:
            return
        fresh = [lane for lane in self._lanes.values() if lane.heard_at >= self.heard_at - 1.0] or list(self._lanes.values())
        self._turn += 1
        lane = fresh[self._turn % len(fresh)]
        try:
            lane.transport.publish(key, payload, Delivery.LATEST)
        except BusError as error:
            _log.debug("an acknowledgement could not be sent: %s", error)

    async def close(self) -> None:
        """Closes all."""
        self._is_closed = True
        for number in list(self._lanes):
            self._drop(number)
        await asyncio.gather(*self._tries, *self._closing, return_exceptions=True)
        self._threads.shutdown(wait=False)

    async def _open(self) -> None:
        try:
            transport = await self._loop.run_in_executor(self._threads, self._connect, PATIENCE)
        except BusError as error:
            _log.debug("no further connection now: %s", error)
            return
        if self._is_closed:
            transport.close()
            return
        number, self._next = self._next % LANES, self._next + 1
        now = self._clock()
        mailbox = Mailbox(self._loop, lambda _, payload: self._arrived(number, payload), newest_only=False)
        stop = transport.subscribe(self._key_of_lane(number), mailbox.put)
        self._lanes[number] = _Lane(transport, stop, now, now)
        while len(self._lanes) > COUNT:
            self._drop(min(self._lanes, key=lambda lane: self._lanes[lane].heard_at))

    def _arrived(self, number: int, payload: bytes) -> None:
        self.heard_at = self._clock()
        if (lane := self._lanes.get(number)) is not None:
            lane.heard_at = self.heard_at
        self._heard(payload)

    def _drop(self, number: int) -> None:
        lane = self._lanes.pop(number)
        closing = self._loop.run_in_executor(self._threads, lane.transport.close)
        self._closing.add(closing)
        closing.add_done_callback(self._closing.discard)

"""From a transport's thread to the node's loop."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import Final, NamedTuple

MAILBOX_LIMIT: Final = 100_000  # messages a node may lag behind before the oldest are given up
MOST_NAMES: Final = 32  # that are told apart under one key between two rounds of the loop
MAILBOX_SIZE: Final = 256 << 20  # [bytes] likewise
KEY_LIMIT: Final = 10_000  # messages of one key, where several share a mailbox: who floods loses his own


class Arrival(NamedTuple):
    """When messages came to this process, by the monotonic clock [s], before the loop had time for them."""

    first: float  # the first of those that waited together
    last: float  # the one that is handed over


class Mailbox:
    """Takes payloads from any thread to the loop: all of them in order, or only the newest of each key.

    Of many keys in one mailbox none takes the others' room.

    Where several share a key, `name_in` finds in a payload whose it is ("" if nobody's), and the newest of each is kept: of
    `MOST_NAMES` between two rounds of the loop, so that who makes up names fills no memory; the others share one place.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        callback: Callable[[str, bytes], None],
        *,
        newest_only: bool,
        name_in: Callable[[bytes], str] | None = None,
    ) -> None:
        self._loop = loop
        self._callback = callback
        self._newest_only = newest_only
        self._newest: dict[tuple[str, str], tuple[bytes, float]] = {}  # and when it came
        self._name_in = name_in
        self._queue: deque[tuple[str, bytes]] = deque()
        self._size = 0
        self._waiting: Counter[str] = Counter()  # messages in the queue, by key
        self._lock = threading.Lock()
        self._woken = False
        self._first = self._last = 0.0  # [s] when the first and the last of those that wait came
        self.arrival = Arrival(0.0, 0.0)  # of what is being handed over; of the last where every message is
        self.lost = 0  # messages given up because the loop did not come round

    def put(self, key: str, payload: bytes) -> None:
        """Hands over; called on any thread."""
        now = time.monotonic()
        with self._lock:
            if self._newest_only:
                self._newest[self._place(key, payload)] = (payload, now)
            else:
                self._append(key, payload)
            self._last = now
            if self._woken:
                return
            self._woken, self._first = True, now
        with contextlib.suppress(RuntimeError):  # the loop has ended: nobody is left to hear it
            self._loop.call_soon_threadsafe(self._drain)

    def _place(self, key: str, payload: bytes) -> tuple[str, str]:
        place = (key, self._name_in(payload) if self._name_in is not None else "")
        return place if place in self._newest or len(self._newest) < MOST_NAMES else (key, "")

    def _append(self, key: str, payload: bytes) -> None:
        if self._waiting[key] >= KEY_LIMIT and len(self._waiting) > 1:
            self.lost += 1
            return
        self._queue.append((key, payload))
        self._waiting[key] += 1
        self._size += len(payload)
        while len(self._queue) > MAILBOX_LIMIT or (self._size > MAILBOX_SIZE and len(self._queue) > 1):
            oldest, given_up = self._queue.popleft()
            self._waiting[oldest] -= 1
            self._size -= len(given_up)
            self.lost += 1

    def _drain(self) -> None:
        with self._lock:
            first = self._first
            waiting = (
                [(key, payload, came) for (key, _), (payload, came) in self._newest.items()]
                if self._newest_only
                else [(key, payload, self._last) for key, payload in self._queue]
            )
            self._newest.clear()
            self._queue.clear()
            self._waiting.clear()
            self._size = 0
            self._woken = False
        for key, payload, came in waiting:
            self.arrival = Arrival(first, came)
            try:
                self._callback(key, payload)
            except Exception as error:  # one message's fault must not cost the others their delivery
                self._loop.call_exception_handler({"message": f"the reader of {key} failed", "exception": error})

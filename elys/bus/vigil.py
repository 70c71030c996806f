"""Sees within a second that the host is gone, whatever becomes of the connection to it.

Of a process that dies the connection ends at once. A cut cable, a machine that stopped or lost its power say nothing: so who
hears nothing for a while asks the host for a sign of life, which is answered beside its loop, and when none comes the host counts
as gone until it is heard again. Far away that takes longer: TCP needs a round trip to send again what was lost on the way.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Final

from elys.bus.transports.reaching import is_near
from elys.bus.transports.transport import Transport
from elys.common.errors import BusError

LOOK_INTERVAL: Final = 0.1  # [s] between two looks
ASK_AFTER: Final = 0.2  # [s] of silence
GONE_AFTER: Final = 0.8  # [s] of silence, when the host is near
ROUND_TRIPS: Final = 1.5  # of silence more than half a second, when it is far away
ON_ONE_MACHINE: Final = 2.0  # [s]: no cable can be cut there, and a process may wait long for its turn
_QUESTIONS: Final = 4  # without an answer, after which no more are asked
_ANSWER_TIME: Final = 5.0  # [s]


def patience(endpoint: str, round_trip: float) -> float:
    """[s] of silence after which a host at an endpoint counts as gone."""
    if is_near(endpoint):
        return ON_ONE_MACHINE
    return max(GONE_AFTER, 0.5 + ROUND_TRIPS * round_trip)


class Vigil:
    """Calls `on_change(is_heard)` when the host falls silent and when it is heard again; `ask` asks it for a sign of life."""

    def __init__(
        self,
        transport: Transport,
        ask: Callable[[float], Awaitable[object]],
        on_change: Callable[[bool], None],
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._transport = transport
        self._ask = ask
        self._on_change = on_change
        self._clock = clock
        self._asking: set[asyncio.Task[None]] = set()
        self._asked_at = 0.0
        self._looked_at = clock()
        self.is_heard = True

    async def keep(self) -> None:
        """Looks, until cancelled."""
        try:
            while True:
                await asyncio.sleep(LOOK_INTERVAL)
                self.look()
        finally:
            for task in self._asking:
                task.cancel()

    def look(self) -> None:
        """One look."""
        now, transport = self._clock(), self._transport
        slept, self._looked_at = now - self._looked_at, now
        silence = transport.silence
        if silence > ASK_AFTER and now - self._asked_at > ASK_AFTER and len(self._asking) < _QUESTIONS:
            self._asked_at = now
            task = asyncio.ensure_future(self._asked())
            self._asking.add(task)
            task.add_done_callback(self._asking.discard)
        if slept > 3.0 * LOOK_INTERVAL:
            return  # it was this side that was away
        is_heard = silence < patience(transport.endpoint, transport.round_trip)
        if not is_heard:
            transport.suspect()
        if is_heard != self.is_heard:
            self.is_heard = is_heard
            self._on_change(is_heard)

    async def _asked(self) -> None:
        try:
            await self._ask(_ANSWER_TIME)
        except BusError:
            return  # silence tells as much

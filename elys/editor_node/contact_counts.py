"""How many contacts each entity has: asked for once, and followed by what begins and ends.

    query TOUCHING ──> all that go on ─┐
    topic CONTACTS ──> begun, ended  ──┴──> counts

An entity takes part in a contact with its own collider, and with those on its body.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Final

from elys.bus import topics
from elys.bus.messages.physics import ContactBatch, Meetings, TouchingRequest
from elys.bus.session import Session
from elys.bus.transports.transport import Closer
from elys.common.errors import BusError

ANSWER_TIMEOUT: Final = 5.0  # [s]

Pair = tuple[int, int, int, int]  # both colliders' entities, and those of their bodies


class ContactCounts:
    """Knows nothing until `start`, and no more once stopped; then every count is no number."""

    def __init__(
        self,
        session: Session,
        *,
        on_refusal: Callable[[str], None] = lambda reason: None,
    ) -> None:
        """`on_change(tick)` is called when counts are others from a tick on, `on_refusal` when the host does not tell them."""
        self.on_change: Callable[[int], None] = lambda tick: None
        self._session = session
        self._on_refusal = on_refusal
        self._pairs: set[Pair] = set()
        self._counts: Counter[int] = Counter()
        self._tick = -1  # up to which batches are in the counts; -1: nothing is known
        self._waiting: list[ContactBatch] = []  # that came before the answer
        self._asked = 0  # times

    def start(self, watch: Callable[[topics.Topic[ContactBatch], Callable[[ContactBatch], None]], Closer]) -> Closer:
        """Follows what touches, every batch of it, until what is returned is called."""
        close = watch(topics.CONTACTS, self._take)
        self.ask_again()

        def stop() -> None:
            close()
            self._asked += 1  # an answer that is under way is nobody's any more
            self._forget()

        return stop

    def ask_again(self) -> None:
        """Forgets, and asks the host what touches: another run, or another time of it."""
        self._forget()
        self._asked += 1
        self._session.start(self._ask(self._asked))

    def count(self, entity: int) -> float:
        """In how many contacts an entity takes part now; not a number while that is not known."""
        return float(self._counts[entity]) if self._tick >= 0 else math.nan

    # --- inside ----------------------------------------------------------------------------------------------------

    def _forget(self) -> None:
        self._pairs.clear()
        self._counts.clear()
        self._waiting.clear()
        self._tick = -1

    async def _ask(self, number: int) -> None:
        try:
            told = await self._session.request(topics.TOUCHING, TouchingRequest(), timeout=ANSWER_TIMEOUT)
        except BusError as error:
            if number == self._asked:
                self._on_refusal(str(error))
            return
        if number != self._asked:
            return
        for pair in _rows(told.contacts):
            self._begin(pair)
        self._tick = told.tick
        self.on_change(told.tick)
        waiting, self._waiting = self._waiting, []
        for batch in waiting:
            self._take(batch)

    def _take(self, batch: ContactBatch) -> None:
        if self._tick < 0:
            self._waiting.append(batch)
            return
        if batch.tick <= self._tick:
            return  # it was in the answer
        for pair in _rows(batch.ended):
            self._end(pair)
        for pair in _rows(batch.begun):
            self._begin(pair)
        self._tick = batch.tick
        self.on_change(batch.tick)

    def _begin(self, pair: Pair) -> None:
        if pair not in self._pairs:
            self._pairs.add(pair)
            self._counts.update(set(pair))

    def _end(self, pair: Pair) -> None:
        if pair in self._pairs:
            self._pairs.remove(pair)
            self._counts.subtract(set(pair))


def _rows(meetings: Meetings) -> Iterable[Pair]:
    return zip(meetings.entity_a, meetings.entity_b, meetings.body_a, meetings.body_b, strict=True)

"""How long what a player does takes until it counts, and until it is seen: measured by what the host says it has applied.

sent ──> host applies it at a tick, tells so on `commands` ──> heard: applied
                    └──> that tick's state ──> shown here ───> seen
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from statistics import median
from typing import Final

from elys.bus import topics
from elys.bus.messages.commands import CommandRecord, Input
from elys.bus.session import Session
from elys.bus.transports.transport import Closer

KEPT: Final = 30  # messages of which the median is told
MOST_WAITING: Final = 256  # messages that nothing was heard of


class InputEcho:
    """Listens while `start`ed."""

    def __init__(self, session: Session, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._session = session
        self._clock = clock
        self._close: Closer | None = None
        self._sent: dict[int, float] = {}  # when [s], by sequence
        self._applied: deque[tuple[int, float]] = deque(maxlen=MOST_WAITING)  # tick, when it was sent [s]
        self._until_applied: deque[float] = deque(maxlen=KEPT)
        self._until_seen: deque[float] = deque(maxlen=KEPT)

    def start(self) -> None:
        """From now on."""
        if self._close is None:
            self._close = self._session.subscribe(topics.COMMANDS, self._heard)

    def stop(self) -> None:
        """Listens no more, and forgets."""
        if self._close is not None:
            self._close()
            self._close = None
        for kept in (self._sent, self._applied, self._until_applied, self._until_seen):
            kept.clear()

    def sent(self, sequence: int) -> None:
        """A message went out now."""
        self._sent[sequence] = self._clock()
        while len(self._sent) > MOST_WAITING:
            del self._sent[next(iter(self._sent))]

    def shown(self, tick: int) -> None:
        """A picture of what a tick left is seen now."""
        while self._applied and self._applied[0][0] < tick:  # applied at a tick's start: seen in the state after it
            self._until_seen.append(self._clock() - self._applied.popleft()[1])

    @property
    def until_applied(self) -> float | None:
        """From sending until the host was heard to have applied it [s]; None before anything was."""
        return median(self._until_applied) if self._until_applied else None

    @property
    def until_seen(self) -> float | None:
        """From sending until what came of it was seen [s]; None before anything was."""
        return median(self._until_seen) if self._until_seen else None

    def _heard(self, record: CommandRecord, _: str) -> None:
        command = record.command
        if record.origin != self._session.node.id or not isinstance(command, Input):
            return
        sent = self._sent.pop(command.sequence, None)
        if sent is not None and record.accepted:
            self._until_applied.append(self._clock() - sent)
            self._applied.append((record.tick, sent))

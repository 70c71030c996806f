"""What a session asks for states instead of the topic, where its way to the host does not carry all of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from elys.bus.messages.streaming import StreamInterest, StreamReport
from elys.bus.transports.transport import Closer


class StateSource(Protocol):
    """Where the states of a session come from, if not from the topic."""

    def subscribe(self, put: Callable[[str, bytes], None]) -> Closer:
        """Calls `put(full key, payload)` with each."""

    def look(self, interest: StreamInterest) -> None:
        """Says what matters."""

    def report(self) -> StreamReport | None:
        """How it does; None where there is nothing to tell."""

    async def close(self) -> None:
        """Ends it."""

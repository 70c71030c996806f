"""What a session asks for states instead of the topic, where its way to the host does not carry all of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from elys.bus.messages.streaming import StreamInterest, StreamReport
from elys.bus.transports.transport import Closer

if TYPE_CHECKING:
    from elys.bus.session import Session


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


def tell_interest(session: Session, interest: StreamInterest) -> None:
    """Says what matters to who watches a session, for the stream of states, where there is one."""
    if session.states is not None:
        session.states.look(interest)


def stream_report(session: Session) -> StreamReport | None:
    """How that stream does; None where there is none."""
    return None if session.states is None else session.states.report()

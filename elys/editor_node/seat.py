"""The editor's place in a session, which it keeps while there is none: what was subscribed to goes on in the next one.

    panels, model, view stream ──> Seat ──> the session that is attached to, or nothing

So nothing in the editor is built anew to detach, to attach to another session or to come back to the first.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from elys.bus.session import Node, Session, node_id
from elys.bus.topics import Delivery, Query, Topic
from elys.bus.transports.transport import Answer, Answers, Closer, IncomingQuery, Link
from elys.common.errors import ConnectionLost

Q = TypeVar("Q")
R = TypeVar("R")


@dataclass(slots=True, eq=False)
class _Held:
    """Something that is to hold in every session, and what ends it in the one that is attached to."""

    begin: Callable[[Session], Closer]
    end: Closer | None = None


class Seat(Session):
    """A session to all who use it. To those who listen to the link, attaching and detaching is a host that comes and goes."""

    def __init__(self, session: Session | None = None, *, kind: str = "editor") -> None:
        """Without a `session` it waits for the first `attach`. Who joins one later joins as this seat's `node`."""
        node = session.node if session is not None else Node(kind, node_id(kind))
        super().__init__(_Nowhere(), name="", node=node, epoch=0)
        self.connected = False
        self._session: Session | None = None
        self._held: list[_Held] = []
        self._attached = asyncio.Event()
        if session is not None:
            self.attach(session)

    @property
    def session(self) -> Session | None:
        """The one that is attached to."""
        return self._session

    def attach(self, session: Session) -> None:
        """Takes part in `session` from now on, which must have been joined as this seat's `node`."""
        self.detach()
        self._session, self.node = session, session.node  # its id tells as whom it was joined
        self.transport, self.name, self.nodes, self.refused = (
            session.transport, session.name, session.nodes, session.refused
        )  # fmt: skip
        self.states = session.states  # of which the session's own subscriptions make use
        for held in self._held:
            held.end = held.begin(session)
        session.on_link(lambda connected: self._hear_link(session, connected))
        session.on_nodes(lambda node, alive: self._hear_node(session, node, alive))
        self._attached.set()
        for node in list(session.nodes.values()):
            self._hear_node(session, node, True)
        if session.connected:
            self._hear_link(session, True)

    def detach(self) -> Session | None:
        """Leaves the session, which goes on; returns it, to be closed."""
        session, self._session, self.states = self._session, None, None
        if session is None:
            return None
        self._attached.clear()
        for held in self._held:
            if held.end is not None:
                held.end()
                held.end = None
        gone, self.nodes = list(self.nodes.values()), {}
        self.transport, self.name = _Nowhere(), ""
        for node in gone:
            for listener in self._node_listeners:
                listener(node, False)
        if self.connected:
            self.connected = False
            for heard in self._link_listeners:
                heard(False)
        return session

    async def close(self) -> None:
        """Detaches and ends what was started here; whoever joined the session closes it."""
        self.detach()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def publish_payload(self, topic: Topic[Any], payload: bytes, *, key: str = "") -> None:
        """Sends; to nobody while there is no session."""
        if self._session is not None:
            self._session.publish_payload(topic, payload, key=key)

    def has_listener(self, topic: Topic[Any], *, key: str = "") -> bool:
        """Whether anybody subscribes to a topic now."""
        return self._session is not None and self._session.has_listener(topic, key=key)

    def subscribe_payloads(
        self, topic: Topic[Any], callback: Callable[[str, bytes], None], *, key: str = "*", every: bool = False
    ) -> Closer:
        """Calls back in every session that is attached to, until closed."""
        return self._hold(lambda session: session.subscribe_payloads(topic, callback, key=key, every=every))

    def serve(self, query: Query[Q, R], handler: Callable[[Q, str], Awaitable[R]], *, key: str = "*") -> Closer:
        """Answers in every session that is attached to, until closed."""
        return self._hold(lambda session: session.serve(query, handler, key=key))

    async def request(self, query: Query[Q, R], request: Q, *, key: str = "", timeout: float = 5.0) -> R:
        """Asks and waits for the answer; while there is no session it waits for one, `timeout` seconds at the longest.

        Raises:
            RequestError: the other side refused, with its reason.
            ConnectionLost: no session, or no answer within `timeout` seconds.
        """
        session = self._session
        if session is None:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(timeout):
                    await self._attached.wait()
            session = self._session
        if session is None:
            raise ConnectionLost("the editor is attached to no session")
        return await session.request(query, request, key=key, timeout=timeout)

    def _hold(self, begin: Callable[[Session], Closer]) -> Closer:
        held = _Held(begin)
        self._held.append(held)
        if self._session is not None:
            held.end = begin(self._session)

        def close() -> None:
            if held in self._held:
                self._held.remove(held)
                if held.end is not None:
                    held.end()

        return close

    def _hear_link(self, session: Session, connected: bool) -> None:
        if session is not self._session or connected == self.connected:
            return
        self.connected, self.epoch = connected, session.epoch
        for listener in list(self._link_listeners):
            listener(connected)

    def _hear_node(self, session: Session, node: Node, alive: bool) -> None:
        if session is self._session:
            for listener in list(self._node_listeners):
                listener(node, alive)


class _Nowhere:
    """Carries nothing: the transport of no session."""

    user = ""
    endpoint = ""
    silence = 0.0
    round_trip = 0.0

    def suspect(self) -> None:
        """There is no way that could break."""

    def publish(self, key: str, payload: bytes, delivery: Delivery) -> None:
        """Nobody hears it."""

    def publish_made(self, key: str, make: Callable[[], bytes], delivery: Delivery) -> None:
        """Nobody hears it, so it is not made."""

    def has_listener(self, key: str) -> bool:
        """Nobody."""
        return False

    def subscribe(self, key_expression: str, on_sample: Callable[[str, bytes], None]) -> Closer:
        """Nothing comes."""
        return _nothing

    def serve(self, key_expression: str, on_query: Callable[[IncomingQuery], None]) -> Closer:
        """Nobody asks."""
        return _nothing

    def request(self, key_expression: str, payload: bytes, timeout: float, answer: Answer) -> None:
        """Nobody answers."""
        answer(None, "")

    def survey(self, key_expression: str, payload: bytes, timeout: float, answers: Answers) -> None:
        """Nobody answers."""
        answers([], [])

    def identity(self) -> str:
        """Nobody calls it anything."""
        return ""

    def links(self) -> list[Link]:
        """There are none."""
        return []

    def announce(self, key: str) -> Closer:
        """Nobody sees it."""
        return _nothing

    def watch(self, key_expression: str, on_change: Callable[[str, bool], None]) -> Closer:
        """Nobody comes."""
        return _nothing

    def watch_link(self, on_change: Callable[[bool], None]) -> Closer:
        """There is no link."""
        return _nothing

    def close(self) -> None:
        """Nothing is open."""


def _nothing() -> None:
    """Nothing was begun."""

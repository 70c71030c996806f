"""A router as people see it: which sessions pass through it, who hangs below, and how it does when somebody asks.

In each session that it sees it shows itself as a node of kind "router", so that `elys top` lists it; it joins none.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import Final

from elys.bus import codec, topics
from elys.bus.access.roles import signed_id
from elys.bus.messages.vitals import VitalsRequest
from elys.bus.session import HOST_KINDS, node_id
from elys.bus.transports.transport import Closer, IncomingQuery
from elys.bus.transports.zenoh_router import ZenohRouter
from elys.bus.vitals import vitals_of
from elys.common.errors import BusError, MessageError, ProtocolError

KIND: Final = "router"
MOST_SESSIONS: Final = 1000  # that it shows itself in; more pass through all the same

Say = Callable[[str], None]


class Router:
    """Watches what passes by, on the loop; `say` hears a sentence at every change."""

    def __init__(self, transport: ZenohRouter, say: Say) -> None:
        self.transport = transport
        self.id = signed_id(node_id(KIND), transport.user)
        self.sessions: dict[str, set[str]] = {}  # hosts by the name of their session
        self.upstream: set[str] = set()  # routers and hosts it is connected to, above and below
        self._say = say
        self._shown: dict[str, list[Closer]] = {}
        self._loop = asyncio.get_running_loop()
        self._closers: list[Closer] = []

    def start(self) -> None:
        """Begins to watch."""
        everyone = topics.node_key("*", "*", "*")
        self._closers.append(self.transport.watch(everyone, self._from_thread(self._node_changed)))
        self._closers.append(self.transport.watch_links(self._from_thread(self._link_changed)))

    def close(self) -> None:
        """Is seen no more; what passes through ends with the transport."""
        for closer in (*self._closers, *(closer for shown in self._shown.values() for closer in shown)):
            closer()
        self._closers.clear()
        self._shown.clear()

    def _node_changed(self, key: str, alive: bool) -> None:
        _, name, _, kind, node = key.split("/")
        if kind not in HOST_KINDS:
            return
        hosts = self.sessions.setdefault(name, set())
        if alive:
            hosts.add(node)
            self._show_in(name)
            self._say(f"session {name} ({kind}) is here")
        else:
            hosts.discard(node)
            if not hosts:
                del self.sessions[name]
                for closer in self._shown.pop(name, []):
                    closer()
                self._say(f"session {name} ({kind}) is gone")

    def _link_changed(self, identity: str, kind: str, connected: bool) -> None:
        if kind != KIND:
            return
        if connected:
            self.upstream.add(identity)
            self._say("connected to a host or router")
        elif identity in self.upstream:
            self.upstream.discard(identity)
            self._say("a host or router is gone")

    def _show_in(self, name: str) -> None:
        if name in self._shown or len(self._shown) >= MOST_SESSIONS:
            return
        with contextlib.suppress(BusError):  # a name that no session of ELYS has
            served = self.transport.serve(topics.asked_key(name, topics.VITALS, self.id), self._answer)
            self._shown[name] = [served, self.transport.announce(topics.node_key(name, KIND, self.id))]

    def _answer(self, incoming: IncomingQuery) -> None:
        """Called on zenoh's thread."""
        try:
            codec.decode(incoming.payload, VitalsRequest, topics.VITALS.request_encoding)
        except (MessageError, ProtocolError) as error:
            incoming.refuse(str(error))
            return
        vitals = vitals_of(self.transport, node=self.id, kind=KIND)
        incoming.reply(codec.encode(vitals, topics.VITALS.reply_encoding))

    def _from_thread(self, callback: Callable[..., None]) -> Callable[..., None]:
        def hand_over(*arguments: object) -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended: nobody is left to hear it
                self._loop.call_soon_threadsafe(callback, *arguments)

        return hand_over

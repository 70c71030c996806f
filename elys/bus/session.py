"""A session: typed messages over any transport, on the asyncio loop of the node that opened it.

The host (a simulation or a player) makes it with `Session.host`; everybody else comes in with `Session.join`, which first
compares protocol versions. Transports call back on their own threads; those only put payloads into a mailbox and wake the
loop. Decoding and callbacks happen on the loop, so nodes need no locks.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import time
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, TypeVar

import elys
from elys.bus import codec, topics
from elys.bus.mailbox import Mailbox
from elys.bus.messages.session import Hello, Welcome
from elys.bus.rivals import require_free_name, warn_of_rivals
from elys.bus.topics import PROTOCOL_VERSION, Delivery, Encoding, Query, Topic
from elys.bus.transports.reaching import is_near
from elys.bus.transports.transport import Closer, IncomingQuery, Transport
from elys.bus.vigil import Vigil
from elys.common.errors import BusError, ConnectionLost, ElysError, MessageError, ProtocolError, RequestError

M = TypeVar("M")
Q = TypeVar("Q")
R = TypeVar("R")

HOST_KINDS: Final = ("simulation", "replay")
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Node:
    """Somebody in the session: what it is and its id."""

    kind: str
    id: str


def node_id(kind: str) -> str:
    """A new id, unique enough within a session."""
    return f"{kind}-{secrets.token_hex(3)}"


class Session:
    """One node's place in a session. Use `host` or `join`, and `close` at the end."""

    def __init__(self, transport: Transport, *, name: str, node: Node, epoch: int) -> None:
        self.transport = transport
        self.name = name
        self.node = node
        self.epoch = epoch  # which run of the host; changes when the host restarts
        self.connected = True
        self.nodes: dict[str, Node] = {}  # all that are alive, by id
        self.refused: dict[str, int] = {}  # messages that were not what their topic promises, by topic
        self.taps: list[Callable[[Topic[Any], str, bytes], None]] = []  # see every publication (topic, key, payload)
        self._loop = asyncio.get_running_loop()
        self._closers: list[Closer] = []
        self._link_listeners: list[Callable[[bool], None]] = []
        self._node_listeners: list[Callable[[Node, bool], None]] = []
        self._refusal_said: dict[str, float] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._rejoining: asyncio.Task[None] | None = None
        self._closed = False

    # --- opening and closing ---------------------------------------------------------------------------------------

    @classmethod
    async def host(cls, transport: Transport, *, name: str, kind: str, epoch: int) -> Session:
        """Opens a session as its host: answers handshakes and shows itself alive. BusError: this name is taken at a router."""
        session = cls(transport, name=name, node=Node(kind, node_id(kind)), epoch=epoch)
        await require_free_name(name, session._ask_for_life)
        session._closers.append(transport.serve(topics.key_of(name, topics.HELLO), session._welcome))
        session._show_and_watch()
        return session

    @classmethod
    async def join(
        cls, transport: Transport, *, kind: str, name: str = "*", timeout: float = 5.0, node: Node | None = None
    ) -> Session:
        """Comes into a session that somebody hosts, as `node`, if it is to be known by an id it had before.

        Raises:
            ConnectionLost: nobody answered within `timeout` seconds.
            ProtocolError: the host speaks another version of the protocol.
        """
        session = cls(transport, name=name, node=node or Node(kind, node_id(kind)), epoch=0)
        welcome = await session._shake_hands(timeout, name)
        session.name, session.epoch = welcome.session, welcome.epoch
        session._show_and_watch()
        session._closers.append(transport.watch_link(session._from_thread(session._link_changed)))
        session.start(Vigil(transport, session._ask_for_life, session._link_changed).keep())
        return session

    async def close(self) -> None:
        """Leaves. A second call does nothing."""
        if self._closed:
            return
        self._closed = True
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for closer in reversed(self._closers):
            closer()
        self._closers.clear()
        await asyncio.to_thread(self.transport.close)

    # --- publishing and subscribing --------------------------------------------------------------------------------

    def publish(self, topic: Topic[M], message: M, *, key: str = "") -> None:
        """Sends a message to all who listen. Never waits."""
        self.publish_payload(topic, codec.encode(message, topic.encoding), key=key)

    def publish_large(self, topic: Topic[M], message: M) -> None:
        """The same for a message that takes time to encode, which may happen later: what is in it must not change any more."""
        if self.taps:
            self.publish(topic, message)
        elif not self._closed:
            make = partial(codec.encode, message, topic.encoding)
            self.transport.publish_made(topics.key_of(self.name, topic), make, topic.delivery)

    def publish_payload(self, topic: Topic[Any], payload: bytes, *, key: str = "") -> None:
        """Sends what is encoded already."""
        if self._closed:
            return
        self.transport.publish(topics.key_of(self.name, topic, key), payload, topic.delivery)
        for tap in self.taps:
            tap(topic, key, payload)

    def has_listener(self, topic: Topic[Any], *, key: str = "") -> bool:
        """Whether anybody subscribes to a topic now, so that what costs something to make need not be made for nobody."""
        return not self._closed and self.transport.has_listener(topics.key_of(self.name, topic, key))

    def subscribe(self, topic: Topic[M], callback: Callable[[M, str], None], *, key: str = "*") -> Closer:
        """Calls `callback(message, key)` on the loop. LATEST topics skip to the newest; the malformed is refused and counted."""

        def deliver(full_key: str, payload: bytes) -> None:
            found = topics.topic_of(full_key)
            last = found[1] if found else ""
            try:
                message = codec.decode(payload, topic.message, topic.encoding)
            except (MessageError, ProtocolError) as error:
                self._refuse(topic.name, error)
                return
            callback(message, last)

        return self.subscribe_payloads(topic, deliver, key=key)

    def subscribe_payloads(
        self, topic: Topic[Any], callback: Callable[[str, bytes], None], *, key: str = "*", every: bool = False
    ) -> Closer:
        """Calls `callback(full key, payload)` on the loop with undecoded payloads; with `every`, LATEST topics skip none."""
        newest_only = topic.delivery is Delivery.LATEST and not every
        name_in = codec.field_finder(topic.newest_of, topic.encoding) if topic.newest_of else None
        mailbox = Mailbox(self._loop, callback, newest_only=newest_only, name_in=name_in)
        expression = topics.key_of(self.name, topic, key)
        return self._keep(self.transport.subscribe(expression, mailbox.put))

    # --- asking and answering --------------------------------------------------------------------------------------

    def serve(self, query: Query[Q, R], handler: Callable[[Q, str], Awaitable[R]], *, key: str = "*") -> Closer:
        """Answers requests: `handler(request, key)` returns the reply or raises an ElysError, whose sentence is the refusal."""

        def arrived(incoming: IncomingQuery) -> None:
            self.start(self._answer(query, handler, incoming))

        expression = topics.key_of(self.name, query, key)
        return self._keep(self.transport.serve(expression, self._from_thread(arrived)))

    async def request(self, query: Query[Q, R], request: Q, *, key: str = "", timeout: float = 5.0) -> R:
        """Asks and waits for the answer.

        Raises:
            RequestError: the other side refused, with its reason.
            ConnectionLost: no answer within `timeout` seconds.
        """
        payload = codec.encode(request, query.request_encoding)
        if not is_near(self.transport.endpoint):
            payload = codec.with_packed_answer(payload)
        answer = codec.unpacked(await self._ask(topics.key_of(self.name, query, key), payload, timeout))
        return codec.decode(answer, query.reply, query.reply_encoding)

    # --- who is there ----------------------------------------------------------------------------------------------

    def on_link(self, listener: Callable[[bool], None]) -> None:
        """Calls `listener(connected)` when the host goes and when it is back (perhaps as a new run: see `epoch`)."""
        self._link_listeners.append(listener)

    def on_nodes(self, listener: Callable[[Node, bool], None]) -> None:
        """Calls `listener(node, alive)` for every node that comes or goes; those here now are in `nodes`."""
        self._node_listeners.append(listener)

    def nodes_of(self, kind: str) -> list[Node]:
        """The nodes of one kind that are alive, oldest first."""
        return [node for node in self.nodes.values() if node.kind == kind]

    def call_soon(self, callback: Callable[..., None], *arguments: Any) -> None:
        """Calls back on the session's loop; may be called on any thread. RuntimeError once the loop has ended."""
        self._loop.call_soon_threadsafe(callback, *arguments)

    def start(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Runs `work` beside everything else, at the longest until the session closes; a failure is said by the loop."""
        task: asyncio.Task[None] = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._ended)
        return task

    # --- inside ----------------------------------------------------------------------------------------------------

    def _keep(self, closer: Closer) -> Closer:
        self._closers.append(closer)

        def close() -> None:
            with contextlib.suppress(ValueError):  # closed with the session already
                self._closers.remove(closer)
                closer()

        return close

    def _from_thread(self, callback: Callable[..., None]) -> Callable[..., None]:
        def hand_over(*arguments: Any) -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended: nobody is left to hear it
                self._loop.call_soon_threadsafe(callback, *arguments)

        return hand_over

    def _ended(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            self._loop.call_exception_handler({"message": "a task of the session failed", "exception": error})

    async def _answer(
        self, query: Query[Q, R], handler: Callable[[Q, str], Awaitable[R]], incoming: IncomingQuery
    ) -> None:
        try:
            request = codec.decode(incoming.payload, query.request, query.request_encoding)
        except (MessageError, ProtocolError) as error:
            self._refuse(query.name, error)
            incoming.refuse(str(error))
            return
        try:
            reply = await handler(request, incoming.key.rsplit("/", 1)[-1])
        except ElysError as error:
            incoming.refuse(str(error))
            return
        except Exception as error:  # a fault of this node's: it hears of it, and the asker is not left waiting
            incoming.refuse(f"the answer to {query.name} failed in {self.node.id}: {error!r}")
            raise
        payload = codec.encode(reply, query.reply_encoding)
        if len(payload) > codec.LONG and codec.may_be_packed(incoming.payload):
            payload = await asyncio.to_thread(codec.packed, payload)
        incoming.reply(payload)

    async def _ask(self, key: str, payload: bytes, timeout: float) -> bytes:
        future: asyncio.Future[bytes] = self._loop.create_future()

        def settle(answer: bytes | None, reason: str) -> None:
            if future.done():
                return
            if answer is not None:
                future.set_result(answer)
            elif reason:
                future.set_exception(RequestError(reason))
            else:
                future.set_exception(ConnectionLost(f"nobody answered within {timeout:g} s"))

        self.transport.request(key, payload, timeout, self._from_thread(settle))
        return await future

    def _refuse(self, topic: str, error: BusError) -> None:
        self.refused[topic] = self.refused.get(topic, 0) + 1
        now = time.monotonic()
        if now - self._refusal_said.get(topic, -10.0) > 1.0:  # a flood of garbage must not flood the log too
            self._refusal_said[topic] = now
            _log.warning("refused a message on %s: %s (%d so far)", topic, error, self.refused[topic])

    # --- handshake and presence ------------------------------------------------------------------------------------

    def _welcome(self, incoming: IncomingQuery) -> None:
        refusal = ""
        try:
            codec.check_prefix(incoming.payload, Encoding.JSON)
            codec.decode_body(incoming.payload, Hello, Encoding.JSON, offset=codec.PREFIX.size)
        except ProtocolError as error:
            refusal = f"{error}: install the same release of ELYS on both sides (this one is {elys.__version__})"
        except MessageError as error:
            incoming.refuse(str(error))
            return
        welcome = Welcome(
            protocol=PROTOCOL_VERSION,
            version=elys.__version__,
            session=self.name,
            epoch=self.epoch,
            refusal=refusal,
        )
        incoming.reply(codec.encode(welcome, Encoding.JSON))

    async def _shake_hands(self, timeout: float, name: str) -> Welcome:
        hello = Hello(protocol=PROTOCOL_VERSION, kind=self.node.kind, node=self.node.id, version=elys.__version__)
        key = f"{topics.ROOT}/{name}/{topics.HELLO.name}"  # the name may be "*": whoever hosts here
        deadline = time.monotonic() + timeout
        while True:
            left = deadline - time.monotonic()
            if left <= 0:
                raise ConnectionLost(f"no session answered within {timeout:g} s")
            try:
                answer = await self._ask(key, codec.encode(hello, Encoding.JSON), min(left, 1.0))
                break
            except ConnectionLost:
                await asyncio.sleep(0.02)  # answered at once with nobody there; the host may be starting
        try:
            welcome = codec.decode_body(answer, Welcome, Encoding.JSON, offset=codec.PREFIX.size)
        except MessageError as error:
            raise ProtocolError(f"the host's greeting cannot be read ({error}): another release of ELYS?") from error
        if welcome.refusal:
            raise ProtocolError(welcome.refusal)
        if welcome.protocol != PROTOCOL_VERSION:
            raise ProtocolError(
                f"the host speaks protocol version {welcome.protocol} (ELYS {welcome.version}), this side "
                f"{PROTOCOL_VERSION} (ELYS {elys.__version__}): install the same release on both sides"
            )
        return welcome

    def _show_and_watch(self) -> None:
        own = topics.node_key(self.name, self.node.kind, self.node.id)
        self._closers.append(self.transport.announce(own))
        everyone = topics.node_key(self.name, "*", "*")
        self._closers.append(self.transport.watch(everyone, self._from_thread(self._node_changed)))

    def _node_changed(self, key: str, alive: bool) -> None:
        kind, identity = key.split("/")[-2:]
        node = Node(kind, identity)
        if alive == (identity in self.nodes):
            return
        if alive:
            self.nodes[identity] = node
        else:
            del self.nodes[identity]
        for listener in self._node_listeners:
            listener(node, alive)
        if kind in HOST_KINDS and alive:
            warn_of_rivals(self.name, [host.id for kind in HOST_KINDS for host in self.nodes_of(kind)])
        if kind in HOST_KINDS and self.node.kind not in HOST_KINDS:
            self._link_changed(bool([host for host in HOST_KINDS if self.nodes_of(host)]))

    def _link_changed(self, alive: bool) -> None:
        """The host went or came: say so at once when it went, after a new handshake when it came."""
        if self._closed:
            return
        if not alive and self.connected:
            self.connected = False
            for listener in self._link_listeners:
                listener(False)
        elif alive and not self.connected and self._rejoining is None:
            self._rejoining = self.start(self._rejoin())

    async def _ask_for_life(self, timeout: float) -> None:
        hello = Hello(protocol=PROTOCOL_VERSION, kind=self.node.kind, node=self.node.id, version=elys.__version__)
        await self._ask(topics.key_of(self.name, topics.HELLO), codec.encode(hello, Encoding.JSON), timeout)

    async def _rejoin(self) -> None:
        try:
            welcome = await self._greet_again()
        except ProtocolError as error:
            _log.error("cannot rejoin the session: %s", error)
            return
        finally:
            self._rejoining = None
        self.epoch = welcome.epoch
        self.connected = True
        for listener in self._link_listeners:
            listener(True)

    async def _greet_again(self) -> Welcome:
        stranger = ""
        while True:
            try:
                welcome = await self._shake_hands(30.0, "*")
            except (ConnectionLost, RequestError) as error:
                _log.warning("the host of session %s is not back yet: %s", self.name, error)
                continue
            if welcome.session == self.name:
                return welcome
            if welcome.session != stranger:
                stranger = welcome.session
                _log.warning(
                    "where session %s was, session %s runs now: start this node anew to attach to it",
                    self.name,
                    stranger,
                )
            await asyncio.sleep(0.5)

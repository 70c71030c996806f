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

from elys.bus import codec, topics
from elys.bus.access.limits import Doorkeeper
from elys.bus.access.permissions import Permissions, check_asker, check_size
from elys.bus.access.roles import Role, role_of_user, signed_id
from elys.bus.handshake import all_welcomes, answer_clock, answer_hello, checked, greet, hello_of
from elys.bus.host_return import until_back
from elys.bus.mailbox import Arrival, Mailbox
from elys.bus.messages.session import Welcome
from elys.bus.messages.vitals import HostFacts
from elys.bus.rivals import require_free_name, warn_of_rivals
from elys.bus.state_source import StateSource
from elys.bus.topics import Delivery, Query, Topic
from elys.bus.transports.reaching import is_near
from elys.bus.transports.transport import Closer, IncomingQuery, Transport
from elys.bus.vigil import Vigil
from elys.bus.vitals import Traffic, give_vitals
from elys.common.errors import BusError, ConnectionLost, ElysError, MessageError, ProtocolError, RequestError

M = TypeVar("M")
Q = TypeVar("Q")
R = TypeVar("R")

HOST_KINDS: Final = ("simulation", "replay")
# Hundreds of viewers that each hear of each other would be tens of thousands of messages: they hear of those they need.
_SEEN_BY: Final = {"viewer": (*HOST_KINDS, "render")}  # all others see everybody
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
        self.nodes: dict[str, Node] = {}  # all that are alive, by id; of a viewer the hosts and render nodes
        self.refused: dict[str, int] = {}  # messages that were not what their topic promises, by topic
        self.traffic = Traffic()
        self.host_facts: Callable[[], HostFacts] | None = None  # of a host: what it carries, for who asks
        self.machine = ""  # of the host, see Welcome
        self.place = ""  # what `discovery.join_session` was told, to come here again
        self.states: StateSource | None = None  # where states come from instead of the topic: a stream
        self.arrival = Arrival(0.0, 0.0)  # of the message that a subscriber is called with
        self.permissions = Permissions(Role.HOST if node.kind in HOST_KINDS else role_of_user(transport.user))
        self.taps: list[Callable[[Topic[Any], str, bytes], None]] = []  # see every publication (topic, key, payload)
        self._loop = asyncio.get_running_loop()
        self._closers: list[Closer] = []
        self._link_listeners: list[Callable[[bool], None]] = []
        self._node_listeners: list[Callable[[Node, bool], None]] = []
        self._refusal_said: dict[str, float] = {}
        self._doorkeeper = Doorkeeper()
        self._tasks: set[asyncio.Task[None]] = set()
        self._rejoining: asyncio.Task[None] | None = None
        self._closed = False

    # --- opening and closing ---------------------------------------------------------------------------------------

    @classmethod
    async def host(cls, transport: Transport, *, name: str, kind: str, epoch: int) -> Session:
        """Opens a session as its host: answers handshakes and shows itself alive. BusError: this name is taken at a router."""
        session = cls(transport, name=name, node=Node(kind, node_id(kind)), epoch=epoch)
        await require_free_name(name, session._ask_for_life)
        session._closers.append(transport.serve(topics.asked_key(name, topics.HELLO), session._welcome))
        # Where releases before protocol 5 ask: they too are to hear that they must be renewed.
        session._closers.append(transport.serve(topics.key_of(name, topics.HELLO), session._welcome))
        session._closers.append(transport.serve(topics.asked_key(name, topics.CLOCK), session._tell_time))
        session._show_and_watch()
        return session

    @classmethod
    async def join(
        cls, transport: Transport, *, kind: str, name: str = "*", timeout: float = 5.0, node: Node | None = None
    ) -> Session:
        """Comes into a session that somebody hosts, as `node` if it is to be known by an id it had before.

        The id that it gets in the session also tells as which user it came.

        Raises:
            ConnectionLost: nobody answered within `timeout` seconds.
            ProtocolError: the host speaks another version of the protocol.
            BusError: several sessions are there, and none was named.
            AccessError: this side's role may not be such a node.
        """
        own = node or Node(kind, node_id(kind))
        session = cls(transport, name=name, node=Node(own.kind, signed_id(own.id, transport.user)), epoch=0)
        session.permissions.require_kind(kind)
        welcome = await greet(transport, node=session.node, name=name, timeout=timeout)
        session.name, session.epoch, session.machine = welcome.session, welcome.epoch, welcome.machine
        session._show_and_watch()
        session._closers.append(transport.watch_link(session._from_thread(session._link_changed)))
        session.start(Vigil(transport, session._ask_for_life, session._link_changed).keep())
        return session

    async def close(self) -> None:
        """Leaves. A second call does nothing."""
        if self._closed:
            return
        self._closed = True
        if self.states is not None:
            await self.states.close()
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
        elif not self._closed and self.permissions.may(topic.name, topic.publisher, "publish"):
            make = partial(self._counted, topic, message)
            self.transport.publish_made(topics.key_of(self.name, topic), make, topic.delivery)

    def _counted(self, topic: Topic[M], message: M) -> bytes:
        payload = codec.encode(message, topic.encoding)
        self.traffic.count_sent(topic.name, len(payload))
        return payload

    def publish_payload(self, topic: Topic[Any], payload: bytes, *, key: str = "") -> None:
        """Sends what is encoded already; what this role may not say goes nowhere, here as at the host."""
        if self._closed or not self.permissions.may(topic.name, topic.publisher, "publish"):
            return
        self.traffic.count_sent(topic.name, len(payload))
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
        """Calls `callback(full key, payload)` on the loop, undecoded; with `every`, none is skipped, nor streamed instead."""
        if not self.permissions.may(topic.name, topic.reader, "hear"):
            return _nothing
        newest_only = topic.delivery is Delivery.LATEST and not every
        name_in = codec.field_finder(topic.newest_of, topic.encoding) if topic.newest_of else None

        def deliver(full_key: str, payload: bytes) -> None:
            self.arrival = mailbox.arrival
            callback(full_key, payload)

        mailbox = Mailbox(self._loop, deliver, newest_only=newest_only, name_in=name_in)
        if topic is topics.STATE and newest_only and self.states is not None:
            return self._keep(self.states.subscribe(mailbox.put))
        expression = topics.key_of(self.name, topic, key)
        arrivals = self.traffic.begin(topic, mailbox)
        close = self._keep(self.transport.subscribe(expression, arrivals.counted(mailbox.put)))

        def end() -> None:
            self.traffic.end(topic, arrivals)
            close()

        return end

    # --- asking and answering --------------------------------------------------------------------------------------

    def serve(self, query: Query[Q, R], handler: Callable[[Q, str], Awaitable[R]], *, key: str = "*") -> Closer:
        """Answers requests: `handler(request, key)` returns the reply or raises an ElysError, whose sentence is the refusal.

        Of one node or user only so many may wait: those beyond end without an answer (`access/limits.py`).
        """

        def begin(incoming: IncomingQuery, asker: str) -> None:
            task = self.start(self._answer(query, handler, incoming))
            task.add_done_callback(lambda _: self._doorkeeper.release(asker))

        hand_over = self._from_thread(begin)

        def arrived(incoming: IncomingQuery) -> None:
            _, asker = topics.parts_of_question(query, incoming.key)
            if self._doorkeeper.admit(asker):
                hand_over(incoming, asker)
            else:
                incoming.drop()

        expression = topics.asked_key(self.name, query, key)
        return self._keep(self.transport.serve(expression, arrived))

    async def request(self, query: Query[Q, R], request: Q, *, key: str = "", timeout: float = 5.0) -> R:
        """Asks and waits for the answer; a host that is away is waited for first.

        Raises:
            RequestError: the other side refused, with its reason; or this side's role may not ask.
            ConnectionLost: no answer within `timeout` seconds, or the host is another run meanwhile.
        """
        self.permissions.require(query, request)
        payload = codec.encode(request, query.request_encoding)
        check_size(query, payload)
        if not is_near(self.transport.endpoint):
            payload = codec.with_packed_answer(payload)
        timeout = await until_back(self, timeout)
        answer = await self._ask(topics.asked_key(self.name, query, key, asker=self.node.id), payload, timeout)
        answer = codec.unpacked(answer)
        return codec.decode(answer, query.reply, query.reply_encoding)

    # --- who is there ----------------------------------------------------------------------------------------------

    def on_link(self, listener: Callable[[bool], None]) -> Closer:
        """Calls `listener(connected)` when the host goes and when it is back (perhaps as a new run: see `epoch`)."""
        self._link_listeners.append(listener)
        return lambda: self._link_listeners.remove(listener)

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
        key, asker = topics.parts_of_question(query, incoming.key)
        try:
            check_asker(query, request, asker)
            reply = await handler(request, key)
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
        began = time.monotonic()

        def settle(answer: bytes | None, reason: str) -> None:
            if future.done():
                return
            if answer is not None:
                future.set_result(answer)
            elif reason:
                future.set_exception(RequestError(reason))
            else:
                is_over = time.monotonic() - began > 0.9 * timeout
                why = f"within {timeout:g} s" if is_over else "and nobody is there who could, or the connection broke"
                future.set_exception(ConnectionLost(f"nobody answered {why}"))

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
        self._answer_at_once(topics.HELLO, incoming, partial(answer_hello, session=self.name, epoch=self.epoch))

    def _tell_time(self, incoming: IncomingQuery) -> None:
        self._answer_at_once(topics.CLOCK, incoming, partial(answer_clock, epoch=self.epoch))

    def _answer_at_once(
        self, query: Query[Any, Any], incoming: IncomingQuery, answer: Callable[[IncomingQuery], None]
    ) -> None:
        """On the transport's thread, so that it does not wait for a tick."""
        asker = topics.parts_of_question(query, incoming.key)[1]
        if not self._doorkeeper.admit(asker):
            incoming.drop()
            return
        try:
            answer(incoming)
        finally:
            self._doorkeeper.release(asker)

    def _show_and_watch(self) -> None:
        self.serve(topics.VITALS, partial(give_vitals, self), key=self.node.id)
        own = topics.node_key(self.name, self.node.kind, self.node.id)
        self._closers.append(self.transport.announce(own))
        for kind in _SEEN_BY.get(self.node.kind, ("*",)):
            them = topics.node_key(self.name, kind, "*")
            self._closers.append(self.transport.watch(them, self._from_thread(self._node_changed)))

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
            for listener in tuple(self._link_listeners):
                listener(False)
        elif alive and not self.connected and self._rejoining is None:
            self._rejoining = self.start(self._rejoin())

    async def _ask_for_life(self, timeout: float) -> None:
        hello = hello_of(kind=self.node.kind, node=self.node.id)
        await self._ask(topics.greeting_key(self.name, self.node.id), hello, timeout)

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
        for listener in tuple(self._link_listeners):
            listener(True)

    async def _greet_again(self) -> Welcome:
        stranger = ""
        while True:
            try:
                welcomes = await all_welcomes(self.transport, node=self.node, name="*", timeout=1.0)
            except RequestError as error:
                _log.warning("the host of session %s is not back yet: %s", self.name, error)
                welcomes = []
            for welcome in welcomes:
                if welcome.session == self.name:
                    return checked(welcome)
            if welcomes and welcomes[0].session != stranger:
                stranger = welcomes[0].session
                _log.warning(
                    "where session %s was, session %s runs now: start this node anew to attach to it",
                    self.name,
                    stranger,
                )
            await asyncio.sleep(0.5 if welcomes else 0.02)


def _nothing() -> None:
    """Nothing is held."""

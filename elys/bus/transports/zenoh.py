"""The transport between processes and machines: zenoh over TCP, through a router that the session's host carries.

    host  = zenoh "router", listens on tcp/127.0.0.1:7447        viewers, editors, recorders = zenoh "client"s of it

All nodes of a session reach one another through the host, so nobody needs a broker, multicast or discovery, and when the
host is gone every client notices at once (its TCP connection closes) and knocks again every 100 ms until there is a new one;
zenoh then declares its subscriptions, queryables and tokens anew by itself.

Delivery. Nothing that a viewer can subscribe to is ever sent with BLOCK: a stopped viewer would stop the simulation. Both
deliveries are reliable on the wire and dropped only for a reader whose transmission queue is full; they use queues of their
own, so that state frames never push a delta out. 16 batches of 64 KiB in each let a healthy reader fall a whole megabyte
behind, and a message longer than that waits up to 1 ms for each further batch; once a reader is known to be congested,
zenoh drops without waiting. No message is express: each would fill a batch of its own, and a burst of small ones the queue.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback

from elys.bus.access.credentials import Credentials
from elys.bus.access.host import HostAccess, client_settings
from elys.bus.access.limits import MAX_MESSAGE_SIZE, host_limits
from elys.bus.topics import Delivery
from elys.bus.transports.outgoing import Outgoing
from elys.bus.transports.transport import Answer, Answers, Closer, IncomingQuery, Link
from elys.common.errors import AccessError, BusError, ConnectionLost

DEFAULT_PORT: Final = 7447
DEFAULT_ENDPOINT: Final = f"tcp/127.0.0.1:{DEFAULT_PORT}"

_LEASE: Final = 2000  # [ms] without a sign of life until a connection (a cut cable, a stopped machine) counts as dead
_ANSWERING_THREADS: Final = 4
_ASKING_WHY: Final = 1.5  # [s] of knocking in vain until it is asked why; three round trips of a slow link fit
_REFUSAL: Final = "elys/refusal"  # encoding that tells our refusals from zenoh's own errors (a timeout)
_PRIORITIES: Final = {Delivery.LATEST: zenoh.Priority.DATA, Delivery.SEQUENCED: zenoh.Priority.DATA_HIGH}
_CLOSED: Final = "this transport is closed: open another one"
_log = logging.getLogger(__name__)

# Closing a connection to who has gone silent blocks one of zenoh's receiving threads for as long as its system waits for an
# answer (SO_LINGER, 10 s), and there are few of them: one viewer's five made a host deaf for seconds. Read when zenoh starts.
os.environ.setdefault("ZENOH_RUNTIME", "(rx: (worker_threads: 16))")


class ZenohTransport:
    """One node's zenoh session; implements `Transport`. Make it with `listen`, `listen_on_free_port` or `connect`."""

    def __init__(self, session: zenoh.Session, *, endpoint: str, hosts: bool, user: str = "") -> None:
        self.endpoint = endpoint
        self.user = user  # who this side is to the host; "" where it asks nobody
        self._session = session
        self._hosts = hosts
        # Replies wait for the asker's queue. On threads of their own they may: the loop must not.
        self._answering = ThreadPoolExecutor(_ANSWERING_THREADS, thread_name_prefix="elys-answers")
        self._unanswered: weakref.WeakSet[ZenohQuery] = weakref.WeakSet()
        # A host speaks to many, and its thread has a world to move. Who speaks to the host alone is faster without a detour.
        self._outgoing = Outgoing() if hosts else None
        self._lock = threading.Lock()
        self._matched: dict[str, zenoh.Publisher] = {}  # declared to hear who listens
        self._closers: set[Closer] = set()
        self._closed = False
        self._way: tuple[list[str], Credentials | None] = ([], None)  # endpoints, and what was shown there

    @classmethod
    def listen(cls, endpoint: str = DEFAULT_ENDPOINT, *, access: HostAccess | None = None) -> ZenohTransport:
        """Opens the host's side, to those whom `access` names; without it to everybody who comes.

        Raises:
            BusError: the endpoint is in use or is none.
        """
        try:
            with access.settings() if access is not None else contextlib.nullcontext(dict[str, Any]()) as who:
                session = zenoh.open(_config("router", {"listen/endpoints": [endpoint], **host_limits(), **who}))
        except zenoh.ZError as error:
            if "in use" in str(error):
                raise BusError(
                    f"{endpoint} is in use, perhaps by another session: stop that one, or choose another port"
                ) from error
            raise BusError(f"cannot listen on '{endpoint}' ({_cause(error)}): give tcp/ADDRESS:PORT") from error
        return cls(session, endpoint=endpoint, hosts=True)

    @classmethod
    def listen_on_free_port(
        cls, *, address: str = "127.0.0.1", first_port: int = DEFAULT_PORT, access: HostAccess | None = None
    ) -> ZenohTransport:
        """Opens the host's side on the first free port from `first_port` on; BusError if 100 are in use."""
        for port in range(first_port, first_port + 100):
            try:
                return cls.listen(f"tcp/{address}:{port}", access=access)
            except BusError as error:
                if "in use" not in str(error):
                    raise
        raise BusError(f"the ports {first_port} to {port} of {address} are all in use: name another port")

    @classmethod
    def connect(
        cls,
        endpoints: str | Sequence[str] = DEFAULT_ENDPOINT,
        *,
        timeout: float = 5.0,
        credentials: Credentials | None = None,
        hosts: bool = False,
    ) -> ZenohTransport:
        """Opens the side of everybody else, or of a host below a router; blocks until connected, at most `timeout` seconds.

        Raises:
            ConnectionLost: nobody listens there.
            AccessError: somebody does, and does not let this side in; the sentence says why.
            BusError: an endpoint is none.
        """
        from elys.bus.access.refusals import is_open, why_refused  # who hosts, records or draws files needs none of it

        names = [endpoints] if isinstance(endpoints, str) else list(endpoints)
        deadline, patience = time.monotonic() + timeout, _ASKING_WHY
        while True:
            left = deadline - time.monotonic()
            session = _opened(names, min(max(left, 0.001), patience), credentials)
            if session is not None:
                transport = cls(session, endpoint=names[0], hosts=hosts, user=credentials.user if credentials else "")
                transport._way = names, credentials
                return transport
            if credentials is not None and any(is_open(name) for name in names):
                credentials = None  # a host that asks nobody does not let in who tells it
                deadline = max(deadline, time.monotonic() + patience)
            elif reason := next(filter(None, (why_refused(name, credentials) for name in names)), ""):
                raise AccessError(reason)
            elif left <= patience:
                raise ConnectionLost(
                    f"nobody answers at {' or '.join(names)} within {timeout:g} s: is the session running? "
                    "Start one with `elys run SCENE`"
                )
            patience = 2.0 * _ASKING_WHY

    def another(self, timeout: float) -> ZenohTransport:
        """One more connection to the same host; raises as `connect` does."""
        endpoints, credentials = self._way
        return self.connect(endpoints, timeout=timeout, credentials=credentials)

    # --- publishing and subscribing --------------------------------------------------------------------------------

    def publish(self, key: str, payload: bytes, delivery: Delivery) -> None:
        """Sends to all who subscribe; a reader whose queue is full misses it."""
        self.publish_made(key, lambda: payload, delivery)

    def publish_made(self, key: str, make: Callable[[], bytes], delivery: Delivery) -> None:
        """Sends what `make` returns; a host calls it on the thread that sends."""
        if self._outgoing is None:
            with self._closed_said():
                self._put(key, make(), delivery)
            return
        if self._closed:
            raise BusError(_CLOSED)
        self._outgoing.put(partial(self._put_later, key, make, delivery))

    def _put_later(self, key: str, make: Callable[[], bytes], delivery: Delivery) -> None:
        try:
            self._put(key, make(), delivery)
        except zenoh.ZError as error:
            _log.error("nothing could be sent on %s: %s", key, _cause(error))

    def _put(self, key: str, payload: bytes, delivery: Delivery) -> None:
        self._session.put(key, payload, congestion_control=zenoh.CongestionControl.DROP, priority=_PRIORITIES[delivery])

    def has_listener(self, key: str) -> bool:
        """Whether anybody subscribes to a key now; the first question about a key comes too early to know of others' nodes."""
        with self._closed_said():
            if key not in self._matched:
                self._matched[key] = self._session.declare_publisher(key)
            status: Any = self._matched[key].matching_status  # its stub says bool
            return bool(status.matching)

    def subscribe(self, key_expression: str, on_sample: Callable[[str, bytes], None]) -> Closer:
        """Calls `on_sample(key, payload)` on zenoh's receiving thread: it must only hand over."""

        def arrived(sample: zenoh.Sample) -> None:
            on_sample(str(sample.key_expr), sample.payload.to_bytes())

        with self._closed_said():
            return self._keep(self._session.declare_subscriber(key_expression, Callback(arrived, indirect=False)))

    # --- asking and answering --------------------------------------------------------------------------------------

    def serve(self, key_expression: str, on_query: Callable[[IncomingQuery], None]) -> Closer:
        """Calls `on_query` on zenoh's receiving thread: it must only hand over."""
        answer_key = "" if "*" in key_expression else key_expression

        def arrived(query: zenoh.Query) -> None:
            question = ZenohQuery(query, answer_key or str(query.key_expr), self._answering)
            self._unanswered.add(question)
            on_query(question)

        with self._closed_said():
            return self._keep(self._session.declare_queryable(key_expression, Callback(arrived, indirect=False)))

    def request(self, key_expression: str, payload: bytes, timeout: float, answer: Answer) -> None:
        """Asks; the first answer within `timeout` seconds counts."""
        settled = threading.Lock()  # taken by the first answer and never given back

        def arrived(reply: zenoh.Reply) -> None:
            if (sample := reply.ok) is not None:
                if settled.acquire(blocking=False):
                    answer(sample.payload.to_bytes(), "")
            elif (error := reply.err) is None or str(error.encoding) != _REFUSAL:
                return  # zenoh's own error: the end of the request follows and says it
            elif settled.acquire(blocking=False):
                answer(None, error.payload.to_bytes().decode(errors="replace"))

        def ended() -> None:
            if settled.acquire(blocking=False):
                answer(None, "")

        with self._closed_said():
            handler = Callback(arrived, ended, indirect=False)
            self._session.get(key_expression, handler, **_options(payload, timeout))

    def survey(self, key_expression: str, payload: bytes, timeout: float, answers: Answers) -> None:
        """Asks all who serve these keys; `answers` hears once, when all have spoken or after `timeout` seconds."""
        replies: list[bytes] = []
        reasons: list[str] = []

        def arrived(reply: zenoh.Reply) -> None:
            if (sample := reply.ok) is not None:
                replies.append(sample.payload.to_bytes())
            elif (error := reply.err) is not None and str(error.encoding) == _REFUSAL:
                reasons.append(error.payload.to_bytes().decode(errors="replace"))

        with self._closed_said():
            handler = Callback(arrived, lambda: answers(replies, reasons), indirect=False)
            self._session.get(key_expression, handler, **_options(payload, timeout))

    # --- who is there ----------------------------------------------------------------------------------------------

    def identity(self) -> str:
        """What this end is called by others' `links`."""
        return str(self._session.info.zid())

    def links(self) -> list[Link]:
        """The connections there are now."""
        return links_of(self._session)

    def announce(self, key: str) -> Closer:
        """Shows others that this key's owner is alive, until closed or dead."""
        with self._closed_said():
            return self._keep(self._session.liveliness().declare_token(key))

    def watch(self, key_expression: str, on_change: Callable[[str, bool], None]) -> Closer:
        """Calls `on_change(key, alive)` for those alive now and at every change."""

        def changed(sample: zenoh.Sample) -> None:
            on_change(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        with self._closed_said():
            handler = Callback(changed, indirect=False)
            return self._keep(self._session.liveliness().declare_subscriber(key_expression, handler, history=True))

    def watch_link(self, on_change: Callable[[bool], None]) -> Closer:
        """Calls `on_change(connected)` now and when the host goes or comes; for the host itself there is nothing to tell."""
        if self._hosts:
            return _nothing

        def changed(event: zenoh.TransportEvent) -> None:
            on_change(event.kind == zenoh.SampleKind.PUT)

        with self._closed_said():
            handler = Callback(changed, indirect=False)
            closer = self._keep(self._session.info.declare_transport_events_listener(handler, history=True))
            if not self._session.info.routers_zid():
                on_change(False)
            return closer

    def close(self) -> None:
        """Leaves and frees everything. A second call does nothing."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            self._closers.clear()
        if self._outgoing is not None:
            self._outgoing.close()
        self._answering.shutdown(wait=False, cancel_futures=True)
        for question in list(self._unanswered):
            question.drop()  # zenoh would wait 10 s for somebody to answer them
        self._session.close()  # type: ignore[no-untyped-call]

    # --- inside ----------------------------------------------------------------------------------------------------

    def _keep(self, declared: Any) -> Closer:
        """The closer of something declared; what is open at the end goes with the zenoh session."""

        def close() -> None:
            with self._lock:
                if close not in self._closers:
                    return
                self._closers.discard(close)
            with contextlib.suppress(zenoh.ZError):  # the zenoh session closed meanwhile and took it along
                declared.undeclare()

        with self._lock:
            self._closers.add(close)
        return close

    @contextlib.contextmanager
    def _closed_said(self) -> Any:
        try:
            yield
        except zenoh.ZError as error:
            if self._closed:
                raise BusError(_CLOSED) from error
            raise BusError(f"zenoh refused ({_cause(error)})") from error


class ZenohQuery:
    """A question as the one who serves it sees it."""

    def __init__(self, query: zenoh.Query, answer_key: str, answering: ThreadPoolExecutor) -> None:
        self.key = str(query.key_expr)
        self.payload = b"" if query.payload is None else query.payload.to_bytes()
        self._query: zenoh.Query | None = query
        self._answer_key = answer_key
        self._answering = answering

    def reply(self, payload: bytes) -> None:
        """Answers, on a thread that may wait for the asker."""
        self._send(lambda query: query.reply(self._answer_key, payload))

    def refuse(self, reason: str) -> None:
        """Says why there is no answer."""
        self._send(lambda query: query.reply_err(reason.encode(), encoding=_REFUSAL))

    def drop(self) -> None:
        """Ends the question for the asker, answered or not."""
        self._query = None

    def _send(self, send: Callable[[zenoh.Query], None]) -> None:
        # Taken here, not on the thread that answers: of two answers the first one counts, whichever thread is faster.
        query, self._query = self._query, None
        if query is None:
            return  # answered already

        def work() -> None:
            try:
                send(query)
            except zenoh.ZError as error:
                _log.debug("an answer on %s found nobody: %s", self.key, _cause(error))

        with contextlib.suppress(RuntimeError):  # the transport is closing: nobody is left to answer
            self._answering.submit(work)


def links_of(session: zenoh.Session) -> list[Link]:
    """The connections of a zenoh session."""
    info = session.info
    kinds = {str(transport.zid): str(transport.whatami) for transport in info.transports()}
    return [Link(str(o.zid), kinds.get(str(o.zid), ""), str(o.src), str(o.dst)) for o in info.links()]


def _options(payload: bytes, timeout: float) -> dict[str, Any]:
    """How questions are asked: of all who may answer, each answer as it comes."""
    return {
        "payload": payload,
        "timeout": timeout,
        "target": zenoh.QueryTarget.ALL,
        "consolidation": zenoh.ConsolidationMode.NONE,
        "congestion_control": zenoh.CongestionControl.BLOCK,
    }


def _opened(names: list[str], timeout: float, credentials: Credentials | None) -> zenoh.Session | None:
    """A client of one of these endpoints; None where it cannot connect. Raises BusError for what is no endpoint."""
    by_certificate = all(name.startswith("tls/") for name in names)
    if by_certificate and (credentials is None or not credentials.has_certificate):
        return None
    settings = {
        "connect/endpoints": names,
        "connect/timeout_ms": max(1, int(timeout * 1000)),
        "connect/exit_on_failure": True,
        **client_settings(credentials, by_certificate=by_certificate),
    }
    try:
        return zenoh.open(_config("client", settings))
    except zenoh.ZError as error:
        if "Unable to connect" in str(error):
            return None
        raise BusError(f"cannot connect to '{' or '.join(names)}' ({_cause(error)}): give tcp/ADDRESS:PORT") from error


def _config(mode: str, settings: dict[str, Any]) -> zenoh.Config:
    """Settings common to both sides, each for a reason given in the module's text or beside it, and those of one side."""
    config = zenoh.Config()
    for key, value in {
        "mode": mode,
        "listen/endpoints": [],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,  # half a second of waiting for peers that nobody looks for
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 100, "period_increase_factor": 1},
        # Killed processes would leave segments behind in /dev/shm, and state frames gain little.
        "transport/shared_memory/enabled": False,
        "transport/link/rx/max_message_size": MAX_MESSAGE_SIZE,
        "transport/link/tx/lease": _LEASE,
        "transport/link/tx/queue/size/data": 16,
        "transport/link/tx/queue/size/data_high": 16,
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": 1000,  # [us]
        "transport/link/tx/queue/congestion_control/block/wait_before_close": 1_000_000,  # [us] for answers
        **settings,
    }.items():
        _insert(config, key, value)
    return config


def _insert(config: zenoh.Config, key: str, value: Any) -> None:
    config.insert_json5(key, json.dumps(value))


def _cause(error: zenoh.ZError) -> str:
    """What zenoh says, without the places in its sources."""
    return str(error).split(" at /")[0].strip()


def _nothing() -> None:
    """Nothing is held."""

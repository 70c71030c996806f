"""The transport between processes and machines: zenoh over TCP, through a router that the session's host carries.

    host  = zenoh "router", listens on tcp/127.0.0.1:7447        viewers, editors, recorders = zenoh "client"s of it

All nodes of a session reach one another through the host, so nobody needs a broker, multicast or discovery, and when the
host is gone every client notices at once (its TCP connection closes) and knocks four times a second at all endpoints that it
was given until one answers (`reaching.py`); its subscriptions, queryables and tokens are declared there anew (`zenoh_line.py`).

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
from elys.bus.transports.reaching import KNOCK_INTERVAL, Reached, is_near, reach
from elys.bus.transports.transport import Answer, Answers, Closer, IncomingQuery, Link
from elys.bus.transports.zenoh_line import Line, Lines
from elys.bus.transports.zenoh_query import REFUSAL, ZenohQuery, asking, cause, links_of
from elys.common.errors import AccessError, BusError, ConnectionLost

DEFAULT_PORT: Final = 7447
DEFAULT_ENDPOINT: Final = f"tcp/127.0.0.1:{DEFAULT_PORT}"

# [ms] without a sign of life until a connection (a cut cable, a stopped machine) counts as dead. A client says its own, by how
# far away it is: TCP needs a round trip to send again what was lost. Of the host it sees earlier that it is silent.
_HOST_LEASE: Final = 4000
_CLIENT_LEASE: Final = 800
_LEASE_ROUND_TRIPS: Final = 4
_NEAR: Final = 0.06  # [s] within which a door answers of which the distance is worth knowing before
_FAR: Final = 0.5  # [s] that the round trip may take where it is not known
_OPENING_TRIPS: Final = 3  # round trips that TCP and zenoh need
_OPENING_TIME: Final = 2.0  # [s] that zenoh may take to open a connection where a door has opened, and 6 round trips
_ANSWERING_THREADS: Final = 4
_ASKING_WHY: Final = 1.5  # [s] of knocking in vain until it is asked why; three round trips of a slow link fit
_SURE_OF: Final = (
    8  # times that a secret was shown and sent away, after which it is refused: a busy host sends some away wrongly
)
_PRIORITIES: Final = {Delivery.LATEST: zenoh.Priority.DATA, Delivery.SEQUENCED: zenoh.Priority.DATA_HIGH}
_CLOSED: Final = "this transport is closed: open another one"
_log = logging.getLogger(__name__)

# Closing a connection to who has gone silent blocks one of zenoh's threads for as long as its system waits for an answer
# (SO_LINGER, 10 s), and there are few of them: one viewer's five made a host deaf for seconds. Read when zenoh starts.
_THREADS: Final = {"rx": 16, "tx": 8, "acc": 4, "net": 4}
os.environ.setdefault(
    "ZENOH_RUNTIME", ", ".join(f"{name}: (worker_threads: {count})" for name, count in _THREADS.items()).join("()")
)


class ZenohTransport:
    """One node's zenoh session; implements `Transport`. Make it with `listen`, `listen_on_free_port` or `connect`."""

    def __init__(
        self,
        session: zenoh.Session,
        *,
        endpoint: str,
        hosts: bool,
        user: str = "",
        names: Sequence[str] = (),
        round_trip: float = 0.0,
        credentials: Credentials | None = None,
    ) -> None:
        """`names` are the endpoints at which the other side is looked for when it is gone, and shown `credentials`."""
        self.endpoint = endpoint
        self.round_trip = round_trip
        self.user = user  # who this side is to the host; "" where it asks nobody
        self._names = names
        self._credentials = credentials
        self._hosts = hosts
        self._lines = Lines(session, self._open_again if names else None)
        # Replies wait for the asker's queue. On threads of their own they may: the loop must not.
        self._answering = ThreadPoolExecutor(_ANSWERING_THREADS, thread_name_prefix="elys-answers")
        self._unanswered: weakref.WeakSet[ZenohQuery] = weakref.WeakSet()
        # A host speaks to many, and its thread has a world to move. Who speaks to the host alone is faster without a detour.
        self._outgoing = Outgoing() if hosts else None
        self._lock = threading.Lock()
        self._matched: dict[str, zenoh.Publisher] = {}  # declared to hear who listens
        self._closed = False

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
            raise BusError(f"cannot listen on '{endpoint}' ({cause(error)}): give tcp/ADDRESS:PORT") from error
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
        deadline, patience, refusals = time.monotonic() + timeout, _ASKING_WHY, 0
        while True:
            left = deadline - time.monotonic()
            session, door, sent_away = _reached(names, min(max(left, 0.001), patience), credentials)
            if session is not None and door is not None:
                return cls(
                    session,
                    endpoint=door.endpoint,
                    hosts=hosts,
                    user=credentials.user if credentials else "",
                    names=names,
                    round_trip=door.round_trip,
                    credentials=credentials,
                )
            if credentials is not None and any(is_open(name) for name in names):
                credentials = None  # a host that asks nobody does not let in who tells it
                deadline = max(deadline, time.monotonic() + patience)
            elif reason := next((why for name in names if (why := why_refused(name, credentials)).sentence), None):
                refusals += sent_away  # who has only just opened, or has much to do, may let this side in yet
                is_sure = reason.is_sure and (credentials is None or refusals >= _SURE_OF)
                is_over = deadline - time.monotonic() <= patience
                if is_over and reason.is_of_credentials and not refusals:
                    raise ConnectionLost(
                        f"{' or '.join(names)} opens no connection within {timeout:g} s: is it very busy? Try again"
                    )
                if is_sure or is_over:
                    raise AccessError(reason.sentence)
                patience = _ASKING_WHY
                continue
            elif left <= patience:
                raise ConnectionLost(
                    f"nobody answers at {' or '.join(names)} within {timeout:g} s: is the session running? "
                    "Start one with `elys run SCENE`"
                )
            patience = 2.0 * _ASKING_WHY

    def another(self, timeout: float, knocks_until: threading.Event | None = None) -> ZenohTransport:
        """One more connection to the same host; raises as `connect` does.

        Where the host has gone silent: knocks, until the event is set at most, and begins with zenoh when a door has opened.
        """
        if knocks_until is None:
            return self.connect(self._names, timeout=timeout, credentials=self._credentials)
        door = reach(self._names, timeout=timeout, stop=knocks_until)
        session = _opened(door, _OPENING_TIME, self._credentials) if door is not None else None
        if door is None or session is None:
            raise ConnectionLost(f"nobody lets a further connection in at {', '.join(self._names)}")
        return type(self)(
            session,
            endpoint=door.endpoint,
            hosts=self._hosts,
            user=self._credentials.user if self._credentials else "",
            names=self._names,
            round_trip=door.round_trip,
            credentials=self._credentials,
        )

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
            _log.error("nothing could be sent on %s: %s", key, cause(error))

    def _put(self, key: str, payload: bytes, delivery: Delivery) -> None:
        self._lines.session.put(
            key, payload, congestion_control=zenoh.CongestionControl.DROP, priority=_PRIORITIES[delivery]
        )

    def has_listener(self, key: str) -> bool:
        """Whether anybody subscribes to a key now; the first question about a key comes too early to know of others' nodes."""
        with self._closed_said():
            if key not in self._matched:
                self._keep(partial(self._match, key))
            status: Any = self._matched[key].matching_status  # its stub says bool
            return bool(status.matching)

    def _match(self, key: str, line: Line) -> zenoh.Publisher:
        self._matched[key] = line.session.declare_publisher(key)
        return self._matched[key]

    def subscribe(self, key_expression: str, on_sample: Callable[[str, bytes], None]) -> Closer:
        """Calls `on_sample(key, payload)` on zenoh's receiving thread: it must only hand over."""

        def declare(line: Line) -> Any:
            def arrived(sample: zenoh.Sample) -> None:
                if line.is_live:
                    self._lines.heard()
                    on_sample(str(sample.key_expr), sample.payload.to_bytes())

            return line.session.declare_subscriber(key_expression, Callback(arrived, indirect=False))

        return self._keep(declare)

    # --- asking and answering --------------------------------------------------------------------------------------

    def serve(self, key_expression: str, on_query: Callable[[IncomingQuery], None]) -> Closer:
        """Calls `on_query` on zenoh's receiving thread: it must only hand over."""
        answer_key = "" if "*" in key_expression else key_expression

        def arrived(query: zenoh.Query) -> None:
            question = ZenohQuery(query, answer_key or str(query.key_expr), self._answering)
            self._unanswered.add(question)
            on_query(question)

        return self._keep(
            lambda line: line.session.declare_queryable(key_expression, Callback(arrived, indirect=False))
        )

    def request(self, key_expression: str, payload: bytes, timeout: float, answer: Answer) -> None:
        """Asks; the first answer within `timeout` seconds counts."""
        settled = threading.Lock()  # taken by the first answer and never given back

        def arrived(reply: zenoh.Reply) -> None:
            self._lines.heard()
            if (sample := reply.ok) is not None:
                if settled.acquire(blocking=False):
                    answer(sample.payload.to_bytes(), "")
            elif (error := reply.err) is None or str(error.encoding) != REFUSAL:
                return  # zenoh's own error: the end of the request follows and says it
            elif settled.acquire(blocking=False):
                answer(None, error.payload.to_bytes().decode(errors="replace"))

        def ended() -> None:
            if settled.acquire(blocking=False):
                answer(None, "")

        with self._closed_said():
            handler = Callback(arrived, ended, indirect=False)
            self._lines.session.get(key_expression, handler, **asking(payload, timeout))

    def survey(self, key_expression: str, payload: bytes, timeout: float, answers: Answers) -> None:
        """Asks all who serve these keys; `answers` hears once, when all have spoken or after `timeout` seconds."""
        replies: list[bytes] = []
        reasons: list[str] = []

        def arrived(reply: zenoh.Reply) -> None:
            self._lines.heard()
            if (sample := reply.ok) is not None:
                replies.append(sample.payload.to_bytes())
            elif (error := reply.err) is not None and str(error.encoding) == REFUSAL:
                reasons.append(error.payload.to_bytes().decode(errors="replace"))

        with self._closed_said():
            handler = Callback(arrived, lambda: answers(replies, reasons), indirect=False)
            self._lines.session.get(key_expression, handler, **asking(payload, timeout))

    # --- who is there ----------------------------------------------------------------------------------------------

    def identity(self) -> str:
        """What this end is called by others' `links`."""
        return str(self._lines.session.info.zid())

    def links(self) -> list[Link]:
        """The connections there are now."""
        return links_of(self._lines.session)

    def announce(self, key: str) -> Closer:
        """Shows others that this key's owner is alive, until closed or dead."""
        return self._keep(lambda line: line.session.liveliness().declare_token(key))

    def watch(self, key_expression: str, on_change: Callable[[str, bool], None]) -> Closer:
        """Calls `on_change(key, alive)` for those alive now and at every change."""

        alive: dict[str, None] = {}

        def declare(line: Line) -> Any:
            for key in list(alive):  # who is there is told anew
                del alive[key]
                on_change(key, False)

            def changed(sample: zenoh.Sample) -> None:
                if not line.is_live:
                    return
                self._lines.heard()
                key, is_alive = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
                if is_alive:
                    alive[key] = None
                else:
                    alive.pop(key, None)
                on_change(key, is_alive)

            handler = Callback(changed, indirect=False)
            return line.session.liveliness().declare_subscriber(key_expression, handler, history=True)

        return self._keep(declare)

    def watch_link(self, on_change: Callable[[bool], None]) -> Closer:
        """Calls `on_change(connected)` now and when the host goes or comes; for the host itself there is nothing to tell."""
        return _nothing if self._hosts else self._lines.on_link(on_change)

    @property
    def silence(self) -> float:
        """[s] since something came from the host; 0 for the host itself."""
        return 0.0 if self._hosts else self._lines.silence

    def suspect(self) -> None:
        """The host was silent for too long: looks for another way to it, unless it speaks first."""
        self._lines.suspect()

    def close(self) -> None:
        """Leaves and frees everything. A second call does nothing."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        if self._outgoing is not None:
            self._outgoing.close()
        self._answering.shutdown(wait=False, cancel_futures=True)
        for question in list(self._unanswered):
            question.drop()  # zenoh would wait 10 s for somebody to answer them
        self._lines.close()

    # --- inside ----------------------------------------------------------------------------------------------------

    def _open_again(self, stop: threading.Event) -> zenoh.Session | None:
        door = reach(self._names, timeout=_OPENING_TIME, stop=stop)
        if door is None:
            return None
        try:
            session = _opened(door, _OPENING_TIME, self._credentials)
        except BusError as error:
            _log.debug("nobody behind the door of %s: %s", door.endpoint, error)
            return None
        if session is None:
            return None
        self.endpoint, self.round_trip = door.endpoint, door.round_trip
        return session

    def _keep(self, declare: Callable[[Line], Any]) -> Closer:
        """The closer of something declared, on this line and on those that follow."""
        with self._closed_said():
            return self._lines.stand(declare)

    @contextlib.contextmanager
    def _closed_said(self) -> Any:
        try:
            yield
        except zenoh.ZError as error:
            if self._closed:
                raise BusError(_CLOSED) from error
            raise BusError(f"zenoh refused ({cause(error)})") from error


def _reached(
    names: Sequence[str], timeout: float, credentials: Credentials | None
) -> tuple[zenoh.Session | None, Reached | None, int]:
    """A zenoh session with who answers first of these, and where that is; None where nobody lets it in within `timeout` [s].

    Also how often somebody answered and sent this side away. Raises BusError for what is no endpoint.
    """
    deadline = time.monotonic() + timeout
    door = reach(names, timeout=min(_NEAR, timeout))
    if door is None and len(names) == 1 and not is_near(names[0]):
        # A round trip is worth something there: straight in, for somebody is there mostly.
        door = Reached(names[0], _FAR)
    elif door is None:
        door = reach(names, timeout=deadline - time.monotonic())
    refusals = 0
    while door is not None and (left := deadline - time.monotonic()) > 0.0:
        begun = time.monotonic()
        session = _opened(door, left, credentials)
        if session is not None:
            trip = min(door.round_trip, (time.monotonic() - begun) / _OPENING_TRIPS)
            return session, Reached(door.endpoint, trip), refusals
        refusals += time.monotonic() - begun < _opening_time(door, left)
        time.sleep(
            min(KNOCK_INTERVAL, max(deadline - time.monotonic(), 0.0))
        )  # who is refused must not keep others out
        door = reach(names, timeout=deadline - time.monotonic())
    return None, None, refusals


def _opening_time(door: Reached, timeout: float) -> float:
    """[s] that opening a connection there may take: `timeout` at most, or 6 round trips where those are longer."""
    return max(min(timeout, _OPENING_TIME), 6.0 * door.round_trip)


def _opened(door: Reached, timeout: float, credentials: Credentials | None) -> zenoh.Session | None:
    """A client's zenoh session with a host whose door is open; None where it lets nobody in, at once, or says nothing within
    `_opening_time` of `timeout` [s]. Raises BusError for no endpoint.
    """
    by_certificate = door.endpoint.startswith("tls/")
    if by_certificate and (credentials is None or not credentials.has_certificate):
        return None
    settings = {
        "transport/link/tx/lease": _CLIENT_LEASE + int(_LEASE_ROUND_TRIPS * door.round_trip * 1000),
        "connect/timeout_ms": 0,  # one attempt: with a time, a refusal at once is told when that time is over
        "transport/unicast/open_timeout": max(1, int(_opening_time(door, timeout) * 1000)),
        "connect/exit_on_failure": True,
        "connect/endpoints": [door.endpoint],
        **client_settings(credentials, by_certificate=by_certificate),
    }
    try:
        return zenoh.open(_config("client", settings))
    except zenoh.ZError as error:
        if "Unable to connect" in str(error):
            return None
        raise BusError(f"cannot connect to '{door.endpoint}' ({cause(error)}): give tcp/ADDRESS:PORT") from error


def _config(mode: str, settings: dict[str, Any]) -> zenoh.Config:
    """Settings common to both sides, each for a reason given in the module's text or beside it, and those of one side."""
    config = zenoh.Config()
    for key, value in {
        "mode": mode,
        "listen/endpoints": [],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,  # half a second of waiting for peers that nobody looks for
        # Never by itself: `zenoh_line.py` comes back sooner, and two that do would bring everything twice.
        "connect/retry": {"period_init_ms": 1 << 30, "period_max_ms": 1 << 30, "period_increase_factor": 1},
        # Killed processes would leave segments behind in /dev/shm, and state frames gain little.
        "transport/shared_memory/enabled": False,
        "transport/link/rx/max_message_size": MAX_MESSAGE_SIZE,
        "transport/link/tx/lease": _HOST_LEASE,
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


def _nothing() -> None:
    """Nothing is held."""

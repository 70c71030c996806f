"""The transport inside one process: a broker that hands bytes over from thread to thread, for tests and single-process runs.

It keeps the promises of the real network: any thread may call, callbacks come on the caller's thread, nobody waits for a
reader, a host that closes takes the link of the others with it.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from elys.bus.topics import Delivery
from elys.bus.transports.transport import Answer, Answers, Closer, IncomingQuery, Link
from elys.common.errors import BusError


@dataclass(eq=False, slots=True)
class _Endpoint:
    """A subscription, queryable, watch or token: a key expression and who hears of it."""

    expression: str
    callback: Callable[..., None]


@dataclass(eq=False, slots=True)
class _Request:
    """One request under way: the first to settle it wins."""

    answer: Answer
    lock: threading.Lock = field(default_factory=threading.Lock)
    timer: threading.Timer | None = None
    settled: bool = False

    def settle(self, payload: bytes | None, reason: str) -> None:
        with self.lock:
            if self.settled:
                return
            self.settled = True
        if self.timer is not None:
            self.timer.cancel()
        self.answer(payload, reason)


@dataclass(slots=True)
class LoopbackQuery:
    """A question as the one who serves it sees it."""

    key: str
    payload: bytes
    request: _Request

    def reply(self, payload: bytes) -> None:
        """Answers."""
        self.request.settle(payload, "")

    def refuse(self, reason: str) -> None:
        """Says why there is no answer."""
        self.request.settle(None, reason)

    def drop(self) -> None:
        """Leaves it without an answer."""
        self.request.settle(None, "")


class _Survey:
    """A question to several: ends when all have answered, or at its time."""

    def __init__(self, count: int, timeout: float, answers: Answers) -> None:
        self._left = count
        self._answers = answers
        self._lock = threading.Lock()
        self._replies: list[bytes] = []
        self._reasons: list[str] = []
        self._timer = threading.Timer(timeout, self._end)
        self._timer.daemon = True
        self._timer.start()

    def hear(self, payload: bytes | None, reason: str) -> None:
        with self._lock:
            if payload is not None:
                self._replies.append(payload)
            elif reason:
                self._reasons.append(reason)
            self._left -= 1
            if self._left:
                return
        self._end()

    def _end(self) -> None:
        with self._lock:
            answers, self._answers = self._answers, _nobody
        self._timer.cancel()
        answers(self._replies, self._reasons)


class LoopbackBroker:
    """What the transports of one process meet on."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._presence = threading.RLock()  # held while telling of it, so that nobody hears "gone" before "here"
        self._subscriptions: list[_Endpoint] = []
        self._queryables: list[_Endpoint] = []
        self._tokens: list[_Endpoint] = []
        self._watches: list[_Endpoint] = []
        self._links: list[Callable[[bool], None]] = []
        self._host_count = 0

    def listen(self) -> LoopbackTransport:
        """A transport for the host: while one is open, the others' links are up."""
        return LoopbackTransport(self, hosts=True)

    def connect(self, *, user: str = "") -> LoopbackTransport:
        """A transport for everybody else; nothing keeps a `user` to his role here but his own session."""
        return LoopbackTransport(self, user=user)

    def _add(self, endpoints: list[_Endpoint], endpoint: _Endpoint) -> Closer:
        with self._lock:
            endpoints.append(endpoint)

        def close() -> None:
            with self._lock:
                if endpoint in endpoints:
                    endpoints.remove(endpoint)

        return close

    def _matching(self, endpoints: list[_Endpoint], expression: str) -> list[_Endpoint]:
        with self._lock:
            return [endpoint for endpoint in endpoints if intersects(endpoint.expression, expression)]

    def _announce(self, key: str) -> Closer:
        token = _Endpoint(key, _nobody)
        with self._presence:
            close = self._add(self._tokens, token)
            self._tell(key, True)

        def withdraw() -> None:
            with self._presence:
                if token not in self._tokens:
                    return
                close()
                if not any(other.expression == key for other in self._tokens):
                    self._tell(key, False)

        return withdraw

    def _watch(self, expression: str, on_change: Callable[[str, bool], None]) -> Closer:
        with self._presence:
            for token in self._matching(self._tokens, expression):
                on_change(token.expression, True)
            return self._add(self._watches, _Endpoint(expression, on_change))

    def _tell(self, key: str, alive: bool) -> None:
        for watch in self._matching(self._watches, key):
            watch.callback(key, alive)

    def _watch_link(self, on_change: Callable[[bool], None]) -> Closer:
        with self._presence:
            self._links.append(on_change)
            on_change(self._host_count > 0)

        def close() -> None:
            with self._presence:
                if on_change in self._links:
                    self._links.remove(on_change)

        return close

    def _count_host(self, change: int) -> None:
        with self._presence:
            before, self._host_count = self._host_count > 0, self._host_count + change
            if before != (self._host_count > 0):
                for on_change in list(self._links):
                    on_change(not before)


class LoopbackTransport:
    """One node's end of a broker; implements `Transport`."""

    def __init__(self, broker: LoopbackBroker, *, hosts: bool = False, user: str = "") -> None:
        self.user = user
        self._broker = broker
        self._hosts = hosts
        self._closers: list[Closer] = []
        self._closed = False
        if hosts:
            broker._count_host(1)

    def publish(self, key: str, payload: bytes, delivery: Delivery) -> None:
        """Calls every subscriber, this side's included."""
        self._require_open()
        for subscription in self._broker._matching(self._broker._subscriptions, key):
            subscription.callback(key, payload)

    def publish_made(self, key: str, make: Callable[[], bytes], delivery: Delivery) -> None:
        """Calls every subscriber with what `make` returns now."""
        self.publish(key, make(), delivery)

    def has_listener(self, key: str) -> bool:
        """Whether anybody subscribes to a key now."""
        return bool(self._broker._matching(self._broker._subscriptions, key))

    def subscribe(self, key_expression: str, on_sample: Callable[[str, bytes], None]) -> Closer:
        """Calls `on_sample(key, payload)` on the publisher's thread."""
        self._require_open()
        return self._keep(self._broker._add(self._broker._subscriptions, _Endpoint(key_expression, on_sample)))

    def serve(self, key_expression: str, on_query: Callable[[IncomingQuery], None]) -> Closer:
        """Calls `on_query` on the asker's thread."""
        self._require_open()
        return self._keep(self._broker._add(self._broker._queryables, _Endpoint(key_expression, on_query)))

    def request(self, key_expression: str, payload: bytes, timeout: float, answer: Answer) -> None:
        """Asks all who serve the key; the first answer counts, with nobody there it fails at once."""
        self._require_open()
        request = _Request(answer)
        queryables = self._broker._matching(self._broker._queryables, key_expression)
        if not queryables:
            request.settle(None, "")
            return
        request.timer = threading.Timer(timeout, request.settle, (None, ""))
        request.timer.daemon = True
        request.timer.start()
        for queryable in queryables:
            queryable.callback(LoopbackQuery(key_expression, payload, request))

    def survey(self, key_expression: str, payload: bytes, timeout: float, answers: Answers) -> None:
        """Asks all who serve these keys; `answers` hears once, when all have spoken or after `timeout` seconds."""
        self._require_open()
        queryables = self._broker._matching(self._broker._queryables, key_expression)
        if not queryables:
            answers([], [])
            return
        survey = _Survey(len(queryables), timeout, answers)
        for queryable in queryables:
            queryable.callback(LoopbackQuery(key_expression, payload, _Request(survey.hear)))

    def identity(self) -> str:
        """There is only one end: the process."""
        return "loopback"

    def links(self) -> list[Link]:
        """None: nothing leaves the process."""
        return []

    def announce(self, key: str) -> Closer:
        """Shows others that this key's owner is alive, until closed."""
        self._require_open()
        return self._keep(self._broker._announce(key))

    def watch(self, key_expression: str, on_change: Callable[[str, bool], None]) -> Closer:
        """Calls `on_change(key, alive)` for those alive now and at every change."""
        self._require_open()
        return self._keep(self._broker._watch(key_expression, on_change))

    def watch_link(self, on_change: Callable[[bool], None]) -> Closer:
        """Calls `on_change(connected)` now and when the host goes or comes; for the host itself there is nothing to tell."""
        self._require_open()
        return _nobody if self._hosts else self._keep(self._broker._watch_link(on_change))

    endpoint = ""
    silence = 0.0
    round_trip = 0.0

    def suspect(self) -> None:
        """There is no way that could break."""

    def close(self) -> None:
        """Ends everything this transport holds. A second call does nothing."""
        if self._closed:
            return
        self._closed = True
        for closer in reversed(self._closers):
            closer()
        self._closers.clear()
        if self._hosts:
            self._broker._count_host(-1)

    def _keep(self, closer: Closer) -> Closer:
        self._closers.append(closer)
        return closer

    def _require_open(self) -> None:
        if self._closed:
            raise BusError("this transport is closed: open another one")


@functools.lru_cache(maxsize=4096)  # asked for each topic in each tick, and always of the same few
def intersects(left: str, right: str) -> bool:
    """Whether some key matches both expressions; each may hold `*` for one part and a final `**` for any rest."""
    left_parts, right_parts = left.split("/"), right.split("/")
    for index in range(max(len(left_parts), len(right_parts)) + 1):
        left_part = left_parts[index] if index < len(left_parts) else None
        right_part = right_parts[index] if index < len(right_parts) else None
        if left_part == "**" or right_part == "**" or (left_part is None and right_part is None):
            return True
        if left_part is None or right_part is None:
            return False
        if left_part != right_part and "*" not in (left_part, right_part):
            return False
    return True


def _nobody(*_: object) -> None:
    """Hears and does nothing."""

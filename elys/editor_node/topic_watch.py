"""What is said on the bus of a session, topic by topic, while somebody looks: how often, how late, and the last message.

Messages are counted as they come and decoded only when they are looked at. What is made only while somebody listens
(`topics.ON_DEMAND`) is listened to only when it is chosen.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import msgspec

from elys.bus import codec, topics
from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.views import ViewFrame
from elys.bus.session import Session
from elys.bus.topic_tools import RateReport, plain, rate_report
from elys.bus.topics import Topic
from elys.bus.transports.transport import Closer
from elys.common.errors import MessageError, ProtocolError

WINDOW: Final = 200  # messages that rates are of
KEYS_SHOWN: Final = 100  # of all topics together
BYTES_SHOWN: Final = 32


class TopicKey(NamedTuple):
    """A topic, or one key of it."""

    topic: str
    key: str


@dataclass(slots=True, eq=False)
class TopicFlow:
    """What came on one topic, for one key of it."""

    topic: Topic[Any]
    key: str = ""
    total: int = 0
    bytes_total: int = 0
    last: bytes = b""
    last_at: float = 0.0  # [s] since 1970
    arrivals: deque[tuple[float, int]] = field(default_factory=lambda: deque(maxlen=WINDOW))
    _decoded: tuple[int, Any, float | None, str] = (-1, None, None, "")

    @property
    def name(self) -> TopicKey:
        """What it is told apart by."""
        return TopicKey(self.topic.name, self.key)

    def take(self, payload: bytes) -> None:
        """Counts a message and keeps it as the last one."""
        self.total += 1
        self.bytes_total += len(payload)
        self.last, self.last_at = payload, time.time()
        self.arrivals.append((time.monotonic(), len(payload)))

    def rate(self) -> RateReport:
        """Over the last messages."""
        return rate_report(list(self.arrivals), self.total)

    def message(self) -> Any:
        """The last message as plain values; None before the first and of one that cannot be read, see `error`."""
        return self._decode()[1]

    @property
    def error(self) -> str:
        """Why the last message cannot be read."""
        return self._decode()[3]

    @property
    def latency(self) -> float | None:
        """[s] from when the last message, or the state that it shows, was published until it came; None where it does not say."""
        return self._decode()[2]

    def _decode(self) -> tuple[int, Any, float | None, str]:
        if self._decoded[0] != self.total:
            self._decoded = (self.total, *self._read()) if self.total else (0, None, None, "")
        return self._decoded

    def _read(self) -> tuple[Any, float | None, str]:
        try:
            message = codec.decode(self.last, self.topic.message, self.topic.encoding)
        except (MessageError, ProtocolError) as error:
            return None, None, str(error)
        published = {StateFrame: "published_at", ViewFrame: "state_published_at"}.get(type(message))
        stamp = getattr(message, published) if published else 0
        latency = self.last_at - stamp * 1e-9 if stamp else None
        return _readable(message), latency, ""


class TopicWatch:
    """Listens between `start` and what that returns; counts start anew each time."""

    def __init__(self, session: Session, *, on_message: Callable[[], None] = lambda: None) -> None:
        self._session = session
        self._on_message = on_message
        self._flows: dict[TopicKey, TopicFlow] = {}
        self._closers: dict[str, Closer] = {}
        self._chosen = ""
        self.is_running = False

    def start(self) -> Closer:
        """Listens to every topic but those on demand."""
        self.is_running = True
        self._flows = {TopicKey(topic.name, ""): TopicFlow(topic) for topic in topics.TOPICS}
        for topic in topics.TOPICS:
            if topic not in topics.ON_DEMAND or topic.name == self._chosen:
                self._listen(topic)
        return self._stop

    def choose(self, topic: str) -> None:
        """Listens to this topic as well if it is one on demand, and to the one chosen before no longer."""
        if topic == self._chosen:
            return
        before, self._chosen = self._chosen, topic
        for listened in topics.ON_DEMAND:
            if listened.name == before and before in self._closers:
                self._closers.pop(before)()
            if listened.name == topic and self.is_running:
                self._listen(listened)

    def flows(self) -> list[TopicFlow]:
        """Topic by topic as `elys topic list` has them, the keys of each below it."""
        order = {topic.name: place for place, topic in enumerate(topics.TOPICS)}
        found = [flow for flow in self._flows.values() if flow.key or not self._has_keys(flow)]
        return sorted(found, key=lambda flow: (order[flow.topic.name], flow.key))

    def flow(self, name: TopicKey) -> TopicFlow | None:
        """That of one name."""
        return self._flows.get(name)

    def is_heard(self, topic: str) -> bool:
        """Whether it is listened to."""
        return topic in self._closers

    def _has_keys(self, flow: TopicFlow) -> bool:
        return any(other.key for other in self._flows.values() if other.topic is flow.topic)

    def _listen(self, topic: Topic[Any]) -> None:
        def heard(full_key: str, payload: bytes) -> None:
            found = topics.topic_of(full_key)
            name = TopicKey(topic.name, found[1] if found is not None else "")
            flow = self._flows.get(name)
            if flow is None:
                if len(self._flows) >= KEYS_SHOWN:
                    name = TopicKey(topic.name, "")
                flow = self._flows.setdefault(name, TopicFlow(topic, name.key))
            flow.take(payload)
            self._on_message()

        self._closers[topic.name] = self._session.subscribe_payloads(topic, heard, every=True)

    def _stop(self) -> None:
        self.is_running = False
        for close in self._closers.values():
            close()
        self._closers.clear()


def _readable(message: Any) -> Any:
    """Plain values in which bytes are told by their number and their first."""
    if isinstance(message, StateFrame):
        return plain(message)
    return _without_bytes(msgspec.to_builtins(message, builtin_types=(bytes,)))


def _without_bytes(value: Any) -> Any:
    match value:
        case bytes():
            return f"{len(value)} bytes: {value[:BYTES_SHOWN].hex(' ')}{'...' if len(value) > BYTES_SHOWN else ''}"
        case dict():
            return {name: _without_bytes(child) for name, child in value.items()}
        case list() | tuple():
            return [_without_bytes(child) for child in value] if _holds_bytes(value) else value
    return value


def _holds_bytes(values: Iterable[Any]) -> bool:
    return any(isinstance(value, (bytes, dict, list, tuple)) for value in values)

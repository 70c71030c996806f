"""Looking at what is said on the bus: what `elys topic list | echo | hz` print."""

from __future__ import annotations

import asyncio
import math
import time
from collections import deque
from collections.abc import AsyncIterator
from itertools import pairwise
from typing import Any

import msgspec

from elys.bus import codec, topics
from elys.bus.access.roles import Role
from elys.bus.messages.state_frame import StateFrame
from elys.bus.session import Session
from elys.bus.topics import Topic
from elys.common.errors import MessageError, ProtocolError

_SHOWN_BODIES = 3


class TopicRow(msgspec.Struct, frozen=True, kw_only=True):
    """A line of `elys topic list`."""

    name: str
    kind: str  # topic or query
    message: str
    delivery: str
    encoding: str
    recorded: bool
    text: str
    roles: str  # who may say it and hear it, or ask and answer


def _roles(sender: Role, receiver: Role, sends: str, receives: str) -> str:
    return f"{sender.title} {sends}, {receiver.title} {receives}"


class RateReport(msgspec.Struct, frozen=True, kw_only=True):
    """A line of `elys topic hz`, over the last messages."""

    count: int
    rate: float  # [Hz]; 0 while nothing comes
    shortest: float  # [s] between two messages
    longest: float  # [s]
    deviation: float  # [s]
    bandwidth: float  # [bytes/s]


def list_topics() -> list[TopicRow]:
    """Every topic and query there is."""
    rows = [
        TopicRow(
            name=topic.name,
            kind="topic",
            message=topic.message.__name__,
            delivery=topic.delivery.value,
            encoding=topic.encoding.value,
            recorded=topic.recorded,
            text=topic.text,
            roles=_roles(topic.publisher, topic.reader, "says", "hears"),
        )
        for topic in topics.TOPICS
    ]
    return rows + [
        TopicRow(
            name=query.name,
            kind="query",
            message=f"{query.request.__name__} -> {query.reply.__name__}",
            delivery="reliable",
            encoding=query.reply_encoding.value,
            recorded=False,
            text=query.text,
            roles=_roles(query.asker, query.answerer, "asks", "answers"),
        )
        for query in topics.QUERIES
    ]


async def echo(session: Session, name: str) -> AsyncIterator[Any]:
    """Every message of a topic as plain values, as they come; one that is malformed as {"error": why}.

    Raises:
        BusError: there is no such topic.
    """
    topic = topics.topic_named(name)
    async for _, payload in _payloads(session, topic):
        try:
            yield plain(codec.decode(payload, topic.message, topic.encoding))
        except (MessageError, ProtocolError) as error:
            yield {"error": str(error)}


async def hz(session: Session, name: str, *, window: int = 200, interval: float = 1.0) -> AsyncIterator[RateReport]:
    """A report every `interval` seconds of how often the topic's last `window` messages came.

    Raises:
        BusError: there is no such topic.
    """
    topic = topics.topic_named(name)
    arrivals: deque[tuple[float, int]] = deque(maxlen=window)
    total = 0

    def heard(_: str, payload: bytes) -> None:
        nonlocal total
        total += 1
        arrivals.append((time.monotonic(), len(payload)))

    close = session.subscribe_payloads(topic, heard, every=True)
    try:
        while True:
            await asyncio.sleep(interval)
            yield rate_report(list(arrivals), total)
    finally:
        close()


def plain(message: Any) -> Any:
    """A message as values that can be printed; of a state frame the header and the first bodies."""
    if not isinstance(message, StateFrame):
        return msgspec.to_builtins(message)
    columns = ("entity", "position", "rotation", "linear_velocity", "angular_velocity")
    shown = {name: getattr(message, name)[:_SHOWN_BODIES].tolist() for name in columns}
    return {
        "epoch": message.epoch,
        "tick": message.tick,
        "simulation_time": message.simulation_time,
        "published_at": message.published_at,
        "delta_sequence": message.delta_sequence,
        "state_hash": f"{message.state_hash:016x}",
        "playing": message.playing,
        "body_count": message.body_count,
        "first_bodies": shown,
    }


def rate_report(arrivals: list[tuple[float, int]], total: int) -> RateReport:
    """How often messages came: the newest `arrivals`, by the monotonic clock [s] with their sizes [bytes], of `total`."""
    gaps = [later[0] - earlier[0] for earlier, later in pairwise(arrivals)]
    # Silence is a gap too: a stream that has stopped must not show its old rate for ever.
    span = time.monotonic() - arrivals[0][0] if arrivals else 0.0
    if not gaps or span <= 0.0 or time.monotonic() - arrivals[-1][0] > 10 * max(gaps) + 1.0:
        return RateReport(count=total, rate=0.0, shortest=0.0, longest=0.0, deviation=0.0, bandwidth=0.0)
    mean = sum(gaps) / len(gaps)
    return RateReport(
        count=total,
        rate=1.0 / mean if mean > 0.0 else 0.0,
        shortest=min(gaps),
        longest=max(gaps),
        deviation=math.sqrt(sum((gap - mean) ** 2 for gap in gaps) / len(gaps)),
        bandwidth=sum(size for _, size in arrivals) / span,
    )


async def _payloads(session: Session, topic: Topic[Any]) -> AsyncIterator[tuple[str, bytes]]:
    waiting: asyncio.Queue[tuple[str, bytes]] = asyncio.Queue()
    close = session.subscribe_payloads(topic, lambda key, payload: waiting.put_nowait((key, payload)), every=True)
    try:
        while True:
            yield await waiting.get()
    finally:
        close()

"""How all nodes of a session do, as one of them sees it by asking each in turn: what `elys top --network` shows.

Between two rounds counts become rates. Clocks differ between machines: of each node that answers, its clock is read in the
middle of the round trip, so ages are told as if all clocks were the host's; that is true to half of the round trips.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import msgspec

from elys.bus import topics
from elys.bus.messages.vitals import HostFacts, Stream, Vitals, VitalsRequest
from elys.bus.session import HOST_KINDS, Node, Session
from elys.common.errors import BusError

PATIENCE: Final = 1.0  # [s] that a node has to answer
_AT_ONCE: Final = 64  # nodes that are asked at the same time


class NodeRow(msgspec.Struct, frozen=True, kw_only=True):
    """One node. Rates are over the time since the round before, 0 in the first; below 0: not known."""

    node: str
    kind: str
    machine: str = ""
    process: int = 0
    address: str = ""  # from which its neighbour above sees it come
    answers: bool = False
    round_trip: float = -1.0  # [ms] of asking it
    heard_rate: float = 0.0  # [messages/s]
    heard_size: float = 0.0  # [bytes/s]
    sent_rate: float = 0.0
    sent_size: float = 0.0
    state_rate: float = -1.0  # [Hz] of the states that come
    missed: int = 0  # states that did not come
    skipped: int = 0  # messages that came faster than they were taken
    age_p50: float = -1.0  # [ms] of the states when they come
    age_p99: float = -1.0
    links: int = 0  # connections to others


class TopicUse(msgspec.Struct, frozen=True, kw_only=True):
    """One topic, by all who say or hear it."""

    publishers: tuple[str, ...]
    listeners: tuple[str, ...]
    rate: float  # [messages/s] of the fastest publisher; of what nobody answers for, as it is heard
    size: float  # [bytes] of a message
    age_p50: float  # [ms]; below 0: nothing tells
    age_p99: float


class NetworkReport(msgspec.Struct, frozen=True, kw_only=True):
    """All nodes of a session at one time."""

    session: str
    host: HostFacts | None
    nodes: tuple[NodeRow, ...]


@dataclass(frozen=True, slots=True)
class _Answer:
    vitals: Vitals
    round_trip: float  # [s]
    offset: float  # [s] by which its clock is ahead of ours


class NetworkWatch:
    """Asks all nodes, round by round."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._now: dict[str, _Answer] = {}
        self._before: dict[str, _Answer] = {}

    async def ask(self) -> None:
        """One round: all who are there are asked; who does not answer within a second is shown as silent."""
        turns = asyncio.Semaphore(_AT_ONCE)
        nodes = [node for node in self._session.nodes.values() if node.id != self._session.node.id]
        answers = await asyncio.gather(*(self._ask(node, turns) for node in nodes))
        self._before, self._now = self._now, {a.vitals.node: a for a in answers if a is not None}

    def report(self) -> NetworkReport:
        """What the last round found, hosts and routers first."""
        host = self._host()
        addresses = {
            neighbour.identity: neighbour.address
            for answer in self._now.values()
            for neighbour in answer.vitals.neighbours
            if answer.vitals.kind in (*HOST_KINDS, "router")
        }
        rows = [self._row(node, addresses) for node in self._session.nodes.values() if node.id != self._session.node.id]
        return NetworkReport(
            session=self._session.name,
            host=host.vitals.host if host is not None else None,
            nodes=tuple(sorted(rows, key=lambda row: (_order(row.kind), row.node))),
        )

    def topic_use(self, topic: str) -> TopicUse:
        """Who says and hears a topic, and how much of it."""
        senders = {node: stream for node, stream in self._streams(topic, "sent").items() if stream[0].messages}
        listeners = self._streams(topic, "heard")
        rates = [rate for _, rate in senders.values()] or [rate for _, rate in listeners.values()]
        told = [stream for stream, _ in (*senders.values(), *listeners.values()) if stream.messages]
        ages = [(node, stream) for node, (stream, _) in listeners.items() if stream.age_p50 >= 0.0]
        return TopicUse(
            publishers=tuple(senders),
            listeners=tuple(listeners),
            rate=max(rates, default=0.0),
            size=told[0].size / told[0].messages if told else 0.0,
            age_p50=max((s.age_p50 + self._correction(node) for node, s in ages), default=-1.0),
            age_p99=max((s.age_p99 + self._correction(node) for node, s in ages), default=-1.0),
        )

    async def _ask(self, node: Node, turns: asyncio.Semaphore) -> _Answer | None:
        async with turns:
            began, wall = time.perf_counter(), time.time()
            try:
                vitals = await self._session.request(topics.VITALS, VitalsRequest(), key=node.id, timeout=PATIENCE)
            except BusError:
                return None
            took = time.perf_counter() - began
            return _Answer(vitals, took, vitals.clock / 1e9 - (wall + took / 2))

    def _host(self) -> _Answer | None:
        return next((answer for answer in self._now.values() if answer.vitals.kind in HOST_KINDS), None)

    def _correction(self, node: str) -> float:
        """What makes an age [ms] by a node's clock and the host's one by the host's alone."""
        host = self._host()
        return 1e3 * (host.offset - self._now[node].offset) if host is not None else 0.0

    def _row(self, node: Node, addresses: Mapping[str, str]) -> NodeRow:
        answer = self._now.get(node.id)
        if answer is None:
            return NodeRow(node=node.id, kind=node.kind)
        vitals = answer.vitals
        state = vitals.heard.get(topics.STATE.name)
        heard_rate, heard_size = self._rates(node.id, "heard")
        sent_rate, sent_size = self._rates(node.id, "sent")
        known = state is not None and state.age_p50 >= 0.0
        return NodeRow(
            node=node.id,
            kind=node.kind,
            machine=vitals.machine,
            process=vitals.process,
            address=addresses.get(vitals.identity, ""),
            answers=True,
            round_trip=1e3 * answer.round_trip,
            heard_rate=heard_rate,
            heard_size=heard_size,
            sent_rate=sent_rate,
            sent_size=sent_size,
            state_rate=self._rates(node.id, "heard", topics.STATE.name)[0] if state is not None else -1.0,
            missed=sum(stream.missed for stream in vitals.heard.values()),
            skipped=sum(stream.skipped for stream in vitals.heard.values()),
            age_p50=state.age_p50 + self._correction(node.id) if state is not None and known else -1.0,
            age_p99=state.age_p99 + self._correction(node.id) if state is not None and known else -1.0,
            links=len(vitals.neighbours),
        )

    def _streams(self, topic: str, side: str) -> dict[str, tuple[Stream, float]]:
        """By node, what it counts of a topic and the messages a second."""
        found = {}
        for node, answer in self._now.items():
            stream = _side(answer.vitals, side).get(topic)
            if stream is not None:
                found[node] = (stream, self._rates(node, side, topic)[0])
        return found

    def _rates(self, node: str, side: str, topic: str = "") -> tuple[float, float]:
        """Messages and bytes a second, of one topic or of all, since the round before."""
        before, now = self._before.get(node), self._now[node]
        if before is None or (seconds := now.vitals.measured_at - before.vitals.measured_at) <= 0.0:
            return 0.0, 0.0
        messages = size = 0
        for name, stream in _side(now.vitals, side).items():
            earlier = _side(before.vitals, side).get(name)
            if topic in ("", name) and (earlier is None or earlier.messages <= stream.messages):  # else counted anew
                messages += stream.messages - (earlier.messages if earlier is not None else 0)
                size += stream.size - (earlier.size if earlier is not None else 0)
        return messages / seconds, size / seconds


def _side(vitals: Vitals, side: str) -> dict[str, Stream]:
    return vitals.sent if side == "sent" else vitals.heard


def _order(kind: str) -> int:
    return 0 if kind in HOST_KINDS else 1 if kind == "router" else 2

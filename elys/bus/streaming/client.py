"""The viewer's end of a stream: a session's source of states where the way to the host does not carry all of them.

    ask the host ──▶ a few connections of its own ──▶ frames ──▶ Receiver ──▶ whole state frames ──▶ who subscribed to `state`
                                                        acks, what matters ◀──┘

It begins with the first subscriber and ends with the last. A host that has no streams to give sends full frames instead.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from elys.bus import codec, topics
from elys.bus.messages.state_frame import HEADER
from elys.bus.messages.streaming import StreamInterest, StreamReport, StreamRequest
from elys.bus.streaming.connections import Connect, Connections
from elys.bus.streaming.measures import Measures
from elys.bus.streaming.receiver import Arrival, Receiver
from elys.bus.streaming.wire import pack_ack
from elys.bus.topics import Encoding
from elys.bus.transports.transport import Closer
from elys.common.errors import ConnectionLost, MessageError, ProtocolError, RequestError

if TYPE_CHECKING:
    from elys.bus.session import Session

BEAT: Final = 0.05  # [s] between two looks
SAY_EVERY: Final = 0.25  # [s] that it is silent at most, so that the sender knows that it is there
SAY_SILENT: Final = 0.1  # [s] the same while nothing comes: the way there may be open again
TELL_EVERY: Final = 0.1  # [s] between two tellings of what matters
TELL_AGAIN: Final = 2.0  # [s] likewise, where nothing has changed: the sender may be a new one
REPORT_EVERY: Final = 1.0  # [s]
SILENCE: Final = (
    0.5  # [s], or three round trips, without a frame: a moving scene sends sixty a second, a still one five
)
ASK_EVERY: Final = 2.0  # [s] of silence after which the host is asked again
_log = logging.getLogger(__name__)
Put = Callable[[str, bytes], None]


class StreamClient:
    """States of a session by a stream. `connect` opens one more connection to the host."""

    def __init__(self, session: Session, connect: Connect, *, clock: Callable[[], float] = time.monotonic) -> None:
        # The router lets nobody acknowledge in another user's name, which stands at the end of the node's id.
        self.name = f"{secrets.token_hex(4)}-{session.node.id}"
        self.is_full = False  # the host has no streams: full frames come
        self.receiver = Receiver()
        self.measures = Measures()
        self._session = session
        self._connect = connect
        self._clock = clock
        self._puts: list[Put] = []
        self._last: bytes | None = None  # for who subscribes while nothing moves
        self._interest = StreamInterest()
        self._told: StreamInterest | None = None
        self._told_at = self._said_at = self._reported_at = self._asked_at = -10.0
        self._connections: Connections | None = None
        self._work: asyncio.Task[None] | None = None
        self._stop_full: Closer | None = None
        session.on_link(self._link_changed)

    # --- what a session asks of it -------------------------------------------------------------------------------------

    def subscribe(self, put: Put) -> Closer:
        """Calls `put(full key, payload)` with each state, and with the newest there is already."""
        self._puts.append(put)
        if self._last is not None:
            put(self._key, self._last)
        if self._work is None:
            self._work = self._session.start(self._run())

        def close() -> None:
            with contextlib.suppress(ValueError):  # closed with the session already
                self._puts.remove(put)
            if not self._puts and self._work is not None:
                self._work.cancel()
                self._work = None

        return close

    def look(self, interest: StreamInterest) -> None:
        """What matters from now on."""
        self._interest = interest

    def report(self) -> StreamReport | None:
        """How it does; None where full frames come, or nothing yet."""
        head, claim, now = self.measures.head, self.measures.claim, self._clock()
        if head is None or claim is None or self.is_full:
            return None
        rate, frames = self.measures.rate(now)
        return StreamReport(
            node=self._session.node.id,
            stream=self.name,
            tick=self.measures.tick,
            age=self.measures.age(now),
            age_p95=self.measures.age_p95,
            round_trip=head.round_trip,
            rate=rate,
            allowed=head.rate,
            frames=frames,
            loss=self.measures.loss,
            position_error=claim.position,
            rotation_error=claim.rotation,
            known=self.receiver.known_count,
            bodies=self.receiver.body_count,
            waiting=head.waiting,
            step=head.step,
            lanes=self._connections.count if self._connections is not None else 0,
            restarts=self.receiver.restarts,
        )

    async def close(self) -> None:
        """Ends it."""
        self._puts.clear()
        work, self._work = self._work, None
        if work is not None:
            work.cancel()
            await asyncio.gather(work, return_exceptions=True)
        self._end_full()

    # --- inside ----------------------------------------------------------------------------------------------------

    @property
    def _key(self) -> str:
        return topics.key_of(self._session.name, topics.STATE)

    async def _run(self) -> None:
        session = self._session
        self._connections = Connections(
            self._connect,
            lambda lane: topics.key_of(session.name, topics.STREAM_FRAME, f"{self.name}.{lane}"),
            heard=self._heard,
            opened=lambda: self._say(self._clock()),
            clock=self._clock,
        )
        try:
            while True:
                if self._must_ask():
                    await self._ask()
                self._beat()
                await asyncio.sleep(BEAT)
        finally:
            connections, self._connections = self._connections, None
            self._end_full()
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.shield(connections.close())

    def _must_ask(self) -> bool:
        assert self._connections is not None
        now = self._clock()
        is_silent = now - max(self._connections.heard_at, self._asked_at) > ASK_EVERY or self._asked_at < 0.0
        return self._session.connected and not self.is_full and is_silent

    async def _ask(self) -> None:
        """Has the host start somebody who sends; where it cannot, full frames are taken."""
        self._asked_at = self._clock()
        request = StreamRequest(node=self._session.node.id, stream=self.name)
        try:
            await self._session.request(topics.STREAM_ASK, request, timeout=2.0)
        except RequestError as error:
            self._take_full(str(error))
        except ConnectionLost:
            _log.debug("the host does not answer whether it has a stream: asking again")

    def _take_full(self, why: str) -> None:
        _log.warning("states come in full, whatever the link carries: %s", why)
        self.is_full = True

        def pass_on(key: str, payload: bytes) -> None:
            for put in tuple(self._puts):
                put(key, payload)

        self._stop_full = self._session.transport.subscribe(self._key, pass_on)

    def _end_full(self) -> None:
        if self._stop_full is not None:
            self._stop_full()
        self._stop_full, self.is_full = None, False

    def _link_changed(self, connected: bool) -> None:
        if connected:  # perhaps another host, which may know more or less than the one before
            self._end_full()
            self._asked_at = -10.0

    def _beat(self) -> None:
        """Everything that is due."""
        now, connections = self._clock(), self._connections
        assert connections is not None
        if self.is_full:
            return
        trip = self.receiver.head.round_trip if self.receiver.head is not None else 0.0
        connections.tend(max(SILENCE, 3.0 * trip), trip)
        if now - self._said_at > (SAY_EVERY if now - connections.heard_at < SILENCE else SAY_SILENT):
            self._say(now)
        is_news = self._interest != self._told
        if now - self._told_at > (TELL_EVERY if is_news else TELL_AGAIN):
            self._told, self._told_at = self._interest, now
            self._send(topics.STREAM_INTEREST, codec.encode(self._interest, Encoding.MSGPACK))
        receiver = self.receiver
        self.measures.counted(now, receiver.came + receiver.missed - receiver.late, receiver.missed)
        self.measures.look(now)
        if now - self._reported_at > REPORT_EVERY and (report := self.report()) is not None:
            self._reported_at = now
            self._session.publish(topics.STREAM_REPORT, report, key=self.name)

    def _heard(self, payload: bytes) -> None:
        now = self._clock()
        try:
            codec.check_prefix(payload, Encoding.RAW)
            arrival = self.receiver.take(payload, offset=codec.PREFIX.size)
        except (MessageError, ProtocolError) as error:
            self._session.refused[topics.STREAM_FRAME.name] = self._session.refused.get(topics.STREAM_FRAME.name, 0) + 1
            _log.debug("refused a streamed frame: %s", error)
            return
        self.measures.arrived(now, len(payload))
        if arrival.is_new or now - self._said_at > BEAT:
            self._say(now)
        if arrival.state is not None:
            self._show(arrival, arrival.state, now)

    def _show(self, arrival: Arrival, state: bytes, now: float) -> None:
        _, tick, _, published_at, *_ = HEADER.unpack_from(state)
        self.measures.shown(now, arrival.head, published_at * 1e-9, tick, arrival.claim)
        self._last = codec.with_prefix(state, Encoding.STATE)
        for put in tuple(self._puts):
            put(self._key, self._last)

    def _say(self, now: float) -> None:
        if self._connections is None:
            return
        self._said_at = now
        ack = self.receiver.ack(self._connections.bits)
        self._send(topics.STREAM_ACK, codec.with_prefix(pack_ack(ack), Encoding.RAW))

    def _send(self, topic: topics.Topic[Any], payload: bytes) -> None:
        if self._connections is not None:
            self._connections.send(topics.key_of(self._session.name, topic, self.name), payload)

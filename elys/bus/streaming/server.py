"""The streaming process's work: takes the full states of a session on its own machine, and sends each viewer its part.

    STATE ──▶ truth ──▶ a Sender a viewer ──▶ STREAM_FRAME/{stream}.{lane}
    STREAM_ACK/{stream}, STREAM_INTEREST/{stream} ──▶ that viewer's Sender, and nobody else's

A stream begins with its viewer's first ack and is forgotten when there were none for a while, so nothing has to be agreed upon
anew when this process is: whoever acknowledges is served.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from elys.bus import codec, topics
from elys.bus.messages.streaming import StreamInterest
from elys.bus.session import Session
from elys.bus.streaming.sender import Sender
from elys.bus.streaming.truth import Truth, TruthReader
from elys.bus.streaming.wire import unpack_ack
from elys.bus.topics import Encoding
from elys.bus.transports.transport import Closer
from elys.common.errors import MessageError, ProtocolError

MOST_STREAMS: Final = 256
SILENCE: Final = 10.0  # [s] without an ack after which a viewer is forgotten
BEAT: Final = 1.0 / 60.0  # [s] between two looks at what can be sent while no state comes
FEW_ACKS: Final = 400.0  # [1/s] that one viewer is heard with; what is more is left unread
_log = logging.getLogger(__name__)


@dataclass(slots=True)
class _Viewer:
    sender: Sender
    heard_at: float
    allowance: float = FEW_ACKS  # acks


class StreamServer:
    """Serves the streams of a session; `run` until cancelled, or until nobody was there for `patience` seconds."""

    def __init__(self, session: Session, *, clock: Callable[[], float] = time.monotonic) -> None:
        self.viewers: dict[str, _Viewer] = {}
        self.refused = 0  # messages that cannot be
        self._session = session
        self._clock = clock
        self._reader = TruthReader()
        self._truth: Truth | None = None
        self._truth_at = 0.0
        self._generation = time.time_ns() // 1000
        self._stop_states: Closer | None = None
        self._had_viewers_at = clock()
        session.subscribe_payloads(topics.STREAM_ACK, self._heard_ack)
        session.subscribe_payloads(topics.STREAM_INTEREST, self._heard_interest)

    async def run(self, *, patience: float = float("inf")) -> None:
        """Sends what can be sent, also between two states and while time stands still."""
        while self._clock() - self._had_viewers_at < patience:
            now = self._clock()
            self._forget_silent(now)
            if self.viewers:
                self._had_viewers_at = now
                if self._truth is not None and now - self._truth_at > BEAT:
                    self._offer(now)
            await asyncio.sleep(BEAT if self.viewers else 10.0 * BEAT)

    @property
    def size(self) -> int:
        """Bytes kept for all viewers, about."""
        return sum(viewer.sender.size for viewer in self.viewers.values())

    # --- what is heard ---------------------------------------------------------------------------------------------

    def _heard_state(self, _: str, payload: bytes) -> None:
        try:
            codec.check_prefix(payload, Encoding.STATE)
            self._truth = self._reader.read(payload, offset=codec.PREFIX.size)
        except (MessageError, ProtocolError) as error:
            self._refuse(f"a state cannot be sent on: {error}")
            return
        self._truth_at = self._clock()
        self._offer(self._truth_at)

    def _heard_ack(self, key: str, payload: bytes) -> None:
        now, name = self._clock(), key.rsplit("/", 1)[-1]
        try:
            codec.check_prefix(payload, Encoding.RAW)
            ack = unpack_ack(payload, codec.PREFIX.size)
        except (MessageError, ProtocolError) as error:
            self._refuse(f"an acknowledgement of stream {name} is none: {error}")
            return
        viewer = self.viewers.get(name) or self._begin(name, now)
        if viewer is None:
            return
        viewer.allowance = min(viewer.allowance + FEW_ACKS * (now - viewer.heard_at), FEW_ACKS)
        viewer.heard_at = now
        if viewer.allowance >= 1.0:
            viewer.allowance -= 1.0
            viewer.sender.acked(ack, now)

    def _heard_interest(self, key: str, payload: bytes) -> None:
        viewer = self.viewers.get(key.rsplit("/", 1)[-1])
        if viewer is None:
            return
        try:
            viewer.sender.interest = codec.decode(payload, StreamInterest, Encoding.MSGPACK)
        except (MessageError, ProtocolError) as error:
            self._refuse(f"what a viewer is interested in cannot be read: {error}")

    def _refuse(self, why: str) -> None:
        self.refused += 1
        if self.refused.bit_count() == 1:  # the 1st, 2nd, 4th, 8th, ...: a flood must not fill the log
            _log.warning("%s (%d such messages so far)", why, self.refused)

    # --- viewers -----------------------------------------------------------------------------------------------------

    def _begin(self, name: str, now: float) -> _Viewer | None:
        if len(self.viewers) >= MOST_STREAMS:
            self._refuse(f"{MOST_STREAMS} viewers are served already: stream {name} has to wait")
            return None
        self._generation += 1_000_000
        viewer = self.viewers[name] = _Viewer(Sender(now, generation=self._generation), now)
        if self._stop_states is None:
            self._stop_states = self._session.subscribe_payloads(topics.STATE, self._heard_state)
        _log.info("stream %s begins", name)
        return viewer

    def _forget_silent(self, now: float) -> None:
        for name in [name for name, viewer in self.viewers.items() if now - viewer.heard_at > SILENCE]:
            del self.viewers[name]
            _log.info("stream %s is over", name)
        if not self.viewers and self._stop_states is not None:
            self._stop_states()
            self._stop_states, self._truth = None, None

    def _offer(self, now: float) -> None:
        assert self._truth is not None
        hold = max((time.time_ns() - self._truth.published_at) * 1e-9, 0.0)
        for name, viewer in self.viewers.items():
            sent = viewer.sender.frame(self._truth, now, hold=min(hold, 3600.0))
            if sent is not None:
                payload = codec.with_prefix(sent.body, Encoding.RAW)
                self._session.publish_payload(topics.STREAM_FRAME, payload, key=f"{name}.{sent.lane}")

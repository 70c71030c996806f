"""The host's side of recording: everything that a session publishes, written to a pipe beside the simulation.

The tick only appends to a queue; a thread of its own writes. A run at full speed waits (`ready`) while the queue is long, so
that nothing is lost. A run in real time never waits: it leaves out whole state frames, counts them and says so. When the
recorder dies, the simulation goes on as if there had been none.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from elys.bus import codec, topics
from elys.bus.exact_keeping import ExactNeed, ExactSource, ExactState
from elys.bus.messages.exact_state import ExactHead
from elys.bus.messages.scene import Snapshot
from elys.bus.recording_pipe import FrameKind, frame_head
from elys.bus.session import Session
from elys.bus.topics import Delivery, Encoding, Topic
from elys.common.assets.store import AssetStore, references_in
from elys.common.errors import AssetError

QUEUE_SIZE: Final = 64 << 20  # [bytes]
_MOST_PIECES: Final = 1024  # that the system writes at once
_RESYNC: Final = b'"resync":true'
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class _Later:
    """An exact state of which the writing thread makes bytes."""

    state: ExactState
    time: int  # [ns]
    size: int  # about how many it takes [bytes]

    def __len__(self) -> int:
        return self.size

    def pieces(self) -> list[bytes | memoryview]:
        parts = self.state.parts()
        return [frame_head(FrameKind.MESSAGE, topics.EXACT.name, sum(map(len, parts)), self.time), *parts]


class RecordingTap:
    """Sends what `session` publishes to the recorder at the other end of `descriptor`, which it then owns.

    `take_snapshot` gives the scene as it is now; it is called at once, and after every delta that asks for a resync. Assets
    that scene and deltas name are taken from `assets`. `exact` gives exact states, so that the recording can be run again.
    """

    def __init__(
        self,
        session: Session,
        descriptor: int,
        *,
        take_snapshot: Callable[[], Snapshot],
        assets: AssetStore,
        lossless: bool,
        exact: ExactSource | None = None,
        queue_size: int = QUEUE_SIZE,
    ) -> None:
        self.lost = 0  # messages left out
        self.alive = True  # whether the recorder still takes what it is sent
        self._session = session
        self._descriptor = descriptor
        self._take_snapshot = take_snapshot
        self._assets = assets
        self._lossless = lossless
        self._limit = queue_size
        self._sent_assets: set[str] = set()
        self._exact = exact
        self._need = ExactNeed()
        self._queue: deque[bytes | memoryview | _Later] = deque()
        self._queued = 0  # [bytes]
        self._ending = False
        self._has_gap = False  # a delta was left out: the scene has to be told anew
        self._changed = threading.Condition()
        self._loop = asyncio.get_running_loop()
        self._room = asyncio.Event()
        self._loss_said = -10.0
        self._thread = threading.Thread(target=self._write, name="elys-recording", daemon=True)
        self._thread.start()
        scene = take_snapshot()
        self._send(FrameKind.BEGIN, session.name, scene.scene.encode())
        self._send_snapshot(scene)
        if exact is not None:
            for name, values in exact.facts().items():
                self._send(FrameKind.FACTS, name, codec.encode_body(values, Encoding.JSON))
            exact.listeners.append(self)
            if (now := exact.exact_now()) is not None:
                self.take(now)
        session.taps.append(self.publication)

    def publication(self, topic: Topic[Any], _: str, payload: bytes) -> None:
        """Takes what the session has just published."""
        if not topic.recorded or not self.alive:
            return
        # A frame of many bodies is not worth a copy in the tick.
        body = memoryview(payload)[codec.PREFIX.size :] if topic is topics.STATE else payload[codec.PREFIX.size :]
        if topic is topics.DELTA or topic is topics.EVENTS:  # events name sounds
            assert isinstance(body, bytes)
            self._send_assets(body)
        if not self._lossless and self._is_too_long(topic.delivery):
            self._leave_out(topic)
            return
        self._send(FrameKind.MESSAGE, topic.name, body)
        if (topic is topics.DELTA and _RESYNC in payload) or self._has_gap:
            self._has_gap = False
            self._send_snapshot(self._take_snapshot())

    def wants(self, head: ExactHead, size: int) -> bool:
        """Whether an exact state would be taken, see `ExactNeed`."""
        return self.alive and self._need.is_due(head, size)

    def take(self, state: ExactState) -> None:
        """Takes an exact state, unless the recorder is too far behind: then another is asked for."""
        if not self._lossless and self._is_too_long(Delivery.LATEST):
            self._need.is_urgent = True
            return
        self._need.taken(state.head)
        self._put(_Later(state, time.time_ns(), state.size))

    async def ready(self) -> None:
        """Returns when there is room for another tick; in real time, or with the recorder gone, at once."""
        while self._lossless and self.alive and self._queued > self._limit:
            self._room.clear()
            with self._changed:
                if self._queued <= self._limit:
                    return
            await self._room.wait()

    def close(self, timeout: float = 30.0) -> None:
        """Sends what is queued and ends the stream, waiting at most `timeout` seconds. A second call does nothing."""
        if self.publication in self._session.taps:
            self._session.taps.remove(self.publication)
        if self._exact is not None and self in self._exact.listeners:
            self._exact.listeners.remove(self)
        with self._changed:
            self._ending = True
            self._changed.notify()
        self._thread.join(timeout)
        if self._thread.is_alive():
            _log.warning("the recorder takes no more: the last %d MiB are not recorded", self._queued >> 20)

    # --- inside ----------------------------------------------------------------------------------------------------

    def _send_snapshot(self, snapshot: Snapshot) -> None:
        body = codec.encode_body(snapshot, Encoding.JSON)
        self._send_assets(body)
        self._send(FrameKind.MESSAGE, topics.SNAPSHOT.name, body)

    def _send_assets(self, body: bytes) -> None:
        for reference in references_in(body):
            if reference in self._sent_assets:
                continue
            self._sent_assets.add(reference)
            try:
                data = self._assets.get(reference)
            except AssetError as error:
                _log.warning("the recording lacks an asset: %s", error)
                continue
            self._send(FrameKind.ASSET, reference, data)

    def _send(self, kind: FrameKind, name: str, content: bytes | memoryview) -> None:
        self._need.said(len(content))
        self._put(frame_head(kind, name, len(content), time.time_ns()), content)

    def _put(self, *pieces: bytes | memoryview | _Later) -> None:
        with self._changed:
            if not self.alive:
                return
            self._queue += pieces
            self._queued += sum(map(len, pieces))
            self._changed.notify()

    def _is_too_long(self, delivery: Delivery) -> bool:
        # State frames go first; only a recorder that has stopped altogether makes the queue longer still.
        return self._queued > (self._limit if delivery is Delivery.LATEST else 2 * self._limit)

    def _leave_out(self, topic: Topic[Any]) -> None:
        self.lost += 1
        self._has_gap = self._has_gap or topic is topics.DELTA
        self._need.is_urgent |= topic is topics.COMMANDS
        now = time.monotonic()
        if now - self._loss_said > 5.0:
            self._loss_said = now
            _log.warning("the recorder cannot keep up: %d messages are not in the recording so far", self.lost)

    def _write(self) -> None:
        try:
            while (batch := self._next_batch()) is not None:
                _write_all(self._descriptor, [made for piece in batch for made in _made(piece)])
                self._written(sum(map(len, batch)))
        except OSError as error:
            with self._changed:
                self.alive = False
                self._queue.clear()
                self._queued = 0
            _log.warning("the recorder is gone (%s): the session goes on without a recording", error.strerror)
            self._written(0)
        finally:
            os.close(self._descriptor)

    def _next_batch(self) -> list[bytes | memoryview | _Later] | None:
        with self._changed:
            while not self._queue:
                if self._ending:
                    return None
                self._changed.wait()
            return [self._queue.popleft() for _ in range(min(len(self._queue), 64))]

    def _written(self, size: int) -> None:
        with self._changed:
            self._queued = max(0, self._queued - size)
            has_room = self._queued <= self._limit
        if has_room and not self._room.is_set():
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._room.set)


def _made(piece: bytes | memoryview | _Later) -> list[bytes | memoryview]:
    return piece.pieces() if isinstance(piece, _Later) else [piece]


def _write_all(descriptor: int, pieces: list[bytes | memoryview]) -> None:
    views = [memoryview(piece) for piece in pieces if piece]
    while views:
        written = os.writev(descriptor, views[:_MOST_PIECES])
        while views and written >= len(views[0]):
            written -= len(views[0])
            del views[0]
        if written:
            views[0] = views[0][written:]

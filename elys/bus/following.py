"""Keeping a mirror up to date over a session.

Deltas are subscribed to first and kept while the snapshot is asked for: what the snapshot does not contain yet is in the
buffer. A gap, a `resync`, another epoch or a change that makes no sense starts the same again.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import Final

from elys.bus import topics
from elys.bus.messages.scene import SceneDelta, SnapshotRequest
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.bus.session import Session
from elys.bus.transports.transport import Closer
from elys.common.errors import BusError, MessageError

_PAUSE: Final = 0.1  # [s] between two requests, so that a host in trouble is not flooded
_BUFFER_LIMIT: Final = 10_000  # deltas kept while there is no snapshot; of more the oldest go, and a new one is needed
_log = logging.getLogger(__name__)


async def follow_scene(
    session: Session, mirror: SceneMirror, on_change: Callable[[MirrorUpdate], None] | None = None
) -> Closer:
    """Keeps `mirror` what the host's scene is; returns when it is so for the first time.

    `on_change` hears every change, as from `mirror.listen`. When the host is gone the mirror stays as it was last; when it
    is back it becomes the new host's scene. A snapshot that cannot be had now is asked for again until there is one.
    """
    unlisten = mirror.listen(on_change) if on_change is not None else _nothing
    follower = _Follower(session, mirror)
    unsubscribe = session.subscribe(topics.DELTA, follower.heard)
    session.on_link(follower.link_changed)
    task = session.start(follower.run())
    try:
        await follower.current.wait()
    except asyncio.CancelledError:
        task.cancel()
        unsubscribe()
        unlisten()
        raise

    def close() -> None:
        task.cancel()
        unsubscribe()
        unlisten()

    return close


def follow_state(session: Session, mirror: SceneMirror, on_frame: Callable[[StateFrame], None] | None = None) -> Closer:
    """Keeps `mirror.latest_frame` the state frame that came last; `on_frame` hears each.

    The last one is the right one even if its tick is smaller: a replay is wound back, a host starts anew. What another run of
    the host says than the one that was greeted is left out: it may be old, or of another that took the same name.
    """

    def heard(frame: StateFrame, _: str) -> None:
        if frame.epoch != session.epoch:
            return
        mirror.keep_frame(frame)
        if on_frame is not None:
            on_frame(frame)

    return session.subscribe(topics.STATE, heard)


class _Follower:
    """Takes deltas as they come; while `lost`, only keeps them until the next snapshot is there."""

    def __init__(self, session: Session, mirror: SceneMirror) -> None:
        self._session = session
        self._mirror = mirror
        self._waiting: list[SceneDelta] = []
        self._lost = asyncio.Event()
        self._lost.set()
        self.current = asyncio.Event()

    def heard(self, delta: SceneDelta, _: str) -> None:
        if delta.epoch != self._session.epoch:
            return  # of another run than the one that was greeted; its snapshot comes after the greeting
        if self._lost.is_set():
            self._waiting.append(delta)
            del self._waiting[:-_BUFFER_LIMIT]
        else:
            self._follow(delta)

    def link_changed(self, connected: bool) -> None:
        if connected:
            self._lost.set()

    async def run(self) -> None:
        while True:
            await self._lost.wait()
            try:
                await self._take_snapshot()
            except MessageError as error:
                _log.warning("the host's snapshot cannot be used, asking again: %s", error)
            except BusError as error:
                _log.debug("no snapshot now, asking again: %s", error)
            await asyncio.sleep(_PAUSE)

    async def _take_snapshot(self) -> None:
        # What came before this request is contained in the answer to it.
        self._waiting.clear()
        snapshot = await self._session.request(topics.SNAPSHOT, SnapshotRequest(), timeout=5.0)
        if snapshot.epoch != self._session.epoch:
            raise MessageError("it is of another run of the host")
        self._mirror.apply_snapshot(snapshot)
        self._lost.clear()
        waiting, self._waiting = self._waiting, []
        for delta in waiting:
            self.heard(delta, "")
        if not self._lost.is_set():
            self.current.set()

    def _follow(self, delta: SceneDelta) -> None:
        mirror = self._mirror
        if delta.epoch == mirror.epoch and delta.sequence <= mirror.sequence:
            return
        try:
            mirror.apply_delta(delta)
        except MessageError as error:
            _log.debug("taking a new snapshot: %s", error)
            self._lost.set()


def _nothing() -> None:
    """Nobody listens."""

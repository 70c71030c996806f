"""The ghosts of a session for who draws them: which there are, and where their bodies are about the time that is shown.

GHOST ────────> GhostFollower: who is there
GHOST_PART ───> frames a little ahead of what is shown, so that ghosts and session are seen at the same instant
GHOST_SCENE ──> what the bodies look like, again where the ghost's scene becomes another
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable
from typing import Final

from elys.bus import topics
from elys.bus.ghost_service import MOST_FRAMES, MOST_GHOSTS, TOLD_EVERY
from elys.bus.ghost_track import FrameRun, Pair
from elys.bus.messages.ghosts import Color, Ghost, GhostPartRequest, GhostSceneRequest
from elys.bus.messages.session import SessionStatus
from elys.bus.messages.state_frame import unpack_frame
from elys.bus.mirror import SceneMirror
from elys.bus.session import Session
from elys.common.errors import BusError, MessageError

SILENCE: Final = 8.0 * TOLD_EVERY  # [s] after which a ghost that says nothing is gone
LEAST_AHEAD: Final = 0.5  # [s] of the ghost's time that is asked for at once
AHEAD: Final = 0.75  # [s] of wall clock, at the speed at which time goes by
DENSEST: Final = 120.0  # frames for a second of wall clock
FAST: Final = 2.0  # [s/s] above which some are left out
KEPT_RUNS: Final = 6  # so that loops and steps back find theirs
SCENE_PAUSE: Final = 0.5  # [s] between two questions for the scene
RETRY: Final = 0.5  # [s]
_log = logging.getLogger(__name__)


class GhostFollower:
    """Keeps `tracks` what ghosts there are, by id. `on_change` hears when a picture would differ."""

    def __init__(self, session: Session, on_change: Callable[[], None]) -> None:
        self._session = session
        self._on_change = on_change
        self.tracks: dict[str, FollowedGhost] = {}
        self._watching: asyncio.TimerHandle | None = None
        self._closers = [session.subscribe(topics.GHOST, self._heard)]

    def close(self) -> None:
        """Stops following."""
        for close in self._closers:
            close()
        if self._watching is not None:
            self._watching.cancel()
        for track in self.tracks.values():
            track.close()
        self.tracks.clear()

    def _heard(self, told: Ghost, key: str) -> None:
        if told.ghost != key:
            return
        track = self.tracks.get(key)
        if told.is_gone:
            self._forget(key)
        elif track is not None:
            track.hear(told)
        elif len(self.tracks) < MOST_GHOSTS:
            if len(self._closers) == 1:  # how fast time goes by matters to nobody else
                self._closers.append(self._session.subscribe(topics.STATUS, self._heard_status))
            self.tracks[key] = FollowedGhost(self._session, told, self._on_change)
            self._on_change()
            if self._watching is None:
                self._look()

    def _heard_status(self, status: SessionStatus, _: str) -> None:
        for track in self.tracks.values():
            track.speed = max(status.rate, status.realtime_factor) if status.playing else 0.0

    def _look(self) -> None:
        """Lets go of who says nothing any more."""
        now = time.monotonic()
        for key in [key for key, track in self.tracks.items() if now - track.heard_at > SILENCE]:
            self._forget(key)
        again = asyncio.get_running_loop().call_later(SILENCE / 4.0, self._look) if self.tracks else None
        self._watching = again

    def _forget(self, key: str) -> None:
        track = self.tracks.pop(key, None)
        if track is not None:
            track.close()
            self._on_change()


class FollowedGhost:
    """A `GhostTrack` over the bus: what is asked for and not here is fetched, and told when it has come."""

    def __init__(self, session: Session, told: Ghost, on_change: Callable[[], None]) -> None:
        self.told = told
        self.mirror = SceneMirror()
        self.heard_at = time.monotonic()
        self.speed = 1.0  # [s/s] at which time goes by in the session; 0: it stands
        self._session = session
        self._loop = asyncio.get_running_loop()
        self._on_change = on_change
        self._runs: list[FrameRun] = []  # the newest first
        self._wanted: float | None = None  # [s] of its own time, that is not here
        self._scene_of: int | None = None  # delta of the frame for which the scene was asked
        self._scene_asked = -SCENE_PAUSE
        self._work: asyncio.Task[None] | None = None
        self._scene_work: asyncio.Task[None] | None = None

    @property
    def title(self) -> str:
        """See `GhostTrack`."""
        return self.told.title

    @property
    def color(self) -> Color:
        """See `GhostTrack`."""
        return self.told.color

    def own_time(self, at: float) -> float:
        """See `GhostTrack`."""
        return self.told.own_time(at)

    def hear(self, told: Ghost) -> None:
        """Takes what the ghost says of itself."""
        self.heard_at = time.monotonic()
        if told != self.told:
            self.told = told
            self._on_change()

    def around(self, at: float) -> Pair | None:
        """See `GhostTrack`. Asks for what is needed and is not here, or will be needed soon."""
        own = self.told.own_time(at)
        if own < self.told.start_time - 1e-9:
            return None
        run = next((run for run in self._runs if run.step <= 2.0 * self._step and run.holds(own)), None)
        if run is None:
            self._want(own)
            return None
        if run.last < own + 0.5 * self._ahead and not any(other.holds(run.last + 1e-6) for other in self._runs):
            self._want(run.last)
        soon = self.told.own_time(at + 0.5 * self._ahead)
        if soon > own + self._ahead and not any(other.holds(soon) for other in self._runs):  # behind what it leaves out
            self._want(soon)
        pair = run.around(own)
        self._follow_scene(pair[0].delta_sequence, own)
        return pair

    def fetch(self, reference: str) -> bytes:
        """See `GhostTrack`; never on the loop's own thread."""
        asked = self._session.request(topics.GHOST_ASSET, reference.encode(), key=self.told.ghost, timeout=30.0)
        return asyncio.run_coroutine_threadsafe(asked, self._loop).result(timeout=60.0)

    def close(self) -> None:
        """Ends what is under way."""
        for work in (self._work, self._scene_work):
            if work is not None:
                work.cancel()

    @property
    def _ahead(self) -> float:
        return max(LEAST_AHEAD, AHEAD * self.speed)

    @property
    def _step(self) -> float:
        """[s] between frames that are asked for: of what rushes by some are enough."""
        return self.speed / DENSEST if self.speed > FAST else 0.0

    def _want(self, own: float) -> None:
        self._wanted = own
        if self._work is None or self._work.done():
            self._work = self._session.start(self._ask())

    async def _ask(self) -> None:
        while self._wanted is not None:
            first, self._wanted = self._wanted, None
            step = self._step
            request = GhostPartRequest(first=first, last=first + self._ahead, step=step)
            try:
                part = await self._session.request(topics.GHOST_PART, request, key=self.told.ghost)
                frames = [unpack_frame(body) for body in part.frames[:MOST_FRAMES]]
                self._runs = [FrameRun(frames, is_end=part.is_end, step=step), *self._runs[: KEPT_RUNS - 1]]
            except BusError as error:
                level = logging.WARNING if isinstance(error, MessageError) else logging.DEBUG
                _log.log(level, "the ghost %s does not say where it is: %s", self.told.title, error)
                await asyncio.sleep(RETRY)
            self._on_change()

    def _follow_scene(self, sequence: int, own: float) -> None:
        is_asking = self._scene_work is not None and not self._scene_work.done()
        is_soon = time.monotonic() - self._scene_asked < SCENE_PAUSE and self._scene_of is not None
        if sequence == self._scene_of or is_asking or is_soon:
            return
        self._scene_asked, asked = time.monotonic(), sequence
        self._scene_work = self._session.start(self._ask_scene(asked, own))

    async def _ask_scene(self, sequence: int, own: float) -> None:
        try:
            snapshot = await self._session.request(
                topics.GHOST_SCENE, GhostSceneRequest(time=own), key=self.told.ghost, timeout=10.0
            )
            self.mirror.apply_snapshot(snapshot)
            self._scene_of = sequence
        except BusError as error:
            _log.debug("the ghost %s does not say what it looks like: %s", self.told.title, error)
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.sleep(RETRY)
        self._on_change()

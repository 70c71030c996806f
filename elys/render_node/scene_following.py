"""What a render node or a viewer's window draws of a session: a RenderWorld that is kept what the session's scene is.

STATE, DELTA ──> mirror ──> RenderWorld       GHOSTS ──> other worlds
debug lines, contacts ──> DebugDrawing        assets ──> the cache
"""

from __future__ import annotations

import asyncio
import logging

from elys.bus.asset_service import AssetClient, open_asset_cache
from elys.bus.following import follow_scene, follow_state
from elys.bus.ghost_following import GhostFollower
from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.views import FRAMED, Debug, ViewCamera
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.bus.session import Session
from elys.common.assets import AssetStore
from elys.common.components import Camera
from elys.common.errors import ElysError
from elys.render_node.camera import camera_of, framing_camera
from elys.render_node.debug_drawing import DebugDrawing
from elys.render_node.debug_listening import DebugListener
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.ghost_worlds import GhostWorlds, ShownGhost
from elys.render_node.overlays import OverlayBoard
from elys.render_node.render_world import RenderWorld
from elys.render_node.scene_reader import SceneReader

_log = logging.getLogger(__name__)


class SceneFollower:
    """Keeps a RenderWorld what a session's scene is. `changed` is set whenever a new picture would differ."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self.mirror = SceneMirror()
        self._reader = SceneReader(self.mirror)
        self.overlays = OverlayBoard(self.mirror)
        self._loop = asyncio.get_running_loop()
        self._assets = AssetClient(session, _asset_store())
        self.world = RenderWorld(DrawableAssets(self.fetch, on_ready=self._asset_arrived))
        if session.states is not None:
            self.world.timeline.expect_stream()
        self.drawing = DebugDrawing(self.mirror)
        self._debug = DebugListener(session, self.drawing, self._lines_arrived)
        self._wanted: frozenset[Debug] = frozenset()
        self.ghosts: list[ShownGhost] = []  # of other runs what is seen, as the world is placed
        self.ghost_revision = 0  # rises when they change by themselves
        self._ghost_tracks = GhostFollower(session, self._ghosts_changed)
        self._ghost_worlds = GhostWorlds(self._asset_arrived)
        self.changed = asyncio.Event()
        self.revision = 0  # rises with every change
        self.edits = 0  # how often the scene was changed, not by motion
        self.arrived_count = 0  # of meshes and images
        self.state_arrived_at = 0.0  # [s] by the monotonic clock
        self._closed = False
        self._retrying: asyncio.TimerHandle | None = None  # for what could not be had
        session.on_link(self._link_changed)

    async def start(self) -> None:
        """Returns when the scene is there for the first time."""
        await follow_scene(self._session, self.mirror, self._scene_changed)
        follow_state(
            self._session, self.mirror, self._state_arrived
        )  # not before: states would delay it on a slow line

    def refresh(self, now: float | None) -> None:
        """Brings the world up to date and to the moment `now` [s]; None for the newest state."""
        self.world.read_scene(self._reader)
        self.world.place(now)
        if self._ghost_tracks.tracks or self.ghosts:
            self.ghosts = self._ghost_worlds.shown(self._ghost_tracks.tracks, self.world)

    def camera(self, through: int, aspect: float) -> ViewCamera:
        """Of the entity `through` as it stands in the newest state, if it has a camera; else as `ViewRequest.through` says."""
        if through == FRAMED:
            return framing_camera(*self.world.bounds(), aspect=aspect)
        found = self.mirror.entities.get(through)
        camera = found.components.get("Camera") if found is not None else None
        if not isinstance(camera, Camera):
            return self.world.camera(aspect)
        pose = self.mirror.world_pose(through)
        return camera_of(camera, pose.position, pose.rotation)

    def want_debug(self, kinds: frozenset[Debug]) -> None:
        """Says of which kinds debug drawing is made from now on."""
        if kinds != self._wanted:
            self._wanted = kinds
            self._debug.want(kinds)

    def close(self) -> None:
        """Stops following."""
        self._closed = True
        if self._retrying is not None:
            self._retrying.cancel()
        self._debug.close()
        self._ghost_tracks.close()
        self._ghost_worlds.close()
        self._reader.close()
        self.world.assets.close()

    @property
    def tick(self) -> int:
        """Of what is shown: of the newest state, or of the snapshot of a scene that has not moved since."""
        return self.world.tick if self.world.tick >= 0 else self.mirror.tick

    @property
    def simulation_time(self) -> float:
        """Of the same [s]."""
        newest = self.world.timeline.newest
        return newest.simulation_time if newest is not None else self.mirror.simulation_time

    def touch(self) -> None:
        """Says that a new picture would differ."""
        self.revision += 1
        self.changed.set()

    def _scene_changed(self, update: MirrorUpdate) -> None:
        newest = self.world.timeline.newest
        if update.reset and newest is not None and newest.epoch != self.mirror.epoch:
            self.world.forget_state()
            self.drawing.forget()
        self.edits += 1
        self.touch()

    def _ghosts_changed(self) -> None:
        self.ghost_revision += 1
        self.touch()

    def _lines_arrived(self, _: str) -> None:
        newest = self.mirror.latest_frame
        if newest is None or not newest.playing:  # else the next state is near, and brings a picture
            self.touch()

    def _state_arrived(self, frame: StateFrame) -> None:
        first, self.state_arrived_at = self._session.arrival
        # Of another run than the scene that is here: its ids mean other things.
        if frame.epoch == self.mirror.epoch and self.world.take_state(frame, self.state_arrived_at, first=first):
            if "trajectories" in self._wanted:
                self.drawing.take_state(frame)
            self.touch()

    def _link_changed(self, connected: bool) -> None:
        if connected:
            self.world.assets.retry_failed()
        self.touch()

    def _asset_arrived(self) -> None:
        if not self._closed:
            self._loop.call_soon_threadsafe(self._show_asset)

    def _show_asset(self) -> None:
        if self._closed:
            return
        self.arrived_count += 1
        self.touch()
        self._plan_retry()

    def _plan_retry(self) -> None:
        """Sees to it that what could not be had is asked for again when its time has come."""
        if self._retrying is not None:
            self._retrying.cancel()
        pause = self.world.assets.retry_pause
        self._retrying = self._loop.call_later(pause, self._retry) if pause is not None else None

    def _retry(self) -> None:
        self.world.assets.retry_due()
        self._plan_retry()

    def fetch(self, reference: str) -> bytes:
        """The bytes of an asset. On another thread than the loop's: asks the bus, which lives there."""
        return asyncio.run_coroutine_threadsafe(self._assets.fetch(reference), self._loop).result(timeout=60.0)


def _asset_store() -> AssetStore:
    try:
        return open_asset_cache()
    except (ElysError, OSError) as error:
        _log.warning("assets are kept in memory only: %s", error)
        return AssetStore()

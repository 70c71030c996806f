"""The render node: follows a session's scene and draws the views that others ask for.

VIEW_REQUEST ──> ViewDesk ──due──> place ──> draw ──> ring or JPEG ──> VIEW_FRAME
STATE, DELTA ──> mirror ──> RenderWorld ──^
PICK ──────────> draw one pixel ──> entity
THUMBNAIL ─────> draw what is in no scene ──> JPEG
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from typing import Final

from elys.bus import topics
from elys.bus.asset_service import AssetClient, open_asset_cache
from elys.bus.following import follow_scene, follow_state
from elys.bus.ghost_following import GhostFollower
from elys.bus.messages.plan import RenderProfile, StagePlan
from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.views import (
    FRAMED,
    Debug,
    PickReply,
    PickRequest,
    Thumbnail,
    ThumbnailRequest,
    ViewCamera,
    ViewFrame,
    ViewRequest,
)
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.bus.session import Node, Session
from elys.bus.state_source import tell_interest
from elys.common.assets import AssetStore
from elys.common.components import Camera
from elys.common.errors import ElysError, RequestError
from elys.render_node.camera import camera_of, framing_camera
from elys.render_node.data_colors import data_pixels, depth_unit_of
from elys.render_node.debug_drawing import DebugDrawing
from elys.render_node.debug_listening import DebugListener
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.ghost_worlds import GhostWorlds, ShownGhost
from elys.render_node.gpu import Context, offscreen_context
from elys.render_node.overlays import OverlayBoard
from elys.render_node.pass_plan import told_passes
from elys.render_node.quality import Quality, interactive_quality
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_reader import SceneReader
from elys.render_node.thumbnails import ThumbnailPainter
from elys.render_node.view_desk import PutPicture, View, ViewDesk, sane_camera, sane_size

SLOW_STATES: Final = 1.0 / 40.0  # [s] between state frames above which views glide from one to the next
_log = logging.getLogger(__name__)


async def serve_views(
    session: Session,
    *,
    context: Context | None = None,
    quality: Quality | None = None,
    measure: Callable[[ViewFrame], None] | None = None,
) -> None:
    """Draws views for whoever asks this node, until cancelled.

    `measure` hears of every picture when it has been sent, for measurements of latency.

    Raises:
        DisplayError: nothing can be drawn on this machine.
    """
    follower = SceneFollower(session)
    desk = ViewDesk()
    server = _ViewServer(session, follower, desk, measure)
    # First of all: what is asked for while OpenGL starts must not be lost.
    session.subscribe(topics.VIEW_REQUEST, server.requested, key=session.node.id)
    session.serve(topics.PICK, server.pick, key=session.node.id)
    session.serve(topics.THUMBNAIL, server.thumbnail, key=session.node.id)
    session.on_nodes(server.node_changed)
    drawing = context
    try:
        drawing = context if context is not None else offscreen_context()
        _log.info("drawing views on %s", drawing.info["GL_RENDERER"])
        await follower.start()
        await server.run(Renderer(drawing, quality=quality or interactive_quality(drawing)))
    finally:
        follower.close()
        desk.close()
        if context is None and drawing is not None:
            drawing.release()


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


class _ViewServer:
    """Answers requests for views, one picture at a time."""

    def __init__(
        self,
        session: Session,
        follower: SceneFollower,
        desk: ViewDesk,
        measure: Callable[[ViewFrame], None] | None,
    ) -> None:
        self._session = session
        self._follower = follower
        self._renderer: Renderer | None = None  # until OpenGL and the scene are there
        self._desk = desk
        self._measure = measure
        self._thumbnails: ThumbnailPainter | None = None  # until somebody wants one

    def requested(self, request: ViewRequest, _: str) -> None:
        """Notes what somebody wants to see."""
        if self._desk.take(request, self._session.arrival.last):
            self._follower.changed.set()

    def node_changed(self, node: Node, alive: bool) -> None:
        """Forgets the views of who is gone."""
        if not alive:
            self._desk.forget(node.id)

    async def pick(self, request: PickRequest, _: str) -> PickReply:
        """What is seen at a pixel."""
        if self._renderer is None:
            raise RequestError("this render node is starting: ask again")
        self._follower.refresh(self._moment())
        width, height, _ = sane_size(request.width, request.height)
        world = self._follower.world
        entity, position = self._renderer.pick(
            world, sane_camera(request.camera), width, height, request.x, request.y, passed_over=request.passed_over
        )
        found = self._follower.mirror.entities.get(entity)
        name = found.name if found is not None else ""
        return PickReply(entity=entity, position=position, tick=self._follower.tick, name=name)

    async def thumbnail(self, request: ThumbnailRequest, _: str) -> Thumbnail:
        """A small picture of entities that are in no scene."""
        if self._renderer is None:
            raise RequestError("this render node is starting: ask again")
        if self._thumbnails is None:
            self._thumbnails = ThumbnailPainter(self._renderer.context)
        return Thumbnail(jpeg=self._thumbnails.draw(request))

    async def run(self, renderer: Renderer) -> None:
        """Draws what is due, again and again."""
        self._renderer = renderer
        follower, desk = self._follower, self._desk
        while True:
            now = time.monotonic()
            follower.want_debug(desk.debug_kinds())
            for view in desk.due(now, follower.revision, gliding=self._is_gliding(now), edits=follower.edits):
                self._draw(view, renderer)
                await asyncio.sleep(0)  # messages and questions between two pictures
            desk.forget_silent(now)
            tell_interest(self._session, desk.interest())
            follower.changed.clear()
            gliding = self._is_gliding(now)
            pause = desk.pause(time.monotonic(), follower.revision, gliding=gliding, edits=follower.edits)
            try:
                async with asyncio.timeout(pause):
                    await follower.changed.wait()
            except TimeoutError:
                pass

    def _draw(self, view: View, renderer: Renderer) -> None:
        start = time.perf_counter()
        request, revision, edits = view.request, self._follower.revision, self._follower.edits
        try:
            self._follower.refresh(self._moment())
            camera = sane_camera(request.camera or self._follower.camera(request.through, view.width / view.height))
            view.camera = camera
            put = self._draw_into(view, renderer, camera)
        except ElysError as error:
            _log.error("view %s cannot be drawn: %s", request.view, error)
            view.answered(revision, time.monotonic(), edits=edits)
            return
        frame = ViewFrame(
            view=request.view,
            sequence=request.sequence,
            tick=self._follower.tick,
            state_published_at=self._follower.world.state_published_at,
            simulation_time=self._follower.simulation_time,
            camera=camera,
            width=view.width,
            height=view.height,
            slot=put.slot,
            jpeg=put.jpeg,
            h264=put.coded.data,
            number=put.coded.number,
            keyframe=put.coded.is_keyframe,
            render_time=(time.perf_counter() - start) * 1e3,
            answer_time=(time.monotonic() - view.asked_at) * 1e3,
        )
        self._session.publish(topics.VIEW_FRAME, frame, key=request.view)
        view.answered(revision, time.monotonic(), edits=edits)
        if self._session.has_listener(topics.RENDER_PROFILE, key=request.view):
            self._publish_profile(frame, renderer, is_light=request.shows == "shaded")
        if self._measure is not None:
            self._measure(frame)

    def _publish_profile(self, frame: ViewFrame, renderer: Renderer, *, is_light: bool) -> None:
        plan = renderer.planned if is_light else None  # data is drawn in one pass, which needs no plan
        profile = RenderProfile(
            node=self._session.node.id,
            view=frame.view,
            sequence=frame.sequence,
            tick=frame.tick,
            width=frame.width,
            height=frame.height,
            total=frame.render_time,
            stages=dict(renderer.timings) if plan is not None else {},
            passes=tuple(StagePlan(**told._asdict()) for told in told_passes(plan)) if plan is not None else (),
        )
        self._session.publish(topics.RENDER_PROFILE, profile, key=frame.view)

    def _draw_into(self, view: View, renderer: Renderer, camera: ViewCamera) -> PutPicture:
        """Draws what a view shows, and puts it where it is wanted."""
        request, world = view.request, self._follower.world
        if request.shows == "shaded":
            ghosts = self._follower.ghosts
            marks = self._follower.drawing.marks(
                world, request.debug, request.debug_entities, hidden=request.hidden, ghosts=ghosts
            )
            picture = renderer.draw(
                world,
                camera,
                view.width,
                view.height,
                selection=request.selection,
                hidden=request.hidden,
                grid=request.grid,
                marks=marks,
                ghosts=ghosts,
                overlays=self._follower.overlays.shown(world, player=request.player),
            )
            return view.put(picture)
        values = renderer.draw_data(world, camera, view.width, view.height, request.shows, hidden=request.hidden)
        unit = depth_unit_of(values) if request.shows == "depth" else 1.0
        return view.put_pixels(data_pixels(values, request.shows, depth_unit=unit))

    def _moment(self) -> float | None:
        """When to show: the newest state, or between two that come too seldom to look like motion."""
        return time.monotonic() if self._follower.world.timeline.interval > SLOW_STATES else None

    def _is_gliding(self, now: float) -> bool:
        timeline = self._follower.world.timeline
        return timeline.interval > SLOW_STATES and timeline.is_moving(now)


def _asset_store() -> AssetStore:
    try:
        return open_asset_cache()
    except (ElysError, OSError) as error:
        _log.warning("assets are kept in memory only: %s", error)
        return AssetStore()

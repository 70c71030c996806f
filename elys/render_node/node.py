"""The render node: follows a session's scene and draws the views that others ask for.

VIEW_REQUEST ──> ViewDesk ──due──> place ──> draw ──> ring or JPEG ──> VIEW_FRAME
STATE, DELTA ──> mirror ──> RenderWorld ──^
PICK ──────────> draw one pixel ──> entity
THUMBNAIL ─────> draw what is in no scene ──> JPEG
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Iterator
from typing import Final

from elys.bus import topics
from elys.bus.messages.plan import RenderProfile, StagePlan
from elys.bus.messages.views import (
    PickReply,
    PickRequest,
    Thumbnail,
    ThumbnailRequest,
    ViewCamera,
    ViewFrame,
    ViewRequest,
)
from elys.bus.session import Node, Session
from elys.bus.state_source import tell_interest
from elys.common.errors import ContextLost, ElysError, RequestError
from elys.render_node.data_colors import data_pixels, depth_unit_of
from elys.render_node.gpu import Context, offscreen_context
from elys.render_node.pass_plan import told_passes
from elys.render_node.quality import Quality, interactive_quality
from elys.render_node.renderer import Renderer
from elys.render_node.scene_classes import SceneClasses
from elys.render_node.scene_following import SceneFollower
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
        DisplayError: nothing can be drawn on this machine. ContextLost: not in this process any more.
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
            with contextlib.suppress(ContextLost):  # which is told already
                drawing.release()


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
        self._classes = SceneClasses(follower.mirror)
        self._thumbnails: ThumbnailPainter | None = None  # until somebody wants one
        self._loss: ContextLost | None = None  # that a question met

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
        with self._noting_loss():
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
        with self._noting_loss():
            if self._thumbnails is None:
                self._thumbnails = ThumbnailPainter(self._renderer.context)
            return Thumbnail(jpeg=self._thumbnails.draw(request))

    @contextlib.contextmanager
    def _noting_loss(self) -> Iterator[None]:
        """Ends `run` as well when the context is lost while a question is answered."""
        try:
            yield
        except ContextLost as error:
            self._loss = error
            self._follower.changed.set()
            raise

    async def run(self, renderer: Renderer) -> None:
        """Draws what is due, again and again. Raises ContextLost."""
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
            if self._loss is not None:
                raise self._loss
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
        except ContextLost:
            raise  # no picture will ever come again
        except ElysError as error:
            if str(error) != view.trouble:  # once, though it is asked for again and again
                _log.error("view %s cannot be drawn: %s", request.view, error)
            view.trouble = str(error)
            view.answered(revision, time.monotonic(), edits=edits)
            return
        view.trouble = ""
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
        if request.shows == "segmentation":
            entity = renderer.draw_data(world, camera, view.width, view.height, "entity", hidden=request.hidden)
            return view.put_pixels(self._classes.pixels(self._classes.seen(entity[..., 0])))
        values = renderer.draw_data(world, camera, view.width, view.height, request.shows, hidden=request.hidden)
        unit = depth_unit_of(values) if request.shows == "depth" else 1.0
        return view.put_pixels(data_pixels(values, request.shows, depth_unit=unit))

    def _moment(self) -> float | None:
        """When to show: the newest state, or between two that come too seldom to look like motion."""
        return time.monotonic() if self._follower.world.timeline.interval > SLOW_STATES else None

    def _is_gliding(self, now: float) -> bool:
        timeline = self._follower.world.timeline
        return timeline.interval > SLOW_STATES and timeline.is_moving(now)

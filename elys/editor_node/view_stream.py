"""Pictures of the scene from a render node: one request under way, the newest point of view wins.

The stream asks for a picture and, when it has come, for one of a later tick; the render node answers that one only when the
scene has moved on, so an idle scene costs nothing. A new camera or size overtakes such a waiting request.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import simplejpeg

from elys.bus import topics
from elys.bus.messages.views import Debug, PickReply, PickRequest, Shows, ViewCamera, ViewFrame, ViewRequest
from elys.bus.picture_ring import MAX_HEIGHT, MAX_WIDTH, PictureRing
from elys.bus.session import Node, Session
from elys.common.errors import BusError
from elys.editor_node.gpu import ViewportPicture

ANSWER_TIMEOUT: Final = 1.5  # [s] after which a picture that was asked for is asked for again
WAIT_TIMEOUT: Final = 3.0  # [s] the same for one that may wait for a later tick
EARLINESS: Final = (
    1.5  # [s] before that, at which a frame that is drawn anyway asks again: several views do so together
)
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class View:
    """What should be seen."""

    camera: ViewCamera
    width: int
    height: int
    selection: tuple[int, ...] = ()
    hidden: tuple[int, ...] = ()
    grid: bool = True
    shows: Shows = "shaded"
    debug: tuple[Debug, ...] = ()
    debug_entities: tuple[int, ...] = ()  # none for everybody


class ViewStream:
    """Keeps the newest picture of a View. `on_frame` is called when one has come."""

    def __init__(self, session: Session, *, on_frame: Callable[[], None] = lambda: None, name: str = "") -> None:
        """`name` of the view at render nodes, by default the session's node's."""
        self._session = session
        self._on_frame = on_frame
        self._ring = _open_ring()
        self.name = name or session.node.id  # of the view
        self._wanted: View | None = None
        self._asked: View | None = None  # of the request under way
        self._answered: View | None = None  # of the last request that was answered
        self._asked_at = 0.0
        self._is_closed = False
        self._is_waiting = False  # the request under way may take until the next tick
        self._sequence = 0
        self._arrived: ViewFrame | None = None  # not uploaded yet
        self.shown: ViewFrame | None = None  # what the texture holds; overlays are drawn with its camera
        self.renderer: Node | None = None
        self.lost_renderer = False  # the last one died and none has taken its place
        self.latency = 0.0  # [s] from the simulation's publishing to the upload here, of the last picture
        self._closers = [session.subscribe(topics.VIEW_FRAME, self._frame_arrived, key=self.name)]
        session.on_nodes(self._nodes_changed)
        self._choose_renderer()

    def want(self, view: View) -> None:
        """Says what should be seen from now on; call it each frame."""
        width = min(max(view.width, 16), MAX_WIDTH)
        height = min(max(view.height, 16), MAX_HEIGHT)
        self._wanted = replace(view, width=width, height=height)
        self._ask_if_useful()

    def rest(self) -> None:
        """Asks for nothing until something is wanted again."""
        self._wanted = None

    def upload(self, picture: ViewportPicture) -> bool:
        """Puts the newest picture that came into the texture; False when there is no new one."""
        frame, self._arrived = self._arrived, None
        if frame is None:
            return False
        try:
            self._show(frame, picture)
        except ValueError as error:
            _log.warning("refused a picture from a render node: %s", error)
            return False
        is_newer_tick = self.shown is None or frame.tick != self.shown.tick
        self.shown = frame
        # Another look at the same tick (a turned camera) is no older than what the simulation has.
        if frame.state_published_at and is_newer_tick:
            self.latency = max(0.0, (time.time_ns() - frame.state_published_at) * 1e-9)
        return True

    def _show(self, frame: ViewFrame, picture: ViewportPicture) -> None:
        """Raises ValueError for a picture that is none."""
        if frame.slot >= 0 and self._ring is not None:
            with self._ring.pixels(frame.slot, frame.width, frame.height) as pixels:
                picture.upload(pixels, frame.width, frame.height)
            return
        rows = simplejpeg.decode_jpeg(frame.jpeg, colorspace="RGBA")
        height, width, _ = rows.shape
        picture.upload(np.ascontiguousarray(rows[::-1]), width, height)  # JPEG rows run downwards, textures upwards

    async def pick(self, x: int, y: int, *, passed_over: tuple[int, ...] = ()) -> PickReply:
        """What is seen at a pixel of the picture shown, or behind who is passed over there.

        Raises BusError when the render node does not answer.
        """
        if self.shown is None or self.renderer is None:
            return PickReply(entity=0)
        request = PickRequest(
            camera=self.shown.camera,
            width=self.shown.width,
            height=self.shown.height,
            x=x,
            y=y,
            passed_over=passed_over,
        )
        return await self._session.request(topics.PICK, request, key=self.renderer.id, timeout=2.0)

    def forget(self) -> None:
        """Another session: no picture of it has come yet."""
        self._arrived = self.shown = None
        self.lost_renderer, self.latency = False, 0.0
        self.refresh()

    def refresh(self) -> None:
        """Forgets what was answered and asks anew: another renderer, or another run of the host."""
        self._asked, self._answered, self._is_waiting, self._asked_at = None, None, False, 0.0
        self._ask_if_useful()

    @property
    def next_deadline(self) -> float:
        """When, by the monotonic clock, `want` should be called again at the latest; never without a render node or a wish."""
        if self.renderer is None or self._wanted is None:
            return math.inf
        return self._asked_at + (WAIT_TIMEOUT if self._is_waiting else ANSWER_TIMEOUT)

    def close(self) -> None:
        """Stops asking and frees the ring."""
        self._is_closed = True
        self.rest()
        for closer in self._closers:
            closer()
        if self._ring is not None:
            self._ring.close()

    def _ask_if_useful(self) -> None:
        if self.renderer is None or self._wanted is None:
            return
        is_overdue = time.monotonic() >= self.next_deadline - (EARLINESS if self._is_waiting else 0.0)
        if self._asked is not None and not is_overdue and (not self._is_waiting or self._wanted == self._asked):
            return
        newest = self._arrived or self.shown
        is_seen = newest is not None and self._answered == self._wanted
        self._ask(newer_than_tick=newest.tick if newest is not None and is_seen else -1)

    def _ask(self, *, newer_than_tick: int) -> None:
        assert self.renderer is not None and self._wanted is not None
        view = self._wanted
        self._sequence += 1
        self._asked, self._asked_at, self._is_waiting = view, time.monotonic(), newer_than_tick >= 0
        request = ViewRequest(
            view=self.name,
            sequence=self._sequence,
            camera=view.camera,
            width=view.width,
            height=view.height,
            selection=view.selection,
            hidden=view.hidden,
            grid=view.grid,
            shows=view.shows,
            debug=view.debug,
            debug_entities=view.debug_entities,
            ring=self._ring.address if self._ring is not None else None,
            newer_than_tick=newer_than_tick,
        )
        self._session.publish(topics.VIEW_REQUEST, request, key=self.renderer.id)

    def _frame_arrived(self, frame: ViewFrame, _: str) -> None:
        if frame.view != self.name or (self._arrived and frame.sequence < self._arrived.sequence):
            return
        self._arrived = frame
        if frame.sequence == self._sequence:
            self._answered, self._asked = self._asked, None
            self._ask_if_useful()
        self._on_frame()

    def _nodes_changed(self, node: Node, alive: bool) -> None:
        if node.kind == "render" and not self._is_closed:
            self._choose_renderer()
            self._on_frame()

    def _choose_renderer(self) -> None:
        """The newest render node; the one in use stays while it lives."""
        nodes = self._session.nodes_of("render")
        if self.renderer in nodes:
            return
        self.lost_renderer = not nodes and (self.renderer is not None or self.lost_renderer)
        self.renderer = nodes[-1] if nodes else None
        self.refresh()


def _open_ring() -> PictureRing | None:
    try:
        return PictureRing()
    except BusError as error:
        _log.info("pictures come as JPEG: %s", error)
        return None

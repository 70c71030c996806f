"""Who wants to see what: the newest request of each view, when it may be drawn, and where its pictures go."""

from __future__ import annotations

import logging
import math
import re
from typing import Final, NamedTuple

import msgspec
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from elys.bus.messages.streaming import StreamInterest
from elys.bus.messages.views import Debug, SharedRing, ViewCamera, ViewRequest
from elys.bus.picture_ring import RingWriter
from elys.common.errors import BusError
from elys.render_node.gpu import Framebuffer
from elys.render_node.view_encoder import CodedPicture, ViewEncoder

MIN_INTERVAL: Final = 1.0 / 62.0  # [s] between two pictures of a view
SILENCE: Final = 10.0  # [s] without a request after which a view is forgotten
MAX_VIEWS: Final = 64
MAX_SIZE: Final = 8192  # [pixels] of an edge
MAX_PIXELS: Final = 4096 * 4096
JPEG_QUALITY: Final = 85
LEAST_BIT_RATE: Final = 50e3  # [bit/s] of H.264
MOST_BIT_RATE: Final = 1e9
_NAME: Final = re.compile(r"[A-Za-z0-9_.-]{1,128}\Z")
_log = logging.getLogger(__name__)


class PutPicture(NamedTuple):
    """Where a picture was put: into a slot of the ring (-1: none), or into one of the messages."""

    slot: int = -1
    jpeg: bytes = b""
    coded: CodedPicture = CodedPicture(b"", 0, False)


class View:
    """One view: its newest request and what became of it."""

    def __init__(self, request: ViewRequest) -> None:
        self.camera: ViewCamera | None = None  # of the picture drawn last
        self.request = request
        self.width, self.height = 1, 1
        self._ring: RingWriter | None = None
        self._ring_address: SharedRing | None = None
        self._encoder: ViewEncoder | None = None  # of the stream, while H.264 is wanted
        self._is_answered = True
        self._shown: tuple[object, ...] | None = None
        self._shown_revision = -1
        self._shown_edits = -1
        self.asked_at = 0.0
        self.drawn_at = -1.0
        self.trouble = ""  # why the last picture could not be drawn, which has been said

    def ask(self, request: ViewRequest, now: float) -> None:
        """Takes a newer request."""
        self.request, self.asked_at, self._is_answered = request, now, False
        self.width, self.height, reason = sane_size(request.width, request.height)
        if reason:
            _log.warning("view %s: %s", request.view, reason)
        if request.ring != self._ring_address:
            self._open_ring(request.ring)

    def is_due(self, revision: int, *, gliding: bool) -> bool:
        """Whether the request wants a picture now: at once, or only if it would show something else than the last one."""
        if self._is_answered:
            return False
        waits = self.request.newer_than_tick >= 0 and self._wanted() == self._shown
        return not waits or gliding or revision != self._shown_revision

    def waits_for_rate(self, edits: int) -> bool:
        """Whether it is drawn no sooner than a while after its last picture: what somebody has edited is shown at once."""
        return edits == self._shown_edits

    def answered(self, revision: int, now: float, *, edits: int = 0) -> None:
        """Notes that the request's picture has been sent."""
        self._shown_edits = edits
        self._is_answered, self.drawn_at = True, now
        self._shown, self._shown_revision = self._wanted(), revision

    def put(self, picture: Framebuffer) -> PutPicture:
        """Puts a picture into the ring, or makes a message of it."""
        if self._ring is not None and self._ring.holds(picture.width, picture.height):
            slot = self._ring.next_slot()
            with self._ring.pixels(slot, picture.width, picture.height) as pixels:
                picture.read_into(pixels)
            return PutPicture(slot=slot)
        return self._encoded(np.ascontiguousarray(picture.read()[::-1]))

    def put_pixels(self, pixels: NDArray[np.uint8]) -> PutPicture:
        """The same for RGB pixels (H, W, 3) of the view's size, the upper row first."""
        if self._ring is not None and self._ring.holds(self.width, self.height):
            slot = self._ring.next_slot()
            opaque = np.full((self.height, self.width, 4), 255, np.uint8)
            opaque[..., :3] = pixels[::-1]
            with self._ring.pixels(slot, self.width, self.height) as target:
                target[:] = opaque.tobytes()
            return PutPicture(slot=slot)
        return self._encoded(np.ascontiguousarray(pixels))

    def _encoded(self, pixels: NDArray[np.uint8]) -> PutPicture:
        """RGB or RGBA pixels (H, W, 3 or 4), the upper row first, as the request wants them."""
        request, (height, width) = self.request, pixels.shape[:2]
        if request.encoding == "jpeg":
            self._encoder = None
            layout = "RGB" if pixels.shape[-1] == 3 else "RGBX"
            return PutPicture(jpeg=simplejpeg.encode_jpeg(pixels, JPEG_QUALITY, layout, fastdct=True))
        bit_rate = sane_bit_rate(request.bit_rate)
        encoder = self._encoder
        if encoder is None or (encoder.width, encoder.height, encoder.bit_rate) != (width, height, bit_rate):
            encoder = self._encoder = ViewEncoder(width, height, bit_rate=bit_rate)
        return PutPicture(coded=encoder.encode(pixels, keyframe=request.keyframe))

    def close(self) -> None:
        """Lets go of the ring and of the encoder."""
        self._encoder = None
        if self._ring is not None:
            self._ring.close()
            self._ring = None

    def _wanted(self) -> tuple[object, ...]:
        request = self.request
        size = (self.width, self.height)
        drawn = (request.selection, request.hidden, request.grid, request.shows, request.debug, request.debug_entities)
        return (request.camera, request.through, *size, *drawn, request.ring, request.player)

    def _open_ring(self, address: SharedRing | None) -> None:
        if self._ring is not None:
            self._ring.close()
            self._ring = None
        self._ring_address = address
        if address is None:
            return
        try:
            self._ring = RingWriter(address)
        except BusError as error:
            _log.info("view %s gets its pictures as JPEG: %s", self.request.view, error)


class ViewDesk:
    """All views of a render node."""

    def __init__(self) -> None:
        self._views: dict[str, View] = {}

    def take(self, request: ViewRequest, now: float) -> bool:
        """Takes a request; False for one that is older than what is here or names a view as none can be named."""
        if not _NAME.match(request.view):
            _log.warning(
                "refused a request for view %r: names hold letters, digits, '.', '_' and '-'", request.view[:40]
            )
            return False
        view = self._views.get(request.view)
        if view is None:
            if len(self._views) >= MAX_VIEWS:
                _log.warning("refused view %s: %d views are being drawn already", request.view, MAX_VIEWS)
                return False
            view = self._views[request.view] = View(request)
        elif request.sequence < view.request.sequence and now - view.asked_at < SILENCE / 2:
            return False
        view.ask(request, now)
        return True

    def due(self, now: float, revision: int, *, gliding: bool, edits: int = 0) -> list[View]:
        """The views to draw now, the one that has waited longest first; `edits` counts changes of the scene by hand."""
        ready = [view for view in self._views.values() if view.is_due(revision, gliding=gliding)]
        ready = [view for view in ready if now - view.drawn_at >= MIN_INTERVAL or not view.waits_for_rate(edits)]
        return sorted(ready, key=lambda view: view.drawn_at)

    def debug_kinds(self) -> frozenset[Debug]:
        """What debug drawing any view shows."""
        return frozenset(kind for view in self._views.values() for kind in view.request.debug)

    def interest(self) -> StreamInterest:
        """What is looked at, for the stream of states."""
        views = [view for view in self._views.values() if view.camera is not None]
        return StreamInterest(
            cameras=tuple(view.camera for view in views if view.camera is not None),
            aspect=max((view.width / view.height for view in views), default=1.0),
            chosen=tuple({entity: None for view in views for entity in view.request.selection}),
        )

    def pause(self, now: float, revision: int, *, gliding: bool, edits: int = 0) -> float:
        """Seconds until a view may be drawn that is only held back by its rate; else until silent ones are to be looked for."""
        due = [view for view in self._views.values() if view.is_due(revision, gliding=gliding)]
        if any(not view.waits_for_rate(edits) for view in due):
            return 0.0
        held = [view.drawn_at for view in due]
        return max(0.0, min(held) + MIN_INTERVAL - now) if held else SILENCE / 10

    def forget(self, name: str) -> None:
        """Ends a view."""
        view = self._views.pop(name, None)
        if view is not None:
            view.close()

    def forget_silent(self, now: float) -> None:
        """Ends the views of who asks no more."""
        for name in [name for name, view in self._views.items() if now - view.asked_at > SILENCE]:
            self.forget(name)

    def close(self) -> None:
        """Ends all views."""
        for name in list(self._views):
            self.forget(name)


def sane_size(width: int, height: int) -> tuple[int, int, str]:
    """A size that can be drawn, and why it is not the one asked for ("" if it is)."""
    sane_width, sane_height = min(max(width, 1), MAX_SIZE), min(max(height, 1), MAX_SIZE)
    if sane_width * sane_height > MAX_PIXELS:
        shrink = math.sqrt(MAX_PIXELS / (sane_width * sane_height))
        sane_width, sane_height = int(sane_width * shrink), int(sane_height * shrink)
    if (sane_width, sane_height) == (width, height):
        return width, height, ""
    return sane_width, sane_height, f"{width} x {height} pixels cannot be drawn, {sane_width} x {sane_height} are"


def sane_bit_rate(bit_rate: float) -> float:
    """A bit rate that can be kept [bit/s]; 0 for any."""
    is_meant = math.isfinite(bit_rate) and bit_rate > 0.0
    return min(max(bit_rate, LEAST_BIT_RATE), MOST_BIT_RATE) if is_meant else 0.0


def sane_camera(camera: ViewCamera) -> ViewCamera:
    """A camera that can be drawn with: finite, with an opening angle and a depth; else the nearest that is."""
    numbers = (*camera.position, *camera.rotation, camera.field_of_view, camera.near, camera.far, camera.ortho_height)
    if not all(math.isfinite(number) and abs(number) < 1e12 for number in numbers):
        return ViewCamera(position=(0.0, 2.0, 8.0), rotation=(0.0, 0.0, 0.0, 1.0))
    near = min(max(camera.near, 1e-4), 1e6)
    field_of_view = min(max(camera.field_of_view, 0.02), 3.0)
    rotation = camera.rotation if any(camera.rotation) else (0.0, 0.0, 0.0, 1.0)
    return msgspec.structs.replace(
        camera,
        rotation=rotation,
        field_of_view=field_of_view,
        near=near,
        far=max(camera.far, near * 1.01),
        ortho_height=max(camera.ortho_height, 0.0),
    )

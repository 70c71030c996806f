"""Pictures that a render node elsewhere draws: asked for one at a time, decoded, in the encoding that suits the way between.

JPEG    134 kB a picture of 1280x720 that is moving, each by itself: where the way carries 30 Mbit/s and more
H.264   a fraction of that, after the picture before: where it does not
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from elys.bus import topics
from elys.bus.messages.views import Debug, Encoding, ViewCamera, ViewFrame, ViewRequest
from elys.bus.session import Node, Session
from elys.render_node.picture_size import PictureSize
from elys.render_node.view_encoder import CodedPicture, ViewDecoder

SLOW_LINK: Final = 30e6  # [bit/s] below which H.264 shows a picture earlier than JPEG (measured)
PROBES: Final = 3  # pictures of each of two sizes by which the link is measured
NOISE: Final = 0.003  # [s] by which times differ whatever the way carries
PROBE_EDGE: Final = 16  # [pixels] of the small ones
ANSWER_TIMEOUT: Final = 1.5  # [s] after which a picture that was asked for is asked for again
WAIT_TIMEOUT: Final = 3.0  # [s] the same for one that may wait for a later tick
PATIENCE: Final = 4.0  # times what the last answer took, if that is longer
LONGEST_PATIENCE: Final = 10.0  # [s]
REST: Final = 0.4  # [s] without a picture after which a small one is followed by one as large as the window
_log = logging.getLogger(__name__)

Choice = Literal["auto", "jpeg", "h264"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What should be seen; without a camera through one of the scene, see `ViewRequest`."""

    camera: ViewCamera | None = None
    through: int = 0
    width: int
    height: int
    debug: tuple[Debug, ...] = ()
    selection: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class RemotePicture:
    """A picture that came."""

    frame: ViewFrame  # what it shows, and when
    pixels: NDArray[np.uint8]  # (H, W, 4) RGBA, the upper row first
    size: int  # [bytes] of the message's picture
    asked_at: float | None = None  # [s] when what it shows was wanted first, if it is the first picture of that


class RemoteView:
    """Keeps the newest picture of what is wanted. `on_picture` is called with each."""

    def __init__(
        self,
        session: Session,
        *,
        choice: Choice = "auto",
        bit_rate: float = 0.0,
        name: str = "",
        adapts: bool = False,
        round_trip: Callable[[], float | None] = lambda: None,
        on_picture: Callable[[RemotePicture], None] = lambda picture: None,
    ) -> None:
        """`bit_rate` [bit/s] that H.264 may take, 0 for any; `name` of the view, by default the session's node's. With `adapts`
        pictures become smaller than wanted, and cheaper, where they would take long beyond the `round_trip` [s] of a message.
        """
        self._session = session
        self._choice = choice
        self._bit_rate = bit_rate
        self._on_picture = on_picture
        self._name = name or session.node.id
        self._decoder = ViewDecoder()
        self._link = LinkMeasure() if choice == "auto" else None
        self._size = PictureSize() if adapts else None
        self._round_trip = round_trip
        self._wanted: Wanted | None = None
        self._wanted_at = 0.0  # [s] since when
        self._asks_rest = False  # the request under way asks for a picture as large as the window, to rest on
        self._is_resting = False  # such a picture is shown, until there is something else to see
        self._shown_whole = True  # the newest picture is as large as the window
        self._shown_at = 0.0  # [s]
        self._asked: Wanted | None = None  # of the request under way
        self._shown: Wanted | None = None  # of the newest picture
        self._shown_tick = -1
        self._asked_at = 0.0
        self._patience = 0.0  # [s] for an answer, by how long the last one took
        self._sequence = 0
        self._is_waiting = False
        self._needs_keyframe = True
        self._turned_slow = False  # pictures had to become smaller: the way carries less than it did
        self._is_probing = False  # the request under way measures the link with a small picture
        self._lost: Node | None = None  # the render node that went while a picture of it was under way
        self.renderer: Node | None = None
        session.subscribe(topics.VIEW_FRAME, self._arrived, key=self._name)
        session.on_nodes(self._nodes_changed)
        self._choose_renderer()

    @property
    def encoding(self) -> Encoding:
        """What is asked for now."""
        if self._choice != "auto":
            return self._choice
        is_slow = self._link is not None and (self._link.is_slow or self._turned_slow)
        return "h264" if is_slow else "jpeg"

    @property
    def scale(self) -> float:
        """Of a window's edges that pictures have now, where they follow what the way carries; else 1."""
        return self._size.scale if self._size is not None else 1.0

    @property
    def link_rate(self) -> float:
        """[bit/s] that the way carries, as measured; infinite for one that is too fast for that, 0 before it is known."""
        return self._link.rate if self._link is not None and self._link.is_done else 0.0

    def want(self, wanted: Wanted) -> None:
        """Says what should be seen from now on; call it again and again, for it asks anew what was lost."""
        if wanted != self._wanted:
            self._wanted, self._wanted_at = wanted, time.monotonic()
        self._ask_if_useful()

    def _ask_if_useful(self) -> None:
        if self.renderer is None or self._wanted is None:
            return
        now = time.monotonic()
        late = now - self._asked_at > max(WAIT_TIMEOUT if self._is_waiting else ANSWER_TIMEOUT, self._patience)
        rests = not self._shown_whole and self._wanted == self._shown and now - self._shown_at > REST
        if (
            self._asked is not None
            and not late
            and (not self._is_waiting or (self._wanted == self._asked and not rests))
        ):
            return
        if self._asked is not None and late and not self._is_waiting:
            self._missed()
        wanted = self._wanted
        self._is_probing = self._link is not None and self._link.wants_small
        measures = self._link is not None and not self._link.is_done
        is_seen = wanted == self._shown and not measures and not self._needs_keyframe and not rests
        self._asks_rest, is_large = rests, rests or (self._is_resting and is_seen)
        width, height = self._asked_size(wanted, is_large=is_large)
        self._sequence += 1
        self._asked, self._asked_at, self._is_waiting = wanted, now, is_seen
        request = ViewRequest(
            view=self._name,
            sequence=self._sequence,
            camera=wanted.camera,
            through=wanted.through,
            width=width,
            height=height,
            selection=wanted.selection,
            grid=False,
            debug=wanted.debug,
            encoding=self.encoding,
            bit_rate=self._asked_bit_rate(),
            keyframe=self._needs_keyframe and self.encoding == "h264",
            newer_than_tick=self._shown_tick if is_seen else -1,
        )
        self._session.publish(topics.VIEW_REQUEST, request, key=self.renderer.id)

    def _asked_size(self, wanted: Wanted, *, is_large: bool) -> tuple[int, int]:
        if self._is_probing:
            return PROBE_EDGE, PROBE_EDGE
        if self._size is None or is_large:
            return wanted.width, wanted.height
        return self._size.size(wanted.width, wanted.height)

    def _asked_bit_rate(self) -> float:
        found = self._size.bit_rate if self._size is not None else 0.0
        return min(found, self._bit_rate) if found and self._bit_rate else found or self._bit_rate

    def _learn(self, frame: ViewFrame, elapsed: float) -> None:
        """What a picture that was asked for `elapsed` [s] ago tells of the way."""
        way, size = elapsed - frame.answer_time * 1e-3, len(frame.jpeg) or len(frame.h264)
        if self._link is not None and not self._link.is_done:
            self._link.note(self._is_probing, way, size)
            if self._link.is_done:
                _log.info(
                    "the way to the render node carries %s: pictures come as %s",
                    _rate_text(self._link.rate),
                    self.encoding,
                )
        elif self._size is not None:
            scale = self.scale
            is_meant = not (self._asks_rest or self._is_resting)
            self._size.note(time.monotonic(), way, size, round_trip=self._round_trip(), is_meant=is_meant)
            self._turned_slow |= self.scale < 1.0
            if self.scale != scale:
                _log.info("pictures come at %.0f %% of the window's size, as %s", self.scale * 100, self.encoding)

    def _missed(self) -> None:
        """A picture that was asked for has not come: one that takes longer than a silent way is waited for never would."""
        if self._size is None:
            return
        scale = self.scale
        self._size.missed()
        self._turned_slow |= self.scale < 1.0
        if self.scale != scale:
            _log.info("pictures do not come: they are asked for at %.0f %% of the window's size", self.scale * 100)

    def _arrived(self, frame: ViewFrame, _: str) -> None:
        if frame.sequence != self._sequence:
            # One that was overtaken: a stream goes on with it all the same, and it is newer than what is seen.
            picture = self._decoded(frame) if frame.width > PROBE_EDGE else None
            if picture is not None:
                self._on_picture(picture)
            return
        elapsed = self._session.arrival.last - self._asked_at  # what it waited here is not the way's
        asked, self._asked = self._asked, None
        self._patience = min(PATIENCE * elapsed, LONGEST_PATIENCE)
        self._learn(frame, elapsed)
        picture = None if self._is_probing else self._decoded(frame)
        if picture is not None:
            if asked is not None and asked == self._wanted and asked != self._shown:
                picture = replace(picture, asked_at=self._wanted_at)
            self._shown, self._shown_tick, self._shown_at = asked, frame.tick, time.monotonic()
            self._is_resting = self._asks_rest
            self._shown_whole = asked is None or (frame.width, frame.height) == (asked.width, asked.height)
            self._on_picture(picture)
        self._ask_if_useful()

    def _decoded(self, frame: ViewFrame) -> RemotePicture | None:
        try:
            if not frame.h264:
                return RemotePicture(frame, simplejpeg.decode_jpeg(frame.jpeg, colorspace="RGBA"), len(frame.jpeg))
            coded = CodedPicture(frame.h264, frame.number, frame.keyframe)
            pixels = self._decoder.decode(coded, frame.width, frame.height)
        except ValueError as error:
            _log.warning("refused a picture from a render node: %s", error)
            pixels = None
        self._needs_keyframe = pixels is None
        return None if pixels is None else RemotePicture(frame, pixels, len(frame.h264))

    def _nodes_changed(self, node: Node, alive: bool) -> None:
        if node.kind == "render":
            self._choose_renderer()

    def _choose_renderer(self) -> None:
        """The newest render node; the one in use stays while it lives."""
        nodes = self._session.nodes_of("render")
        if self.renderer in nodes and self.renderer is not None:
            return
        if self.renderer is not None and self._asked is not None and not self._is_waiting:
            self._lost = self.renderer
        self.renderer = nodes[-1] if nodes else None
        if self.renderer is not None and self.renderer == self._lost:  # it never went: it was the way
            self._missed()
        self._lost = self._lost if self.renderer is None else None
        self._asked, self._shown, self._needs_keyframe = None, None, True
        self._ask_if_useful()


class LinkMeasure:
    """How much the way carries, by the times that small and large pictures take: what both take is not the way's."""

    def __init__(self) -> None:
        self._small: list[tuple[float, int]] = []  # [s] on the way, [bytes]
        self._large: list[tuple[float, int]] = []
        self.rate = 0.0  # [bit/s]

    @property
    def is_done(self) -> bool:
        """Whether enough was measured."""
        return len(self._small) >= PROBES and len(self._large) >= PROBES

    @property
    def wants_small(self) -> bool:
        """Whether the next picture to be measured is a small one."""
        return len(self._small) < PROBES and len(self._small) <= len(self._large)

    @property
    def is_slow(self) -> bool:
        """Whether it carries less than SLOW_LINK; not before that is known."""
        return self.is_done and self.rate < SLOW_LINK

    def note(self, is_small: bool, elapsed: float, size: int) -> None:
        """Takes the time [s] that question and answer were on the way, of a picture of `size` bytes."""
        (self._small if is_small else self._large).append((elapsed, size))
        if self.is_done:
            # The quickest of each: whatever else was going on only ever adds.
            (least, few), (longer, many) = min(self._small), min(self._large)
            is_measured = many > few and longer - least > NOISE
            self.rate = (many - few) * 8.0 / (longer - least) if is_measured else float("inf")


def _rate_text(rate: float) -> str:
    return f"{rate * 1e-6:.0f} Mbit/s" if rate < 1e10 else "more than can be measured"

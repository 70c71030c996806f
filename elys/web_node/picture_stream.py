"""Pictures of one browser's view: asked of a render node one at a time, handed on, and the next when there is room for it.

    Look ──> want ──> VIEW_REQUEST ──> render node ──> VIEW_FRAME ──> on_picture ──> browser
                ^                                                                       │
                └───────────── room again <── Shown ────────────────────────────────────┘

At most `ON_THE_WAY` pictures are between the render node and the browser's eye. So a slow browser, or one at the end of a slow
way, gets fewer of them, each as new as can be, and what the render node draws for others is not touched by it.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable
from typing import Final

from elys.bus import topics
from elys.bus.messages.views import FRAMED, ViewFrame, ViewRequest
from elys.bus.session import Node, Session
from elys.web_node.requests import Look

ON_THE_WAY: Final = 2  # pictures: one is on its way while the one before is being shown
ANSWER_TIMEOUT: Final = 1.5  # [s] after which a picture that was asked for is asked for again
WAIT_TIMEOUT: Final = 3.0  # [s] the same for one that may wait for a later tick
LOST_AFTER: Final = 5.0  # [s] after which a picture that was not shown no longer takes a place
MOST_PIXELS: Final = 2560 * 1600


class PictureStream:
    """One browser's view. `tend` must be called now and then, for what was lost is asked for anew."""

    def __init__(
        self,
        session: Session,
        *,
        name: str,
        on_picture: Callable[[ViewFrame, int, int], None],
        most_a_second: float,
        bit_rate: float = 0.0,
    ) -> None:
        """`on_picture` hears of each picture: the frame, its number, and that of the Look that it shows (0: of none any more).

        `bit_rate` [bit/s] bounds H.264.
        """
        self._session = session
        self._name = name
        self._on_picture = on_picture
        self._interval = 1.0 / most_a_second
        self._bit_rate = bit_rate
        self._wanted: Look | None = None
        self._asked: Look | None = None  # of the request under way
        self._answered: Look | None = None  # of the last request that was answered
        self._tick = -1  # of the newest picture
        self._asked_at = -math.inf
        self._sequence = time.time_ns() // 1_000_000  # beyond all of who had this name before
        self._is_waiting = False  # the request under way may take until the next tick
        self._needs_keyframe = True
        self._last_number = 0  # of the stream
        self._on_the_way: dict[int, float] = {}  # pictures by number, and when they left
        self._picture_count = 0
        self._later: asyncio.TimerHandle | None = None
        self.renderer: Node | None = None
        self._choose_renderer()
        self._close = session.subscribe(topics.VIEW_FRAME, self._arrived, key=name)

    def want(self, look: Look) -> None:
        """What is to be seen from now on."""
        if self._wanted is not None and look.encoding != self._wanted.encoding:
            self._needs_keyframe = True
        self._wanted = look
        self._ask_if_useful()

    def shown(self, picture: int, *, lost: bool) -> None:
        """The browser has shown a picture, or could not."""
        self._on_the_way.pop(picture, None)
        self._needs_keyframe |= lost
        self._ask_if_useful()

    def tend(self) -> None:
        """Asks anew for what was lost."""
        before = time.monotonic() - LOST_AFTER
        self._on_the_way = {picture: at for picture, at in self._on_the_way.items() if at > before}
        self._choose_renderer()
        self._ask_if_useful()

    def refresh(self) -> None:
        """Another run of the host: nothing that was seen counts."""
        self._answered, self._asked, self._is_waiting, self._tick = None, None, False, -1
        self._ask_if_useful()

    def close(self) -> None:
        """Asks for nothing more."""
        self._wanted = None
        self._close()
        if self._later is not None:
            self._later.cancel()

    def _ask_if_useful(self) -> None:
        look, now = self._wanted, time.monotonic()
        if self.renderer is None or look is None or not look.is_seen or len(self._on_the_way) >= ON_THE_WAY:
            return
        is_late = now - self._asked_at > (WAIT_TIMEOUT if self._is_waiting else ANSWER_TIMEOUT)
        overtakes = self._is_waiting and look != self._asked
        if self._asked is not None and not is_late and not overtakes:
            return
        left = self._asked_at + self._interval - now
        if left > 0.0:
            if self._later is None:
                self._later = asyncio.get_running_loop().call_later(left, self._ask_later)
            return
        self._ask(look, now)

    def _ask_later(self) -> None:
        self._later = None
        self._ask_if_useful()

    def _ask(self, look: Look, now: float) -> None:
        assert self.renderer is not None
        needs_keyframe = self._needs_keyframe and look.encoding == "h264"
        is_seen = look == self._answered and not needs_keyframe
        self._sequence += 1
        self._asked, self._asked_at, self._is_waiting = look, now, is_seen
        shrink = min(1.0, math.sqrt(MOST_PIXELS / (look.width * look.height)))
        request = ViewRequest(
            view=self._name,
            sequence=self._sequence,
            camera=look.camera,
            through=FRAMED if look.framed else 0,
            width=max(int(look.width * shrink), 1),
            height=max(int(look.height * shrink), 1),
            selection=look.selection,
            grid=False,
            encoding=look.encoding,
            bit_rate=self._bit_rate,
            keyframe=needs_keyframe,
            newer_than_tick=self._tick if is_seen else -1,
        )
        self._session.publish(topics.VIEW_REQUEST, request, key=self.renderer.id)

    def _arrived(self, frame: ViewFrame, _: str) -> None:
        look = self._asked or self._answered
        if frame.sequence == self._sequence:
            self._answered, self._asked, self._tick = self._asked, None, frame.tick
        if look is None or not self._continues(frame):
            self._ask_if_useful()
            return
        self._picture_count += 1
        self._on_the_way[self._picture_count] = time.monotonic()
        number = (
            look.number if frame.sequence == self._sequence else 0
        )  # one that was overtaken shows what was wanted before
        self._on_picture(frame, self._picture_count, number)
        self._ask_if_useful()

    def _continues(self, frame: ViewFrame) -> bool:
        """Whether a browser that has all pictures before can show this one."""
        if not frame.h264:
            return bool(frame.jpeg)
        if frame.keyframe or frame.number == self._last_number + 1:
            self._needs_keyframe &= not frame.keyframe
            self._last_number = frame.number
            return True
        self._needs_keyframe, self._answered = True, None
        return False

    def _choose_renderer(self) -> None:
        """The newest render node; the one in use stays while it lives."""
        nodes = self._session.nodes_of("render")
        if self.renderer in nodes:
            return
        self.renderer = nodes[-1] if nodes else None
        self._asked, self._answered, self._is_waiting, self._needs_keyframe = None, None, False, True

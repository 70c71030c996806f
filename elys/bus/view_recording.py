"""Views in a recording: asks a render node for pictures while a session is recorded, and keeps those that come.

The simulation knows nothing of it: a render node that is too slow loses pictures, and nobody waits for them.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from elys.bus import topics
from elys.bus.compressed_video import video_body, video_channel
from elys.bus.messages.views import ViewFrame, ViewRequest
from elys.bus.session import Session

ANSWER_TIMEOUT: Final = 3.0  # [s] after which a picture is asked for again
KEYFRAME_TIME: Final = 2.0  # [s] between pictures that can be seen by themselves, so that viewers can jump
_log = logging.getLogger(__name__)

Keep = Callable[[str, bytes, int], None]  # channel, body, wall clock [ns]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedView:
    """What is to be kept: through which entity's camera, under which name, how large and how often."""

    name: str
    entity: int
    width: int = 1280
    height: int = 720
    fps: float = 30.0

    @property
    def channel(self) -> str:
        """Where its pictures are in the recording."""
        return video_channel(self.name)


class ViewRecording:
    """One view of a session that is being recorded. `run` asks until it is cancelled."""

    def __init__(self, session: Session, view: RecordedView, keep: Keep) -> None:
        self._session = session
        self._view = view
        self._keep = keep
        self._key = f"{session.node.id}-{secrets.token_hex(3)}"
        self._sequence = 0
        self._tick = -1  # of the last picture
        self._number = 0  # of the last picture in its stream
        self._keyframe_at = -KEYFRAME_TIME  # [s]
        self._answered = asyncio.Event()
        self.picture_count = 0
        self._close = session.subscribe(topics.VIEW_FRAME, self._arrived, key=self._key)

    async def run(self) -> None:
        """Asks for a picture of each later tick, as often as the view wants them."""
        try:
            while True:
                start = time.monotonic()
                self._ask()
                try:
                    async with asyncio.timeout(ANSWER_TIMEOUT):
                        await self._answered.wait()
                except TimeoutError:
                    continue  # paused, or the render node is gone: another may be there now
                await asyncio.sleep(max(0.0, start + 1.0 / self._view.fps - time.monotonic()))
        finally:
            self._close()

    def _ask(self) -> None:
        nodes = self._session.nodes_of("render")
        if not nodes:
            return
        self._answered.clear()
        self._sequence += 1
        request = ViewRequest(
            view=self._key,
            sequence=self._sequence,
            through=self._view.entity,
            width=self._view.width,
            height=self._view.height,
            grid=False,
            encoding="h264",
            keyframe=self._number == 0 or time.monotonic() - self._keyframe_at >= KEYFRAME_TIME,
            newer_than_tick=self._tick,
        )
        self._session.publish(topics.VIEW_REQUEST, request, key=nodes[-1].id)

    def _arrived(self, frame: ViewFrame, _: str) -> None:
        if frame.keyframe:
            self._keyframe_at = time.monotonic()
        elif frame.number != self._number + 1:
            self._number = 0  # what is missing cannot be mended: from a keyframe on
            self._answered.set()
            return
        self._number, self._tick = frame.number, max(frame.tick, 0)
        self.picture_count += 1
        now = time.time_ns()
        shown = frame.state_published_at or now
        self._keep(self._view.channel, video_body(frame.h264, time_ns=shown, frame_id=self._view.name), now)
        self._answered.set()

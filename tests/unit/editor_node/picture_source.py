"""A render node of two colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import simplejpeg

from elys.bus import topics
from elys.bus.messages.views import PickReply, PickRequest, ViewFrame, ViewRequest
from elys.bus.session import Session


class PictureSource:
    """A render node that draws red above and blue below, and sees the same entity everywhere."""

    def __init__(self, session: Session, *, entity: int, is_sharing: bool) -> None:
        self.entity = entity
        self.requests: list[ViewRequest] = []
        self.picks: list[PickRequest] = []
        self.hit = (0.0, 0.0, 0.0)
        self.sent: list[int] = []
        self.tick = 0
        self.state_published_at = 0
        self._is_sharing = is_sharing
        self._session = session
        session.subscribe(topics.VIEW_REQUEST, self._draw, key=session.node.id)
        session.serve(topics.PICK, self._pick, key=session.node.id)

    async def close(self) -> None:
        await self._session.close()

    def _draw(self, request: ViewRequest, _: str) -> None:
        self.requests.append(request)
        if request.newer_than_tick >= 0:
            return  # nothing moves here
        rows = np.zeros((request.height, request.width, 4), np.uint8)
        rows[: request.height // 2] = (200, 60, 30, 0)
        rows[request.height // 2 :] = (20, 60, 200, 0)
        slot, jpeg = -1, b""
        if self._is_sharing and request.ring is not None:
            slot = request.sequence % request.ring.slot_count
            with Path(f"/proc/{request.ring.process}/fd/{request.ring.descriptor}").open("r+b", buffering=0) as memory:
                memory.seek(slot * request.ring.slot_size)
                memory.write(rows[::-1].tobytes())
        else:
            jpeg = simplejpeg.encode_jpeg(rows, colorspace="RGBX", quality=95)
        self.sent.append(request.sequence)
        self._session.publish(
            topics.VIEW_FRAME,
            ViewFrame(
                view=request.view,
                sequence=request.sequence,
                tick=self.tick,
                state_published_at=self.state_published_at,
                camera=request.camera,
                width=request.width,
                height=request.height,
                slot=slot,
                jpeg=jpeg,
            ),
            key=request.view,
        )

    async def _pick(self, request: PickRequest, _: str) -> PickReply:
        self.picks.append(request)
        return PickReply(entity=self.entity, position=self.hit)

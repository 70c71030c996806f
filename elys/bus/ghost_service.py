"""A recorded run served beside a session, to be seen there as a ghost.

    elys play F --ghost G     the player serves it in the session that it hosts
    elys view --ghost G       a node that has joined serves it, be the session a replay or a simulation that runs
    the editor                starts such a node

It knows nothing of the session's time: who draws asks for the part that he needs, so a ghost that nobody looks at costs nothing.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from pathlib import Path
from typing import Final

import msgspec
import numpy as np

from elys.bus import topics
from elys.bus.access.roles import signed_id, user_of
from elys.bus.messages.ghosts import (
    GHOST_COLORS,
    Color,
    Ghost,
    GhostChange,
    GhostPart,
    GhostPartRequest,
    GhostSceneRequest,
    Span,
)
from elys.bus.messages.scene import Snapshot
from elys.bus.recording import Recording
from elys.bus.session import Session, node_id
from elys.common.assets.store import is_reference
from elys.common.errors import RecordingError, RequestError

TOLD_EVERY: Final = 0.5  # [s]
MOST_FRAMES: Final = 64  # in one answer
MOST_BYTES: Final = 8 << 20  # likewise, unless two frames are longer
MOST_GHOSTS: Final = 16  # of one session, in what draws them
ALIGNED_NOW: Final = math.nan  # as an offset: the recording begins when the ghost does


class GhostServer:
    """Serves one recording in a session, until `run` is cancelled or somebody has it removed."""

    def __init__(
        self,
        recording: Recording,
        session: Session,
        *,
        color: Color = GHOST_COLORS[0],
        title: str = "",
        offset: float = 0.0,
        waits: tuple[Span, ...] = (),
        leaves_out: tuple[Span, ...] = (),
    ) -> None:
        """`offset` [s] is what its time is ahead of the session's; ALIGNED_NOW lets it begin with the next state heard.

        `waits` and `leaves_out`: as in `Ghost`.
        """
        self._recording, self._session = recording, session
        self._removed = asyncio.Event()
        self._waits = math.isnan(offset)
        path = recording.path.absolute()
        self.told = Ghost(
            ghost=signed_id(node_id("ghost"), user_of(session.node.id)),  # so that only its server can answer for it
            title=title or path.stem,
            file=str(path),
            color=checked_color(color),
            offset=0.0 if self._waits else offset,
            waits=waits,
            leaves_out=leaves_out,
            start_time=float(recording.time[0]),
            end_time=float(recording.time[-1]),
        )

    async def run(self) -> None:
        """Answers, and tells that it is there."""
        session, key = self._session, self.told.ghost
        closers = [
            session.serve(topics.GHOST_PART, self._give_part, key=key),
            session.serve(topics.GHOST_SCENE, self._give_scene, key=key),
            session.serve(topics.GHOST_ASSET, self._give_asset, key=key),
            session.serve(topics.GHOST_CHANGE, self._change, key=key),
        ]
        try:
            if self._waits:
                await self._align()
            while not self._removed.is_set():
                self._tell()
                try:
                    async with asyncio.timeout(TOLD_EVERY):
                        await self._removed.wait()
                except TimeoutError:
                    pass
        finally:
            self.told = msgspec.structs.replace(self.told, is_gone=True)
            self._tell()
            for close in closers:
                close()

    def wait(self, waits: tuple[Span, ...]) -> None:
        """When it stands, from now on."""
        self.told = msgspec.structs.replace(self.told, waits=waits)
        self._tell()

    async def _align(self) -> None:
        """Lets the recording begin at what time it is in the session."""
        heard: asyncio.Future[float] = asyncio.get_running_loop().create_future()
        close = self._session.subscribe(
            topics.STATUS, lambda status, _: None if heard.done() else heard.set_result(status.simulation_time)
        )
        try:
            now = await heard
        finally:
            close()
        self.told = msgspec.structs.replace(self.told, offset=self.told.start_time - now)

    def _tell(self) -> None:
        self._session.publish(topics.GHOST, self.told, key=self.told.ghost)

    async def _give_part(self, request: GhostPartRequest, _: str) -> GhostPart:
        positions = positions_between(self._recording, request)
        frames: list[bytes] = []
        size = 0
        for position in positions:
            body = self._recording.frame_body(position)
            size += len(body)
            if len(frames) >= 2 and size > MOST_BYTES:
                break
            frames.append(body)
            if len(frames) % 8 == 0:
                await asyncio.sleep(0)  # who plays in the same process has his turn
        is_end = positions[len(frames) - 1] == len(self._recording) - 1
        return GhostPart(frames=tuple(frames), is_end=is_end)

    async def _give_scene(self, request: GhostSceneRequest, _: str) -> Snapshot:
        _check_time(request.time)
        return self._recording.mirror_at(self._recording.position_at(request.time)).to_snapshot()

    async def _give_asset(self, request: bytes, _: str) -> bytes:
        reference = request.decode("ascii", errors="replace")
        if not is_reference(reference):
            raise RequestError("the reference of an asset is asked for, and what came is none")
        return self._recording.asset(reference)

    async def _change(self, request: GhostChange, _: str) -> Ghost:
        color = self.told.color if request.color is None else checked_color(request.color)
        offset = self.told.offset if request.offset is None else request.offset
        _check_time(offset)
        self.told = msgspec.structs.replace(self.told, color=color, offset=offset)
        if request.is_removed:
            self._removed.set()
        else:
            self._tell()
        return self.told


def positions_between(recording: Recording, request: GhostPartRequest) -> list[int]:
    """The frames that answer a request, one at least; of several at one time the last. Raises RequestError."""
    for time in (request.first, request.last, request.step):
        _check_time(time)
    times = recording.time
    first = max(int(np.searchsorted(times, request.first, side="right")) - 1, 0)
    found = [first]
    while len(found) < MOST_FRAMES and times[found[-1]] < request.last and found[-1] + 1 < len(times):
        wanted = max(float(times[found[-1]]) + request.step, float(np.nextafter(times[found[-1]], np.inf)))
        following = min(int(np.searchsorted(times, wanted, side="left")), len(times) - 1)
        found.append(int(np.searchsorted(times, times[following], side="right")) - 1)
    return found


def opened_ghosts(files: list[Path]) -> list[Recording]:
    """Recordings to be shown as ghosts. Raises RecordingError for one that is none, or for too many."""
    if len(files) > MOST_GHOSTS:
        raise RecordingError(f"{len(files)} ghosts are too many: a session shows {MOST_GHOSTS} at most")
    with contextlib.ExitStack() as stack:
        opened = [stack.enter_context(Recording(file, checked=True)) for file in files]
        stack.pop_all()
        return opened


def checked_color(color: Color) -> Color:
    """The same colour; RequestError for none."""
    if not all(0 <= channel <= 255 for channel in color):
        raise RequestError(f"{color} is no colour: red, green and blue go from 0 to 255")
    return color


def _check_time(time: float) -> None:
    if not math.isfinite(time):
        raise RequestError(f"{time} is no time")

"""Where a ghost's bodies are at any time: what draws it asks here, be the recording at hand or served over the bus."""

from __future__ import annotations

from bisect import bisect_right
from typing import Protocol

import numpy as np

from elys.bus.messages.ghosts import GHOST_COLORS, Color
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.bus.recording import Recording
from elys.common.errors import MessageError

Pair = tuple[StateFrame, StateFrame]


class GhostTrack(Protocol):
    """A recorded run that is seen beside another one."""

    @property
    def title(self) -> str:
        """What people call it."""

    @property
    def color(self) -> Color:
        """What it is tinted with."""

    def own_time(self, at: float) -> float:
        """Which moment of it [s] is seen at a time [s] of who is accompanied."""

    @property
    def mirror(self) -> SceneMirror:
        """Its scene, about as it is at the time that was asked for last; empty before that is known."""

    def around(self, time: float) -> Pair | None:
        """The frames at or before and at or after a time [s] of who is accompanied: the same one twice where one is of just this
        time, or none comes later. None: the run has not begun by then, or it is not known yet.
        """

    def fetch(self, reference: str) -> bytes:
        """The content of an asset that its scene names; on any thread. Raises ElysError."""


class RecordedTrack:
    """A ghost whose recording is at hand, as for films."""

    def __init__(
        self, recording: Recording, *, color: Color = GHOST_COLORS[0], title: str = "", offset: float = 0.0
    ) -> None:
        self.recording = recording
        self.title = title or recording.path.stem
        self.color = color
        self.offset = offset
        self.mirror = recording.mirror_at(0)
        self._known: dict[int, StateFrame] = {}

    def own_time(self, at: float) -> float:
        """See `GhostTrack`."""
        return at + self.offset

    def around(self, time: float) -> Pair | None:
        """See `GhostTrack`."""
        recording, own = self.recording, self.own_time(time)
        before = int(np.searchsorted(recording.time, own + 1e-9, side="right")) - 1
        if before < 0:
            return None
        is_last = before + 1 >= len(recording) or abs(float(recording.time[before]) - own) <= 1e-9
        after = before if is_last else recording.last_of_tick(before + 1)
        self._follow_scene(before)
        pair = (self._frame(before), self._frame(after))
        self._known = {place: frame for place, frame in self._known.items() if place in (before, after)}
        return pair

    def fetch(self, reference: str) -> bytes:
        """See `GhostTrack`."""
        return self.recording.asset(reference)

    def _follow_scene(self, position: int) -> None:
        if self.recording.needs_rebuilding(self.mirror, position):
            self.mirror = self.recording.mirror_at(position)
        else:
            self.recording.advance(self.mirror, position)

    def _frame(self, position: int) -> StateFrame:
        if position not in self._known:
            self._known[position] = self.recording.frame(position)
        return self._known[position]


class FrameRun:
    """Frames of a ghost one behind the other."""

    def __init__(self, frames: list[StateFrame], *, is_end: bool, step: float = 0.0) -> None:
        """`step` [s] by which they are apart at least. Raises MessageError for none, or for frames that are in no order."""
        self.frames = frames
        self.step = step
        self.is_end = is_end
        self.times = [frame.simulation_time for frame in frames]
        if not frames or any(later <= earlier for earlier, later in zip(self.times, self.times[1:], strict=False)):
            raise MessageError("the frames of a ghost are in no order of time")

    @property
    def last(self) -> float:
        """[s] up to which it tells where things are."""
        return np.inf if self.is_end else self.times[-1]

    def holds(self, time: float) -> bool:
        """Whether it tells where things are at a time [s]."""
        return self.times[0] <= time + 1e-9 and time <= self.last + 1e-9

    def around(self, time: float) -> Pair:
        """The frames about a time [s] that it holds."""
        before = max(bisect_right(self.times, time + 1e-9) - 1, 0)
        is_there = abs(self.times[before] - time) <= 1e-9 or before + 1 == len(self.times)
        return self.frames[before], self.frames[before if is_there else before + 1]

"""Ghosts: recorded runs that are shown beside a session, each at the session's own time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import msgspec

Color = tuple[int, int, int]  # sRGB, 0 to 255
# Of ghosts in the order in which they come: apart from one another, also for who cannot tell red from green.
GHOST_COLORS: Final[tuple[Color, ...]] = (
    (86, 180, 233),
    (240, 160, 40),
    (200, 120, 220),
    (20, 185, 140),
    (235, 220, 70),
    (225, 95, 75),
)


Span = tuple[float, float]  # [s] when it begins, and how long it is
UNTIL_TOLD: Final = 1e9  # [s] as the length of a wait whose end nobody knows yet


def own_time(at: float, offset: float, waits: Sequence[Span] = (), leaves_out: Sequence[Span] = ()) -> float:
    """The moment [s] of a ghost at a time [s] of the session; spans are in the order of time."""
    own = at + offset - sum(min(max(at - start, 0.0), length) for start, length in waits)
    for start, length in leaves_out:
        own += length if own > start else 0.0
    return own


class Ghost(msgspec.Struct, frozen=True, kw_only=True):
    """Tells that a recorded run can be seen beside the session: at every change and twice a second."""

    ghost: str  # its id, the key of all that is asked of it
    title: str
    file: str  # on the machine of who serves it
    color: Color
    offset: float = 0.0  # [s] what is seen of it is of the session's time and so much
    start_time: float  # [s] of its own time
    end_time: float
    is_gone: bool = False  # it was taken away
    waits: tuple[Span, ...] = ()  # of the session's time, in which it stands: its session was held then
    leaves_out: tuple[Span, ...] = ()  # of its own time, which it passes over: its own session was held then

    def own_time(self, at: float) -> float:
        """Which moment of it [s] is seen at a time [s] of the session."""
        return own_time(at, self.offset, self.waits, self.leaves_out)


class GhostPartRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Asks a ghost where its bodies are from `first` to `last` [s] of its own time, in frames at least `step` [s] apart."""

    first: float
    last: float
    step: float = 0.0


class GhostPart(msgspec.Struct, frozen=True, kw_only=True):
    """State frames as they were recorded, in the order of time: from the last one at or before `first` on, up to the first one
    at or after `last`, or fewer, so that it is no longer than a message should be.
    """

    frames: tuple[bytes, ...]
    is_end: bool = False  # nothing comes after the last one


class GhostSceneRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Asks a ghost for its scene as it is at `time` [s] of its own."""

    time: float


class GhostChange(msgspec.Struct, frozen=True, kw_only=True):
    """Asks a ghost to be another colour, to run at another time, or to go away; answered with what it is then."""

    color: Color | None = None
    offset: float | None = None
    is_removed: bool = False

"""Ghosts: recorded runs that are shown beside a session, each at the session's own time."""

from __future__ import annotations

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

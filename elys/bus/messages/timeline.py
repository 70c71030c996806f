"""What stands out on a timeline: collisions, triggers, errors, edits."""

from __future__ import annotations

from typing import Literal

import msgspec

MarkerKind = Literal["collision", "trigger", "error", "edit", "event"]


class Marker(msgspec.Struct, frozen=True, kw_only=True):
    """Something that happened at a tick."""

    tick: int
    time: float  # [s] of simulation
    kind: MarkerKind
    text: str  # what an error says or an edit did; of collisions and triggers nothing, the entities say it
    entity: int = 0
    other: int = 0
    strength: float = 0.0  # impulse of a collision [N s]


class MarkersRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Asks the host for markers of what can be gone to, at most so many: of collisions the strongest.

    Who asks again says what it has: from which tick on it wants them, and of which line (see `Markers`).
    """

    limit: int = 2000
    from_tick: int = 0
    line: int = 0


class Markers(msgspec.Struct, frozen=True, kw_only=True):
    """Markers in the order of their ticks; `left_out` says how many more there were.

    Every fork begins another line of history. Where it is not the one that was asked for, all markers are told anew.
    """

    markers: tuple[Marker, ...]
    line: int = 1
    left_out: int = 0

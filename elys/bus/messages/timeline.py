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
    """Asks the host for markers of all that can be gone to, at most so many: of collisions the strongest."""

    limit: int = 2000


class Markers(msgspec.Struct, frozen=True, kw_only=True):
    """Markers in the order of their ticks; `left_out` says how many more there were."""

    markers: tuple[Marker, ...]
    left_out: int = 0

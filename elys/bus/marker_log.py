"""Markers of a timeline, gathered from what a session says: by a host as it says it, by an editor as it hears it, by a player
from a file."""

from __future__ import annotations

import heapq
from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from typing import Final

from elys.bus.edit_parts import edits_of
from elys.bus.messages.commands import CommandRecord, LoadScene
from elys.bus.messages.physics import ContactBatch
from elys.bus.messages.session import EventBatch
from elys.bus.messages.sounds import SOUND
from elys.bus.messages.timeline import Marker, Markers, MarkersRequest

MOST: Final = 4000  # markers kept; of more the weakest collisions go first
MOST_OF_A_TICK: Final = 8  # collisions, the strongest
_ERRORS: Final = ("physics", "animation", "script")
_QUIET: Final = ("playing", "paused", SOUND)  # a timeline shows them otherwise, or would show nothing else


class MarkerLog:
    """Markers by tick, each once."""

    def __init__(self) -> None:
        self._markers: list[Marker] = []
        self._ticks: list[int] = []
        self._known: set[Marker] = set()
        self.left_out = 0
        self.line = 1  # which history they are of: another after each fork
        self.version = 0  # rises when they change

    @property
    def markers(self) -> tuple[Marker, ...]:
        """All, in the order of ticks."""
        return tuple(self._markers)

    def add(self, markers: Iterable[Marker]) -> None:
        """Takes those that are not there yet."""
        for marker in markers:
            if marker in self._known:
                continue
            self._known.add(marker)
            place = bisect_right(self._ticks, marker.tick)
            self._ticks.insert(place, marker.tick)
            self._markers.insert(place, marker)
            self.version += 1
        if len(self._markers) > MOST:
            self._thin(MOST * 3 // 4)

    def forget_after(self, tick: int) -> None:
        """What comes after a tick will never have been: another future begins there."""
        self.line += 1
        self._cut(0, bisect_right(self._ticks, tick))

    def forget_before(self, tick: int) -> None:
        """What cannot be gone to any more."""
        self._cut(bisect_left(self._ticks, tick), len(self._ticks))

    def clear(self) -> None:
        """Forgets them all."""
        self._cut(0, 0)
        self.left_out = 0

    def reply(self, request: MarkersRequest) -> Markers:
        """What was asked for."""
        first = bisect_left(self._ticks, request.from_tick) if request.line == self.line else 0
        asked = self._markers[first:]
        chosen = _strongest(asked, max(request.limit, 0))
        return Markers(markers=tuple(chosen), line=self.line, left_out=self.left_out + len(asked) - len(chosen))

    def take(self, reply: Markers) -> None:
        """Follows another log: what it replied to a request for what is new since `line` and `from_tick`."""
        if reply.line != self.line:
            self._cut(0, 0)
            self.line = reply.line
        self.left_out = reply.left_out
        self.add(reply.markers)

    @property
    def last_tick(self) -> int:
        """Tick of the newest; 0 if there is none."""
        return self._ticks[-1] if self._ticks else 0

    def _cut(self, first: int, last: int) -> None:
        if last - first < len(self._markers):
            self._markers, self._ticks = self._markers[first:last], self._ticks[first:last]
            self._known = set(self._markers)
            self.version += 1

    def _thin(self, count: int) -> None:
        kept = _strongest(self._markers, count)
        self.left_out += len(self._markers) - len(kept)
        self._markers, self._ticks, self._known = kept, [marker.tick for marker in kept], set(kept)
        self.version += 1


def _strongest(markers: list[Marker], count: int) -> list[Marker]:
    if len(markers) <= count:
        return list(markers)
    places = range(len(markers))
    chosen = heapq.nlargest(count, places, key=lambda k: (markers[k].kind != "collision", markers[k].strength, k))
    return [markers[place] for place in sorted(chosen)]


def markers_of_contacts(batch: ContactBatch, time: float) -> list[Marker]:
    """The strongest collisions that a tick began, and who entered a trigger."""
    begun, entered = batch.begun, batch.entered
    found = heapq.nlargest(MOST_OF_A_TICK, range(len(begun.body_a)), key=lambda k: begun.normal_impulse[k])
    collisions = [
        Marker(
            tick=batch.tick,
            time=time,
            kind="collision",
            text="",
            entity=begun.body_a[k],
            other=begun.body_b[k],
            strength=begun.normal_impulse[k],
        )
        for k in found
    ]
    visits = [
        Marker(tick=batch.tick, time=time, kind="trigger", text="", entity=trigger, other=body)
        for trigger, body in zip(entered.trigger, entered.body, strict=True)
    ]
    return collisions + visits


def markers_of_events(batch: EventBatch, time: float) -> list[Marker]:
    """What the simulation said in a tick."""
    return [
        Marker(
            tick=batch.tick,
            time=time,
            kind="error" if event.kind in _ERRORS else "event",
            text=str(event.values.get("text", "")) or event.kind.replace("_", " "),
            entity=event.entity,
            other=event.other,
        )
        for event in batch.events
        if event.kind not in _QUIET
    ]


def markers_of_command(record: CommandRecord, time: float) -> list[Marker]:
    """An edit that was accepted."""
    if not record.accepted:
        return []
    is_scene = isinstance(record.command, LoadScene)
    edits = (record.command,) if is_scene else edits_of(record.command)
    if not edits:  # to the clock, a hand, a file
        return []
    first, more = edits[0], len(edits) - 1
    what = str(type(first).__struct_config__.tag).replace("_", " ")
    text = f"{what} {getattr(first, 'component', '')}".strip() + (f" and {more} more" if more else "")
    return [Marker(tick=record.tick, time=time, kind="edit", text=text, entity=getattr(first, "entity", 0))]

"""Markers of clips: which of them come by in a tick, and who is told."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.session import Event
from elys.common.components import AnimationMarkers, Script
from elys.common.components.animation_texts import Marker, markers_of
from elys.common.errors import ComponentError
from elys.common.ids import Entity
from elys.sim_node.animation.clip_times import MOST_PASSES, PING_PONG, Way, instants_met
from elys.sim_node.animation.voices import Voices
from elys.sim_node.ecs.columns import NO_ROW
from elys.sim_node.ecs.world import World

MOST_TOLD: Final = MOST_PASSES  # of one player in one tick


class MarkedVoice(NamedTuple):
    """A voice with markers on its clip; `player` is the entity that it belongs to."""

    voice: int
    player: int
    clip: str
    markers: tuple[Marker, ...]


class MarkerTable:
    """The markers of all voices, to be looked through at once."""

    def __init__(self, marked: Iterable[MarkedVoice]) -> None:
        self._marked = {one.voice: one for one in marked}
        rows = [(one.voice, marker.time) for one in self._marked.values() for marker in one.markers]
        self._voice = np.array([voice for voice, _ in rows], np.intp)
        self._time = np.array([time for _, time in rows])

    def __len__(self) -> int:
        return len(self._voice)

    def met(
        self,
        way: Way,
        loop: NDArray[np.uint8],
        duration: NDArray[np.float64],
        is_heard: NDArray[np.bool_],
        world: World,
    ) -> list[Event]:
        """What is told of a tick, by the order of players, and for each in the order in which it came by.

        Of several clips that a player plays the one that `is_heard` [V] counts.
        """
        told: list[Event] = []
        for voice in np.unique(self._voice[self._may_be_met(way, loop, duration) & is_heard[self._voice]]).tolist():
            one = self._marked[voice]
            times = [marker.time for marker in one.markers]
            met = instants_met(way, voice, int(loop[voice]), float(duration[voice]), times)[:MOST_TOLD]
            if met:
                listener = _listener(world, one.player)
                told += [_event(one, one.markers[number], listener) for number in met]
        return told

    def _may_be_met(self, way: Way, loop: NDArray[np.uint8], duration: NDArray[np.float64]) -> NDArray[np.bool_]:
        """[K] all that are met, and those that are a little beyond."""
        start, end = way.start[self._voice], way.end[self._voice]
        around = (way.laps[self._voice] != 0) | way.ended[self._voice]
        low, high = np.minimum(start, end), np.maximum(start, end)
        here = (self._time >= low) & (self._time <= high)
        back = 2.0 * duration[self._voice] - self._time
        turned = (loop[self._voice] == PING_PONG) & (back >= low) & (back <= high)
        moves = way.goes_on[self._voice] != 0
        return np.asarray(moves & (around | here | turned))


def marked_voices(
    world: World, voices: Voices, players: Iterable[int], tell: Callable[[int, str], None]
) -> list[MarkedVoice]:
    """The voices whose players have markers, with those of their clips by time."""
    found: dict[int, tuple[Marker, ...]] = {}
    for entity in players:
        component = world.try_get(Entity(entity), AnimationMarkers)
        try:
            found[entity] = markers_of(component.markers) if component is not None else ()
        except ComponentError as error:
            tell(entity, f"tells of nothing: {error}")
            found[entity] = ()
    marked = []
    for voice, (entity, (_, clip)) in enumerate(zip(voices.entity.tolist(), voices.keys, strict=True)):
        if found[entity] and voices.is_wanted[voice]:
            mine = sorted((one for one in found[entity] if one.clip in ("", clip)), key=lambda one: one.time)
            marked.append(MarkedVoice(voice, entity, clip, tuple(mine)))
    return marked


def _event(one: MarkedVoice, marker: Marker, listener: int) -> Event:
    values = {"clip": one.clip, "time": marker.time}
    return Event(kind=marker.name, entity=listener, other=one.player, values=values)


def _listener(world: World, player: int) -> int:
    """The player, or the nearest above it that has a script."""
    scripts, above = world.table(Script).row_of, player
    while above:
        if scripts[world.hierarchy.require(Entity(above))] != NO_ROW:
            return above
        above = int(world.hierarchy.parent_of(Entity(above)))
    return player

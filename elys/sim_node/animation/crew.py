"""The arrays by which all players of clips go on together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.components import AnimationBlend
from elys.sim_node.animation.clip_library import ClipLibrary
from elys.sim_node.animation.players import Layer, tents, wanted_by
from elys.sim_node.animation.voices import Voices
from elys.sim_node.ecs.world import World

BY_VALUE: Final = 1  # place among the choices of AnimationBlend.by


class Crew(NamedTuple):
    """The players of a world [N] and what belongs to them, voices [V] as they stand.

    Attributes:
        entities: [N]. reference: [N] s, the length that Animation.time is of: of the longest clip that is wanted.
        is_single: [N] whether one clip is wanted, and no more.
        owner: [V] which player each voice is of. duration: [V] s.
        by_value: rows of voices that a value weighs. tent: [those, 3].
        layers: rows of players that are layers over others.
    """

    entities: NDArray[np.uint32]
    reference: NDArray[np.float64]
    is_single: NDArray[np.bool_]
    owner: NDArray[np.intp]
    duration: NDArray[np.float64]
    by_value: NDArray[np.intp]
    tent: NDArray[np.float64]
    layers: NDArray[np.intp]


NOBODY: Final = Crew(
    np.zeros(0, np.uint32),
    np.zeros(0),
    np.zeros(0, np.bool_),
    np.zeros(0, np.intp),
    np.zeros(0),
    np.zeros(0, np.intp),
    np.zeros((0, 3)),
    np.zeros(0, np.intp),
)


def crew_of(
    world: World, voices: Voices, library: ClipLibrary, players: list[int], layers: Mapping[int, Layer]
) -> Crew:
    """The players, in their order, as the voices are now."""
    number = {entity: row for row, entity in enumerate(players)}
    owner = np.array([number[entity] for entity in voices.entity.tolist()], np.intp)
    duration = np.array([library.sampler(key).duration for key in voices.keys])
    reference = np.zeros(len(players))
    np.maximum.at(reference, owner[voices.is_wanted], duration[voices.is_wanted])
    by_value, tent = _valued(world, voices, library, players)
    return Crew(
        entities=np.array(players, np.uint32),
        reference=reference,
        is_single=np.bincount(owner[voices.is_wanted], minlength=len(players)) <= 1,
        owner=owner,
        duration=duration,
        by_value=by_value,
        tent=tent,
        layers=np.array([number[entity] for entity, layer in layers.items() if layer.number], np.intp),
    )


def _valued(
    world: World, voices: Voices, library: ClipLibrary, players: list[int]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """The voices that a value weighs, and their tents."""
    of_player: dict[int, list[int]] = {}
    for row, entity in enumerate(voices.entity.tolist()):
        if voices.is_wanted[row]:
            of_player.setdefault(entity, []).append(row)
    table = world.table(AnimationBlend)
    rows: list[int] = []
    found: list[tuple[float, float, float]] = []
    for entity, blend in zip(players, table.rows(np.array(players, np.uint32)).tolist(), strict=True):
        if blend >= 0 and int(table.column("by")[blend]) == BY_VALUE:
            wanted = wanted_by(world, entity, library, lambda *_: None)
            if wanted.is_by_value:
                rows += of_player.get(entity, [])
                found += tents(list(wanted.clips.values()))
    return np.array(rows, np.intp), np.array(found).reshape(-1, 3)

"""What the components say that shall be played, and the arrays by which all players go on together."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.components import Animation, AnimationBlend, AnimationLayer
from elys.common.components.animation_texts import mix_of
from elys.common.errors import ComponentError
from elys.common.ids import Entity
from elys.sim_node.animation.clip_library import ClipKey, ClipLibrary
from elys.sim_node.ecs.world import World

Tell = Callable[[int, str], None]


class Wanted(NamedTuple):
    """What an entity shall play.

    Attributes:
        clips: with the weights, together 1, or the values at which each is all there is.
    """

    clips: dict[ClipKey, float]
    is_by_value: bool


class Layer(NamedTuple):
    """Where an entity's clips go: onto `root`, `number` 0 for its own, layers over those from 1 on."""

    root: int
    number: int
    is_added: bool
    mask: str


def wanted_by(world: World, entity: int, library: ClipLibrary, tell: Tell) -> Wanted:
    """What the components of an entity say; nothing where they say nothing sound, which is told."""
    animation = world.get(Entity(entity), Animation)
    if not animation.clips:
        return Wanted({}, False)
    blend = world.try_get(Entity(entity), AnimationBlend)
    if blend is None or animation.clip or not blend.mix.strip():
        key = library.find(animation.clips, animation.clip)
        if isinstance(key, str):
            tell(entity, f"plays nothing: {key}")
            return Wanted({}, False)
        return Wanted({key: 1.0}, False)
    found: dict[ClipKey, float] = {}
    try:
        mix = mix_of(blend.mix)
    except ComponentError as error:
        tell(entity, f"plays nothing: {error}")
        return Wanted({}, False)
    for name, number in mix.items():
        key = library.find(animation.clips, name)
        if isinstance(key, str):
            tell(entity, f"leaves a clip out of its mix: {key}")
        elif blend.by == "weight" and number < 0.0:
            tell(entity, f"leaves '{name}' out of its mix: a weight must be at least 0, not {number:g}")
        else:
            found[key] = number
    if blend.by == "value":
        return Wanted(found, True)
    total = sum(found.values())
    return Wanted({key: number / total if total > 0.0 else 0.0 for key, number in found.items()}, False)


def tents(values: list[float]) -> list[tuple[float, float, float]]:
    """Of each value the nearest ones below and above: a clip fades in from the one and out towards the other.

    The lowest and the highest count beyond as well. Of equal values only the first counts.
    """
    order = sorted(set(values))
    found, seen = [], set[float]()
    for value in values:
        place = order.index(value)
        below = order[place - 1] if place else -np.inf
        above = order[place + 1] if place + 1 < len(order) else np.inf
        found.append((below, value, above) if value not in seen else (np.inf, np.inf, np.inf))
        seen.add(value)
    return found


def tent_weights(value: NDArray[np.float64], tent: NDArray[np.float64]) -> NDArray[np.float64]:
    """[V] how much there is at `value` [V] of clips with such `tents` [V, 3]; those of a mix together are 1."""
    below, at, above = tent.T
    is_low = value <= at
    width = np.where(is_low, at - below, above - at)
    away = np.abs(value - at)
    with np.errstate(invalid="ignore"):
        share = np.where(np.isfinite(width) & (width > 0.0), 1.0 - away / np.where(width > 0.0, width, 1.0), 1.0)
    return np.where(np.isfinite(at), np.clip(share, 0.0, 1.0), 0.0)


def layers_of(world: World, players: list[int], tell: Tell) -> dict[int, Layer]:
    """Where the clips of each player go; who cannot go anywhere is left out, and told of."""
    found: dict[int, Layer] = {}
    several: dict[int, list[tuple[int, int, AnimationLayer]]] = {}
    for number, entity in enumerate(players):
        layer = world.try_get(Entity(entity), AnimationLayer)
        if layer is None:
            found[entity] = Layer(entity, 0, False, "")
            continue
        root = layer.on or int(world.hierarchy.parent_of(Entity(entity)))
        if not root or root == entity or not world.is_alive(root):
            tell(entity, "lays its clips over nobody: AnimationLayer.on names no other entity, and it has no parent")
            continue
        several.setdefault(root, []).append((layer.order, number, layer))
    for root, layers in several.items():
        ordered = sorted(layers, key=lambda one: one[:2])
        for number, (_, player, layer) in enumerate(ordered, 1):
            found[players[player]] = Layer(root, number, layer.mode == "add", layer.mask)
    return found

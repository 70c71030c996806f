"""What scripts ask of the clips of an entity: to play one, to mix several, and how far it went by them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from elys.common.components import Animation, AnimationBlend
from elys.common.components.animation_texts import mix_of, mix_text
from elys.common.errors import ComponentError
from elys.common.ids import Entity
from elys.sim_node.animation.clip_library import shown
from elys.sim_node.scripts.vector import Rotation, Vector

if TYPE_CHECKING:
    from elys.sim_node.simulation import Simulation


def player_of(simulation: Simulation, entity: int) -> Entity:
    """The entity itself if it has an Animation, else the first below it that has one; LookupError if nobody has."""
    world = simulation.world
    table = world.table(Animation)
    places = world.hierarchy.subtree_places(world.hierarchy.require(Entity(entity)))
    found = places[table.row_of[places] >= 0]
    if not len(found):
        raise LookupError(f"{simulation.named(entity)} has no Animation, nor has anybody below it")
    return Entity(int(world.allocator.ids[found[0]]))


def play(simulation: Simulation, entity: int, clip: str, values: Mapping[str, Any]) -> None:
    """Has a clip played, from its beginning unless it is being played; `values` of Animation's fields that are not None.

    Raises:
        LookupError: there is no such clip. ComponentError: a value is none that the field takes.
    """
    player, animation = _animation(simulation, entity)
    names = simulation.animations.library.names(animation.clips)
    if clip not in names:
        raise LookupError(f"{simulation.named(player)} has no clip {clip!r}; there are {shown(names)}")
    changes = {name: value for name, value in values.items() if value is not None}
    is_mixed = not animation.clip and simulation.world.has(player, AnimationBlend)
    loop = changes.get("loop", animation.loop)
    is_over = loop == "once" and animation.passes > 0
    if (animation.clip or next(iter(names))) != clip or is_mixed or is_over:
        changes = {"time": 0.0, "passes": 0, **changes}
    elif "time" in changes:
        changes = {"passes": 0, **changes}
    changes = {"clip": clip, "playing": True, **changes}
    if any(getattr(animation, name) != value for name, value in changes.items()):
        simulation.world.set_fields(player, Animation, changes)


def blend(
    simulation: Simulation, entity: int, mix: Mapping[str, float], value: float | None, fade: float | None
) -> None:
    """Has several clips played in step, by weights, or by where `value` is between their numbers.

    Raises:
        LookupError: there is no such clip. ComponentError: a number or a name is none.
    """
    player, animation = _animation(simulation, entity)
    names = simulation.animations.library.names(animation.clips)
    if missing := [name for name in mix if name not in names]:
        raise LookupError(f"{simulation.named(player)} has no clip {missing[0]!r}; there are {shown(names)}")
    if not mix:
        raise ComponentError("blend() takes at least one clip, as in blend({'Walk': 0.3, 'Run': 0.7})")
    if value is None and any(number < 0.0 for number in mix.values()):
        raise ComponentError("blend() takes weights of at least 0")
    world = simulation.world
    wanted = AnimationBlend(
        mix=mix_text(mix), by="weight" if value is None else "value", value=0.0 if value is None else float(value)
    )
    before = world.try_get(player, AnimationBlend)
    if before is None:
        world.add(player, wanted)
    elif before.by == "value" and wanted.by == "value" and mix_of(before.mix) == mix_of(wanted.mix):
        if before.value != wanted.value:
            world.set_fields(player, AnimationBlend, {"value": wanted.value})
    elif before != wanted:
        world.set(player, wanted)
    changes: dict[str, Any] = {"clip": ""} | ({} if fade is None else {"fade": float(fade)})
    if any(getattr(animation, name) != value for name, value in changes.items()):
        world.set_fields(player, Animation, changes)


def passes_of(simulation: Simulation, entity: int) -> tuple[str, int]:
    """The clip that is named, and how often it has come to an end; what `animation_end` looks at."""
    _, animation = _animation(simulation, entity)
    return animation.clip, animation.passes


def root_motion_of(simulation: Simulation, entity: int) -> tuple[Vector, Rotation]:
    """How far it went by root motion in the last tick, or would have gone: in the world [m], and the turn in its own space."""
    walks = simulation.animations.walks
    player = player_of(simulation, entity)
    rows = (walks.entity == player).nonzero()[0]
    if not len(rows):
        return Vector((0.0, 0.0, 0.0)), Rotation((0.0, 0.0, 0.0, 1.0))
    return Vector(walks.gone[rows[0]].tolist()), Rotation(walks.rotation[rows[0]].tolist())


def _animation(simulation: Simulation, entity: int) -> tuple[Entity, Animation]:
    player = player_of(simulation, entity)
    return player, simulation.world.get(player, Animation)

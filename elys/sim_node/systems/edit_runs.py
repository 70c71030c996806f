"""Runs of like edits, done together: thousands of entities are ended, moved or changed for about what a few would cost.

What a run leaves, and what takes it back, is what its edits one after the other would leave. Where that is not certain a run is
not done at all, and whoever asked tries a part of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from elys.bus.messages.commands import Despawn, Edit, Reparent, SetComponent, Spawn
from elys.common.components import declaration_of, values_of
from elys.common.components.columns import pack_values, unpack_values
from elys.common.errors import ElysError
from elys.common.ids import Entity
from elys.sim_node.ecs.columns import NO_ROW
from elys.sim_node.ecs.entities import Entities, indices_of
from elys.sim_node.ecs.many import Move, despawn_many, set_parents, write_many
from elys.sim_node.ecs.world import World
from elys.sim_node.scene.loading import Planting, plant, records_of_each
from elys.sim_node.scene.subtrees import stand_apart, subtrees_at
from elys.sim_node.systems.apply_commands import check_numbers, check_spawn

TRANSFORM: Final = "Transform"
WRITTEN_WHOLE: Final = "Joint"  # fitting it writes fields that nobody named
_LAST_ID: Final = (1 << 32) - 1


class Outcome(NamedTuple):
    """What edits have made, and what takes them back, in the order in which it is to be done."""

    entities: list[Entity]
    back: tuple[Edit, ...]


def run_at(edits: Sequence[Edit], start: int) -> int:
    """How many edits from `start` on are alike, so that `apply_run` may do them together."""
    first, end = edits[start], start + 1
    if not isinstance(first, Despawn | Spawn | Reparent | SetComponent):
        return 1
    while end < len(edits) and _are_alike(first, edits[end]):
        end += 1
    return end - start


def _are_alike(first: Edit, other: Edit) -> bool:
    if isinstance(first, SetComponent) and isinstance(other, SetComponent):
        return other.component == first.component and other.values.keys() == first.values.keys()
    return type(other) is type(first)


def apply_run(world: World, run: Sequence[Edit]) -> Outcome | None:
    """Does edits that are alike; None, and nothing is done, where one of them is wrong or depends on another."""
    try:
        match run[0]:
            case Despawn():
                return _despawn(world, [edit.entity for edit in run if isinstance(edit, Despawn)])
            case Spawn():
                return _spawn(world, [edit for edit in run if isinstance(edit, Spawn)])
            case Reparent():
                return _reparent(world, [edit for edit in run if isinstance(edit, Reparent)])
            case SetComponent():
                return _set(world, [edit for edit in run if isinstance(edit, SetComponent)])
    except ElysError:
        pass  # whoever finds it among fewer says which of them it is
    return None


def tops_of(spawn: Spawn, entities: Sequence[int]) -> tuple[int, ...]:
    """The topmost of the entities that a Spawn made."""
    return tuple(entity for entity, record in zip(entities, spawn.records, strict=True) if record.parent < 0)


def _living(world: World, entities: Sequence[int]) -> Entities | None:
    """Ids (N,) as an array; None where one lives no more, or never did."""
    if not all(0 < entity <= _LAST_ID for entity in entities):
        return None
    ids = np.array(entities, np.uint32)
    return ids if world.allocator.are_alive(ids).all() else None


def _despawn(world: World, entities: Sequence[int]) -> Outcome | None:
    ids, hierarchy = _living(world, entities), world.hierarchy
    subtrees = subtrees_at(hierarchy, indices_of(ids)) if ids is not None else None
    if subtrees is None:
        return None
    records = records_of_each(world, subtrees)
    parents = world.allocator.ids[hierarchy.parent[subtrees.tops]].tolist()
    all_ids = world.allocator.ids[subtrees.places].tolist()
    indices = despawn_many(world, subtrees)
    back = [
        Spawn(records=tuple(own), parent=parent, index=index, entities=tuple(all_ids[start : start + len(own)]))
        for own, parent, index, start in zip(records, parents, indices, subtrees.starts.tolist(), strict=True)
    ]
    return Outcome([], tuple(reversed(back)))


def _spawn(world: World, run: Sequence[Spawn]) -> Outcome | None:
    for edit in run:
        check_spawn(edit)
    returning = [bool(edit.entities) for edit in run]
    if any(returning):
        revived = [entity for edit in run for entity in edit.entities]
        if not all(returning) or not all(0 < entity <= _LAST_ID for entity in revived):
            return None
        if not world.allocator.can_revive(np.array(revived, np.uint32)):
            return None
    made = plant(world, [Planting(edit.records, Entity(edit.parent), edit.index, edit.entities) for edit in run])
    back: list[Edit] = []
    end = len(made)
    for edit in reversed(run):
        # Last sibling first: redone in reverse, each comes back at the place it had among those before it.
        start = end - len(edit.records)
        back += [Despawn(entity=entity) for entity in reversed(tops_of(edit, made[start:end]))]
        end = start
    return Outcome(made, tuple(back))


def _reparent(world: World, run: Sequence[Reparent]) -> Outcome | None:
    ids = _living(world, [edit.entity for edit in run])
    targets = _living(world, [edit.parent for edit in run if edit.parent])
    if ids is None or targets is None or not stand_apart(world.hierarchy, indices_of(ids), indices_of(targets)):
        return None
    parents = world.allocator.ids[world.hierarchy.parent[indices_of(ids)]].tolist()
    transforms = [world.try_get(Entity(edit.entity), TRANSFORM) if edit.keep_world_pose else None for edit in run]
    moves = [Move(Entity(edit.entity), Entity(edit.parent), edit.index, edit.keep_world_pose) for edit in run]
    stood = set_parents(world, moves)
    back: list[Edit] = [
        Reparent(entity=edit.entity, parent=parent, index=index, keep_world_pose=False)
        for edit, parent, index in zip(run, parents, stood, strict=True)
    ]
    # The very values they had: through the world and back they would come out rounded.
    poses = [
        SetComponent(entity=edit.entity, component=TRANSFORM, values=values_of(transform))
        for edit, transform in zip(run, transforms, strict=True)
        if transform is not None
    ]
    return Outcome([], (*reversed(back), *poses))


def _set(world: World, run: Sequence[SetComponent]) -> Outcome | None:
    name, fields = run[0].component, tuple(run[0].values)
    declaration, ids = declaration_of(name), _living(world, [edit.entity for edit in run])
    if name == WRITTEN_WHOLE or ids is None or len(np.unique(ids)) != len(ids):
        return None
    table, places = world.table(name), indices_of(ids)
    rows = table.row_of[places]
    if (rows == NO_ROW).any():
        return None
    for edit in run:
        check_numbers(name, edit.values)
    declared = {field: declaration.field(field) for field in fields}
    columns = {
        field: pack_values(declaration, declared[field], [edit.values[field] for edit in run], world.strings)
        for field in fields
    }
    before = [unpack_values(declared[field], table.column(field)[rows], world.strings) for field in fields]
    write_many(world, ids, places, name, columns)
    back = [
        SetComponent(entity=edit.entity, component=name, values=dict(zip(fields, values, strict=True)))
        for edit, *values in zip(run, *before, strict=True)
    ]
    return Outcome([], tuple(reversed(back)))

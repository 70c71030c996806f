"""What World does to one entity done to many, for about what it costs to do it to one.

What comes of it is what comes of doing it one after the other: the same tree, values, ids and log. Only the order of rows in
the tables, which nothing depends on, may be another.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from elys.common.components import Transform
from elys.common.components.columns import Column
from elys.common.ids import Entity
from elys.sim_node.ecs.changes import EntityDespawned, EntityReparented
from elys.sim_node.ecs.columns import NO_ROW
from elys.sim_node.ecs.entities import Entities, Indices, indices_of
from elys.sim_node.ecs.world import World
from elys.sim_node.scene.sibling_rows import SiblingRows
from elys.sim_node.scene.subtrees import Subtrees


@dataclass(frozen=True, slots=True)  # no tuple, for a tuple's `index` is something else
class Move:
    """As the arguments of `World.set_parent`."""

    entity: Entity
    parent: Entity
    index: int
    keep_world_pose: bool


def despawn_many(world: World, subtrees: Subtrees) -> list[int]:
    """Ends subtrees with all in them, in this order; at which index among its siblings each stood when its turn came."""
    hierarchy, ids = world.hierarchy, world.allocator.ids
    ended = ids[subtrees.tops].tolist()
    rows = SiblingRows(hierarchy)
    parents = hierarchy.parent[subtrees.tops].tolist()
    indices = [rows.of(parent).take(top) for parent, top in zip(parents, subtrees.tops.tolist(), strict=True)]
    for table in world.tables():
        table.remove(subtrees.places)
    rows.write()
    hierarchy.forget(subtrees.places)
    world.allocator.free_many(ids[subtrees.places])
    for entity in ended:
        world.log.log_structure(EntityDespawned(entity))
    return indices


def place_many(world: World, moves: Sequence[Move]) -> list[int]:
    """Moves entities in the tree, one after the other; at which index each stood when its turn came. Poses are left alone.

    None of the entities may be one of the parents, or above one of them.
    """
    hierarchy = world.hierarchy
    rows = SiblingRows(hierarchy)
    places = [hierarchy.require(move.entity) for move in moves]
    stood = []
    for place, move in zip(places, moves, strict=True):
        target = hierarchy.require_parent(move.parent)
        stood.append(rows.of(int(hierarchy.parent[place])).take(place))
        index = rows.of(target).put(place, move.index)
        world.log.log_structure(EntityReparented(move.entity, move.parent, index))
    rows.write()
    world.transforms.mark_dirty(np.array(places, np.intp))
    return stood


def place_new(world: World, moves: Sequence[Move]) -> None:
    """Brings entities that were just made, and are the last children of their parents, to their indices, one after the other."""
    hierarchy = world.hierarchy
    places = indices_of(np.array([move.entity for move in moves], np.uint32)).tolist()
    new, rows = set(places), SiblingRows(hierarchy)
    for place, move in zip(places, moves, strict=True):
        row = rows.of(hierarchy.require_parent(move.parent), without=new)
        index = row.put(place, move.index)
        if move.index >= 0:
            world.log.log_structure(EntityReparented(move.entity, move.parent, index))
    rows.write()


def set_parents(world: World, moves: Sequence[Move]) -> list[int]:
    """`World.set_parent` for different entities, see `place_many`; none of them may stand below another either."""
    transforms, hierarchy = world.table(Transform), world.hierarchy
    kept = [
        move.entity
        for move in moves
        if move.keep_world_pose
        and hierarchy.parent_of(move.entity) != move.parent
        and transforms.row_of[hierarchy.require(move.entity)] != NO_ROW
    ]
    entities = np.array(kept, np.uint32)
    world_from_local = world.transforms.world_affines(entities)
    stood = place_many(world, moves)
    world.transforms.set_world_affines(entities, world_from_local)
    for entity in kept:
        world.log.log_component(entity, Transform.__name__, was_present=True)
    return stood


def write_many(world: World, entities: Entities, places: Indices, name: str, columns: Mapping[str, Column]) -> None:
    """Writes stored values [N] or [N, width] of some fields of a component that [N] different entities have."""
    table = world.table(name)
    rows = table.row_of[places]
    for field, values in columns.items():
        table.column(field)[rows] = values
    if name == Transform.__name__:
        world.transforms.mark_dirty(places)
    for entity in entities.tolist():
        world.log.log_component(entity, name, was_present=True, fields=columns)

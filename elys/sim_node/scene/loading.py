"""Records to entities and back: how scenes, prefabs and spawn commands come in, and copies and undone deletions go out.

Records are turned into columns first, all values of one field together, and then spawned in one go: ten thousand take a
fraction of a second, and a record that is wrong leaves the world as it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from elys.common.components import Kind, component_from, declaration_of, declarations
from elys.common.components.columns import Column, pack_value, pack_values, unpack_values
from elys.common.errors import ComponentError, SceneError
from elys.common.ids import NO_ENTITY, Entity
from elys.common.scene_document import EntityRecord
from elys.common.scene_naming import take_references
from elys.sim_node.ecs.columns import NO_ROW, ComponentTable
from elys.sim_node.ecs.entities import Entities, Indices, indices_of
from elys.sim_node.ecs.many import Move, place_new
from elys.sim_node.ecs.world import SpawnBatch, World
from elys.sim_node.scene.subtrees import Subtrees

Members = list[int]
_MAX_ID = (1 << 32) - 1


@dataclass(frozen=True, slots=True)
class Planting:
    """Records that come in together, as the arguments of `load_records`."""

    records: Sequence[EntityRecord]
    parent: Entity = NO_ENTITY
    index: int = -1
    revived: Sequence[int] = ()


def load_records(
    world: World,
    records: Sequence[EntityRecord],
    *,
    parent: Entity = NO_ENTITY,
    index: int = -1,
    revived: Sequence[int] = (),
) -> list[Entity]:
    """Makes the entities of records (parents first) and returns them in the same order.

    Those without a parent among the records go under `parent`, one after the other from `index` on (-1: last). `revived`, one
    for each record, are the ids that they had when they lived before: they have them again if all still can.

    Raises:
        SceneError: a record's parent does not stand before it, it refers to nobody, or ids are not one for each.
        ComponentError: a component or field does not exist or has a wrong value; the sentence names the record.
        EntityError: `parent` does not live.
    """
    return plant(world, [Planting(records, parent, index, revived)])


def plant(world: World, plantings: Sequence[Planting]) -> list[Entity]:
    """What `load_records` does, one after the other: all, or none and what it raises. All come back, or all are new."""
    records = [record for planting in plantings for record in planting.records]
    parents, references = _parents_of(plantings), _references_of(plantings)
    revived = _revived_of(plantings)
    batch = SpawnBatch(
        names=[record.name for record in records],
        parents=parents,
        enabled=np.array([record.enabled for record in records], np.bool_),
        components=_columns_of(world, records),
        prefabs={place: record.prefab for place, record in enumerate(records) if record.prefab},
    )
    above = [planting.parent for planting in plantings]
    for parent in dict.fromkeys(above):
        world.hierarchy.require_parent(parent)
    under = np.repeat(np.array(above, np.uint32), [len(planting.records) for planting in plantings])
    spawned = world.spawn_batch(batch, parent=under, revived=revived)
    for (component, field), (places, targets) in references.items():
        table = world.table(component)
        table.column(field)[table.rows(spawned[places])] = spawned[targets]
    entities = [Entity(entity) for entity in spawned.tolist()]
    if any(planting.index >= 0 for planting in plantings):
        place_new(world, _moves_of(plantings, entities))
    return entities


def _moves_of(plantings: Sequence[Planting], entities: Sequence[Entity]) -> list[Move]:
    """Where those go that have no parent among the records."""
    moves, made = [], iter(entities)
    for planting in plantings:
        index = planting.index
        for record, entity in zip(planting.records, made, strict=False):
            if record.parent < 0:
                moves.append(Move(entity, planting.parent, index, False))
                index += index >= 0
    return moves


def records_of(world: World, entity: Entity = NO_ENTITY) -> list[EntityRecord]:
    """An entity and all below it (with NO_ENTITY the whole world) as records that hold only what differs from the defaults."""
    hierarchy = world.hierarchy
    indices = hierarchy.order.astype(np.intp) if entity == NO_ENTITY else indices_of(hierarchy.subtree_of(entity))
    return _records(world, indices, np.zeros(1, np.intp))


def records_of_each(world: World, subtrees: Subtrees) -> list[list[EntityRecord]]:
    """`records_of` the roots of subtrees."""
    records = _records(world, subtrees.places, subtrees.starts)
    ends = [*subtrees.starts[1:].tolist(), len(records)]
    return [records[start:end] for start, end in zip(subtrees.starts.tolist(), ends, strict=True)]


def _records(world: World, indices: Indices, starts: Indices) -> list[EntityRecord]:
    """Records of [M] places, which are several pieces that begin at `starts`; those of a piece know of no other piece."""
    hierarchy = world.hierarchy
    first = np.repeat(starts, np.diff(starts, append=len(indices)))
    place_of = np.full(world.allocator.capacity, -1)
    place_of[indices] = np.arange(len(indices))
    components: list[dict[str, dict[str, Any]]] = [{} for _ in range(len(indices))]
    for name in declarations():
        _collect_values(world, world.table(name), indices, components)
    parents = place_of[hierarchy.parent[indices]] - first
    return [
        EntityRecord(name=name, parent=parent, enabled=enabled, components=values, prefab=prefab, references=named)
        for name, parent, enabled, values, prefab, named in zip(
            hierarchy.names(indices),
            np.where(parents < 0, -1, parents).tolist(),
            hierarchy.enabled[indices].tolist(),
            components,
            hierarchy.prefabs(indices),
            _taken_references(world.allocator.ids[indices].tolist(), first.tolist(), components),
            strict=True,
        )
    ]


def _taken_references(
    entities: Sequence[int], first: Sequence[int], components: Sequence[dict[str, dict[str, Any]]]
) -> list[dict[str, int]]:
    """Takes the names of others out of component values, see `take_references`; `first` is where an entity's piece begins."""
    referring = {name for name, known in declarations().items() if any(f.kind is Kind.ENTITY for f in known.fields)}
    references: list[dict[str, int]] = []
    row_of = {entity: row for row, entity in enumerate(entities)}
    for start, values in zip(first, components, strict=True):
        if referring.isdisjoint(values):
            references.append({})
            continue
        named = [value for name in referring & values.keys() for value in values[name].values() if type(value) is int]
        near = {
            entity: row_of[entity] - start for entity in named if entity in row_of and first[row_of[entity]] == start
        }
        references.append(take_references(values, near))
    return references


def _parents_of(plantings: Sequence[Planting]) -> Indices:
    parents: list[int] = []
    for planting in plantings:
        start = len(parents)
        for place, record in enumerate(planting.records):
            if not -1 <= record.parent < place:
                raise SceneError(
                    f"record {place} '{record.name}' names record {record.parent} as its parent; a parent must stand before "
                    "its children, -1 is for none"
                )
            parents.append(record.parent + start if record.parent >= 0 else -1)
    return np.array(parents, np.intp)


def _revived_of(plantings: Sequence[Planting]) -> Entities | None:
    for planting in plantings:
        if planting.revived and len(planting.revived) != len(planting.records):
            raise SceneError(
                f"{len(planting.records)} records were given {len(planting.revived)} ids to live again; give one each"
            )
    revived = [entity for planting in plantings for entity in planting.revived]
    if not all(0 < entity <= _MAX_ID for entity in revived):
        raise SceneError("an id that shall live again is none: ids are from 1 to 2^32 - 1")
    return np.array(revived, np.uint32) if revived else None


def _references_of(plantings: Sequence[Planting]) -> dict[tuple[str, str], tuple[Members, Members]]:
    """By component and field, which records refer to which."""
    references: dict[tuple[str, str], tuple[Members, Members]] = {}
    start = 0
    for planting in plantings:
        records = planting.records
        for place, record in enumerate(records):
            for key, target in record.references.items():
                component, _, field = key.partition(".")
                if component not in record.components or declaration_of(component).field(field).kind is not Kind.ENTITY:
                    raise SceneError(f"record {place} '{record.name}' refers to another by {key}, which it has not")
                if not 0 <= target < len(records):
                    raise SceneError(
                        f"record {place} '{record.name}' refers to record {target} by {key}; there is none"
                    )
                places, targets = references.setdefault((component, field), ([], []))
                places.append(start + place)
                targets.append(start + target)
        start += len(records)
    return references


def _columns_of(world: World, records: Sequence[EntityRecord]) -> dict[str, tuple[Indices | None, dict[str, Column]]]:
    members: dict[str, Members] = {}
    for place, record in enumerate(records):
        for name in record.components:
            members.setdefault(name, []).append(place)
    columns: dict[str, tuple[Indices | None, dict[str, Column]]] = {}
    for name, places in members.items():
        values = [records[place].components[name] for place in places]
        try:
            packed = _packed_fields(world, name, values)
        except ComponentError:
            _raise_for_record(name, records, places)
            raise
        columns[name] = (np.array(places, np.intp), packed)
    return columns


def _packed_fields(world: World, name: str, values: list[dict[str, Any]]) -> dict[str, Column]:
    declaration = world.table(name).declaration
    named = set().union(*values)
    for unknown in named - {field.name for field in declaration.fields}:
        declaration.field(unknown)
    return {
        field.name: pack_values(
            declaration, field, [given.get(field.name, field.default) for given in values], world.strings
        )
        if field.name in named
        else pack_value(declaration, field, field.default, world.strings)
        for field in declaration.fields
    }


def _raise_for_record(name: str, records: Sequence[EntityRecord], places: Members) -> None:
    """Something in a column is wrong: finds the first record that it came from."""
    for place in places:
        try:
            component_from(name, records[place].components[name])
        except ComponentError as error:
            raise ComponentError(f"record {place} '{records[place].name}': {error}") from error


def _collect_values(
    world: World, table: ComponentTable, indices: Indices, components: list[dict[str, dict[str, Any]]]
) -> None:
    """Adds one component's values, where they differ from the defaults, to those of the entities at [N] places."""
    rows = table.row_of[indices]
    places = np.flatnonzero(rows != NO_ROW)
    if not len(places):  # of one entity most components are not there
        return
    name = table.declaration.name
    for place in places.tolist():
        components[place][name] = {}
    rows = rows[places]
    for field in table.declaration.fields:
        column = table.column(field.name)[rows]
        default = np.zeros_like(column, shape=(1, *column.shape[1:]))
        default[0] = pack_value(table.declaration, field, field.default, world.strings)
        changed = np.flatnonzero(_differs(column, default))
        for place, value in zip(
            places[changed].tolist(), unpack_values(field, column[changed], world.strings), strict=True
        ):
            components[place][name][field.name] = value


def _differs(column: Column, default: Column) -> NDArray[np.bool_]:
    """[N] whether any bit of a row differs from the default's: -0.0 is not 0.0 here, so that what is saved is what was there."""
    if not len(column):
        return np.zeros(0, np.bool_)
    row_size = column.nbytes // len(column)
    bits = np.ascontiguousarray(column).view(np.uint8).reshape(len(column), row_size)
    return np.asarray((bits != default.view(np.uint8).reshape(1, row_size)).any(axis=1))

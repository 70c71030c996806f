"""Records to entities and back: how scenes, prefabs and spawn commands come in, and copies and undone deletions go out.

Records are turned into columns first, all values of one field together, and then spawned in one go: ten thousand take a
fraction of a second, and a record that is wrong leaves the world as it was.
"""

from __future__ import annotations

from collections.abc import Sequence
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
from elys.sim_node.ecs.entities import Indices, indices_of
from elys.sim_node.ecs.world import SpawnBatch, World

Members = list[int]
_MAX_ID = (1 << 32) - 1


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
    if revived and len(revived) != len(records):
        raise SceneError(f"{len(records)} records were given {len(revived)} ids to live again; give one each")
    if not all(0 < entity <= _MAX_ID for entity in revived):
        raise SceneError("an id that shall live again is none: ids are from 1 to 2^32 - 1")
    references = _references_of(records)
    batch = SpawnBatch(
        names=[record.name for record in records],
        parents=_parents_of(records),
        enabled=np.array([record.enabled for record in records], np.bool_),
        components=_columns_of(world, records),
        prefabs={place: record.prefab for place, record in enumerate(records) if record.prefab},
    )
    spawned = world.spawn_batch(batch, parent=parent, revived=np.array(revived, np.uint32) if len(revived) else None)
    for (component, field), (places, targets) in references.items():
        table = world.table(component)
        table.column(field)[table.rows(spawned[places])] = spawned[targets]
    entities = [Entity(entity) for entity in spawned.tolist()]
    if index >= 0:
        roots = [entity for entity, record in zip(entities, records, strict=True) if record.parent < 0]
        for place, root in enumerate(roots, start=index):
            world.set_parent(root, parent, index=place, keep_world_pose=False)
    return entities


def records_of(world: World, entity: Entity = NO_ENTITY) -> list[EntityRecord]:
    """An entity and all below it (with NO_ENTITY the whole world) as records that hold only what differs from the defaults."""
    hierarchy = world.hierarchy
    indices = hierarchy.order.astype(np.intp) if entity == NO_ENTITY else indices_of(hierarchy.subtree_of(entity))
    place_of = np.full(world.allocator.capacity, -1)
    place_of[indices] = np.arange(len(indices))
    components: list[dict[str, dict[str, Any]]] = [{} for _ in range(len(indices))]
    for name in declarations():
        _collect_values(world, world.table(name), indices, components)
    row_of = {entity: row for row, entity in enumerate(world.allocator.ids[indices].tolist())}
    references = [take_references(values, row_of) for values in components]
    return [
        EntityRecord(name=name, parent=parent, enabled=enabled, components=values, prefab=prefab, references=named)
        for name, parent, enabled, values, prefab, named in zip(
            hierarchy.names(indices),
            place_of[hierarchy.parent[indices]].tolist(),
            hierarchy.enabled[indices].tolist(),
            components,
            hierarchy.prefabs(indices),
            references,
            strict=True,
        )
    ]


def _parents_of(records: Sequence[EntityRecord]) -> Indices:
    for place, record in enumerate(records):
        if not -1 <= record.parent < place:
            raise SceneError(
                f"record {place} '{record.name}' names record {record.parent} as its parent; a parent must stand before its "
                "children, -1 is for none"
            )
    return np.array([record.parent for record in records], np.intp)


def _references_of(records: Sequence[EntityRecord]) -> dict[tuple[str, str], tuple[Members, Members]]:
    """By component and field, which records refer to which."""
    references: dict[tuple[str, str], tuple[Members, Members]] = {}
    for place, record in enumerate(records):
        for key, target in record.references.items():
            component, _, field = key.partition(".")
            if component not in record.components or declaration_of(component).field(field).kind is not Kind.ENTITY:
                raise SceneError(f"record {place} '{record.name}' refers to another by {key}, which it has not")
            if not 0 <= target < len(records):
                raise SceneError(f"record {place} '{record.name}' refers to record {target} by {key}; there is none")
            places, targets = references.setdefault((component, field), ([], []))
            places.append(place)
            targets.append(target)
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
    for unknown in set().union(*values) - {field.name for field in declaration.fields}:
        declaration.field(unknown)
    return {
        field.name: pack_values(
            declaration, field, [given.get(field.name, field.default) for given in values], world.strings
        )
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

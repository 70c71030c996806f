"""The world: entities, what they have, how they stand to one another, and what changed.

    world = World()
    box = world.spawn([Transform(position=(0.0, 2.0, 0.0)), RigidBody(mass=3.0)], name="Box")
    world.set(box, RigidBody(mass=4.0))
    bodies = world.query(RigidBody, Transform, enabled_only=True)
    bodies.values(RigidBody, "mass")                                   # [N] for kernels

Single values go in and out as Components, checked and logged for the scene delta. Systems read and write whole columns,
which is not logged; who writes a Transform's columns marks the entities dirty in `world.transforms`.

Methods that take entities raise EntityError for one that does not live, and ComponentError for what components forbid. What
raises changes nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from elys.common.components import Component, Transform, declaration_of
from elys.common.components.columns import Column, StringTable, pack_array, pack_value, pack_values, unpack_value
from elys.common.errors import ComponentError
from elys.common.ids import NO_ENTITY, Entity
from elys.sim_node.ecs.changes import ChangeLog, EntityDespawned, EntityReparented, WorldChanges
from elys.sim_node.ecs.columns import NO_ROW, ComponentTable, require_row
from elys.sim_node.ecs.command_buffer import CommandBuffer
from elys.sim_node.ecs.entities import Entities, EntityAllocator, Indices, indices_of
from elys.sim_node.ecs.query import Query
from elys.sim_node.scene.hierarchy import GROUND, Hierarchy
from elys.sim_node.scene.transforms import Transforms

C = TypeVar("C", bound=Component)
ComponentName = str | type[Component]


@dataclass(frozen=True, slots=True, kw_only=True)
class SpawnBatch:
    """Entities to be made together, as columns; `World.spawn_batch` makes them.

    Attributes:
        parents: [N] for each its parent's place in the batch, -1 for the parent of all; parents stand first.
        components: by name, which of the batch have it (None: all) and a full column of stored values per field.
        prefabs: by place in the batch.
    """

    names: Sequence[str]
    parents: Indices
    enabled: NDArray[np.bool_]
    components: Mapping[str, tuple[Indices | None, Mapping[str, Any]]]
    prefabs: Mapping[int, str] = field(default_factory=dict)


class World:
    """Everything that exists in one simulation.

    Attributes:
        hierarchy: names, parents, children and enabled switches, to read.
        transforms: where everything stands in the world; its bulk writes log nothing.
        strings: the texts that columns name by row.
        commands: structural changes for systems to record; the schedule applies them.
        log: what has changed since `drain_changes`, for who changes many at once (`many.py`).
    """

    def __init__(self, capacity: int = 1024) -> None:
        self.allocator = EntityAllocator(capacity)
        self.hierarchy = Hierarchy(self.allocator)
        self.strings = StringTable()
        self._tables: dict[str, ComponentTable] = {}
        self._queries: dict[tuple[frozenset[str], frozenset[str], bool], Query] = {}
        self.log = ChangeLog()
        self._transform_table = self.table(Transform)
        self.transforms = Transforms(self.allocator, self.hierarchy, self._transform_table)
        self.commands = CommandBuffer(self)

    @property
    def entity_count(self) -> int:
        """How many entities live."""
        return self.allocator.count

    # Entities

    def spawn(
        self,
        components: Iterable[Component] = (),
        *,
        name: str = "",
        parent: Entity = NO_ENTITY,
        enabled: bool = True,
        prefab: str = "",
    ) -> Entity:
        """A new entity with these components, last among the children of `parent`."""
        packed: dict[str, tuple[None, dict[str, Any]]] = {}
        for component in components:
            table = self.table(type(component))
            if table.declaration.name in packed:
                raise ComponentError(f"a new entity '{name}' was given two {table.declaration.name}; it can have one")
            packed[table.declaration.name] = (None, self._packed(table, component))
        batch = SpawnBatch(
            names=(name,),
            parents=np.array([-1]),
            enabled=np.array([enabled]),
            components=packed,
            prefabs={0: prefab} if prefab else {},
        )
        return Entity(int(self.spawn_batch(batch, parent=parent)[0]))

    def spawn_many(
        self,
        count: int,
        columns: Mapping[ComponentName, Mapping[str, Any]],
        *,
        names: str | Sequence[str] = "",
        parent: Entity = NO_ENTITY,
    ) -> Entities:
        """`count` new entities at once: [count].

        Args:
            columns: for every component they get, its fields: an array [count] or [count, width] of stored values, a list of
                `count` values, or one value for all. Fields not given have their defaults.
            names: one each, or what comes before a number: "Box" names them "Box 1" and so on.
        """
        if not isinstance(names, str) and len(names) != count:
            raise ComponentError(f"{count} new entities were given {len(names)} names; give one each, or one to number")
        if isinstance(names, str):
            names = [f"{names} {number}" for number in range(1, count + 1)] if names else [""] * count
        batch = SpawnBatch(
            names=names,
            parents=np.full(count, -1),
            enabled=np.ones(count, np.bool_),
            components={
                declaration_of(component).name: (None, self._packed_columns(component, values, count))
                for component, values in columns.items()
            },
        )
        return self.spawn_batch(batch, parent=parent)

    def spawn_batch(
        self, batch: SpawnBatch, *, parent: Entity | Entities = NO_ENTITY, revived: Entities | None = None
    ) -> Entities:
        """Makes the entities of a batch, those without a parent in it last among the children of `parent`, one for all or [N].

        They are the `revived` ones, that lived before, if all of them still can live again.
        """
        above = self.hierarchy.require_parents(np.asarray(parent, np.uint32).reshape(-1))
        if revived is not None and self.allocator.can_revive(revived):
            entities = revived
            self.allocator.revive(entities)
        else:
            entities = self.allocator.allocate_many(len(batch.names))
        parents = self._fill(entities, batch, above)
        self.log.log_spawned(entities.tolist(), parents.tolist())
        return entities

    def despawn(self, entity: Entity) -> None:
        """Ends an entity and all below it."""
        places = self.hierarchy.subtree_places(self.hierarchy.require(entity))
        for table in self._tables.values():
            table.remove(places)
        self.hierarchy.remove(places)
        self.allocator.free_many(self.allocator.ids[places])
        self.log.log_structure(EntityDespawned(entity))

    def is_alive(self, entity: int) -> bool:
        """Whether this very entity lives."""
        return self.allocator.is_alive(entity)

    def describe(self, entity: Entity) -> str:
        """An entity as sentences name it: its id and, if it has one, its name."""
        return self.hierarchy.describe(entity)

    def entities(self) -> Entities:
        """[N] all entities, parents before children and siblings in order."""
        return self.allocator.ids[self.hierarchy.order]

    def replace_all(self, batch: SpawnBatch, entities: Entities, *, free: Entities, strings: StringTable) -> None:
        """Ends everything and makes a batch with these very ids; the next ids will be those of `free`, then untouched ones.

        The batch's texts are rows of `strings`. EntityError if two ids name one place.
        """
        self.allocator.restore(entities, free)
        self.strings = strings
        self.hierarchy.clear()
        self.transforms.clear()
        for table in self._tables.values():
            table.clear()
        self._fill(entities, batch, GROUND)
        self.log.discard(overflowed=True)

    def outdate(self) -> None:
        """All of it was put back to another time: whatever was derived from it is stale."""
        self.hierarchy.outdate()
        for table in self._tables.values():
            table.structure_version += 1

    # Components of one entity

    @overload
    def get(self, entity: Entity, component: type[C]) -> C: ...
    @overload
    def get(self, entity: Entity, component: str) -> Component: ...
    def get(self, entity: Entity, component: ComponentName) -> Component:
        """The value of a component; ComponentError if the entity has none."""
        table, row = self._find(entity, component)
        return self._unpacked(table, row)

    @overload
    def try_get(self, entity: Entity, component: type[C]) -> C | None: ...
    @overload
    def try_get(self, entity: Entity, component: str) -> Component | None: ...
    def try_get(self, entity: Entity, component: ComponentName) -> Component | None:
        """The value of a component, None if the entity has none."""
        table = self.table(component)
        row = int(table.row_of[self.hierarchy.require(entity)])
        return None if row == NO_ROW else self._unpacked(table, row)

    def set(self, entity: Entity, component: Component) -> None:
        """Gives a component the entity has another value."""
        table, row = self._find(entity, type(component))
        table.write(row, self._packed(table, component))
        self._note_component(entity, table, was_present=True)

    def set_fields(self, entity: Entity, component: ComponentName, values: Mapping[str, Any]) -> None:
        """Changes some fields of a component the entity has; ComponentError for what they do not take."""
        table, row = self._find(entity, component)
        declaration, strings = table.declaration, self.strings
        packed = {
            name: pack_value(declaration, declaration.field(name), value, strings) for name, value in values.items()
        }
        table.write(row, packed)
        self._note_component(entity, table, was_present=True, fields=values)

    def add(self, entity: Entity, component: Component) -> None:
        """Gives the entity a component it has not."""
        table = self.table(type(component))
        if table.row_of[self.hierarchy.require(entity)] != NO_ROW:
            raise ComponentError(
                f"{self.hierarchy.describe(entity)} has a {table.declaration.name} already; set it instead"
            )
        table.insert(np.array([entity], np.uint32), self._packed(table, component))
        self._note_component(entity, table, was_present=False)

    def remove(self, entity: Entity, component: ComponentName) -> None:
        """Takes a component from the entity."""
        table, _ = self._find(entity, component)
        table.remove(np.array([self.hierarchy.require(entity)]))
        self._note_component(entity, table, was_present=True)

    def has(self, entity: Entity, component: ComponentName) -> bool:
        """Whether the entity has a component."""
        return bool(self.table(component).row_of[self.hierarchy.require(entity)] != NO_ROW)

    def components_of(self, entity: Entity) -> tuple[Component, ...]:
        """All components of an entity."""
        index = self.hierarchy.require(entity)
        found = ((table, int(table.row_of[index])) for table in self._tables.values())
        return tuple(self._unpacked(table, row) for table, row in found if row != NO_ROW)

    # Components of many

    def table(self, component: ComponentName) -> ComponentTable:
        """The columns of one component."""
        name = component if isinstance(component, str) else component.__name__
        table = self._tables.get(name)
        if table is None:
            table = self._tables[name] = ComponentTable(declaration_of(component), self.allocator.capacity)
        return table

    def tables(self) -> tuple[ComponentTable, ...]:
        """The columns of all components that were ever used here."""
        return tuple(self._tables.values())

    def query(
        self, *components: type[Component], excluding: Iterable[type[Component]] = (), enabled_only: bool = False
    ) -> Query:
        """The entities with all these components and none of those excluded; one and the same query each time it is asked."""
        required = {component.__name__: self.table(component) for component in components}
        excluded = {component.__name__: self.table(component) for component in excluding}
        key = (frozenset(required), frozenset(excluded), enabled_only)
        if key not in self._queries:
            self._queries[key] = Query(
                self.hierarchy, tuple(required.values()), excluded=tuple(excluded.values()), enabled_only=enabled_only
            )
        return self._queries[key]

    # The tree

    def set_parent(self, entity: Entity, parent: Entity, *, index: int = -1, keep_world_pose: bool = True) -> None:
        """Moves an entity under another, or with NO_ENTITY to the roots, at `index` among its children (-1: last).

        With `keep_world_pose` its Transform is rewritten so that it stays where it is in the world.

        Raises:
            HierarchyError: `parent` is the entity itself or below it.
        """
        keeps_pose = keep_world_pose and self.has(entity, Transform) and self.hierarchy.parent_of(entity) != parent
        world_from_local = self.transforms.world_from_local(entity) if keeps_pose else None
        position = self.hierarchy.move(entity, parent, index=index)
        self.log.log_structure(EntityReparented(entity, parent, position))
        self.transforms.mark_dirty(self.hierarchy.require(entity))
        if world_from_local is not None:
            self.transforms.set_world_affines(np.array([entity], np.uint32), world_from_local[None])
            self._note_component(entity, self._transform_table, was_present=True)

    def unparent(self, entity: Entity, *, keep_world_pose: bool = True) -> None:
        """Makes an entity a root."""
        self.set_parent(entity, NO_ENTITY, keep_world_pose=keep_world_pose)

    def set_sibling_index(self, entity: Entity, index: int) -> None:
        """Moves an entity to `index` among its siblings (-1: last)."""
        self.set_parent(entity, self.hierarchy.parent_of(entity), index=index)

    def rename(self, entity: Entity, name: str) -> None:
        """Gives an entity another name."""
        self.hierarchy.rename(entity, name)
        self.log.log_renamed(entity)

    def set_enabled(self, entity: Entity, enabled: bool) -> None:
        """Switches an entity, and with it all below it."""
        self.hierarchy.set_enabled(entity, enabled)
        self.log.log_switched(entity)

    # Changes

    def drain_changes(self) -> WorldChanges:
        """What changed since this was last asked."""
        return self.log.drain(self.is_alive, lambda entity, component: self.has(Entity(entity), component))

    # Values in and out of columns

    def _fill(self, entities: Entities, batch: SpawnBatch, above: Indices | int) -> Entities:
        """Gives new ids their place in the tree and their components; returns their parents."""
        indices = indices_of(entities)
        for table in self._tables.values():
            table.reserve_entities(self.allocator.capacity)
        has_parent = batch.parents >= 0
        parents = np.where(has_parent, indices[np.where(has_parent, batch.parents, 0)], above)
        self.hierarchy.insert(indices, parents, batch.names, batch.enabled)
        for place, prefab in batch.prefabs.items():
            self.hierarchy.set_prefab(int(indices[place]), prefab)
        for name, (members, columns) in batch.components.items():
            self.table(name).insert(entities if members is None else entities[members], columns)
        self.transforms.mark_dirty(indices)
        return self.allocator.ids[parents]

    def _find(self, entity: Entity, component: ComponentName) -> tuple[ComponentTable, int]:
        table, index = self.table(component), self.hierarchy.require(entity)
        row = int(table.row_of[index])
        return table, row if row != NO_ROW else require_row(table, index, self.hierarchy.describe(entity))

    def _packed(self, table: ComponentTable, component: Component) -> dict[str, Any]:
        declaration, strings = table.declaration, self.strings
        return {f.name: pack_value(declaration, f, getattr(component, f.name), strings) for f in declaration.fields}

    def _unpacked(self, table: ComponentTable, row: int) -> Component:
        stored, strings = table.read(row), self.strings
        declaration = table.declaration
        return declaration.struct(**{f.name: unpack_value(f, stored[f.name], strings) for f in declaration.fields})

    def _packed_columns(self, component: ComponentName, values: Mapping[str, Any], count: int) -> dict[str, Column]:
        declaration = self.table(component).declaration
        for name in values:
            declaration.field(name)
        columns: dict[str, Column] = {}
        for f in declaration.fields:
            match values.get(f.name, f.default):
                case np.ndarray() as array:
                    columns[f.name] = pack_array(declaration, f, array, count, self.strings)
                case list() as several:
                    columns[f.name] = pack_values(declaration, f, several, self.strings)
                case single:
                    columns[f.name] = pack_value(declaration, f, single, self.strings)
        return columns

    def _note_component(
        self, entity: Entity, table: ComponentTable, *, was_present: bool, fields: Iterable[str] | None = None
    ) -> None:
        if table is self._transform_table:
            self.transforms.mark_dirty(self.hierarchy.require(entity))
        self.log.log_component(entity, table.declaration.name, was_present=was_present, fields=fields)

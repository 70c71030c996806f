"""What changed in a world, as the messages that make a mirror follow it.

Structure comes first, in the order in which it happened, so that siblings end in the same order; then the values, as they are
now, of entities that are still there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from elys.bus.messages.scene import (
    ComponentRemoved,
    ComponentSet,
    Despawned,
    EnabledSet,
    Renamed,
    Reparented,
    SceneChange,
    Spawned,
)
from elys.common.components import Component, declaration_of, values_of
from elys.common.ids import Entity
from elys.sim_node.ecs.changes import EntityDespawned, EntityReparented, EntitySpawned, WorldChanges
from elys.sim_node.ecs.world import World


def scene_changes(world: World, logs: Sequence[WorldChanges]) -> tuple[SceneChange, ...]:
    """The messages for what one or more drains of the change log, oldest first, said; none of them may have overflowed."""
    spawned = {entity for log in logs for entity in log.spawned}
    return (
        *(_structural(world, change) for log in logs for change in log.structure),
        *_component_changes(world, logs, spawned),
        *(
            Renamed(entity=entity, name=world.hierarchy.name_of(entity))
            for entity in _distinct(world, (log.renamed for log in logs), spawned)
        ),
        *(
            EnabledSet(entity=entity, enabled=world.hierarchy.is_enabled(entity))
            for entity in _distinct(world, (log.switched for log in logs), spawned)
        ),
    )


def _structural(world: World, change: EntitySpawned | EntityDespawned | EntityReparented) -> SceneChange:
    match change:
        case EntitySpawned(entity, parent):
            return _spawned(world, entity, parent)
        case EntityDespawned(entity):
            return Despawned(entity=entity)
        case EntityReparented(entity, parent, index):
            return Reparented(entity=entity, parent=parent, index=index)


def _spawned(world: World, entity: Entity, parent: Entity) -> Spawned:
    if not world.is_alive(entity):  # ended since: it is only told because siblings were counted while it was there
        return Spawned(entity=entity, name="", parent=parent, enabled=True, components={})
    hierarchy = world.hierarchy
    return Spawned(
        entity=entity,
        name=hierarchy.name_of(entity),
        parent=parent,
        enabled=hierarchy.is_enabled(entity),
        components={type(component).__name__: _told(component) for component in world.components_of(entity)},
        prefab=hierarchy.prefab_of(entity),
    )


def _component_changes(world: World, logs: Sequence[WorldChanges], spawned: set[Entity]) -> Iterator[SceneChange]:
    touched = dict.fromkeys(key for log in logs for key in (*log.removed, *log.set, *log.added))
    for entity, component in touched:
        if entity in spawned or not world.is_alive(entity):
            continue
        if world.has(entity, component):
            yield ComponentSet(entity=entity, component=component, values=_told(world.get(entity, component)))
        else:
            yield ComponentRemoved(entity=entity, component=component)


def _told(component: Component) -> dict[str, Any]:
    """The values of a component but for what it remembers for itself."""
    values = values_of(component)
    for field in declaration_of(component).fields:
        if field.is_memory:
            del values[field.name]
    return values


def _distinct(world: World, entities: Iterator[Sequence[Entity]], spawned: set[Entity]) -> list[Entity]:
    """Those that are there and are not told of as new, each once."""
    listed = dict.fromkeys(entity for several in entities for entity in several)
    return [entity for entity in listed if entity not in spawned and world.is_alive(entity)]

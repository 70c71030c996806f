"""What takes an edit back: for each command the commands that undo it, computed from the mirror before it is sent."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from elys.bus.messages.commands import (
    AddComponent,
    Command,
    CommandReply,
    Despawn,
    RemoveComponent,
    Rename,
    Reparent,
    SetComponent,
    SetEnabled,
    SetSettings,
    Spawn,
)
from elys.common.components import Kind, declaration_of, declarations, values_of
from elys.common.scene import EntityRecord
from elys.common.scene_naming import take_references
from elys.editor_node.scene_mirror import EditorScene

TRANSFORM = "Transform"


def inverse_of(command: Command, scene: EditorScene) -> tuple[Command, ...]:
    """The commands that bring back what `command` is about to change; () for one that changes no scene, and for Spawn.

    What a Spawn made is known from its reply: see `inverse_of_reply`.
    """
    match command:
        case SetComponent(entity=entity, component=name, values=values):
            current = scene.component_of(entity, name)
            if current is None:
                return ()
            before = {field: getattr(current, field) for field in values if hasattr(current, field)}
            return (SetComponent(entity=entity, component=name, values=before),)
        case AddComponent(entity=entity, component=name):
            return (RemoveComponent(entity=entity, component=name),)
        case RemoveComponent(entity=entity, component=name):
            current = scene.component_of(entity, name)
            return () if current is None else (AddComponent(entity=entity, component=name, values=values_of(current)),)
        case Despawn(entity=entity) if scene.exists(entity):
            parent, index = scene.place_of(entity)
            return (Spawn(records=records_of(scene, entity)[0], parent=parent, index=index),)
        case Rename(entity=entity) if scene.exists(entity):
            return (Rename(entity=entity, name=scene.name_of(entity)),)
        case Reparent(entity=entity) if scene.exists(entity):
            return _inverse_of_reparent(entity, scene)
        case SetEnabled(entity=entity) if scene.exists(entity):
            return (SetEnabled(entity=entity, enabled=scene.is_enabled(entity)),)
        case SetSettings():
            return (SetSettings(settings=scene.settings),)
        case _:
            return ()


def inverse_of_reply(command: Command, reply: CommandReply) -> tuple[Command, ...]:
    """What undoes a command that was accepted, as far as only its reply tells."""
    # Last sibling first: redone in reverse, each comes back at the place it had among those before it.
    return tuple(Despawn(entity=entity) for entity in reversed(roots_of(command, reply)))


def roots_of(command: Command, reply: CommandReply) -> tuple[int, ...]:
    """The topmost of the entities that a Spawn made."""
    if not isinstance(command, Spawn):
        return ()
    return tuple(e for e, record in zip(reply.entities, command.records, strict=False) if record.parent < 0)


def _inverse_of_reparent(entity: int, scene: EditorScene) -> tuple[Command, ...]:
    parent, index = scene.place_of(entity)
    back = Reparent(entity=entity, parent=parent, index=index, keep_world_pose=False)
    transform = scene.component_of(entity, TRANSFORM)
    if transform is None:
        return (back,)
    # The very values it had: through the world and back they would come out rounded.
    return (back, SetComponent(entity=entity, component=TRANSFORM, values=values_of(transform)))


def records_of(scene: EditorScene, entity: int) -> tuple[tuple[EntityRecord, ...], tuple[int, ...]]:
    """An entity and all below it as records, parents first and siblings in order; and their ids in the same order."""
    parents: list[int] = []
    row_of: dict[int, int] = {}
    waiting = [(entity, -1)]
    while waiting:
        current, parent = waiting.pop()
        row_of[current] = len(parents)
        parents.append(parent)
        waiting.extend((child, row_of[current]) for child in reversed(scene.children_of(current)))
    return tuple(_record(scene, current, parents[row], row_of) for current, row in row_of.items()), tuple(row_of)


def _record(scene: EditorScene, entity: int, parent: int, row_of: Mapping[int, int]) -> EntityRecord:
    components = {
        name: values_of(component, only_changed=True) for name, component in scene.components_of(entity).items()
    }
    return EntityRecord(
        name=scene.name_of(entity),
        parent=parent,
        enabled=scene.is_enabled(entity),
        components=components,
        prefab=scene.prefab_of(entity),
        references=take_references(components, row_of),
    )


def with_new_ids(command: Command, new_ids: Mapping[int, int]) -> Command:
    """The command, about entities that came back under other ids."""
    changes: dict[str, Any] = {}
    for field in ("entity", "parent"):
        old = getattr(command, field, 0)
        if old in new_ids:
            changes[field] = new_ids[old]
    match command:
        case SetComponent(component=name, values=values) | AddComponent(component=name, values=values):
            changes["values"] = _values_with_new_ids(name, values, new_ids)
        case Spawn(records=records):
            changes["records"] = tuple(
                msgspec.structs.replace(
                    record,
                    components={
                        name: _values_with_new_ids(name, values, new_ids) for name, values in record.components.items()
                    },
                )
                for record in records
            )
    return msgspec.structs.replace(command, **changes) if changes else command


def _values_with_new_ids(component: str, values: Mapping[str, Any], new_ids: Mapping[int, int]) -> dict[str, Any]:
    if component not in declarations():
        return dict(values)
    names = {field.name for field in declaration_of(component).fields if field.kind is Kind.ENTITY}
    return {name: new_ids.get(value, value) if name in names else value for name, value in values.items()}


def target_of(command: Command) -> tuple[Any, ...]:
    """What a command changes: of two in one drag with the same target the later one is enough."""
    match command:
        case SetComponent(entity=entity, component=name, values=values):
            return (SetComponent, entity, name, frozenset(values))
        case SetSettings():
            return (SetSettings,)
        case _:
            return (type(command), getattr(command, "entity", 0))


def is_echoed(command: Command, reply: CommandReply, scene: EditorScene, before: object) -> bool:
    """Whether the mirror shows what an accepted command did; `before` is what `watched_value` said before it was sent."""
    match command:
        case Spawn():
            return all(scene.exists(entity) for entity in reply.entities)
        case Despawn(entity=entity):
            return not scene.exists(entity)
        case Reparent(entity=entity, parent=parent):
            return not scene.exists(entity) or (
                scene.parent_of(entity) == parent and watched_value(command, scene) != before
            )
        case _:
            return watched_value(command, scene) != before


def watched_value(command: Command, scene: EditorScene) -> object:
    """What the mirror says of a command's target, in a form that another echo makes unequal or keeps."""
    entity = getattr(command, "entity", 0)
    if entity and not scene.exists(entity):
        return None
    match command:
        case SetComponent(component=name) | AddComponent(component=name) | RemoveComponent(component=name):
            return _identity(scene.echo_of(entity, name))
        case Rename():
            return scene.name_of(entity)
        case Reparent():
            return (scene.place_of(entity), _identity(scene.echo_of(entity, TRANSFORM)))
        case SetEnabled():
            return scene.is_enabled(entity)
        case SetSettings():
            return scene.settings
        case _:
            return None


def _identity(echo: object) -> tuple[int, object]:
    """Unequal to any other object's, also one of the same value: an echo counts though it changed nothing."""
    return id(echo), echo

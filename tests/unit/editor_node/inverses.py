"""What takes an edit back, worked out from a mirror: for the small host, which has no world."""

from __future__ import annotations

from elys.bus.messages.commands import (
    AddComponent,
    Despawn,
    Edit,
    RemoveComponent,
    Rename,
    Reparent,
    SetComponent,
    SetEnabled,
    SetSettings,
    Spawn,
)
from elys.common.components import values_of
from elys.editor_node.edits import records_of
from elys.editor_node.scene_mirror import EditorScene

TRANSFORM = "Transform"


def inverse_of(command: Edit, scene: EditorScene) -> tuple[Edit, ...]:
    """The commands that bring back what `command` is about to change; () for one that changes no scene, and for Spawn.

    What a Spawn made is known when it is made.
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
            records, ids = records_of(scene, entity)
            return (Spawn(records=records, parent=parent, index=index, entities=ids),)
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


def _inverse_of_reparent(entity: int, scene: EditorScene) -> tuple[Edit, ...]:
    parent, index = scene.place_of(entity)
    back = Reparent(entity=entity, parent=parent, index=index, keep_world_pose=False)
    transform = scene.component_of(entity, TRANSFORM)
    if transform is None:
        return (back,)
    # The very values it had: through the world and back they would come out rounded.
    return (back, SetComponent(entity=entity, component=TRANSFORM, values=values_of(transform)))

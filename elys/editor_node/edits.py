"""Entities of the mirror as records: what copies, clipboards and files are made of."""

from __future__ import annotations

from collections.abc import Mapping

from elys.bus.messages.commands import Command, SetComponent, SetSettings
from elys.common.components import values_of
from elys.common.scene import EntityRecord
from elys.common.scene_naming import take_references
from elys.editor_node.scene_mirror import EditorScene


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


def target_of(command: Command) -> tuple[object, ...]:
    """What a command changes: of two in one drag with the same target the later one is enough."""
    match command:
        case SetComponent(entity=entity, component=name, values=values):
            return (SetComponent, entity, name, frozenset(values))
        case SetSettings():
            return (SetSettings,)
        case _:
            return (type(command), getattr(command, "entity", 0))

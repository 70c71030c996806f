"""The edits a person can make, each one entry of the history, however many entities it touches."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

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
from elys.common.components import check_value, component_from, declaration_of, values_of
from elys.common.math import matrix
from elys.common.math.poses import local_pose
from elys.common.scene import ComponentChanges, EntityRecord, SceneSettings
from elys.editor_node.asset_uses import Use
from elys.editor_node.edits import records_of
from elys.editor_node.free_names import FreeNames
from elys.editor_node.ground import falls
from elys.editor_node.history import History, Outcome
from elys.editor_node.primitives import PRIMITIVES, primitive_record
from elys.editor_node.scene_mirror import EditorScene
from elys.editor_node.selection import Selection
from elys.editor_node.sentences import sentence

Done = asyncio.Future[Outcome]
Point = NDArray[np.float64]


class Operations:
    """Builds the commands of an edit from the mirror and the selection, and hands them to the history.

    Values are checked before they are sent: ComponentError for those that no host would accept. What changes nothing is not sent,
    and answered with None.
    """

    def __init__(self, scene: EditorScene, selection: Selection, history: History) -> None:
        self._scene = scene
        self._selection = selection
        self._history = history

    def rename(self, entity: int, name: str) -> Done | None:
        """Gives an entity another name; blanks around it are not part of it."""
        name = name.strip()
        if not name or not self._scene.exists(entity) or name == self._scene.name_of(entity):
            return None
        return self._perform(sentence("Rename to {name}", name=name), (Rename(entity=entity, name=name),))

    def reparent(self, entities: Iterable[int], parent: int, index: int = -1) -> Done | None:
        """Moves entities under `parent` (0: to the roots), in the order of the tree; each keeps its place in the world.

        `index` is the place among the children before anything moves. Those that would come below themselves stay.
        """
        scene = self._scene
        above = set(scene.ancestors_of(parent)) | {parent}
        moving = [entity for entity in self.tops(entities) if entity not in above]
        if index >= 0:
            before = set(scene.children_of(parent)[:index])
            index -= sum(entity in before for entity in moving)
        else:
            moving = [entity for entity in moving if scene.parent_of(entity) != parent]
        commands: list[Edit] = []
        for offset, entity in enumerate(moving):
            place = index + offset if index >= 0 else -1
            if scene.place_of(entity) != (parent, place):
                commands.append(Reparent(entity=entity, parent=parent, index=place))
        target = scene.name_of(parent) if parent else "the top"
        return self._perform(
            sentence("Move {what} to {target}", what=self._described(moving), target=target), tuple(commands)
        )

    def set_enabled(self, entities: Iterable[int], enabled: bool) -> Done | None:
        """Switches entities, and with them all below."""
        targets = [e for e in dict.fromkeys(entities) if self._scene.exists(e) and self._scene.is_enabled(e) != enabled]
        what = self._described(targets)
        label = sentence("Enable {what}", what=what) if enabled else sentence("Disable {what}", what=what)
        return self._perform(label, tuple(SetEnabled(entity=entity, enabled=enabled) for entity in targets))

    def set_fields(
        self, entities: Iterable[int], component: str, values: Mapping[str, Any], *, stroke: object = None
    ) -> Done | None:
        """Sets the same values of a component on all of the entities that have it."""
        return self.set_each(dict.fromkeys(entities, values), component, stroke=stroke)

    def set_each(
        self, values_of_entity: Mapping[int, Mapping[str, Any]], component: str, *, stroke: object = None
    ) -> Done | None:
        """Sets values of a component, each entity its own."""
        declaration = declaration_of(component)
        commands: list[Edit] = []
        for entity, values in values_of_entity.items():
            current = self._scene.component_of(entity, component)
            if current is None:
                continue
            checked = {name: check_value(declaration, declaration.field(name), v) for name, v in values.items()}
            # Within a stroke the mirror may lag behind what was sent: the way back to the start must be sent as well.
            if stroke is not None or any(getattr(current, name) != value for name, value in checked.items()):
                commands.append(SetComponent(entity=entity, component=component, values=checked))
        names = ", ".join(dict.fromkeys(name for values in values_of_entity.values() for name in values))
        what = self._described(list(values_of_entity))
        label = sentence("Set {field} of {what}", field=f"{component}.{names}", what=what)
        return self._perform(label, tuple(commands), stroke=stroke)

    def drop(self, entities: Iterable[int]) -> Done | None:
        """Puts entities, each with all below it, down on what is under them; those that are locked stay."""
        scene = self._scene
        tops = [
            entity
            for entity in self.tops(entities)
            if scene.echo_of(entity, "Transform") is not None and not scene.marks.is_marked("locked", entity)
        ]
        commands: list[Edit] = []
        for entity, rise in falls(scene, tops).items():
            pose, parent = scene.world_pose(entity), scene.parent_of(entity)
            x, y, z = pose.position
            position = (x, y + rise, z)
            if parent:
                position, _ = local_pose(*scene.world_pose(parent), position, pose.rotation)
            values = {"position": tuple(round(value, 6) + 0.0 for value in position)}
            if abs(rise) > 1e-5:
                commands.append(SetComponent(entity=entity, component="Transform", values=values))
        return self._perform(sentence("Drop {what}", what=self._described(tops)), tuple(commands))

    def set_settings(self, settings: SceneSettings, *, stroke: object = None) -> Done | None:
        """Changes the scene's settings."""
        if settings == self._scene.settings and stroke is None:
            return None
        return self._perform(sentence("Change the scene's settings"), (SetSettings(settings=settings),), stroke=stroke)

    def add_component(self, entities: Iterable[int], component: str) -> Done | None:
        """Gives a component with its defaults to all of the entities that have none."""
        declaration_of(component)
        targets = [
            e
            for e in dict.fromkeys(entities)
            if self._scene.exists(e) and component not in self._scene.components_of(e)
        ]
        commands = tuple(AddComponent(entity=entity, component=component) for entity in targets)
        return self._perform(
            sentence("Add {component} to {what}", component=component, what=self._described(targets)), commands
        )

    def lay_over(self, label: str, changes_of_entity: Mapping[int, ComponentChanges], **named: object) -> Done | None:
        """Lays changes over entities' components, as an instance's are laid over its prefab's: one edit, whatever it takes.

        A component that an entity lacks is added, None takes one away. `label` is a `sentence` of `named` and of `what` it is to.
        """
        commands: list[Edit] = []
        for entity, changes in changes_of_entity.items():
            if not self._scene.exists(entity):
                continue
            for name, values in changes.items():
                current = self._scene.component_of(entity, name)
                if values is None:
                    if current is not None:
                        commands.append(RemoveComponent(entity=entity, component=name))
                    continue
                checked = values_of(component_from(name, values, base=current))
                given = {field: checked[field] for field in values}
                if current is None:
                    commands.append(AddComponent(entity=entity, component=name, values=given))
                elif any(getattr(current, field) != value for field, value in given.items()):
                    commands.append(SetComponent(entity=entity, component=name, values=given))
        targets = list(dict.fromkeys(getattr(command, "entity", 0) for command in commands))
        return self._perform(sentence(label, what=self._described(targets), **named), tuple(commands))

    def remove_component(self, entities: Iterable[int], component: str) -> Done | None:
        """Takes a component away."""
        targets = [
            e for e in dict.fromkeys(entities) if self._scene.exists(e) and component in self._scene.components_of(e)
        ]
        commands = tuple(RemoveComponent(entity=entity, component=component) for entity in targets)
        return self._perform(
            sentence("Remove {component} from {what}", component=component, what=self._described(targets)), commands
        )

    def spawn(self, kind: str, *, parent: int = 0, at: Point | None = None) -> Done | None:
        """Makes a box, a sphere, ... at a point in the world [m], or where its parent is, and selects it.

        A body comes to stand above whatever is at that point.
        """
        point = np.zeros(3) if at is None else np.array(at, dtype=np.float64)
        if at is not None and "Collider" in PRIMITIVES[kind]:
            point[1] = self._scene.free_height(float(point[0]), float(point[1]), float(point[2]), 0.5)
        if parent and at is not None:
            local_from_world = matrix.inverse_affine(self._scene.world_from_local(parent))
            point = np.asarray(matrix.transform_points(local_from_world, point), dtype=np.float64)
        x, y, z = (round(float(value), 4) for value in point)
        record = primitive_record(kind, name=FreeNames(self._scene).take(parent, kind), position=(x, y, z))
        return self._spawn(sentence("Add {what}", what=record.name), (Spawn(records=(record,), parent=parent),))

    def spawn_records(self, label: str, records: Sequence[EntityRecord]) -> Done | None:
        """Makes entities at the top, whose content the host has, and selects them; roots get names that no sibling has."""
        names = FreeNames(self._scene)
        free = tuple(
            _renamed(record, names.take(0, record.name)) if record.parent < 0 else record for record in records
        )
        return self._spawn(label, (Spawn(records=free),) if free else ())

    def replace_assets(self, label: str, new_of: Mapping[str, str], uses: Mapping[str, Sequence[Use]]) -> Done | None:
        """Puts other content wherever a field names one of `new_of`, which `uses` tells; how a texture is laid stays."""
        changes: dict[tuple[int, str], dict[str, Any]] = {}
        for old, new in new_of.items():
            for use in uses.get(old, ()) if old != new else ():
                current = self._scene.component_of(use.entity, use.component) if use.field else None
                if current is not None and getattr(current, use.field) == old + use.options:
                    changes.setdefault((use.entity, use.component), {})[use.field] = new + use.options
        commands = tuple(
            SetComponent(entity=entity, component=component, values=values)
            for (entity, component), values in changes.items()
        )
        return self._perform(label, commands)

    def duplicate(self) -> Done | None:
        """Copies the selected entities with all below them, each beside its original, and selects the copies."""
        names, commands = FreeNames(self._scene), list[Edit]()
        for entity in self.tops(self._selection):
            parent, index = self._scene.place_of(entity)
            records, _ = records_of(self._scene, entity)
            renamed = (_renamed(records[0], names.take(parent, records[0].name)), *records[1:])
            commands.append(Spawn(records=renamed, parent=parent, index=index + 1))
        commands.reverse()  # from the last on, so that a copy does not shift the places of those that are still to be copied
        return self._spawn(
            sentence("Duplicate {what}", what=self._described(self.tops(self._selection))), tuple(commands)
        )

    def delete(self) -> Done | None:
        """Ends the selected entities with all below them."""
        doomed = self.tops(self._selection)
        commands = tuple(Despawn(entity=entity) for entity in doomed)
        return self._perform(sentence("Delete {what}", what=self._described(doomed)), commands)

    def tops(self, entities: Iterable[int]) -> list[int]:
        """Those that have none of the others above them, in the order of the tree."""
        scene = self._scene
        chosen = {entity for entity in entities if scene.exists(entity)}
        tops = [entity for entity in chosen if not chosen.intersection(scene.ancestors_of(entity))]
        return sorted(tops, key=scene.order_of)

    def _perform(self, label: str, commands: tuple[Edit, ...], *, stroke: object = None) -> Done | None:
        return self._history.perform(label, commands, stroke=stroke) if commands else None

    def _spawn(self, label: str, commands: tuple[Edit, ...]) -> Done | None:
        done = self._perform(label, commands)
        if done is not None:
            done.add_done_callback(self._select_spawned)
        return done

    def _select_spawned(self, done: Done) -> None:
        if not done.cancelled() and done.result().spawned:
            self._selection.replace(reversed(done.result().spawned))

    def _described(self, entities: list[int]) -> str:
        if len(entities) == 1:
            return self._scene.name_of(entities[0]) or "an entity"
        return sentence("{count} entities", count=len(entities))


def _renamed(record: EntityRecord, name: str) -> EntityRecord:
    return msgspec.structs.replace(record, name=name)

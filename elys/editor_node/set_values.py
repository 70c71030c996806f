"""What every field was last set to by a hand or by loading: what differs from it now was written by the simulation.

    snapshot, Spawned, a component that is new ──▶ set
    COMMANDS: somebody's accepted SetComponent ──▶ set, also as one of a Batch
    any other ComponentSet, and state frames   ──▶ written by the simulation: what was set stays

The two topics come in any order, so neither waits for the other: a command sets its values whenever it is heard.
"""

from __future__ import annotations

import contextlib
from typing import Any

from elys.bus.edit_parts import edits_of
from elys.bus.messages.commands import AddComponent, CommandRecord, SetComponent
from elys.bus.messages.scene import ComponentRemoved, ComponentSet, Reparented, Spawned
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.common.components import Component, component_from, declaration_of, declarations
from elys.common.errors import ComponentError
from elys.editor_node.field_values import is_close

_TRANSFORM = "Transform"


class SetValues:
    """Listens to a mirror; `command_seen` must be told of the commands."""

    def __init__(self, mirror: SceneMirror) -> None:
        self._mirror = mirror
        self._set: dict[int, dict[str, Component]] = {}
        self._epoch = 0
        mirror.listen(self._follow)

    def of(self, entity: int, component: str) -> Component | None:
        """A component as it was last set; None if the entity has none."""
        return self._set.get(entity, {}).get(component)

    def written_fields(self, entity: int, now: Component) -> dict[str, Any]:
        """The fields that the simulation has changed since, with what they were set to."""
        declaration = declaration_of(now)
        before = self.of(entity, declaration.name)
        if before is None or before is now or before == now:
            return {}
        pairs = [(field.name, getattr(before, field.name), getattr(now, field.name)) for field in declaration.fields]
        return {name: was for name, was, value in pairs if not is_close(was, value)}

    def command_seen(self, record: CommandRecord) -> None:
        """Takes what somebody set; what was refused sets nothing."""
        for edit in edits_of(record.command) if record.accepted else ():
            if isinstance(edit, SetComponent | AddComponent):
                self._take(edit)

    def _take(self, edit: SetComponent | AddComponent) -> None:
        owned = self._set.get(edit.entity, {})
        before = owned.get(edit.component)
        if before is None or edit.component not in declarations():
            return
        base = before if isinstance(edit, SetComponent) else None
        with contextlib.suppress(ComponentError):  # of another version, which declares it differently
            owned[edit.component] = component_from(edit.component, edit.values, base=base)

    def _follow(self, update: MirrorUpdate) -> None:
        entities = self._mirror.entities
        if update.reset:
            self._take_all()
            return
        moved = {change.entity for change in update.changes if isinstance(change, Reparented)}
        for change in update.changes:
            match change:
                case Spawned(entity=entity) if entity in entities:
                    self._set[entity] = dict(entities[entity].components)
                case ComponentSet(entity=entity, component=name) if entity in entities:
                    owned = self._set.setdefault(entity, {})
                    # Who moves under another parent gets another local pose by that, not by the simulation.
                    if (name not in owned or (name == _TRANSFORM and entity in moved)) and (
                        name in entities[entity].components
                    ):
                        owned[name] = entities[entity].components[name]
                case ComponentRemoved(entity=entity, component=name):
                    self._set.get(entity, {}).pop(name, None)
        for entity in update.removed:
            self._set.pop(entity, None)

    def _take_all(self) -> None:
        """After a snapshot: of the same run (a gap in the deltas, a seek) what was set stays set; only what is new is taken."""
        known = self._set if self._mirror.epoch == self._epoch else {}
        self._epoch = self._mirror.epoch
        self._set = {}
        for entity, found in self._mirror.entities.items():
            owned = known.get(entity)
            values = dict(found.components)
            self._set[entity] = values if owned is None else {name: owned.get(name, v) for name, v in values.items()}

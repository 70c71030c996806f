"""What bodies, clips and joints were before time moved them: the scene as somebody edited it, beside the scene as it runs.

Just before the first step, or the first pose of a clip, the columns that a simulation writes into are copied, once. From then on
edits are noted here too: the fields that they name, as the edit left them. Whoever saves the scene saves these and not where
bodies have fallen.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from elys.common.components.columns import Column
from elys.common.ids import Entity
from elys.sim_node.ecs.columns import NO_ROW, ComponentTable
from elys.sim_node.ecs.entities import Entities, indices_of
from elys.sim_node.ecs.world import World

MOVED: Final[dict[str, tuple[str, ...]]] = {  # by component the fields that steps write
    "Transform": ("position", "rotation", "scale"),
    "RigidBody": ("linear_velocity", "angular_velocity"),
    "Joint": ("broken",),
    "Animation": ("time", "passes"),
    "Character": (
        *("velocity", "carried", "grounded", "ground_normal", "ground", "blocked", "stature", "air_time", "jump_time"),
        *("jump_held", "has_jumped", "yaw", "wish", "wish_run", "wish_jump", "wish_crouch", "mode"),
    ),
    "CameraRig": ("view", "yaw", "pitch", "reach", "eye"),
}

FieldValues = dict[str, Any]  # stored values by field
EditedMemory = tuple[dict[str, tuple[Entities, dict[str, Column]]], dict[tuple[int, str], FieldValues]]


class EditedValues:
    """Of one world. Nothing is kept until `capture`: until then all is as it was edited."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._captured: dict[str, tuple[Entities, dict[str, Column]]] = {}
        self._row_of: dict[str, dict[int, int]] = {}  # of what was captured; made when first asked for
        self._noted: dict[tuple[int, str], FieldValues] = {}

    @property
    def is_captured(self) -> bool:
        """Whether anything was moved since the scene was loaded."""
        return bool(self._captured)

    def capture(self) -> None:
        """Takes what is there as edited, before anything is moved; does nothing later."""
        if self._captured:
            return
        for name, fields in MOVED.items():
            table = self._world.table(name)
            columns = {field: table.column(field).copy() for field in fields}
            self._captured[name] = (table.entities.copy(), columns)

    def forget(self) -> None:
        """Another scene: all that is there is as it was edited."""
        self._captured.clear()
        self._row_of.clear()
        self._noted.clear()

    def kept(self) -> EditedMemory:
        """What is remembered, for `put_back`; what is in it is never written into."""
        return dict(self._captured), dict(self._noted)

    def put_back(self, memory: EditedMemory) -> None:
        """Remembers what `kept` once gave."""
        self._captured, self._noted = dict(memory[0]), dict(memory[1])
        self._row_of.clear()

    def of(self, entity: int, component: str) -> FieldValues | None:
        """The values of an entity's fields as edited; None where they are what is there now."""
        if component not in MOVED:
            return None
        noted = self._noted.get((entity, component))
        if noted is not None:
            return dict(noted)
        row = self._captured_row(entity, component)
        if row < 0:
            return None
        return {field: column[row].copy() for field, column in self._captured[component][1].items()}

    def note(self, entity: int, component: str, *, fields: tuple[str, ...] | None = None) -> None:
        """An edit has written these fields (None: all) of a component: they are as they are now."""
        if component not in MOVED or not self._captured or not self._world.is_alive(entity):
            return
        table = self._world.table(component)
        row = int(table.row_of[indices_of(np.array([entity], np.uint32))[0]])
        if row == NO_ROW:
            return
        values = (self.of(entity, component) if fields is not None else None) or _live(table, row)
        for field in MOVED[component]:
            if fields is None or field in fields:
                values[field] = table.column(field)[row].copy()
        self._noted[entity, component] = values

    def note_spawned(self, entities: tuple[int, ...]) -> None:
        """Entities came to be. Those that came back are remembered as they were."""
        for entity in entities if self._captured else ():
            for component in MOVED:
                if self._world.is_alive(entity) and self.of(entity, component) is None:
                    self.note(entity, component)

    def recall(self, entity: int, component: str, values: FieldValues | None) -> None:
        """Makes an entity's values as edited those that `of` once gave."""
        if values is None:
            self.note(entity, component)
        else:
            self._noted[entity, component] = values

    def columns(self, table: ComponentTable) -> dict[str, Column]:
        """All columns of a component, with what steps have written as it was edited."""
        columns = table.columns()
        name = table.declaration.name
        if name not in MOVED or not self._captured:
            return columns
        columns = {field: column.copy() if field in MOVED[name] else column for field, column in columns.items()}
        entities, captured = self._captured[name]
        alive = self._world.allocator.are_alive(entities)
        rows = np.full(len(entities), NO_ROW, np.int32)
        rows[alive] = table.rows(entities[alive])
        present = rows != NO_ROW
        for field, column in captured.items():
            columns[field][rows[present]] = column[present]
        for (entity, component), values in self._noted.items():
            if component == name and self._world.is_alive(entity) and self._world.has(Entity(entity), name):
                row = int(table.rows(np.array([entity], np.uint32))[0])
                for field, value in values.items():
                    columns[field][row] = value
        return columns

    def _captured_row(self, entity: int, component: str) -> int:
        if component not in self._captured:
            return -1
        if component not in self._row_of:
            entities = self._captured[component][0].tolist()
            self._row_of[component] = {owner: row for row, owner in enumerate(entities)}
        return self._row_of[component].get(entity, -1)


def _live(table: ComponentTable, row: int) -> FieldValues:
    return {field: table.column(field)[row].copy() for field in MOVED[table.declaration.name]}

"""Tables that follow a mirror: an edit writes the rows that it touches, and what changes who is there makes all of them anew.

MirrorUpdate ──note──> what was edited ──read──> SceneTables, written in place, and SceneEdits: which rows
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from elys.bus.messages.scene import ComponentRemoved, ComponentSet, Renamed, SceneChange, SettingsSet
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.common.components import Camera, Environment, Light, Material, MeshRenderer, Morph, Skin, Transform
from elys.common.math import quaternion
from elys.common.math.matrix import compose_affine, multiply_affine
from elys.render_node.scene_tables import Rows, SceneTables, ranges, tables_of_mirror

# What has other values while everything else stays, by the table that holds it; others decide who is drawn, and with whom.
_VALUES: Final = {
    Material.__name__: "materials",
    Light.__name__: "lights",
    Camera.__name__: "cameras",
    Environment.__name__: "environments",
}
_DRAWN: Final = frozenset({Transform.__name__, MeshRenderer.__name__, Skin.__name__, Morph.__name__, *_VALUES})


@dataclass(frozen=True, slots=True)
class SceneEdits:
    """Rows of tables that differ from what was read before: nothing else does, but the settings, which may.

    Attributes:
        moved: who stands elsewhere, with all below, ascending; or was put by a newer scene delta.
        materials, lights, cameras, environments: whose values are others.
    """

    moved: Rows
    materials: tuple[int, ...] = ()
    lights: tuple[int, ...] = ()
    cameras: tuple[int, ...] = ()
    environments: tuple[int, ...] = ()


class SceneReading(NamedTuple):
    """Tables, and what was edited since the last ones; None where they are new."""

    tables: SceneTables
    edits: SceneEdits | None


class SceneReader:
    """Makes tables of a mirror, and keeps them what it is. Those read before are written to: there is one reader for each."""

    def __init__(self, mirror: SceneMirror) -> None:
        self._mirror = mirror
        self._tables: SceneTables | None = None
        self._moved: set[int] = set()
        self._set: set[tuple[str, int]] = set()  # components of entities
        self._has_settings = False
        self._unlisten = mirror.listen(self._note)

    def read(self) -> SceneReading | None:
        """What the scene is now; None when nothing changed since the last call."""
        if self._tables is None:
            self._tables = tables_of_mirror(self._mirror)
            self._end = subtree_ends(self._tables)
            self._forget()
            return SceneReading(self._tables, None)
        if not (self._moved or self._set or self._has_settings):
            return None
        self._tables = replace(self._tables, settings=self._mirror.settings)
        values = self._write_values(self._tables)
        set_rows = {table: tuple(sorted(rows)) for table, rows in values.items()}
        edits = SceneEdits(self._write_transforms(self._tables), **set_rows)
        self._forget()
        return SceneReading(self._tables, edits)

    def close(self) -> None:
        """Stops listening to the mirror."""
        self._unlisten()

    def _note(self, update: MirrorUpdate) -> None:
        if update.reset or not all(map(self._takes, update.changes)):
            self._tables = None

    def _takes(self, change: SceneChange) -> bool:
        """Notes a change that leaves the tables what they are, but for the rows that it touches; False for others."""
        if self._tables is None:
            return False
        match change:
            case Renamed():
                return not self._tables.skins  # which name their joints
            case SettingsSet():
                self._has_settings = True
                return True
            case ComponentSet(component="Transform", entity=entity):
                self._moved.add(entity)
                return entity in self._tables.row_of
            case ComponentSet(component=component, entity=entity) if component in _VALUES:
                self._set.add((component, entity))
                return self._tables.row_of.get(entity, -1) in getattr(self._tables, _VALUES[component])
            case ComponentSet(component=component) | ComponentRemoved(component=component):
                return component not in _DRAWN
            case _:
                return False

    def _forget(self) -> None:
        self._moved.clear()
        self._set.clear()
        self._has_settings = False

    def _write_values(self, tables: SceneTables) -> dict[str, list[int]]:
        rows: dict[str, list[int]] = {}
        for component, entity in self._set:
            row, table = tables.row_of[entity], _VALUES[component]
            values: dict[int, Any] = getattr(tables, table)
            value = self._mirror.entities[entity].components[component]
            if value != values[row]:
                values[row] = value
                rows.setdefault(table, []).append(row)
        return rows

    def _write_transforms(self, tables: SceneTables) -> Rows:
        if not self._moved:
            return np.zeros(0, np.intp)
        position, rotation, scale = tables.local
        rows = np.array(sorted(tables.row_of[entity] for entity in self._moved), np.intp)
        entities = [self._mirror.entities[entity] for entity in tables.entity[rows].tolist()]
        transforms: list[Any] = [entity.components[Transform.__name__] for entity in entities]
        position[rows] = [transform.position for transform in transforms]
        rotation[rows] = [transform.rotation for transform in transforms]
        scale[rows] = [transform.scale for transform in transforms]
        tables.pose_sequence[rows] = [entity.pose_sequence for entity in entities]
        return place_below(tables, rows, self._end)


def subtree_ends(tables: SceneTables) -> Rows:
    """For each row (N,) that after the last one below it, where whatever is below a row follows it at once."""
    size = np.ones(len(tables.entity), np.intp)
    for rows in reversed(tables.levels[1:]):
        np.add.at(size, tables.parent[rows], size[rows])
    return np.arange(len(size)) + size


def place_below(tables: SceneTables, rows: Rows, end: Rows) -> Rows:
    """Brings the world's transforms of some rows, ascending, and of all below them to what the local ones say; returns all these.

    `end` (N,) is what `subtree_ends` says.
    """
    last = np.maximum.accumulate(end[rows])
    tops = rows[np.append(True, rows[1:] >= last[:-1])]  # those that are below no other
    touched = ranges(tops, end[tops])
    world_from_local, world_rotation = tables.world_from_local, tables.rotation
    position, rotation, scale = tables.local
    for depth, level in enumerate(tables.levels):
        here = level[ranges(np.searchsorted(level, tops), np.searchsorted(level, end[tops]))]
        if not len(here):
            continue
        parent_from_local = compose_affine(position[here], rotation[here], scale[here])
        if depth:
            above = tables.parent[here]
            world_from_local[here] = multiply_affine(world_from_local[above], parent_from_local)
            world_rotation[here] = quaternion.multiply(world_rotation[above], rotation[here])
        else:
            world_from_local[here], world_rotation[here] = parent_from_local, rotation[here]
    return touched

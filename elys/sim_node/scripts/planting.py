"""Prefabs that scripts spawn: records with changes laid over them, planted into a world."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence

import msgspec

from elys.common.components import Kind, declaration_of, laid_over
from elys.common.errors import SceneError
from elys.common.ids import Entity
from elys.common.scene_document import ComponentChanges, EntityRecord
from elys.sim_node.ecs.world import World
from elys.sim_node.scene.loading import load_records


def spawn_records(
    world: World,
    records: Sequence[EntityRecord],
    parent: Entity,
    changes: Mapping[str, ComponentChanges],
    *,
    name: str = "",
) -> Entity:
    """Makes the entities of a prefab and returns its root; `changes` by path of names below the root, "" for itself.

    Raises:
        SceneError: nobody stands at a path. ComponentError: a value does not fit.
    """
    laid = list(records)
    rows = _rows_by_path(records)
    for path, change in changes.items():
        if path not in rows:
            close = difflib.get_close_matches(path, list(rows), n=1, cutoff=0.5)
            remedy = f"; did you mean {close[0]!r}?" if close else ""
            raise SceneError(f"the prefab has nobody at {path!r}{remedy}")
        row = rows[path]
        laid[row] = _changed(laid[row], change)
    if name:
        laid[0] = msgspec.structs.replace(laid[0], name=name)
    return load_records(world, laid, parent=parent)[0]


def _rows_by_path(records: Sequence[EntityRecord]) -> dict[str, int]:
    """Of those with the same path the first."""
    paths = [""]
    for record in records[1:]:
        above = paths[record.parent]
        paths.append(f"{above}/{record.name}" if above else record.name)
    rows: dict[str, int] = {}
    for row, path in enumerate(paths):
        rows.setdefault(path, row)
    return rows


def _changed(record: EntityRecord, changes: ComponentChanges) -> EntityRecord:
    components, references = dict(record.components), dict(record.references)
    for name, values in changes.items():
        named = {field.name for field in declaration_of(name).fields if field.kind is Kind.ENTITY}
        for key in named if values is None else named & values.keys():
            references.pop(f"{name}.{key}", None)
        if values is None:
            components.pop(name, None)
        else:
            components[name] = laid_over(name, components.get(name, {}), values)
    return msgspec.structs.replace(record, components=components, references=references)

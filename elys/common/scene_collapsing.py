"""From records back to a SceneDocument: what `expand` put in place becomes a prefab with overrides again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from elys.common.assets.store import AssetStore, is_reference
from elys.common.assets.texture import split_texture
from elys.common.components import FieldDeclaration, Kind, component_from, declaration_of, declarations
from elys.common.components.decimals import FLOAT32_MAX, shortest_decimal
from elys.common.errors import AssetError, SceneError
from elys.common.scene_document import (
    ComponentChanges,
    ComponentValues,
    EntityNode,
    EntityRecord,
    SceneDocument,
    SceneSettings,
)
from elys.common.scene_expansion import expand
from elys.common.scene_files import relative_name
from elys.common.scene_naming import Names
from elys.common.scene_reading import MAX_DEPTH


def collapse(
    records: Sequence[EntityRecord],
    *,
    name: str,
    settings: SceneSettings,
    directory: str | Path,
    assets: AssetStore,
) -> SceneDocument:
    """The document of a scene that is to be written into `directory`.

    An instance of a prefab is written as one again, with what changed as overrides, as long as it has all of the prefab's
    entities and new ones only below its root; else its entities are written out. Content references become the files they
    came from: those that `assets` knows, and the prefabs'.

    Raises:
        SceneError: the records are no tree, or nested deeper than a file may be, or a number is out of all bounds; a prefab
            cannot be read; no file is known to hold what a content reference names; a field names an entity by its id, or one
            whose path of names others have as well.
        ComponentError: a value is not what its component takes.
    """
    directory = Path(directory).absolute()
    children: list[list[int]] = [[] for _ in records]
    roots: list[int] = []
    for row, record in enumerate(records):
        if record.parent >= row:
            raise SceneError(f"'{record.name}' stands before its parent")
        (children[record.parent] if record.parent >= 0 else roots).append(row)
    job = _Collapse(
        records=records,
        children=children,
        directory=directory,
        assets=assets,
        baselines={},
        names=Names([(record.name, record.parent) for record in records]),
    )
    return SceneDocument(name=name, settings=settings, entities=[_node(job, row, 1) for row in roots])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Collapse:
    """What the steps share."""

    records: Sequence[EntityRecord]
    children: list[list[int]]
    directory: Path
    assets: AssetStore
    baselines: dict[str, list[EntityRecord]]
    names: Names


def _node(job: _Collapse, row: int, depth: int) -> EntityNode:
    record = job.records[row]
    if depth > MAX_DEPTH:
        raise SceneError(f"'{record.name}' is nested more than {MAX_DEPTH} deep, which a scene file cannot hold")
    if record.prefab:
        instance = _instance(job, row, depth)
        if instance is not None:
            return instance
    return EntityNode(
        name=record.name,
        enabled=record.enabled,
        components=_in_files(job, record, _changes(job, None, record, {})),
        children=[_node(job, child, depth + 1) for child in job.children[row]],
    )


def _instance(job: _Collapse, row: int, depth: int) -> EntityNode | None:
    """The entity as an instance of its prefab, or None if it has become something else."""
    record = job.records[row]
    baseline = _baseline(job, record)
    original, present = _paths(baseline, _children_of(baseline), 0), _paths(job.records, job.children, row)
    if original is None or present is None or not original.keys() <= present.keys():
        return None
    kept = {present[path] for path in original}
    added = [r for path, r in present.items() if path not in original and job.records[r].parent in kept]
    if any(job.records[r].parent != row for r in added):
        return None
    overrides: dict[str, ComponentChanges] = {}
    place_now = {place: present[path] for path, place in original.items()}
    for path, place in original.items():
        was, now = baseline[place], job.records[present[path]]
        if path and was.enabled != now.enabled:
            return None
        changes = _changes(job, was, now, place_now)
        if path and changes:
            overrides[path] = _in_files(job, now, changes)
    if not baseline[0].enabled and record.enabled:
        return None
    changes = _changes(job, baseline[0], record, place_now)
    return EntityNode(
        name="" if record.name == baseline[0].name else record.name,
        enabled=record.enabled or not baseline[0].enabled,
        prefab=relative_name(job.directory / record.prefab, job.directory),
        components=_in_files(job, record, changes),
        overrides=overrides,
        children=[_node(job, child, depth + 1) for child in added],
    )


def _baseline(job: _Collapse, record: EntityRecord) -> list[EntityRecord]:
    """The record's prefab as its file has it."""
    if record.prefab not in job.baselines:
        document = SceneDocument(entities=[EntityNode(prefab=record.prefab)])
        try:
            job.baselines[record.prefab] = expand(document, directory=job.directory, assets=job.assets)
        except (SceneError, AssetError) as error:
            reason = str(error).removeprefix("entities[0].prefab: ")
            raise SceneError(f"'{record.name}' cannot be saved, its prefab cannot be read here: {reason}") from error
    return job.baselines[record.prefab]


def _children_of(records: Sequence[EntityRecord]) -> list[list[int]]:
    children: list[list[int]] = [[] for _ in records]
    for row, record in enumerate(records):
        if record.parent >= 0:
            children[record.parent].append(row)
    return children


def _paths(records: Sequence[EntityRecord], children: list[list[int]], root: int) -> dict[str, int] | None:
    """Row by path of names below `root` (itself at ""), in order; None if two have the same path."""
    paths = {"": root}
    waiting = [(child, "") for child in reversed(children[root])]
    while waiting:
        row, above = waiting.pop()
        path = f"{above}/{records[row].name}" if above else records[row].name
        if path in paths:
            return None
        paths[path] = row
        waiting.extend((child, path) for child in reversed(children[row]))
    return paths


def _changes(
    job: _Collapse, was: EntityRecord | None, now: EntityRecord, place_now: Mapping[int, int]
) -> ComponentChanges:
    """What must be laid over a record to get another; `place_now` tells where those that `was` names stand now."""
    changes = _differences(was.components if was is not None else {}, now.components)
    before = {} if was is None else {key: place_now.get(row) for key, row in was.references.items()}
    for name in now.components:
        for field in declaration_of(name).fields:
            if field.kind is not Kind.ENTITY:
                continue
            if now.components[name].get(field.name, 0):
                raise SceneError(
                    f"'{now.name}' cannot be saved: its {name}.{field.name} is an entity that is not there any more, or not part "
                    "of what is saved; name another one, or none"
                )
            key = f"{name}.{field.name}"
            target = now.references.get(key)
            values = changes.get(name) or {}
            values.pop(field.name, None)
            if target is not None and target != before.get(key):
                values[field.name] = _name_of(job, now, key, target)
            elif target is None and key in before:
                values[field.name] = ""
            if values:
                changes[name] = values
    return changes


def _name_of(job: _Collapse, record: EntityRecord, key: str, target: int) -> str:
    try:
        return job.names.name_of(target)
    except SceneError as error:
        raise SceneError(
            f"'{record.name}' cannot be saved, whose {key} is '{job.records[target].name}': {error}"
        ) from error


def _differences(was: ComponentValues, now: ComponentValues) -> ComponentChanges:
    """What must be laid over `was` to get `now`."""
    changes: ComponentChanges = {}
    for name in declarations():
        if name in now:
            old, new = _full_values(name, was.get(name, {})), _full_values(name, now[name])
            changed = {field: value for field, value in new.items() if value != old[field]}
            for field in declaration_of(name).fields:
                if field.kind is Kind.VALUES and field.name in changed:
                    changed[field.name] = _named_differences(old[field.name], new[field.name])
            if changed or name not in was:
                changes[name] = changed
        elif name in was:
            changes[name] = None
    for name in now:
        declaration_of(name)  # an unknown component must not get lost without a word
    return changes


def _named_differences(was: dict[str, Any], now: dict[str, Any]) -> dict[str, Any]:
    """Named values are laid over one by one; None takes one away."""
    taken = dict.fromkeys(name for name in was if name not in now)
    return taken | {name: value for name, value in now.items() if name not in was or was[name] != value}


def _full_values(name: str, values: dict[str, Any]) -> dict[str, Any]:
    component = component_from(name, values)
    return {field.name: _tidy(field, getattr(component, field.name)) for field in declaration_of(name).fields}


def _tidy(field: FieldDeclaration, value: Any) -> Any:
    """A value as it is best written: what is stored in 32 bits with the fewest digits that give the same 32 bits."""
    if isinstance(value, tuple):
        return [_tidy(field, element) for element in value]
    if isinstance(value, float) and field.dtype == "f4":
        if abs(value) > FLOAT32_MAX:
            raise SceneError(f"{field.name} must fit 32 bits (3.4e38), not {value:g}")
        return shortest_decimal(value)
    return value


def _in_files(job: _Collapse, record: EntityRecord, changes: ComponentChanges) -> ComponentChanges:
    """The changes with content references turned into the files they came from."""
    return {
        component: None
        if values is None
        else {field: _in_file(job, record, f"{component}.{field}", value) for field, value in values.items()}
        for component, values in changes.items()
    }


def _in_file(job: _Collapse, record: EntityRecord, place: str, value: Any) -> Any:
    if isinstance(value, dict) and place == "Script.values":
        return {key: _in_file(job, record, f"{place}.{key}", item) for key, item in value.items()}
    if isinstance(value, str) and is_reference(split_texture(value)[0]):
        return _source(job, record, place, value)
    return value


def _source(job: _Collapse, record: EntityRecord, place: str, text: str) -> str:
    reference, options = split_texture(text)
    if not job.assets.source(reference):
        # It may stand in a prefab that no entity before this one was an instance of.
        for other in job.records:
            if other.prefab:
                _baseline(job, other)
    path, hash_sign, fragment = job.assets.source(reference).partition("#")
    if not path:
        raise SceneError(
            f"'{record.name}' cannot be saved: no file is known here that holds its {place}, {reference}; name one instead"
        )
    return relative_name(Path(path), job.directory) + hash_sign + fragment + options

"""What differs between two scenes, entity by entity and field by field: what was edited since the file, in words.

Entities have no ids in files: they are matched by where they stand and what they are called, those of one name in their order;
what is left over of a parent's children on both sides and is alike within counts as renamed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import msgspec

from elys.common.components import component_from, declaration_of
from elys.common.errors import ElysError
from elys.common.scene import EntityRecord, SceneSettings

DiffKind = Literal["added", "removed", "changed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DiffLine:
    """One difference. `what` is empty for a whole entity, else a component, "Component.field" or "name" and the like."""

    kind: DiffKind
    path: str  # of names, as "House/Door"; empty for the scene's settings
    what: str = ""
    before: str = ""
    after: str = ""


@dataclass(slots=True)
class _Node:
    record: EntityRecord
    path: str
    children: list[_Node]


def scene_diff(
    before: Sequence[EntityRecord],
    after: Sequence[EntityRecord],
    *,
    settings_before: SceneSettings,
    settings_after: SceneSettings,
) -> list[DiffLine]:
    """The differences in the order of the later scene, what is gone after what is still there."""
    lines = _settings_lines(settings_before, settings_after)
    old, new = _forest(before), _forest(after)
    matches: dict[int, int] = {}  # rows of the earlier by rows of the later, for what refers to entities
    pairs: list[tuple[_Node, _Node]] = []
    changes: list[DiffLine] = []
    _match(old, new, pairs, changes)
    row_of_old = {id(record): row for row, record in enumerate(before)}
    row_of_new = {id(record): row for row, record in enumerate(after)}
    for left, right in pairs:
        matches[row_of_new[id(right.record)]] = row_of_old[id(left.record)]
    for left, right in pairs:
        lines += _entity_lines(left, right, matches)
    return lines + changes


def _forest(records: Sequence[EntityRecord]) -> list[_Node]:
    nodes: list[_Node] = []
    roots: list[_Node] = []
    for record in records:
        above = nodes[record.parent] if record.parent >= 0 else None
        path = f"{above.path}/{record.name}" if above is not None else record.name
        node = _Node(record, path, [])
        nodes.append(node)
        (above.children if above is not None else roots).append(node)
    return roots


def _match(old: list[_Node], new: list[_Node], pairs: list[tuple[_Node, _Node]], changes: list[DiffLine]) -> None:
    waiting: dict[str, list[_Node]] = {}
    for node in old:
        waiting.setdefault(node.record.name, []).append(node)
    partner: dict[int, _Node] = {}
    for node in new:
        same = waiting.get(node.record.name)
        if same:
            partner[id(node)] = same.pop(0)
    left = [node for node in old if any(node is one for several in waiting.values() for one in several)]
    for node in new:
        if id(node) not in partner:
            alike = next((other for other in left if _is_alike(other, node)), None)
            if alike is not None:
                left.remove(alike)
                partner[id(node)] = alike
    for node in new:
        match = partner.get(id(node))
        if match is None:
            changes.append(DiffLine(kind="added", path=node.path))
            continue
        pairs.append((match, node))
        _match(match.children, node.children, pairs, changes)
    changes += [DiffLine(kind="removed", path=node.path) for node in left]


def _is_alike(left: _Node, right: _Node) -> bool:
    """Whether two are the same but for their names."""
    return (
        left.record.components.keys() == right.record.components.keys()
        and _values(left.record) == _values(right.record)
        and [child.record.name for child in left.children] == [child.record.name for child in right.children]
    )


def _values(record: EntityRecord) -> dict[str, Any]:
    return {name: _component(name, values) for name, values in record.components.items()}


def _component(name: str, values: dict[str, Any]) -> Any:
    try:
        return component_from(name, values)
    except ElysError:  # of another version: compared as it is written
        return values


def _entity_lines(left: _Node, right: _Node, matches: dict[int, int]) -> list[DiffLine]:
    before, after, path = left.record, right.record, right.path
    lines: list[DiffLine] = []
    for what in ("name", "enabled", "prefab"):
        was, now = getattr(before, what), getattr(after, what)
        if was != now:
            lines.append(DiffLine(kind="changed", path=path, what=what, before=_shown(was), after=_shown(now)))
    for name in dict.fromkeys((*before.components, *after.components)):
        if name not in before.components:
            lines.append(DiffLine(kind="added", path=path, what=name))
        elif name not in after.components:
            lines.append(DiffLine(kind="removed", path=path, what=name))
        else:
            lines += _component_lines(path, name, before.components[name], after.components[name])
    for key in dict.fromkeys((*before.references, *after.references)):
        was_row, now_row = before.references.get(key, -1), after.references.get(key, -1)
        if (matches.get(now_row, -2) if now_row >= 0 else -1) != was_row:
            lines.append(DiffLine(kind="changed", path=path, what=key))
    return lines


def _component_lines(path: str, name: str, before: dict[str, Any], after: dict[str, Any]) -> list[DiffLine]:
    was, now = _component(name, before), _component(name, after)
    if was == now:
        return []
    if isinstance(was, dict) or isinstance(now, dict):
        return [DiffLine(kind="changed", path=path, what=name)]
    lines = []
    for field in declaration_of(name).fields:
        old, new = getattr(was, field.name), getattr(now, field.name)
        if old != new:
            line = DiffLine(
                kind="changed", path=path, what=f"{name}.{field.name}", before=_shown(old), after=_shown(new)
            )
            lines.append(line)
    return lines


def _settings_lines(before: SceneSettings, after: SceneSettings) -> list[DiffLine]:
    lines = []
    for name, was in msgspec.structs.asdict(before).items():
        now = getattr(after, name)
        if was != now:
            lines.append(DiffLine(kind="changed", path="", what=name, before=_shown(was), after=_shown(now)))
    return lines


def _shown(value: Any) -> str:
    """A value as a line shows it."""
    match value:
        case bool():
            return "yes" if value else "no"
        case float():
            return f"{value:g}"
        case tuple():
            return "(" + ", ".join(_shown(part) for part in value) + ")"
        case str():
            return value or "nothing"
        case _:
            text = str(value)
            return text if len(text) <= 60 else f"{text[:57]}..."

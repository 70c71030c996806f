"""Edits about entities that came back under other ids, and which of two edits makes the other superfluous."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from elys.bus.messages.commands import AddComponent, Edit, SetComponent, SetSettings, Spawn
from elys.common.components import Kind, declaration_of, declarations


def with_new_ids(edit: Edit, new_ids: Mapping[int, int]) -> Edit:
    """The edit, about entities that have other ids now."""
    changes: dict[str, Any] = {}
    for field in ("entity", "parent"):
        old = getattr(edit, field, 0)
        if old in new_ids:
            changes[field] = new_ids[old]
    match edit:
        case SetComponent(component=name, values=values) | AddComponent(component=name, values=values):
            changes["values"] = _values_with_new_ids(name, values, new_ids)
        case Spawn(records=records, entities=entities):
            changes["entities"] = tuple(new_ids.get(entity, entity) for entity in entities)
            changes["records"] = tuple(
                msgspec.structs.replace(
                    record,
                    components={
                        name: _values_with_new_ids(name, values, new_ids) for name, values in record.components.items()
                    },
                )
                for record in records
            )
    return msgspec.structs.replace(edit, **changes) if changes else edit


def _values_with_new_ids(component: str, values: Mapping[str, Any], new_ids: Mapping[int, int]) -> dict[str, Any]:
    if component not in declarations():
        return dict(values)
    names = {field.name for field in declaration_of(component).fields if field.kind is Kind.ENTITY}
    return {name: new_ids.get(value, value) if name in names else value for name, value in values.items()}


def target_of(edit: Edit) -> tuple[Any, ...]:
    """What an edit changes: of two in one drag with the same target one is enough."""
    match edit:
        case SetComponent(entity=entity, component=name, values=values):
            return (SetComponent, entity, name, frozenset(values))
        case SetSettings():
            return (SetSettings,)
        case _:
            return (type(edit), getattr(edit, "entity", 0))

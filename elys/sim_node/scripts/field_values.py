"""What a Script component says of its behaviour's fields, as values that the script can use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from elys.common.components import check_value
from elys.common.components.declaration import ComponentDeclaration, FieldDeclaration, Kind
from elys.common.errors import ComponentError, EntityError, ScriptError
from elys.common.ids import Entity
from elys.sim_node.scripts.handles import EntityHandle
from elys.sim_node.scripts.vector import Rotation, Vector

if TYPE_CHECKING:
    from elys.sim_node.scripts.library import LoadedScript
    from elys.sim_node.scripts.runner import Scripts


def field_values(
    scripts: Scripts, script: LoadedScript, values: Mapping[str, Any], *, before: Mapping[str, Any]
) -> dict[str, Any]:
    """The fields to be set, of those that say something else than before; those said no more have their defaults.

    Raises:
        ScriptError: a field is none of the script's, or its value is not of its type; the sentence says what was expected.
    """
    for name in values:
        if name not in script.fields:
            known = ", ".join(script.fields) or "none"
            raise ScriptError(f"{script.name} has no field {name!r}; it has {known}")
    found = {}
    for name, declared in script.fields.items():
        value = values.get(name, declared.default)
        if not before and name not in values and declared.kind is not Kind.ENTITY:
            continue  # the class's own default
        if value != before.get(name, declared.default) or not before:
            found[name] = _value(scripts, script, declared, value)
    return found


def _value(scripts: Scripts, script: LoadedScript, declared: FieldDeclaration, value: Any) -> Any:
    if declared.kind is Kind.ENTITY and isinstance(value, str):
        try:
            return EntityHandle(scripts, scripts.simulation.world.hierarchy.find(value)) if value else None
        except EntityError as error:
            raise ScriptError(f"{script.name}.{declared.name}: {error}") from error
    owner = ComponentDeclaration(name=script.name, struct=None, text="", fields=(declared,))  # type: ignore[arg-type]
    try:
        checked = check_value(owner, declared, value)
    except ComponentError as error:
        raise ScriptError(f"{error}; set it in the inspector or in the scene's file") from error
    match declared.kind:
        case Kind.ENTITY:
            return EntityHandle(scripts, Entity(checked)) if checked else None
        case Kind.VEC3:
            return Vector(checked)
        case Kind.QUAT:
            return Rotation(checked)
    return checked

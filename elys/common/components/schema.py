"""JSON Schema (2020-12) of components and of the scene file, derived from the declarations: for editors, tools and recordings."""

from __future__ import annotations

from typing import Any, Final

import msgspec

from elys.common.components.curve import KEY_WIDTH, MAX_KEYS
from elys.common.components.declaration import (
    ComponentDeclaration,
    FieldDeclaration,
    Kind,
    declaration_of,
    declarations,
)
from elys.common.scene_document import SCENE_VERSION, SceneSettings

DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"
_VECTORS: Final = (Kind.VEC3, Kind.QUAT, Kind.COLOR)


def component_schema(name: str) -> dict[str, Any]:
    """The schema of one component's values, in files and elsewhere; raises ComponentError if there is none of this name."""
    return {"$schema": DIALECT, **_component(declaration_of(name))}


def scene_schema() -> dict[str, Any]:
    """The schema of a scene or prefab file, with all components that are declared now."""
    components = {name: {"$ref": f"#/$defs/{name}"} for name in declarations()}
    changes = {name: {"anyOf": [reference, {"type": "null"}]} for name, reference in components.items()}
    return {
        "$schema": DIALECT,
        "title": "ELYS scene",
        "description": "A scene (.scene.json) or, with exactly one root entity, a prefab (.prefab.json).",
        "type": "object",
        "properties": {
            "elys_scene": {"const": SCENE_VERSION, "description": "Version of the format."},
            "name": {"type": "string"},
            "settings": {"$ref": "#/$defs/settings"},
            "entities": {"type": "array", "items": {"$ref": "#/$defs/entity"}},
        },
        "required": ["elys_scene"],
        "additionalProperties": False,
        "$defs": {
            **_settings(),
            "entity": _entity(),
            "components": _closed(components, "Components by name."),
            "changes": _closed(changes, "Laid over a prefab's components; null takes one away."),
            **{name: _component(declaration) for name, declaration in declarations().items()},
        },
    }


def _entity() -> dict[str, Any]:
    return {
        "type": "object",
        "description": "An entity with its children.",
        "properties": {
            "name": {"type": "string"},
            "enabled": {"type": "boolean", "default": True},
            "prefab": {
                "type": "string",
                "minLength": 1,
                "description": "A prefab or model file that takes this place.",
            },
            "components": True,
            "overrides": {
                "type": "object",
                "description": 'Changes to the prefab\'s entities by path of names, as "Arm/Hand".',
                "additionalProperties": {"$ref": "#/$defs/changes"},
            },
            "children": {"type": "array", "items": {"$ref": "#/$defs/entity"}},
        },
        "additionalProperties": False,
        "if": {"required": ["prefab"]},
        "then": {"properties": {"components": {"$ref": "#/$defs/changes"}}},
        "else": {"properties": {"components": {"$ref": "#/$defs/components"}, "overrides": {"maxProperties": 0}}},
    }


def _settings() -> dict[str, Any]:
    """The definition of the scene's settings, and of what they are made of."""
    (schema,), definitions = msgspec.json.schema_components([SceneSettings], ref_template="#/$defs/{name}")
    settings = definitions.pop(schema["$ref"].rpartition("/")[2])
    return {"settings": {**settings, "additionalProperties": False}, **definitions}


def _component(declaration: ComponentDeclaration) -> dict[str, Any]:
    properties = {field.name: _field(field) for field in declaration.fields}
    return {"title": declaration.name, **_closed(properties, declaration.text)}


def _closed(properties: dict[str, Any], description: str) -> dict[str, Any]:
    return {
        "description": description,
        "type": "object",
        "properties": properties,
        "additionalProperties": False,
    }


def _field(field: FieldDeclaration) -> dict[str, Any]:
    schema: dict[str, Any] = {"description": f"{field.text} [{field.unit}]" if field.unit else field.text}
    element = _element(field)
    if field.kind is Kind.CURVE:
        key = {"type": "array", "items": {"type": "number"}, "minItems": KEY_WIDTH, "maxItems": KEY_WIDTH}
        schema |= {"type": "array", "items": key, "maxItems": MAX_KEYS}
    elif field.kind in _VECTORS:
        schema |= {"type": "array", "items": element, "minItems": field.width, "maxItems": field.width}
    else:
        schema |= element
    default = list(field.default) if isinstance(field.default, tuple) else field.default
    schema["default"] = default
    if field.unit:
        schema["unit"] = field.unit
    return schema


def _element(field: FieldDeclaration) -> dict[str, Any]:
    """The schema of a single value, or of one element of a vector."""
    schema: dict[str, Any]
    match field.kind:
        case Kind.FLOAT | Kind.VEC3 | Kind.QUAT | Kind.COLOR | Kind.CURVE:
            schema = {"type": "number"}
        case Kind.INT:
            schema = {"type": "integer", "minimum": -(2**31), "maximum": 2**31 - 1}
        case Kind.BOOL:
            return {"type": "boolean"}
        case Kind.CHOICE:
            return {"enum": list(field.choices)}
        case Kind.TEXT | Kind.ASSET:
            return {"type": "string"}
        case Kind.VALUES:
            return {"type": "object"}
        case Kind.ENTITY:
            # By name in files, where nobody has an id yet.
            return {"type": ["string", "integer"], "minimum": 0, "maximum": 2**32 - 1}
    if field.minimum is not None:
        schema["minimum"] = field.minimum
    if field.maximum is not None:
        schema["maximum"] = field.maximum
    return schema

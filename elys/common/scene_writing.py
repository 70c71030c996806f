"""From a SceneDocument to a file in its one canonical form, so that two versions of a scene differ only where it changed.

Two spaces of indentation; keys in a fixed order (components and fields as they are declared); what equals its default is left
out; lists of numbers, and components that fit, stand on one line; whole numbers are written without a point, others with the
fewest digits that read back to the same float.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import msgspec

from elys.common.assets.store import replace_file
from elys.common.components import FieldDeclaration, Kind, declarations
from elys.common.errors import SceneError
from elys.common.scene_document import SCENE_VERSION, ComponentChanges, EntityNode, SceneDocument, SceneSettings

LINE_WIDTH: Final = 120
_INDENT: Final = "  "
_EXACT_INTEGERS: Final = 2**53


def write_scene(document: SceneDocument, path: str | Path) -> None:
    """Writes the document's canonical form: whole or, should anything fail, not at all. Raises SceneError."""
    path = Path(path)
    try:
        replace_file(path, format_scene(document).encode())
    except OSError as error:
        raise SceneError(f"{path} cannot be written: {error.strerror}") from error


def format_scene(document: SceneDocument) -> str:
    """The canonical text of a scene file; raises SceneError for a value that JSON cannot hold."""
    tree: dict[str, Any] = {"elys_scene": SCENE_VERSION}
    if document.name:
        tree["name"] = document.name
    settings = _changed_settings(document.settings)
    if settings:
        tree["settings"] = settings
    tree["entities"] = [_entity_tree(entity) for entity in document.entities]
    return _block("{}", _members(tree, 0), 0) + "\n"


def _changed_settings(settings: SceneSettings) -> dict[str, Any]:
    values = {name: msgspec.to_builtins(value) for name, value in msgspec.structs.asdict(settings).items()}
    defaults = msgspec.to_builtins(SceneSettings())
    changed = {name: value for name, value in values.items() if value != defaults[name]}
    if "picture" in changed:
        plain = defaults["picture"]
        changed["picture"] = {name: value for name, value in changed["picture"].items() if value != plain[name]}
    return changed


def _entity_tree(node: EntityNode) -> dict[str, Any]:
    tree: dict[str, Any] = {}
    if node.name:
        tree["name"] = node.name
    if not node.enabled:
        tree["enabled"] = False
    if node.prefab:
        tree["prefab"] = node.prefab
    if node.components:
        # Over a prefab a value says something even where it is the default: it may undo the prefab's own.
        tree["components"] = _component_tree(node.components, keep_defaults=bool(node.prefab))
    if node.overrides:
        tree["overrides"] = {
            path: _component_tree(node.overrides[path], keep_defaults=True) for path in sorted(node.overrides)
        }
    if node.children:
        tree["children"] = [_entity_tree(child) for child in node.children]
    return tree


def _component_tree(components: ComponentChanges, *, keep_defaults: bool) -> dict[str, Any]:
    tree: dict[str, Any] = {}
    for name, declaration in declarations().items():
        if name not in components:
            continue
        values = components[name]
        tree[name] = (
            None
            if values is None
            else {
                field.name: values[field.name]
                for field in declaration.fields
                if field.name in values and (keep_defaults or not _is_default(field, values[field.name]))
            }
        )
    for name in components:
        if name not in tree:
            raise SceneError(f"there is no component '{name}', so it cannot be written")
    return tree


def _is_default(field: FieldDeclaration, value: Any) -> bool:
    return _equal(value, field.default) or (field.kind is Kind.ENTITY and value == "")


def _equal(value: Any, default: Any) -> bool:
    if isinstance(value, list | tuple) and isinstance(default, tuple):
        return len(value) == len(default) and all(map(_equal, value, default))
    # -0.0 == 0.0, and yet is another float.
    return bool(value == default) and str(value).startswith("-") == str(default).startswith("-")


def _formatted(value: Any, depth: int) -> str:
    match value:
        case dict():
            return _formatted_object(value, depth)
        case list() | tuple() if all(isinstance(element, int | float) for element in value):
            return f"[{', '.join(_scalar(element) for element in value)}]"
        case list() | tuple():
            return _block("[]", [_formatted(element, depth + 1) for element in value], depth)
        case _:
            return _scalar(value)


def _formatted_object(table: Mapping[str, Any], depth: int) -> str:
    if not table:
        return "{}"
    members = _members(table, depth)
    if not any(isinstance(value, dict) for value in table.values()) and not any("\n" in member for member in members):
        line = f"{{{', '.join(members)}}}"
        # Room for the key before it, taken as constant.
        if len(_INDENT) * depth + len(line) <= LINE_WIDTH - 20:
            return line
    return _block("{}", members, depth)


def _members(table: Mapping[str, Any], depth: int) -> list[str]:
    return [f"{_scalar(key)}: {_formatted(value, depth + 1)}" for key, value in table.items()]


def _block(brackets: str, members: list[str], depth: int) -> str:
    if not members:
        return brackets
    inner = _INDENT * (depth + 1)
    body = ",\n".join(inner + member for member in members)
    return f"{brackets[0]}\n{body}\n{_INDENT * depth}{brackets[1]}"


def _scalar(value: Any) -> str:
    match value:
        case None | bool() | str():
            return json.dumps(value, ensure_ascii=False)
        case int():
            return str(value)
        case float():
            if value != value or value in (float("inf"), float("-inf")):
                raise SceneError(f"{value} cannot be written to a scene file")
            whole = value.is_integer() and abs(value) <= _EXACT_INTEGERS and str(value) != "-0.0"
            return str(int(value)) if whole else repr(value)
        case _:
            raise SceneError(f"a {type(value).__name__} cannot be written to a scene file")

"""Components as text, for the system's clipboard: {"elys_components": {"Light": {"kind": "spot", ...}}}.

Values stand as in scene files, all of them. Another entity is named as there, by the shortest end of its path; where that names
several, by its id ("#12"), which only means it within the same session.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Final

from elys.common.components import Component, Kind, component_from, declaration_of, values_of
from elys.common.errors import ComponentError, SceneError
from elys.common.scene_naming import Names
from elys.editor_node.scene_mirror import EditorScene

KEY: Final = "elys_components"
MAX_LENGTH: Final = 1 << 20  # characters: what is longer is no component


def text_of(components: Mapping[str, Component], scene: EditorScene) -> str:
    """The text that `components_in` reads."""
    names = _EntityNames(scene)
    values = {name: values_of(component) for name, component in components.items()}
    for name, given in values.items():
        for field in declaration_of(name).fields:
            if field.kind is Kind.ENTITY:
                given[field.name] = names.name_of(given[field.name])
    return json.dumps({KEY: values}, ensure_ascii=False, indent=2)


def components_in(text: str, scene: EditorScene) -> dict[str, dict[str, Any]]:
    """Component values by name, checked, with the ids of the entities they name.

    Raises:
        ComponentError: the text is something else, or holds what no component takes; one sentence.
    """
    try:
        tree = json.loads(text) if len(text) <= MAX_LENGTH else None
    except (ValueError, RecursionError):
        tree = None
    found = tree.get(KEY) if isinstance(tree, dict) else None
    if not isinstance(found, dict) or not found:
        raise ComponentError("the clipboard holds no component: copy one first")
    names = _EntityNames(scene)
    return {str(name): _checked(str(name), values, names) for name, values in found.items()}


def _checked(name: str, values: Any, names: _EntityNames) -> dict[str, Any]:
    declaration = declaration_of(name)
    if not isinstance(values, dict):
        raise ComponentError(f"{name} must be fields with their values")
    given = dict(values)
    for field in declaration.fields:
        if field.kind is Kind.ENTITY and isinstance(given.get(field.name), str):
            given[field.name] = names.find(f"{name}.{field.name}", given[field.name])
    component = component_from(name, given)
    return {field: getattr(component, field) for field in given}


class _EntityNames:
    """Names of a scene's entities; listed when the first is asked for."""

    def __init__(self, scene: EditorScene) -> None:
        self._scene = scene
        self._listed: tuple[Names, list[int], dict[int, int]] | None = None

    def name_of(self, entity: int) -> str:
        if not entity or not self._scene.exists(entity):
            return ""
        names, _, row_of = self._list()
        try:
            return names.name_of(row_of[entity])
        except SceneError:
            return f"#{entity}"

    def find(self, place: str, text: str) -> int:
        if not text:
            return 0
        if text.startswith("#") and text[1:].isdecimal() and self._scene.exists(int(text[1:])):
            return int(text[1:])
        names, entities, _ = self._list()
        try:
            return entities[names.find(text)]
        except SceneError as error:
            raise ComponentError(f"{place}: {error}") from error

    def _list(self) -> tuple[Names, list[int], dict[int, int]]:
        if self._listed is None:
            found = self._scene.mirror.in_order()
            row_of = {entity.id: row for row, entity in enumerate(found)}
            names = Names([(entity.name, row_of.get(entity.parent, -1)) for entity in found])
            self._listed = names, [entity.id for entity in found], row_of
        return self._listed

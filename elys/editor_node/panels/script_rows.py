"""The fields that a script declares, in the inspector: a line each, as those of components, in place of its raw values."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, Final

from imgui_bundle import imgui

from elys.common.components import FieldDeclaration, Script
from elys.common.errors import ComponentError
from elys.editor_node.field_search import shows_field
from elys.editor_node.field_values import FieldChange, values_of_each
from elys.editor_node.language import tr
from elys.editor_node.panels.field_rows import FieldActions, FieldRows, FieldState
from elys.editor_node.script_forms import Form, value_of, values_with
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.ui import Ui, dim_text

_COMPARED: Final = 300  # entities of a selection that are looked at for what differs


class ScriptRows:
    """Lines of one selection's script; see `draw`."""

    def __init__(self) -> None:
        self._starts: tuple[object, dict[int, Any]] = (None, {})  # a stroke, and the values from before it

    def draw(self, ui: Ui, rows: FieldRows, entities: Sequence[int], search: str, prefab_values: Any) -> bool:
        """Draws the lines; False where the fields are not known, or the selected have several scripts.

        `prefab_values` are the values in the prefab where those of the last selected are others, else None.
        """
        form = self._form(ui, entities)
        if form is None:
            return False
        if form.problem:
            self._draw_problem(ui, form)
            return False
        for declared in form.declaration.fields:
            if shows_field(search, form.declaration, declared):
                self._draw_field(ui, rows, form, declared, entities, prefab_values)
        return True

    def finds(self, ui: Ui, entities: Sequence[int], search: str) -> bool:
        """Whether any of the fields is what is searched for."""
        form = self._form(ui, entities) if search else None
        return form is not None and any(
            shows_field(search, form.declaration, field) for field in form.declaration.fields
        )

    def _form(self, ui: Ui, entities: Sequence[int]) -> Form | None:
        scripts = (self._script(ui, entity) for entity in entities)
        sources = {script.source if script is not None else "" for script in scripts}
        return ui.model.script_forms.of(next(iter(sources))) if len(sources) == 1 else None

    def _draw_problem(self, ui: Ui, form: Form) -> None:
        imgui.table_next_row()
        imgui.table_next_column()
        dim_text(tr("fields"))
        imgui.table_next_column()
        imgui.push_text_wrap_pos(0.0)
        dim_text(tr_sentence(form.problem))
        imgui.pop_text_wrap_pos()
        ui.landmarks.note("inspector/Script/problem")

    def _draw_field(
        self,
        ui: Ui,
        rows: FieldRows,
        form: Form,
        declared: FieldDeclaration,
        entities: Sequence[int],
        prefab_values: Any,
    ) -> None:
        found = [self._value(ui, entity, declared) for entity in entities[-_COMPARED:]]
        in_prefab = None
        if isinstance(prefab_values, dict):
            said = prefab_values.get(declared.name, declared.default)
            in_prefab = said if said != found[-1] else None
        state = FieldState(
            mixed=_differing(found, declared.elements),
            is_default=all(value == declared.default for value in found),
            prefab_value=in_prefab,
        )
        actions = FieldActions(
            reset=partial(self._set_all, ui, declared, entities, declared.default),
            revert=partial(self._set_all, ui, declared, entities, in_prefab) if in_prefab is not None else None,
        )
        path = f"inspector/Script/{declared.name}"
        change = rows.draw(ui, declared, path, found[-1], state, actions)
        if change is not None:
            self._send(ui, rows, form, declared, entities, change)

    def _send(
        self,
        ui: Ui,
        rows: FieldRows,
        form: Form,
        declared: FieldDeclaration,
        entities: Sequence[int],
        change: FieldChange,
    ) -> None:
        """Works out what a change means for each entity, and sends it; or says beside the field why that cannot be."""
        if self._starts[0] is not change.stroke:  # within a stroke from what was before it, as the host may lag
            self._starts = (change.stroke, {entity: self._value(ui, entity, declared) for entity in entities})
        path = f"inspector/Script/{declared.name}"
        try:
            chosen = values_of_each(form.declaration, declared, self._starts[1], change)
        except ComponentError as error:
            rows.refuse(path, tr_sentence(str(error)))
            return
        if change.entry is not None:
            rows.show(path, next(reversed(chosen.values())))
        self._set_each(ui, declared, chosen, change.stroke)

    def _set_all(self, ui: Ui, declared: FieldDeclaration, entities: Sequence[int], value: Any) -> None:
        self._set_each(ui, declared, dict.fromkeys(entities, value), None)

    def _set_each(self, ui: Ui, declared: FieldDeclaration, chosen: dict[int, Any], stroke: object) -> None:
        values = {
            entity: {"values": values_with(ui.model.scene, script, declared, value)}
            for entity, value in chosen.items()
            if (script := self._script(ui, entity)) is not None
        }
        ui.model.edit.set_each(values, "Script", stroke=stroke)

    @staticmethod
    def _script(ui: Ui, entity: int) -> Script | None:
        found = ui.model.scene.component_of(entity, "Script") if ui.model.scene.exists(entity) else None
        return found if isinstance(found, Script) else None

    def _value(self, ui: Ui, entity: int, declared: FieldDeclaration) -> Any:
        script = self._script(ui, entity)
        return value_of(ui.model.scene, script, declared) if script is not None else declared.default


def _differing(found: Sequence[Any], elements: int) -> tuple[bool, ...]:
    """For each element whether not all have the same."""
    if elements == 1:
        return (any(value != found[-1] for value in found),)
    return tuple(any(value[axis] != found[-1][axis] for value in found) for axis in range(elements))

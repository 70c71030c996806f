"""The inspector: every component of the selected entities, each field with the widget its declaration asks for.

What is shown is what the host echoed. Only the field a person holds shows its own value, until the host has answered.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from imgui_bundle import imgui

from elys.common.components import Component, ComponentDeclaration, FieldDeclaration, Kind, declaration_of
from elys.common.errors import ComponentError
from elys.common.ids import generation_of, index_of
from elys.editor_node.comparison import Comparison
from elys.editor_node.field_paths import is_plottable
from elys.editor_node.field_search import shows_field
from elys.editor_node.field_values import FieldChange, has_effect, switch_of, values_of_each
from elys.editor_node.language import tr, tr_label
from elys.editor_node.panels.component_menus import AddComponentPopup, component_icon, draw_component_menu
from elys.editor_node.panels.field_rows import FieldActions, FieldRows, FieldState
from elys.editor_node.panels.scene_settings import draw_scene_settings
from elys.editor_node.panels.script_rows import ScriptRows
from elys.editor_node.prefab_values import PrefabEntity
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.theme import ACCENT, icons
from elys.editor_node.ui import Ui, centered_text, color_code, dim_text

TITLE: Final = f"{icons.ICON_FA_SLIDERS}  Inspector###Inspector"
MANY: Final = 100  # above this the values of a drag are worked out only when those before have been sent


class InspectorPanel:
    """Shows the selection; edits go to all entities that are selected and have the component."""

    def __init__(self) -> None:
        self.rows = FieldRows()
        self._script_rows = ScriptRows()
        self._adding = AddComponentPopup()
        self._search = ""
        self._focuses_search = False
        self._shown: tuple[int, ...] = ()  # what the rows are of
        self._entities: list[int] = []  # those of the selection that live
        self._living_of: tuple[int, ...] = ()  # when that was found
        self._comparison: Comparison | None = None
        self._starts: tuple[object, dict[int, Any]] = (None, {})  # a stroke, and the values from before it
        self._waiting: tuple[ComponentDeclaration, FieldDeclaration, tuple[int, ...], FieldChange] | None = None
        self._prefab: PrefabEntity | None = None

    def search(self) -> None:
        """Puts the cursor into the box that filters fields."""
        self._focuses_search = True

    def add_component(self) -> None:
        """Opens the list of components that can be added."""
        self._adding.opens = True

    def fold_all(self, ui: Ui, folded: bool) -> None:
        """Folds or unfolds all components of what is selected."""
        names = self._comparison.common if self._comparison is not None else ()
        kept = [name for name in ui.preferences.folded if name not in names]
        ui.preferences.folded = kept + (list(names) if folded else [])

    def revert_all(self, ui: Ui) -> None:
        """Makes the selected parts of prefab instances what their prefabs say again; one edit."""
        changes = {}
        for entity in ui.model.selection:
            prefab = ui.model.prefabs.of(entity)
            if prefab is not None:
                changes[entity] = prefab.changes(_as_set(ui, entity))
        ui.model.edit.lay_over("Revert to the prefab: {what}", changes)

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(TITLE)[0]:
            self._begin_frame(ui)
            if ui.model.is_replay:
                dim_text(f"{icons.ICON_FA_FILM}  {tr('this is a recording: it cannot be edited')}")
                ui.landmarks.note("inspector/recording")
            entities = self._living(ui)
            if entities:
                self._draw_header(ui, entities)
                self._draw_search(ui)
                self._draw_components(ui, entities)
            elif ui.model.scene.is_known:
                self._draw_search(ui)
                draw_scene_settings(ui, self.rows, self._search)
            else:
                imgui.dummy((0.0, imgui.get_frame_height()))
                centered_text(tr("Waiting for the scene"), imgui.get_content_region_avail().x)
        imgui.end()

    def _living(self, ui: Ui) -> Sequence[int]:
        """Those of the selection that live; of fifty thousand looked for when one may have gone, not each frame."""
        selection, scene = ui.model.selection, ui.model.scene
        key = (selection.version, scene.structure_version, scene.mirror.epoch)
        if key != self._living_of:
            self._living_of, living = key, scene.mirror.entities
            self._entities = [entity for entity in selection if entity in living]
        return self._entities

    def _begin_frame(self, ui: Ui) -> None:
        selection = ui.model.selection
        if self._shown != selection.entities:
            self._send_waiting(ui)
            self._shown = selection.entities
            self.rows.forget()
        if self._waiting is not None and not ui.model.history.is_stroke_busy(self._waiting[3].stroke):
            self._send_waiting(ui)
        self.rows.begin_frame(ui)

    # --- above the components --------------------------------------------------------------------------------------

    def _draw_header(self, ui: Ui, entities: Sequence[int]) -> None:
        scene, primary = ui.model.scene, entities[-1]
        imgui.begin_disabled(ui.model.is_replay)
        changed, enabled = imgui.checkbox("###enabled", scene.is_enabled(primary))
        ui.landmarks.note("inspector/enabled")
        imgui.set_item_tooltip(tr("Whether the entity takes part; a disabled one takes all below it along"))
        if changed:
            ui.model.edit.set_enabled(entities, enabled)
        imgui.same_line()
        if len(entities) > 1:
            imgui.align_text_to_frame_padding()
            imgui.push_font(ui.fonts.bold, 0.0)
            imgui.text_unformatted(tr("{count} entities", count=len(entities)))
            imgui.pop_font()
            dim_text(tr("what they have in common"))
        else:
            imgui.set_next_item_width(-1.0)
            imgui.push_id(str(primary))  # another entity is another text field, also while one is being typed in
            _, text = imgui.input_text("###name", scene.name_of(primary))
            imgui.pop_id()
            ui.landmarks.note("inspector/name")
            if imgui.is_item_deactivated_after_edit():
                ui.model.edit.rename(primary, text)
            dim_text(entity_label(primary))
        self._draw_prefab(ui, primary)
        imgui.end_disabled()
        imgui.spacing()

    def _draw_prefab(self, ui: Ui, primary: int) -> None:
        """Of what prefab the entity is part, and the way back to it."""
        prefab = self._prefab = ui.model.prefabs.of(primary)
        file = ui.model.scene.prefab_of(primary) or (prefab.file if prefab is not None else "")
        if not file:
            return
        dim_text(f"{icons.ICON_FA_BOX_ARCHIVE}  {Path(file).name}")
        ui.landmarks.note("inspector/prefab")
        problem = f"\n{prefab.problem}" if prefab is not None and prefab.problem else ""
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            imgui.set_tooltip(f"{file}{problem}")
        if prefab is None or prefab.problem:
            if problem:
                imgui.same_line()
                dim_text(tr("cannot be read here"))
            return
        changes = prefab.changes(_as_set(ui, primary))
        if not changes:
            return
        imgui.same_line()
        if imgui.small_button(tr_label("Revert all", "revert all")):
            self.revert_all(ui)
        ui.landmarks.note("inspector/revert_all")
        removed = [name for name in changes if name not in ui.model.scene.components_of(primary)]
        if removed:
            dim_text(tr("without the prefab's {names}", names=", ".join(removed)))

    def _draw_search(self, ui: Ui) -> None:
        if self._focuses_search:
            imgui.set_keyboard_focus_here()
            self._focuses_search = False
        imgui.set_next_item_width(-1.0)
        hint = f"{icons.ICON_FA_MAGNIFYING_GLASS}  {tr('Find a field')}"
        _, self._search = imgui.input_text_with_hint("###fields", hint, self._search)
        ui.landmarks.note("inspector/search")
        imgui.spacing()

    # --- components ------------------------------------------------------------------------------------------------

    def _draw_components(self, ui: Ui, entities: Sequence[int]) -> None:
        if self._comparison is None:
            self._comparison = Comparison(ui.model.scene)
        comparison = self._comparison
        comparison.update(entities, ui.model.selection.version)
        imgui.push_id(str(entities[-1]))
        for name in comparison.common:
            declaration = declaration_of(name)
            fields = [
                field
                for field in declaration.told
                if shows_field(self._search, declaration, field)
                or (
                    name == "Script"
                    and field.kind is Kind.VALUES
                    and self._script_rows.finds(ui, entities, self._search)
                )
            ]
            if fields or not self._search:
                imgui.push_id(name)
                self._draw_component(ui, declaration, fields, entities)
                imgui.pop_id()
        imgui.pop_id()
        if not ui.model.is_replay:
            self._adding.draw(ui, entities, comparison.common)

    def _draw_component(
        self, ui: Ui, declaration: ComponentDeclaration, fields: Sequence[FieldDeclaration], entities: Sequence[int]
    ) -> None:
        name = declaration.name
        right = imgui.get_cursor_pos_x() + imgui.get_content_region_avail().x
        is_added = self._prefab is not None and not self._prefab.problem and name not in self._prefab.components
        if self._draw_component_header(ui, declaration, is_added=is_added):
            is_open = True
        else:
            is_open = bool(self._search)
        if not ui.model.is_replay:
            self._draw_switch(ui, declaration, entities, right)
            imgui.same_line(right - imgui.get_frame_height())
            draw_component_menu(ui, declaration, entities, self._component_of)
        if is_open and self.rows.begin("fields"):
            assert self._comparison is not None
            now = self._comparison.primary[name]
            written = {} if ui.model.is_replay else ui.model.set_values.written_fields(entities[-1], now)
            overridden = {} if is_added else self._overridden(ui, entities[-1], now)
            for declared in fields:
                if (
                    name == "Script"
                    and declared.kind is Kind.VALUES
                    and self._script_rows.draw(ui, self.rows, entities, self._search, overridden.get(declared.name))
                ):
                    continue
                self._draw_field(ui, declaration, declared, entities, now, written, overridden)
            imgui.end_table()
            imgui.spacing()

    def _draw_component_header(self, ui: Ui, declaration: ComponentDeclaration, *, is_added: bool) -> bool:
        """The line of a component's name; whether it is open."""
        name, folded = declaration.name, ui.preferences.folded
        imgui.push_style_color(imgui.Col_.header, imgui.get_style_color_vec4(imgui.Col_.header_hovered))
        imgui.push_font(ui.fonts.bold, 0.0)
        imgui.set_next_item_open(name not in folded or bool(self._search))
        icon = component_icon(name)
        is_open = imgui.collapsing_header(f"{icon}   {name}###header", imgui.TreeNodeFlags_.allow_overlap.value)
        if imgui.is_item_toggled_open() and not self._search:
            folded[:] = [other for other in folded if other != name] + ([] if is_open else [name])
        imgui.pop_font()
        imgui.pop_style_color()
        ui.landmarks.note(f"inspector/{name}")
        if is_added:
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            left = imgui.get_window_pos().x + 2.0
            imgui.get_window_draw_list().add_rect_filled((left, low.y), (left + 3.0, high.y), color_code(ACCENT))
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            added = f"\n{tr('The prefab has no such component')}" if is_added else ""
            imgui.set_tooltip(f"{tr(declaration.text)}{added}")
        return is_open

    def _draw_switch(self, ui: Ui, declaration: ComponentDeclaration, entities: Sequence[int], right: float) -> None:
        """The component's own switch on its header, where its declaration has one."""
        switch = switch_of(declaration)
        if switch is None:
            return
        assert self._comparison is not None
        imgui.same_line(right - 2.2 * imgui.get_frame_height())
        is_on = getattr(self._comparison.primary[declaration.name], switch.name)
        mixed = self._comparison.mixed(declaration.name, switch)[0]
        imgui.push_item_flag(imgui.ItemFlags_.mixed_value.value, mixed)
        changed, is_on = imgui.checkbox("###switch", is_on)
        imgui.pop_item_flag()
        ui.landmarks.note(f"inspector/{declaration.name}/switch")
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            imgui.set_tooltip(tr(switch.text))
        if changed:
            ui.model.edit.set_fields(entities, declaration.name, {switch.name: is_on})

    def _overridden(self, ui: Ui, entity: int, now: Component) -> dict[str, Any]:
        """The fields of a part of a prefab's instance that were set to something else than the prefab has."""
        if self._prefab is None:
            return {}
        was_set = ui.model.set_values.of(entity, type(now).__name__)
        return self._prefab.changed_fields(was_set if was_set is not None else now)

    # --- fields ----------------------------------------------------------------------------------------------------

    def _draw_field(
        self,
        ui: Ui,
        declaration: ComponentDeclaration,
        declared: FieldDeclaration,
        entities: Sequence[int],
        now: Component,
        written: dict[str, Any],
        overridden: dict[str, Any],
    ) -> None:
        name, comparison = declared.name, self._comparison
        assert comparison is not None
        path = f"inspector/{declaration.name}/{name}"
        state = FieldState(
            mixed=comparison.mixed(declaration.name, declared),
            is_default=comparison.is_default(declaration.name, declared),
            is_used=has_effect(now, name),
            written_over=written.get(name),
            prefab_value=overridden.get(name),
            offer=ui.model.clip_names.offer(declared, now, entities),
        )
        actions = FieldActions(
            reset=lambda: ui.model.edit.set_fields(entities, declaration.name, {name: declared.default}),
            revert=partial(self._revert_field, ui, declaration.name, name) if name in overridden else None,
            take_back=lambda value: ui.model.edit.set_fields(entities[-1:], declaration.name, {name: value}),
            plot=partial(ui.plot_field, entities[-1], declaration.name, name) if is_plottable(declared) else None,
        )
        change = self.rows.draw(ui, declared, path, getattr(now, name), state, actions)
        if change is not None:
            self._waiting = (declaration, declared, tuple(entities), change)
            is_busy = len(entities) > MANY and ui.model.history.is_stroke_busy(change.stroke)
            if not is_busy:
                self._send_waiting(ui)

    def _send_waiting(self, ui: Ui) -> None:
        """Works out what a change means for each entity, and sends it; or says beside the field why that cannot be."""
        if self._waiting is None:
            return
        declaration, declared, entities, change = self._waiting
        self._waiting = None
        path = f"inspector/{declaration.name}/{declared.name}"
        own = self._own_values(ui, declaration.name, declared.name, entities, change.stroke)
        if not own:
            return
        try:
            chosen = values_of_each(declaration, declared, own, change)
        except ComponentError as error:
            self.rows.refuse(path, tr_sentence(str(error)))
            return
        if change.entry is not None or change.keeps_proportions:
            self.rows.show(path, next(reversed(chosen.values())))
        values = {entity: {declared.name: value} for entity, value in chosen.items()}
        ui.model.edit.set_each(values, declaration.name, stroke=change.stroke)

    def _own_values(
        self, ui: Ui, component: str, field: str, entities: Sequence[int], stroke: object
    ) -> dict[int, Any]:
        """The value of each entity that has the component; within a stroke those from before it, as the host may lag."""
        if self._starts[0] is not stroke:
            found = ((entity, ui.model.scene.component_of(entity, component)) for entity in entities
                     if ui.model.scene.exists(entity))  # fmt: skip
            self._starts = (stroke, {e: getattr(value, field) for e, value in found if value is not None})
        return self._starts[1]

    def _component_of(self, name: str) -> Component:
        assert self._comparison is not None
        return self._comparison.primary[name]

    def _revert_field(self, ui: Ui, component: str, field: str) -> None:
        """Gives the field of each selected entity the value that its own prefab has."""
        changes: dict[int, dict[str, dict[str, Any] | None]] = {}
        for entity in ui.model.selection:
            prefab = ui.model.prefabs.of(entity)
            if prefab is not None and component in prefab.components:
                changes[entity] = {component: {field: getattr(prefab.components[component], field)}}
        ui.model.edit.lay_over("Revert to the prefab: {what}", changes)


def entity_label(entity: int) -> str:
    """An id as one says it: its place in the tables, and how often that was used before, if it was."""
    reused = generation_of(entity)
    return tr("entity {index}", index=index_of(entity)) + (
        f" ({tr('reused {count}x', count=reused)})" if reused else ""
    )


def _as_set(ui: Ui, entity: int) -> dict[str, Component]:
    """An entity's components as they were last set: what the simulation makes of them is no override."""
    return {
        name: ui.model.set_values.of(entity, name) or value
        for name, value in ui.model.scene.components_of(entity).items()
    }

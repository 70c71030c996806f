"""The inspector: every component of the selected entities, each field with the widget its declaration asks for.

What is shown is what the host echoed. Only the field a person holds shows its own value, until the host has answered.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from imgui_bundle import imgui

from elys.common.components import Component, ComponentDeclaration, FieldDeclaration, Kind, declarations
from elys.common.errors import ComponentError
from elys.common.ids import generation_of, index_of
from elys.editor_node.fields import has_effect, rotation_from
from elys.editor_node.panels.field_rows import FieldChange, FieldRows
from elys.editor_node.panels.scene_settings import draw_scene_settings
from elys.editor_node.theme import icons
from elys.editor_node.ui import Ui, centered_text, dim_text

TITLE: Final = f"{icons.ICON_FA_SLIDERS}  Inspector###Inspector"
COMPARED: Final = 200  # of the selected entities, the last so many are looked at for what they have in common
_ICONS: Final = {
    "Transform": icons.ICON_FA_UP_DOWN_LEFT_RIGHT,
    "RigidBody": icons.ICON_FA_WEIGHT_HANGING,
    "Collider": icons.ICON_FA_SHAPES,
    "MeshRenderer": icons.ICON_FA_CUBE,
    "Material": icons.ICON_FA_PALETTE,
    "Light": icons.ICON_FA_LIGHTBULB,
    "Environment": icons.ICON_FA_CLOUD_SUN,
    "Camera": icons.ICON_FA_VIDEO,
    "Script": icons.ICON_FA_CODE,
}


class InspectorPanel:
    """Shows the selection; edits go to all entities that are selected and have the component."""

    def __init__(self) -> None:
        self._rows = FieldRows()
        self._component_search = ""

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(TITLE)[0]:
            self._rows.let_go(ui)
            if ui.model.is_replay:
                dim_text(f"{icons.ICON_FA_FILM}  this is a recording: it cannot be edited")
                ui.landmarks.note("inspector/recording")
            entities = [e for e in ui.model.selection if ui.model.scene.exists(e)]
            if entities:
                self._draw_header(ui, entities)
                self._draw_components(ui, entities)
                if not ui.model.is_replay:
                    self._draw_add_button(ui, entities)
            elif ui.model.scene.is_known:
                draw_scene_settings(ui, self._rows)
            else:
                imgui.dummy((0.0, imgui.get_frame_height()))
                centered_text("Waiting for the scene", imgui.get_content_region_avail().x)
        imgui.end()

    def _draw_header(self, ui: Ui, entities: Sequence[int]) -> None:
        scene, primary = ui.model.scene, entities[-1]
        imgui.begin_disabled(ui.model.is_replay)
        changed, enabled = imgui.checkbox("###enabled", scene.is_enabled(primary))
        ui.landmarks.note("inspector/enabled")
        imgui.set_item_tooltip("Whether the entity takes part; a disabled one takes all below it along")
        if changed:
            ui.model.edit.set_enabled(entities, enabled)
        imgui.same_line()
        if len(entities) > 1:
            imgui.align_text_to_frame_padding()
            imgui.push_font(ui.fonts.bold, 0.0)
            imgui.text_unformatted(f"{len(entities)} entities")
            imgui.pop_font()
            dim_text("what they have in common")
        else:
            imgui.set_next_item_width(-1.0)
            imgui.push_id(str(primary))  # another entity is another text field, also while one is being typed in
            _, text = imgui.input_text("###name", scene.name_of(primary))
            imgui.pop_id()
            ui.landmarks.note("inspector/name")
            if imgui.is_item_deactivated_after_edit():
                ui.model.edit.rename(primary, text)
            prefab = scene.prefab_of(primary)
            origin = f"    {icons.ICON_FA_BOX_ARCHIVE} {Path(prefab).name}" if prefab else ""
            dim_text(f"{entity_label(primary)}{origin}")
            if prefab:
                imgui.set_item_tooltip(prefab)
        imgui.end_disabled()
        imgui.spacing()

    def _draw_components(self, ui: Ui, entities: Sequence[int]) -> None:
        components = [ui.model.scene.components_of(entity) for entity in entities[-COMPARED:]]
        common = set(components[-1]).intersection(*components)
        for name, declaration in declarations().items():
            if name in common:
                imgui.push_id(name)
                self._draw_component(ui, declaration, entities, [owned[name] for owned in components])
                imgui.pop_id()

    def _draw_component(
        self, ui: Ui, declaration: ComponentDeclaration, entities: Sequence[int], values: list[Component]
    ) -> None:
        right = imgui.get_cursor_pos_x() + imgui.get_content_region_avail().x
        imgui.push_style_color(imgui.Col_.header, imgui.ImVec4(1.0, 1.0, 1.0, 0.045))
        imgui.push_font(ui.fonts.bold, 0.0)
        flags = imgui.TreeNodeFlags_.default_open | imgui.TreeNodeFlags_.allow_overlap
        icon = _ICONS.get(declaration.name, icons.ICON_FA_PUZZLE_PIECE)
        is_open = imgui.collapsing_header(f"{icon}   {declaration.name}###header", flags.value)
        imgui.pop_font()
        imgui.pop_style_color()
        ui.landmarks.note(f"inspector/{declaration.name}")
        if declaration.text and imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            imgui.set_tooltip(declaration.text)
        if not ui.model.is_replay:
            self._draw_component_menu(ui, declaration, entities, right)
        if is_open and self._rows.begin("fields"):
            for declared in declaration.fields:
                self._draw_field(ui, declaration, declared, entities, values)
            imgui.end_table()
            imgui.spacing()

    def _draw_component_menu(
        self, ui: Ui, declaration: ComponentDeclaration, entities: Sequence[int], right: float
    ) -> None:
        imgui.same_line(right - imgui.get_frame_height())
        imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(0.0, 0.0, 0.0, 0.0))
        if imgui.button(f"{icons.ICON_FA_ELLIPSIS_VERTICAL}###menu", (imgui.get_frame_height(), 0.0)):
            imgui.open_popup("component")
        imgui.pop_style_color()
        ui.landmarks.note(f"inspector/{declaration.name}/menu")
        if imgui.begin_popup("component"):
            if imgui.menu_item("Reset to defaults", "", False)[0]:
                defaults = {declared.name: declared.default for declared in declaration.fields}
                ui.model.edit.set_fields(entities, declaration.name, defaults)
            if imgui.menu_item("Remove component", "", False)[0]:
                ui.model.edit.remove_component(entities, declaration.name)
            ui.landmarks.note("component/remove")
            imgui.end_popup()

    def _draw_field(
        self,
        ui: Ui,
        declaration: ComponentDeclaration,
        declared: FieldDeclaration,
        entities: Sequence[int],
        values: list[Component],
    ) -> None:
        component, name = declaration.name, declared.name
        each = [getattr(value, name) for value in values]

        def reset() -> None:
            ui.model.edit.set_fields(entities, component, {name: declared.default})

        is_used = any(has_effect(value, name) for value in values)
        path = f"inspector/{component}/{name}"
        change = self._rows.draw(ui, declared, path, each, reset=reset, is_used=is_used)
        if change is None:
            return
        try:
            chosen = _values_of_each(ui, component, declared, entities, change)
            ui.model.edit.set_each(chosen, component, stroke=change.stroke)
        except ComponentError as error:
            ui.model.say("error", str(error))

    def _draw_add_button(self, ui: Ui, entities: Sequence[int]) -> None:
        imgui.spacing()
        if imgui.button(f"{icons.ICON_FA_PLUS}  Add component###add component", (-1.0, 0.0)):
            self._component_search = ""
            imgui.open_popup("add component")
        ui.landmarks.note("inspector/add")
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        imgui.set_next_window_pos((low.x, high.y + 2.0), imgui.Cond_.appearing.value)
        imgui.set_next_window_size((high.x - low.x, 0.0))
        if not imgui.begin_popup("add component"):
            return
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(-1.0)
        _, self._component_search = imgui.input_text_with_hint("###search", "Search", self._component_search)
        owned = set.intersection(*(set(ui.model.scene.components_of(entity)) for entity in entities[-COMPARED:]))
        for name, declaration in declarations().items():
            if name in owned or self._component_search.casefold() not in name.casefold():
                continue
            icon = _ICONS.get(name, icons.ICON_FA_PUZZLE_PIECE)
            if imgui.menu_item(f"{icon}   {name}###{name}", "", False)[0]:
                ui.model.edit.add_component(entities, name)
            ui.landmarks.note(f"component/{name}")
            if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
                imgui.set_tooltip(declaration.text)
        imgui.end_popup()


def entity_label(entity: int) -> str:
    """An id as one says it: its place in the tables, and how often that was used before, if it was."""
    reused = generation_of(entity)
    return f"entity {index_of(entity)}" + (f" (reused {reused}x)" if reused else "")


def _values_of_each(
    ui: Ui, component: str, declared: FieldDeclaration, entities: Sequence[int], change: FieldChange
) -> dict[int, dict[str, Any]]:
    """What every entity is to be sent: of several numbers each keeps those that were not touched."""
    value, axis = change.value, change.axis
    if declared.kind is Kind.QUAT and len(value) == 3:
        value = rotation_from(value)
    if axis is None:
        return {entity: {declared.name: value} for entity in entities}
    chosen = {}
    for entity in entities:
        current = ui.model.scene.component_of(entity, component)
        if current is not None:
            own = getattr(current, declared.name)
            chosen[entity] = {declared.name: (*own[:axis], value[axis], *own[axis + 1 :])}
    return chosen

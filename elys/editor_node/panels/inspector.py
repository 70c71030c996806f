"""The inspector: every component of the selected entities, each field with the widget its declaration asks for.

What is shown is what the host echoed. Only the field a person holds shows its own value, until the host has answered.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import msgspec
from imgui_bundle import imgui

from elys.common.components import Component, ComponentDeclaration, FieldDeclaration, Kind, declarations
from elys.common.errors import ComponentError
from elys.editor_node.fields import FieldContext, edit_field, rotation_from
from elys.editor_node.theme import icons
from elys.editor_node.ui import Ui, centered_text, dim_text

TITLE: Final = f"{icons.ICON_FA_SLIDERS}  Inspector###Inspector"
_ICONS: Final = {
    "Transform": icons.ICON_FA_UP_DOWN_LEFT_RIGHT,
    "RigidBody": icons.ICON_FA_WEIGHT_HANGING,
    "Collider": icons.ICON_FA_SHAPES,
    "MeshRenderer": icons.ICON_FA_CUBE,
    "Material": icons.ICON_FA_PALETTE,
    "Light": icons.ICON_FA_LIGHTBULB,
    "Camera": icons.ICON_FA_VIDEO,
    "Script": icons.ICON_FA_CODE,
}
_LABEL_SHARE: Final = 0.36  # of the line


@dataclass(slots=True)
class _Held:
    """The field a person holds, or has just let go of."""

    path: str
    value: Any
    is_active: bool = True
    stroke: object = field(default_factory=object)


class InspectorPanel:
    """Shows the selection; edits go to all entities that are selected and have the component."""

    def __init__(self) -> None:
        self._held: _Held | None = None
        self._name = ""
        self._component_search = ""

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(TITLE):
            self._let_go(ui)
            entities = [e for e in ui.model.selection if ui.model.scene.exists(e)]
            if entities:
                self._draw_header(ui, entities)
                self._draw_components(ui, entities)
                self._draw_add_button(ui, entities)
            else:
                self._draw_settings(ui)
        imgui.end()

    def _let_go(self, ui: Ui) -> None:
        """Once the host has answered, its word holds again."""
        held = self._held
        if held is not None and not held.is_active and not ui.model.history.is_stroke_busy(held.stroke):
            self._held = None

    def _draw_header(self, ui: Ui, entities: Sequence[int]) -> None:
        scene, primary = ui.model.scene, entities[-1]
        enabled = scene.is_enabled(primary)
        changed, enabled = imgui.checkbox("###enabled", enabled)
        ui.landmarks.note("inspector/enabled")
        imgui.set_item_tooltip("Whether the entity takes part; a disabled one takes all below it along")
        if changed:
            ui.model.edit.set_enabled(entities, enabled)
        imgui.same_line()
        imgui.set_next_item_width(-1.0)
        if len(entities) > 1:
            imgui.align_text_to_frame_padding()
            imgui.push_font(ui.fonts.bold, 0.0)
            imgui.text_unformatted(f"{len(entities)} entities")
            imgui.pop_font()
        else:
            _, text = imgui.input_text("###name", scene.name_of(primary))
            ui.landmarks.note("inspector/name")
            if imgui.is_item_deactivated_after_edit():
                ui.model.edit.rename(primary, text)
        index, generation = primary & ((1 << 22) - 1), primary >> 22
        prefab = f"   {icons.ICON_FA_BOX_ARCHIVE} {scene.prefab_of(primary)}" if scene.prefab_of(primary) else ""
        dim_text(f"entity {index}.{generation}{prefab}" if len(entities) == 1 else "common components")
        imgui.spacing()

    def _draw_components(self, ui: Ui, entities: Sequence[int]) -> None:
        components = [ui.model.scene.components_of(entity) for entity in entities]
        common = set(components[-1]).intersection(*components)
        for name, declaration in declarations().items():
            if name in common:
                values = [owned[name] for owned in components]
                imgui.push_id(name)
                self._draw_component(ui, declaration, entities, values)
                imgui.pop_id()

    def _draw_component(
        self, ui: Ui, declaration: ComponentDeclaration, entities: Sequence[int], values: list[Component]
    ) -> None:
        imgui.push_style_color(imgui.Col_.header, imgui.ImVec4(1.0, 1.0, 1.0, 0.045))
        flags = imgui.TreeNodeFlags_.default_open | imgui.TreeNodeFlags_.allow_overlap
        icon = _ICONS.get(declaration.name, icons.ICON_FA_PUZZLE_PIECE)
        right = imgui.get_cursor_pos_x() + imgui.get_content_region_avail().x
        imgui.push_font(ui.fonts.bold, 0.0)
        is_open = imgui.collapsing_header(f"{icon}   {declaration.name}###header", flags.value)
        imgui.pop_font()
        imgui.pop_style_color()
        ui.landmarks.note(f"inspector/{declaration.name}")
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip) and declaration.text:
            imgui.set_tooltip(declaration.text)
        self._draw_component_menu(ui, declaration, entities, right)
        if is_open and imgui.begin_table("fields", 2, imgui.TableFlags_.sizing_stretch_prop.value):
            imgui.table_setup_column("label", imgui.TableColumnFlags_.width_stretch.value, _LABEL_SHARE)
            imgui.table_setup_column("value", imgui.TableColumnFlags_.width_stretch.value, 1.0 - _LABEL_SHARE)
            for declared in declaration.fields:
                imgui.push_id(declared.name)
                self._draw_field(ui, declaration, declared, entities, values)
                imgui.pop_id()
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
        imgui.table_next_row()
        imgui.table_next_column()
        each = [getattr(value, declared.name) for value in values]
        path = f"inspector/{declaration.name}/{declared.name}"
        self._draw_label(ui, declaration, declared, entities, is_default=all(v == declared.default for v in each))
        imgui.table_next_column()
        held = self._held if self._held is not None and self._held.path == path else None
        shown = held.value if held is not None else each[-1]
        context = FieldContext(
            scene=ui.model.scene,
            landmarks=ui.landmarks,
            path=path,
            mixed=_mixed(declared, each, is_held=held is not None),
        )
        edit = edit_field(declared, shown, context)
        if edit.began:
            held = self._held = _Held(path, shown)
        if edit.changed:
            if held is None:
                held = self._held = _Held(path, edit.value, is_active=False)
            held.value = edit.value
            self._send(ui, declaration, declared, entities, each, held, edit.axis)
        if edit.ended and not edit.began and held is not None:
            held.is_active = False

    def _send(
        self,
        ui: Ui,
        declaration: ComponentDeclaration,
        declared: FieldDeclaration,
        entities: Sequence[int],
        each: list[Any],
        held: _Held,
        axis: int | None,
    ) -> None:
        value = held.value
        if declared.kind is Kind.QUAT and len(value) == 3:
            value = rotation_from(value)
        if axis is None:
            chosen = {entity: {declared.name: value} for entity in entities}
        else:  # of several entities each keeps its other elements
            chosen = {
                entity: {declared.name: (*own[:axis], value[axis], *own[axis + 1 :])}
                for entity, own in zip(entities, each, strict=True)
            }
        try:
            ui.model.edit.set_each(chosen, declaration.name, stroke=held.stroke)
        except ComponentError as error:
            ui.model.say("error", str(error))

    def _draw_label(
        self,
        ui: Ui,
        declaration: ComponentDeclaration,
        declared: FieldDeclaration,
        entities: Sequence[int],
        *,
        is_default: bool,
    ) -> None:
        imgui.align_text_to_frame_padding()
        label = declared.name.replace("_", " ").capitalize()
        if is_default:
            dim_text(label)
        else:
            imgui.text_unformatted(label)
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            unit = f" [{declared.unit}]" if declared.unit else ""
            imgui.set_tooltip(f"{declared.text}{unit}\nRight click: reset")
        if imgui.begin_popup_context_item("reset"):
            if imgui.menu_item("Reset to default", "", False, not is_default)[0]:
                ui.model.edit.set_fields(entities, declaration.name, {declared.name: declared.default})
            imgui.end_popup()

    def _draw_add_button(self, ui: Ui, entities: Sequence[int]) -> None:
        imgui.spacing()
        if imgui.button(f"{icons.ICON_FA_PLUS}  Add component###add component", (-1.0, 0.0)):
            self._component_search = ""
            imgui.open_popup("add component")
        ui.landmarks.note("inspector/add")
        if not imgui.begin_popup("add component"):
            return
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        _, self._component_search = imgui.input_text_with_hint("###search", "Search", self._component_search)
        owned = set.intersection(*(set(ui.model.scene.components_of(entity)) for entity in entities))
        for name, declaration in declarations().items():
            if name in owned or self._component_search.casefold() not in name.casefold():
                continue
            icon = _ICONS.get(name, icons.ICON_FA_PUZZLE_PIECE)
            if imgui.menu_item(f"{icon}  {name}###{name}", "", False)[0]:
                ui.model.edit.add_component(entities, name)
            ui.landmarks.note(f"component/{name}")
            if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
                imgui.set_tooltip(declaration.text)
        imgui.end_popup()

    def _draw_settings(self, ui: Ui) -> None:
        """With nothing selected: what holds for the whole scene."""
        scene = ui.model.scene
        if not scene.is_known:
            imgui.dummy((0.0, imgui.get_frame_height()))
            centered_text("Waiting for the scene", imgui.get_content_region_avail().x)
            return
        imgui.push_font(ui.fonts.bold, 0.0)
        imgui.text_unformatted(scene.mirror.scene or "Scene")
        imgui.pop_font()
        dim_text(f"{len(scene.mirror.entities)} entities, none selected")
        imgui.spacing()
        settings = scene.settings
        changed, gravity = imgui.drag_float3("Gravity###gravity", list(settings.gravity), 0.05, 0.0, 0.0, "%.2f")
        ui.landmarks.note("inspector/gravity")
        imgui.set_item_tooltip("Acceleration of everything that falls [m/s2]")
        self._hold_settings(ui, "gravity", changed, tuple(round(element, 5) for element in gravity))
        changed, substeps = imgui.slider_int("Substeps###substeps", settings.substeps, 1, 16)
        imgui.set_item_tooltip("Steps of the contact solver in a tick: more are stiffer and dearer")
        self._hold_settings(ui, "substeps", changed, substeps)

    def _hold_settings(self, ui: Ui, name: str, changed: bool, value: Any) -> None:
        path = f"settings/{name}"
        if changed:
            if self._held is None or self._held.path != path:
                self._held = _Held(path, value)
            settings = msgspec.structs.replace(ui.model.scene.settings, **{name: value})
            ui.model.edit.set_settings(settings, stroke=self._held.stroke)
        if imgui.is_item_deactivated() and self._held is not None and self._held.path == path:
            self._held.is_active = False


def _mixed(declared: FieldDeclaration, each: list[Any], *, is_held: bool) -> tuple[bool, ...]:
    """For each element of a field whether the entities differ in it."""
    if is_held or len(each) == 1:
        return (False,) * declared.width
    if declared.width == 1:
        return (any(value != each[-1] for value in each),)
    return tuple(any(value[axis] != each[-1][axis] for value in each) for axis in range(declared.width))

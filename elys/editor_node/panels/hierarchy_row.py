"""One line of the hierarchy: its icon and name, what a click, a drag and a drop on it do, and its switches."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from imgui_bundle import imgui

from elys.bus.tree.kinds import EntityKind, kind_of
from elys.bus.tree.rows import Row, TreeRows
from elys.editor_node.fields import ENTITY_PAYLOAD
from elys.editor_node.language import tr
from elys.editor_node.panels.hierarchy_menus import draw_entity_menu
from elys.editor_node.theme import ACCENT, TEXT, TEXT_DIM, WARNING, icons
from elys.editor_node.ui import Ui, color_code

_ICONS: Final = {
    "Light": icons.ICON_FA_LIGHTBULB,
    "Environment": icons.ICON_FA_CLOUD_SUN,
    "Camera": icons.ICON_FA_VIDEO,
    "Animation": icons.ICON_FA_PERSON_RUNNING,
    "Joint": icons.ICON_FA_LINK,
    "Mesh": icons.ICON_FA_DRAW_POLYGON,
    "Body": icons.ICON_FA_WEIGHT_HANGING,
    "Collider": icons.ICON_FA_SHAPES,
    "Input": icons.ICON_FA_GAMEPAD,
    "Script": icons.ICON_FA_CODE,
    "Empty": icons.ICON_FA_LOCATION_CROSSHAIRS,
}
_DETAIL_ICONS: Final = {
    "directional": icons.ICON_FA_SUN,
    "box": icons.ICON_FA_CUBE,
    "sphere": icons.ICON_FA_CIRCLE,
    "cylinder": icons.ICON_FA_DATABASE,
    "capsule": icons.ICON_FA_CAPSULES,
    "plane": icons.ICON_FA_VECTOR_SQUARE,
}
_SWITCHES: Final = 3  # at the right end of a line


def icon_of(kind: EntityKind) -> str:
    """The icon of a kind of entity."""
    return _DETAIL_ICONS.get(kind.detail) or _ICONS[kind.name]


class HierarchyRow:
    """Draws lines, one after the other; one of them may be being renamed."""

    def __init__(self) -> None:
        self._renaming = 0
        self._rename_text = ""
        self._rename_starts = False

    def start_renaming(self, ui: Ui, entity: int) -> None:
        """Puts a text field where the entity's name is."""
        self._renaming, self._rename_text = entity, ui.model.scene.name_of(entity)
        self._rename_starts = True

    def draw(self, ui: Ui, rows: TreeRows, row: Row, height: float, *, is_dim: bool) -> None:
        """The line of `row`; dim if it is there only for what is below it."""
        scene, selection = ui.model.scene, ui.model.selection
        entity = row.entity
        imgui.push_id(str(entity))
        imgui.set_next_item_allow_overlap()
        flags = imgui.SelectableFlags_.allow_double_click | imgui.SelectableFlags_.allow_overlap
        imgui.push_style_var_y(imgui.StyleVar_.item_spacing, 0.0)
        is_selected = entity in selection
        if is_selected:  # under the pointer as well
            imgui.push_style_color(imgui.Col_.header_hovered, imgui.ImVec4(*ACCENT[:3], 0.36))
        pressed, _ = imgui.selectable("###row", is_selected, flags.value, (0.0, height))
        if is_selected:
            imgui.pop_style_color()
        imgui.pop_style_var()
        left, top = imgui.get_item_rect_min().x, imgui.get_item_rect_min().y
        arrow = left + row.depth * height * 0.75
        ui.landmarks.note(f"hierarchy/{scene.name_of(entity)}")
        is_hovered = imgui.is_item_hovered()
        on_arrow = row.has_children and arrow <= imgui.get_mouse_pos().x <= arrow + height
        if pressed and on_arrow:
            self._turn(ui, row)
        elif pressed and imgui.is_mouse_double_clicked(0):
            self.start_renaming(ui, entity)
        elif pressed:
            _select(ui, row, rows)
        _drag_and_drop(ui, row, is_sorted=rows.order != "scene")
        if imgui.begin_popup_context_item("menu"):
            if entity not in selection:
                selection.replace((entity,))
            draw_entity_menu(ui, entity)
            imgui.end_popup()
        if self._renaming == entity:
            self._draw_rename(ui, arrow + height * 1.9, top, height)
        else:
            _draw_label(ui, row, arrow, top, height, is_dim=is_dim)
        _draw_switches(ui, entity, is_hovered, height)
        imgui.pop_id()

    def _turn(self, ui: Ui, row: Row) -> None:
        """Opens or closes the line; with Alt all below it as well."""
        if imgui.get_io().key_alt:
            ui.model.scene.tree.set_all_open(not row.is_open, (row.entity,))
        else:
            ui.model.scene.set_open(row.entity, not row.is_open)

    def _draw_rename(self, ui: Ui, left: float, top: float, height: float) -> None:
        imgui.same_line()
        imgui.set_cursor_screen_pos((left - 4.0, top))
        imgui.set_next_item_width(imgui.get_content_region_avail().x - _SWITCHES * height)
        if self._rename_starts:
            imgui.set_keyboard_focus_here()
            self._rename_starts = False
        flags = imgui.InputTextFlags_.auto_select_all | imgui.InputTextFlags_.enter_returns_true
        entered, text = imgui.input_text("###rename", self._rename_text, flags.value)
        ui.landmarks.note("hierarchy/rename")
        self._rename_text = text
        if entered or imgui.is_item_deactivated():
            if not imgui.is_key_pressed(imgui.Key.escape):
                ui.model.edit.rename(self._renaming, text)
            self._renaming = 0


def _select(ui: Ui, row: Row, rows: TreeRows) -> None:
    """A line selects when the button comes up, so that dragging several does not first select one of them."""
    io, selection = imgui.get_io(), ui.model.selection
    if io.key_shift:
        selection.extend(rows.entities, row.entity)
    elif io.key_ctrl or io.key_super:
        selection.toggle(row.entity)
    else:
        selection.replace((row.entity,))


def _draw_label(ui: Ui, row: Row, arrow: float, top: float, height: float, *, is_dim: bool) -> None:
    scene, entity = ui.model.scene, row.entity
    found = scene.mirror.entities[entity]
    draw_list = imgui.get_window_draw_list()
    text_top = top + (height - imgui.get_text_line_height()) / 2.0
    is_bright = scene.is_world_enabled(entity) and not is_dim
    color = color_code(TEXT if is_bright else (*TEXT_DIM[:3], 0.55))
    if row.has_children:
        chevron = icons.ICON_FA_CHEVRON_DOWN if row.is_open else icons.ICON_FA_CHEVRON_RIGHT
        draw_list.add_text(
            ui.fonts.regular, imgui.get_font_size() * 0.68, (arrow + 5.0, text_top + 3.0), _dim_code(), chevron
        )
    kind = kind_of(found)
    tint = ACCENT if found.prefab else WARNING if kind.name == "Light" else TEXT_DIM
    tinted = color_code((*tint[:3], 1.0 if is_bright else 0.4))
    draw_list.add_text((arrow + height * 0.95, text_top), tinted, icon_of(kind))
    right = imgui.get_window_pos().x + imgui.get_window_width() - height * 0.4
    draw_list.push_clip_rect((arrow, top), (right, top + height), True)
    draw_list.add_text((arrow + height * 1.95, text_top), color, found.name or f"#{entity}")
    draw_list.pop_clip_rect()


def _draw_switches(ui: Ui, entity: int, is_hovered: bool, height: float) -> None:
    """From the right: seen here, locked, switched on. Each is shown where it says something, all under the pointer."""
    model, marks = ui.model, ui.model.scene.marks
    chosen = model.selection.entities if entity in model.selection else (entity,)
    is_enabled = model.scene.is_enabled(entity)
    is_hidden, is_locked = marks.has("hidden", entity), marks.has("locked", entity)
    imgui.same_line()

    def draw(place: int, name: str, icon: str, tooltip: str, *, is_told: bool, run: Callable[[], object]) -> None:
        imgui.set_cursor_pos_x(imgui.get_window_width() - height * (0.25 + place) + imgui.get_scroll_x())
        pressed = imgui.invisible_button(f"###{name}", (height, height))
        ui.landmarks.note(f"hierarchy/{model.scene.name_of(entity)}/{name}")
        low = imgui.get_item_rect_min()
        if is_hovered or imgui.is_item_hovered() or is_told:
            text_top = low.y + (height - imgui.get_text_line_height()) / 2.0
            imgui.get_window_draw_list().add_text((low.x + 2.0, text_top), _dim_code(), icon)
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            imgui.set_tooltip(tooltip)
        if pressed:
            run()
        if place > 1:
            imgui.same_line()

    draw(
        3,
        "switch",
        icons.ICON_FA_TOGGLE_ON if is_enabled else icons.ICON_FA_TOGGLE_OFF,
        tr("Disable") if is_enabled else tr("Enable"),
        is_told=not is_enabled,
        run=lambda: model.edit.set_enabled(chosen, not is_enabled),
    )
    draw(
        2,
        "lock",
        icons.ICON_FA_LOCK if marks.is_marked("locked", entity) else icons.ICON_FA_LOCK_OPEN,
        tr("Unlock") if is_locked else tr("Lock: it is not picked in the viewport, nor dragged"),
        is_told=marks.is_marked("locked", entity),
        run=lambda: marks.set("locked", chosen, not is_locked),
    )
    draw(
        1,
        "eye",
        icons.ICON_FA_EYE_SLASH if marks.is_marked("hidden", entity) else icons.ICON_FA_EYE,
        tr("Show in this editor") if is_hidden else tr("Hide in this editor"),
        is_told=marks.is_marked("hidden", entity),
        run=lambda: marks.set("hidden", chosen, not is_hidden),
    )


def _drag_and_drop(ui: Ui, row: Row, *, is_sorted: bool) -> None:
    """Dropped on a line what is dragged goes below it, between two lines beside them, unless the lines are sorted."""
    scene, selection, entity = ui.model.scene, ui.model.selection, row.entity
    if imgui.begin_drag_drop_source():
        imgui.set_drag_drop_payload_py_id(ENTITY_PAYLOAD, entity)
        count = len(selection) if entity in selection else 1
        imgui.text_unformatted(scene.name_of(entity) if count == 1 else tr("{count} entities", count=count))
        imgui.end_drag_drop_source()
    if not imgui.begin_drag_drop_target():
        return
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    share = (imgui.get_mouse_pos().y - low.y) / max(high.y - low.y, 1.0)
    flags = imgui.DragDropFlags_.accept_before_delivery | imgui.DragDropFlags_.accept_no_draw_default_rect
    payload = imgui.accept_drag_drop_payload_py_id(ENTITY_PAYLOAD, flags.value)
    if payload is not None:
        draw_list = imgui.get_window_draw_list()
        parent, index = entity, -1
        if is_sorted or 0.25 <= share <= 0.75:
            draw_list.add_rect(low, high, color_code(ACCENT), 3.0)
        else:
            parent, index = scene.place_of(entity)
            index += share > 0.75
            line = high.y if share > 0.75 else low.y
            draw_list.add_line((low.x, line), (high.x, line), color_code(ACCENT), 2.0)
        if imgui.is_mouse_released(0):
            dragged = payload.data_id
            ui.model.edit.reparent(selection.entities if dragged in selection else (dragged,), parent, index)
    imgui.end_drag_drop_target()


def _dim_code() -> int:
    return color_code(TEXT_DIM)

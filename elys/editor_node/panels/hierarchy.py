"""The hierarchy: the tree of entities, searched, selected, renamed, rearranged and switched here."""

from __future__ import annotations

from typing import Final

import numpy as np
from imgui_bundle import imgui

from elys.editor_node.fields import ENTITY_PAYLOAD
from elys.editor_node.primitives import PRIMITIVES
from elys.editor_node.scene_mirror import Row
from elys.editor_node.theme import ACCENT, TEXT, TEXT_DIM, WARNING, icons
from elys.editor_node.ui import Ui, centered_text, color_code, icon_button

TITLE: Final = f"{icons.ICON_FA_SITEMAP}  Hierarchy###Hierarchy"
_ICONS: Final = (  # the first component an entity has decides
    ("Light", icons.ICON_FA_LIGHTBULB),
    ("Environment", icons.ICON_FA_CLOUD_SUN),
    ("Camera", icons.ICON_FA_VIDEO),
    ("MeshRenderer", icons.ICON_FA_CUBE),
    ("Collider", icons.ICON_FA_SHAPES),
    ("Script", icons.ICON_FA_CODE),
)
PRIMITIVE_ICONS: Final = {
    "Empty": icons.ICON_FA_LOCATION_CROSSHAIRS,
    "Box": icons.ICON_FA_CUBE,
    "Sphere": icons.ICON_FA_CIRCLE,
    "Light": icons.ICON_FA_LIGHTBULB,
    "Camera": icons.ICON_FA_VIDEO,
}


class HierarchyPanel:
    """Only the lines to be seen are drawn, so that fifty thousand entities cost no more than fifty."""

    def __init__(self) -> None:
        self._search = ""
        self._renaming = 0
        self._rename_text = ""
        self._rename_starts = False
        self._revealed_version = -1
        self._scroll_to = 0

    def start_renaming(self, ui: Ui, entity: int) -> None:
        """Puts a text field where the entity's name is."""
        if ui.model.scene.exists(entity):
            ui.model.scene.reveal(entity)
            self._renaming, self._rename_text = entity, ui.model.scene.name_of(entity)
            self._rename_starts, self._scroll_to = True, entity

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(TITLE)[0]:
            self._draw_search(ui)
            if imgui.begin_child("###tree", (0.0, 0.0), 0, imgui.WindowFlags_.no_nav.value):
                self._draw_tree(ui)
            imgui.end_child()
        imgui.end()

    def _draw_search(self, ui: Ui) -> None:
        button = imgui.get_frame_height() * 1.15 + imgui.get_style().item_inner_spacing.x
        imgui.set_next_item_width(imgui.get_content_region_avail().x - button)
        hint = f"{icons.ICON_FA_MAGNIFYING_GLASS}  Search, or has:Light"
        _, self._search = imgui.input_text_with_hint("###search", hint, self._search)
        ui.landmarks.note("hierarchy/search")
        imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)
        if icon_button(icons.ICON_FA_PLUS, "add", "Add an entity"):
            imgui.open_popup("add")
        ui.landmarks.note("hierarchy/add")
        if imgui.begin_popup("add"):
            draw_add_menu(ui, parent=0)
            imgui.end_popup()

    def _draw_tree(self, ui: Ui) -> None:
        scene = ui.model.scene
        self._reveal_selection(ui)
        rows = scene.rows(self._search)
        if not rows:
            self._draw_nothing(ui)
        imgui.push_style_var_y(imgui.StyleVar_.item_spacing, 1.0)
        height = imgui.get_frame_height()
        if self._scroll_to:
            self._scroll(rows, height + 1.0)
        clipper = imgui.ListClipper()
        clipper.begin(len(rows), height + 1.0)
        while clipper.step():
            for place in range(clipper.display_start, clipper.display_end):
                self._draw_row(ui, rows[place], rows, height)
        clipper.end()
        imgui.pop_style_var()
        self._draw_rest(ui)

    def _reveal_selection(self, ui: Ui) -> None:
        """What was selected elsewhere (in the viewport) is opened and scrolled to."""
        selection = ui.model.selection
        if selection.version != self._revealed_version:
            self._revealed_version = selection.version
            if selection.primary and ui.model.scene.exists(selection.primary):
                ui.model.scene.reveal(selection.primary)
                self._scroll_to = selection.primary

    def _scroll(self, rows: list[Row], pitch: float) -> None:
        place = next((place for place, row in enumerate(rows) if row.entity == self._scroll_to), -1)
        self._scroll_to = 0
        if place < 0:
            return
        top, bottom, height = place * pitch, (place + 1) * pitch, imgui.get_window_height()
        if top < imgui.get_scroll_y():
            imgui.set_scroll_y(max(0.0, top - height * 0.3))
        elif bottom > imgui.get_scroll_y() + height:
            imgui.set_scroll_y(bottom - height * 0.7)

    def _draw_row(self, ui: Ui, row: Row, rows: list[Row], height: float) -> None:
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
            scene.set_open(entity, not row.is_open)
        elif pressed and imgui.is_mouse_double_clicked(0):
            self.start_renaming(ui, entity)
        else:
            self._select_on_mouse(ui, row, rows, pressed=pressed)
        self._drag_and_drop(ui, row)
        self._draw_context_menu(ui, entity)
        if self._renaming == entity:
            self._draw_rename(ui, arrow + height * 1.9, top)
        else:
            self._draw_label(ui, row, arrow, top, height)
        self._draw_eye(ui, entity, is_hovered, height)
        imgui.pop_id()

    def _select_on_mouse(self, ui: Ui, row: Row, rows: list[Row], *, pressed: bool) -> None:
        """A row selects when the button comes up, so that dragging several does not first select one of them."""
        if not pressed:
            return
        io, selection = imgui.get_io(), ui.model.selection
        if io.key_shift:
            selection.extend([other.entity for other in rows], row.entity)
        elif io.key_ctrl or io.key_super:
            selection.toggle(row.entity)
        else:
            selection.replace((row.entity,))
        self._revealed_version = selection.version  # it is in sight: nothing to scroll to

    def _draw_label(self, ui: Ui, row: Row, arrow: float, top: float, height: float) -> None:
        scene, entity = ui.model.scene, row.entity
        found = scene.mirror.entities[entity]
        draw_list = imgui.get_window_draw_list()
        text_top = top + (height - imgui.get_text_line_height()) / 2.0
        is_enabled = scene.is_world_enabled(entity)
        color = color_code(TEXT if is_enabled else (*TEXT_DIM[:3], 0.55))
        if row.has_children:
            chevron = icons.ICON_FA_CHEVRON_DOWN if row.is_open else icons.ICON_FA_CHEVRON_RIGHT
            draw_list.add_text(
                ui.fonts.regular, imgui.get_font_size() * 0.68, (arrow + 5.0, text_top + 3.0), _dim_code(), chevron
            )
        icon = next((icon for name, icon in _ICONS if name in found.components), icons.ICON_FA_LOCATION_CROSSHAIRS)
        tint = WARNING if icon == icons.ICON_FA_LIGHTBULB else ACCENT if found.prefab else TEXT_DIM
        draw_list.add_text((arrow + height * 0.95, text_top), color_code((*tint[:3], 1.0 if is_enabled else 0.4)), icon)
        draw_list.add_text((arrow + height * 1.95, text_top), color, found.name or f"#{entity}")

    def _draw_rename(self, ui: Ui, left: float, top: float) -> None:
        imgui.same_line()
        imgui.set_cursor_screen_pos((left - 4.0, top))
        imgui.set_next_item_width(imgui.get_content_region_avail().x - imgui.get_frame_height() * 1.2)
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

    def _draw_eye(self, ui: Ui, entity: int, is_hovered: bool, height: float) -> None:
        """The switch of an entity: shown where it is off, or where the pointer is."""
        is_enabled = ui.model.scene.is_enabled(entity)
        imgui.same_line()
        imgui.set_cursor_pos_x(imgui.get_window_width() - height * 1.25)
        pressed = imgui.invisible_button("###eye", (height, height))
        ui.landmarks.note(f"hierarchy/{ui.model.scene.name_of(entity)}/eye")
        if is_hovered or imgui.is_item_hovered() or not is_enabled:
            icon = icons.ICON_FA_EYE if is_enabled else icons.ICON_FA_EYE_SLASH
            low = imgui.get_item_rect_min()
            text_top = low.y + (height - imgui.get_text_line_height()) / 2.0
            imgui.get_window_draw_list().add_text((low.x + 2.0, text_top), _dim_code(), icon)
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            imgui.set_tooltip("Disable" if is_enabled else "Enable")
        if pressed:
            chosen = ui.model.selection.entities if entity in ui.model.selection else (entity,)
            ui.model.edit.set_enabled(chosen, not is_enabled)

    def _drag_and_drop(self, ui: Ui, row: Row) -> None:
        scene, selection, entity = ui.model.scene, ui.model.selection, row.entity
        if imgui.begin_drag_drop_source():
            imgui.set_drag_drop_payload_py_id(ENTITY_PAYLOAD, entity)
            count = len(selection) if entity in selection else 1
            imgui.text_unformatted(scene.name_of(entity) if count == 1 else f"{count} entities")
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
            if 0.25 <= share <= 0.75:
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

    def _draw_context_menu(self, ui: Ui, entity: int) -> None:
        model = ui.model
        if not imgui.begin_popup_context_item("menu"):
            return
        if entity not in model.selection:
            model.selection.replace((entity,))
            self._revealed_version = model.selection.version
        if imgui.menu_item("Rename", "F2", False)[0]:
            self.start_renaming(ui, entity)
        if imgui.menu_item("Duplicate", "Ctrl+D", False)[0]:
            model.edit.duplicate()
        is_enabled = model.scene.is_enabled(entity)
        if imgui.menu_item("Disable" if is_enabled else "Enable", "", False)[0]:
            model.edit.set_enabled(model.selection.entities, not is_enabled)
        if imgui.menu_item("Move to the top", "", False, model.scene.parent_of(entity) != 0)[0]:
            model.edit.reparent(model.selection.entities, 0)
        if imgui.begin_menu("Add a child"):
            draw_add_menu(ui, parent=entity)
            imgui.end_menu()
        imgui.separator()
        if imgui.menu_item("Delete", "Del", False)[0]:
            model.edit.delete()
        imgui.end_popup()

    def _draw_rest(self, ui: Ui) -> None:
        """What lies below the last line: a click selects nothing, a drop moves to the top."""
        size = imgui.get_content_region_avail()
        if size.y < 4.0 or size.x < 1.0:
            return
        if imgui.invisible_button("###rest", (size.x, size.y)):
            ui.model.selection.clear()
        if imgui.begin_drag_drop_target():
            payload = imgui.accept_drag_drop_payload_py_id(ENTITY_PAYLOAD)
            if payload is not None:
                dragged, selection = payload.data_id, ui.model.selection
                ui.model.edit.reparent(selection.entities if dragged in selection else (dragged,), 0)
            imgui.end_drag_drop_target()
        if imgui.begin_popup_context_item("add here"):
            draw_add_menu(ui, parent=0)
            imgui.end_popup()

    def _draw_nothing(self, ui: Ui) -> None:
        imgui.dummy((0.0, imgui.get_frame_height()))
        if self._search:
            text = f"No entity is called '{self._search}'"
        else:
            text = "The scene is empty" if ui.model.scene.is_known else "Waiting for the scene"
        centered_text(text, imgui.get_content_region_avail().x)


def draw_add_menu(ui: Ui, *, parent: int) -> None:
    """The entities that can be made."""
    for kind in PRIMITIVES:
        if imgui.menu_item(f"{PRIMITIVE_ICONS[kind]}  {kind}###{kind}", "", False)[0]:
            ui.model.edit.spawn(kind, parent=parent, at=None if parent else np.array(ui.focus))
        ui.landmarks.note(f"add/{kind}")


def _dim_code() -> int:
    return color_code(TEXT_DIM)

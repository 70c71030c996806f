"""The menus of the hierarchy: what can be added, done with an entity, searched and sorted."""

from __future__ import annotations

from typing import Final

import numpy as np
from imgui_bundle import imgui

from elys.bus.tree.filter import EXAMPLES
from elys.bus.tree.order import Order
from elys.editor_node.language import tr, tr_label
from elys.editor_node.piece_list import PIECE_MENUS, piece_file
from elys.editor_node.primitives import PRIMITIVES
from elys.editor_node.theme import icons
from elys.editor_node.ui import Ui, action_item, dim_text

PRIMITIVE_ICONS: Final = {
    "Empty": icons.ICON_FA_LOCATION_CROSSHAIRS,
    "Box": icons.ICON_FA_CUBE,
    "Sphere": icons.ICON_FA_CIRCLE,
    "Light": icons.ICON_FA_LIGHTBULB,
    "Camera": icons.ICON_FA_VIDEO,
}
_ORDERS: Final[tuple[tuple[Order, str], ...]] = (
    ("scene", "As in the scene"),
    ("name", "By name"),
    ("kind", "By kind"),
)
SELECT_ACTIONS: Final = (
    "select.children",
    "select.parent",
    "select.inverse",
    "select.same_components",
    "select.back",
    "select.forward",
)


def draw_add_menu(ui: Ui, *, parent: int) -> None:
    """The entities that can be made."""
    for kind in PRIMITIVES:
        if imgui.menu_item(f"{PRIMITIVE_ICONS[kind]}  {tr(kind)}###{kind}", "", False)[0]:
            ui.model.edit.spawn(kind, parent=parent, at=None if parent else np.array(ui.focus))
        ui.landmarks.note(f"add/{kind}")
    if not parent:
        imgui.separator()
        for menu in PIECE_MENUS:
            _draw_pieces(ui, menu)


def _draw_pieces(ui: Ui, menu: str) -> None:
    """The pieces of one menu: prefabs that are put where the view looks."""
    is_open = imgui.begin_menu(tr_label(menu))
    ui.landmarks.note(f"add/{menu}")
    if not is_open:
        return
    for name in PIECE_MENUS[menu][1]:
        if imgui.menu_item(tr_label(name), "", False)[0]:
            ui.place_file(piece_file(menu, name))
        ui.landmarks.note(f"add/{menu}/{name}")
    imgui.end_menu()


def draw_entity_menu(ui: Ui, entity: int) -> None:
    """What can be done with what is selected, of which `entity` is one."""
    model = ui.model
    for name in ("edit.rename", "edit.duplicate", "edit.cut", "edit.copy", "edit.paste", "edit.group"):
        action_item(ui, name)
    imgui.separator()
    is_enabled = model.scene.is_enabled(entity)
    if imgui.menu_item(tr_label("Disable" if is_enabled else "Enable", "enabled"), "", False)[0]:
        model.edit.set_enabled(model.selection.entities, not is_enabled)
    ui.landmarks.note("menu/enabled")
    action_item(ui, "tree.hide")
    action_item(ui, "tree.lock")
    imgui.separator()
    if imgui.menu_item(tr_label("Move to the top"), "", False, model.scene.parent_of(entity) != 0)[0]:
        model.edit.reparent(model.selection.entities, 0)
    ui.landmarks.note("menu/to_top")
    if imgui.begin_menu(tr_label("Add a child")):
        draw_add_menu(ui, parent=entity)
        imgui.end_menu()
    draw_select_menu(ui)
    action_item(ui, "tree.open_below")
    action_item(ui, "tree.close_below")
    imgui.separator()
    action_item(ui, "edit.delete")


def draw_select_menu(ui: Ui) -> None:
    """Ways to select others."""
    is_open = imgui.begin_menu(tr_label("Select"))
    if not is_open:
        ui.landmarks.note("menu/select")
        return
    for name in SELECT_ACTIONS:
        action_item(ui, name)
    imgui.end_menu()


def draw_examples(ui: Ui) -> str | None:
    """Searches to learn from; the one that was chosen, "" for none at all."""
    chosen: str | None = None
    dim_text(tr("Words that must all hold; ! before one turns it round"))
    for place, (search, meaning) in enumerate(EXAMPLES):
        if imgui.menu_item(f"{search}###{search}", tr(meaning), False)[0]:
            chosen = search
        ui.landmarks.note(f"filters/{place}")
    imgui.separator()
    if imgui.menu_item(tr_label("Show everything"), "", False)[0]:
        chosen = ""
    ui.landmarks.note("filters/none")
    return chosen


def draw_orders(ui: Ui, order: Order) -> Order:
    """How siblings are sorted, and what is open."""
    for name, label in _ORDERS:
        if imgui.menu_item(tr_label(label, name), "", name == order)[0]:
            order = name
        ui.landmarks.note(f"order/{name}")
    imgui.separator()
    action_item(ui, "tree.expand_all")
    action_item(ui, "tree.collapse_all")
    return order

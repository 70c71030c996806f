"""What the viewport puts into the menu View: the camera's points of view, and lines over the picture."""

from __future__ import annotations

from typing import get_args

from imgui_bundle import imgui

from elys.bus.messages.views import Debug, Shows
from elys.editor_node.camera_views import PLACES, SIDES
from elys.editor_node.language import tr, tr_label
from elys.editor_node.ui import Ui, action_item


def draw_camera_menu(ui: Ui) -> None:
    """Sides, places and the scene's cameras."""
    is_open = imgui.begin_menu(tr_label("Camera", "menu_camera"))
    if not is_open:
        ui.landmarks.note("menu/camera")
        return
    for side in SIDES:
        action_item(ui, f"camera.{side}")
    action_item(ui, "camera.parallel")
    imgui.separator()
    action_item(ui, "camera.look_through")
    action_item(ui, "camera.move_here")
    imgui.separator()
    for digit in PLACES:
        if ui.actions[f"camera.go_{digit}"].is_possible():
            action_item(ui, f"camera.go_{digit}")
    if imgui.begin_menu(tr_label("Keep this view")):
        for digit in PLACES:
            action_item(ui, f"camera.keep_{digit}")
        imgui.end_menu()
    else:
        ui.landmarks.note("menu/keep_view")
    imgui.end_menu()


def draw_show_menu(ui: Ui) -> None:
    """What the picture says of surfaces."""
    if not imgui.begin_menu(tr_label("Show")):
        ui.landmarks.note("menu/show")
        return
    for view in get_args(Shows):
        action_item(ui, f"view.{view}", tr(view.capitalize()))
        ui.landmarks.note(f"show/{view}")
    imgui.end_menu()


def draw_debug_menu(ui: Ui) -> None:
    """What can be drawn over the picture in lines and letters; it stays open, so that several are chosen at once."""
    if not imgui.begin_menu(tr_label("Debug", "menu_debug")):
        ui.landmarks.note("menu/debug")
        return
    imgui.push_item_flag(imgui.ItemFlags_.auto_close_popups.value, False)
    for kind in get_args(Debug):
        action_item(ui, f"debug.{kind}")
    imgui.separator()
    action_item(ui, "debug.selection")
    imgui.pop_item_flag()
    imgui.end_menu()

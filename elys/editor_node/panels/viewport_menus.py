"""What the viewport puts into the menu View: the camera's points of view."""

from __future__ import annotations

from imgui_bundle import imgui

from elys.editor_node.camera_views import PLACES, SIDES
from elys.editor_node.language import tr_label
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

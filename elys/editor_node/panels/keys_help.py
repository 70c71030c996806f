"""What the keys and the mouse do, for the person who looks it up; they are bound in `shortcuts` and `viewport_layer`."""

from __future__ import annotations

from typing import Final

from imgui_bundle import imgui

import elys
from elys.editor_node.ui import dim_text

TITLE: Final = "Keys and mouse###help"
SHORTCUTS: Final = (
    ("Ctrl+S", "save"),
    ("Ctrl+Z", "undo"),
    ("Ctrl+Y, Ctrl+Shift+Z", "redo"),
    ("Ctrl+D", "duplicate"),
    ("Ctrl+A", "select all"),
    ("Delete", "delete"),
    ("F2", "rename"),
    ("F", "look at the selection"),
    ("Q  W  E  R", "select, move, rotate, scale"),
    ("Space", "play or pause"),
    (".", "one tick"),
    ("Escape", "select nothing"),
    ("Alt + left button", "orbit"),
    ("middle button", "pan"),
    ("wheel", "zoom to the pointer"),
    ("right button + W A S D Q E", "fly; Shift is fast, the wheel sets the speed"),
    ("Ctrl while dragging the gizmo", "snap"),
)


def draw_help() -> None:
    """Draws the window, if its popup is open."""
    center = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(center, imgui.Cond_.appearing.value, (0.5, 0.5))
    if not imgui.begin_popup_modal(TITLE, True, imgui.WindowFlags_.always_auto_resize.value)[0]:
        return
    if imgui.begin_table("keys", 2):
        for keys, meaning in SHORTCUTS:
            imgui.table_next_column()
            imgui.text_unformatted(f"{keys}    ")
            imgui.table_next_column()
            dim_text(meaning)
        imgui.end_table()
    imgui.spacing()
    dim_text(f"ELYS {elys.__version__}")
    if imgui.is_key_pressed(imgui.Key.escape):
        imgui.close_current_popup()
    imgui.end_popup()

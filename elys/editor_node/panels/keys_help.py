"""What the keys and the mouse do, for the person who looks it up: keys from the actions, the mouse as `viewport_layer` has it."""

from __future__ import annotations

from typing import Final

from imgui_bundle import imgui

import elys
from elys.editor_node.language import tr, tr_label
from elys.editor_node.ui import Ui, dim_text

TITLE: Final = "Keys and mouse###help"
_MOUSE: Final = (
    ("Alt + left button", "orbit"),
    ("left button dragged", "select in a rectangle; Shift adds, Ctrl turns it about"),
    ("middle button", "pan"),
    ("wheel", "zoom to the pointer"),
    ("right button + W A S D Q E", "fly; Shift is fast, the wheel sets the speed"),
    ("Ctrl while dragging the gizmo", "snap"),
)


def draw_help(ui: Ui) -> None:
    """Draws the window, if its popup is open."""
    center = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(center, imgui.Cond_.appearing.value, (0.5, 0.5))
    if not imgui.begin_popup_modal(
        tr_label("Keys and mouse", "help"), True, imgui.WindowFlags_.always_auto_resize.value
    )[0]:
        return
    if imgui.begin_table("keys", 2):
        bound = [(", ".join(map(str, ui.keys.chords_of(a.name))), tr(a.label)) for a in ui.actions]
        for keys, meaning in [row for row in bound if row[0]] + [(tr(k), tr(m)) for k, m in _MOUSE]:
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

"""A list in a popup: what is searched in it is picked by a click, the first that is found by Enter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, TypeVar

from imgui_bundle import imgui

from elys.editor_node.fields import FieldContext, PickState, label_item
from elys.editor_node.language import tr

T = TypeVar("T")
WIDTH: Final = 18.0  # of the font's size
VISIBLE_LINES: Final = 12


def open_list(state: PickState) -> None:
    """Opens the list of the field that is being drawn, with nothing searched."""
    state.search, state.found_for, state.kept_for, state.offered = "", (), (), {}
    imgui.open_popup("pick")


def draw_list(context: FieldContext, found: Callable[[], Sequence[T]], label: Callable[[T], str]) -> T | None:
    """The open list of what can be picked, and what was picked."""
    if not imgui.begin_popup("pick"):
        return None
    width = imgui.get_font_size() * WIDTH
    entered = draw_search(context, width)
    offered = found()
    picked = draw_choices(context, offered, label, width=width)
    if entered and offered and picked is None:
        picked = offered[0]
    if picked is not None:
        imgui.close_current_popup()
    imgui.end_popup()
    return picked


def draw_search(context: FieldContext, width: float) -> bool:
    """The box for what is searched, which has the keyboard when the popup opens; whether Enter was pressed."""
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    imgui.set_next_item_width(width)
    entered, context.picking.search = imgui.input_text_with_hint(
        "###search", tr("Search"), context.picking.search, imgui.InputTextFlags_.enter_returns_true.value
    )
    context.note("search")
    return entered


def draw_choices(
    context: FieldContext, offered: Sequence[T], label: Callable[[T], str], *, width: float, chosen: T | None = None
) -> T | None:
    """The lines, of which `chosen` is marked, and the one that was clicked."""
    picked = None
    line = imgui.get_text_line_height_with_spacing()
    if imgui.begin_child("###list", (width, line * min(max(len(offered), 1), VISIBLE_LINES) + line * 0.5)):
        if not offered:
            imgui.text_disabled(tr("Nothing is called so"))
        clipper = imgui.ListClipper()
        clipper.begin(len(offered))
        while clipper.step():
            for place in range(clipper.display_start, clipper.display_end):
                one = offered[place]
                imgui.push_id(place)
                if imgui.selectable("###one", one == chosen)[0]:
                    picked = one
                imgui.pop_id()
                context.note(f"pick/{label(one)}")
                label_item(label(one))
        clipper.end()
    imgui.end_child()
    return picked

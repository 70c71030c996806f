"""Texts that name things of which it is known what there is: one is chosen from a list, or added to a text that lists several."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from imgui_bundle import imgui

from elys.editor_node.field_values import NameOffer
from elys.editor_node.fields import MIXED, FieldContext, FieldEdit, element_width, label_item, small_button
from elys.editor_node.language import tr
from elys.editor_node.panels.pick_list import VISIBLE_LINES, WIDTH, draw_choices, draw_list, draw_search, open_list
from elys.editor_node.panels.text_fields import edit_text
from elys.editor_node.theme import WARNING, icons
from elys.editor_node.ui import color_code


def edit_names(value: str, offer: NameOffer, context: FieldContext) -> FieldEdit:
    """One of the names that are offered, or a text to which they are added."""
    if offer.longer is None:
        return _edit_one(value, offer.names, context)
    return _edit_several(value, offer.longer, context)


def _edit_one(value: str, names: tuple[str, ...], context: FieldContext) -> FieldEdit:
    """A list to choose from. A name that is not among them stays until another is chosen, and is marked."""
    edit = FieldEdit()
    is_mixed = context.mixed[0]
    is_missing = bool(value) and not is_mixed and value not in names
    imgui.set_next_item_width(element_width(1))
    if imgui.begin_combo("###value", "", imgui.ComboFlags_.height_largest.value):
        picked = _draw_names(names, None if is_mixed else value, context)
        if picked is not None:
            imgui.close_current_popup()
            if is_mixed or picked != value:
                edit.choose(picked)
        imgui.end_combo()
    else:
        context.note()
    label_item(
        MIXED if is_mixed else value or tr("(none)"),
        color=color_code(WARNING) if is_missing else None,
        room=imgui.get_frame_height(),
    )
    if is_missing and imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
        imgui.set_tooltip(tr("There is none of that name"))
    return edit


def _draw_names(names: tuple[str, ...], value: str | None, context: FieldContext) -> str | None:
    """The open list, which can be searched where it is long, and the name that was picked; "" for none."""
    state = context.picking
    if imgui.is_window_appearing():
        state.search = ""
    width = max(imgui.get_content_region_avail().x, imgui.get_font_size() * WIDTH / 2.0)
    entered = draw_search(context, width) if len(names) > VISIBLE_LINES else False
    words = state.search.casefold().split()
    found = [name for name in names if all(word in name.casefold() for word in words)]
    picked = draw_choices(
        context, found if words else ["", *names], lambda name: name or tr("(none)"), width=width, chosen=value
    )
    return found[0] if picked is None and entered and words and found else picked


def _edit_several(value: str, longer: Callable[[str], Mapping[str, str]], context: FieldContext) -> FieldEdit:
    """The text, and a button that adds a name to it: not where the texts of several entities differ."""
    edit = edit_text(value, context, buttons=1)
    is_mixed = context.mixed[0]
    if small_button(icons.ICON_FA_PLUS, "pick", tr("Add one to it"), context, enabled=not is_mixed):
        open_list(context.picking)
    words = context.picking.search.casefold().split()
    picked = draw_list(
        context, lambda: [name for name in longer(value) if all(word in name.casefold() for word in words)], str
    )
    if picked is not None:
        edit.choose(longer(value)[picked])
    return edit

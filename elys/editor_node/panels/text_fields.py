"""Texts that are typed."""

from __future__ import annotations

from imgui_bundle import imgui

from elys.editor_node.fields import MIXED, FieldContext, FieldEdit, element_width


def edit_text(value: str, context: FieldContext, *, buttons: int = 0) -> FieldEdit:
    """Sent when the person presses Enter or goes elsewhere, not at every letter. Leaves room for square buttons."""
    edit = FieldEdit()
    shown = "" if context.mixed[0] else value
    imgui.set_next_item_width(element_width(1, buttons=buttons))
    _, text = imgui.input_text_with_hint("###value", MIXED if context.mixed[0] else "", shown)
    context.note()
    if imgui.is_item_deactivated_after_edit() and text != shown:
        edit.choose(text)
    return edit

"""Switches, choices and named values, and the one place that tells which widget a field gets."""

from __future__ import annotations

import contextlib
import json
from typing import Any

from imgui_bundle import imgui

from elys.common.components import FieldDeclaration, Kind
from elys.editor_node.fields import MIXED, FieldContext, FieldEdit, element_width
from elys.editor_node.panels.color_fields import edit_color
from elys.editor_node.panels.curve_fields import edit_curve
from elys.editor_node.panels.name_fields import edit_names
from elys.editor_node.panels.number_fields import edit_integer, edit_numbers, edit_rotation
from elys.editor_node.panels.reference_fields import edit_asset, edit_entity
from elys.editor_node.panels.text_fields import edit_text


def edit_field(field: FieldDeclaration, value: Any, context: FieldContext, *, buttons: int = 0) -> FieldEdit:
    """Draws the widget in the rest of the line, of which numbers leave room for square buttons."""
    match field.kind:
        case Kind.FLOAT:
            return edit_numbers(field, (value,), context)
        case Kind.VEC3:
            return edit_numbers(field, value, context, buttons=buttons)
        case Kind.QUAT:
            return edit_rotation(context)
        case Kind.INT:
            return edit_integer(field, value, context)
        case Kind.BOOL:
            return edit_switch(value, context)
        case Kind.CHOICE:
            return edit_choice(field, value, context)
        case Kind.COLOR:
            return edit_color(field, value, context)
        case Kind.CURVE:
            return edit_curve(field, value, context)
        case Kind.TEXT:
            return edit_text(value, context) if context.offer is None else edit_names(value, context.offer, context)
        case Kind.ASSET:
            return edit_asset(field, value, context)
        case Kind.ENTITY:
            return edit_entity(value, context)
        case Kind.VALUES:
            return edit_named_values(value, context)


def edit_switch(value: bool, context: FieldContext) -> FieldEdit:
    """Yes or no."""
    edit = FieldEdit()
    imgui.push_item_flag(imgui.ItemFlags_.mixed_value.value, context.mixed[0])
    edit.changed, edit.value = imgui.checkbox("###value", value)
    imgui.pop_item_flag()
    edit.watch()
    context.note()
    return edit


def edit_choice(field: FieldDeclaration, value: str, context: FieldContext) -> FieldEdit:
    """One of a few names."""
    edit = FieldEdit()
    imgui.set_next_item_width(element_width(1))
    is_mixed = context.mixed[0]
    if imgui.begin_combo("###value", MIXED if is_mixed else value):
        for choice in field.choices:
            pressed, _ = imgui.selectable(choice, choice == value and not is_mixed)
            context.note(choice)
            if pressed:
                edit.choose(choice)
        imgui.end_combo()
    else:
        context.note()
    return edit


def edit_named_values(value: dict[str, Any], context: FieldContext) -> FieldEdit:
    """As JSON; what is no object is sent as it is, and refused with a sentence."""
    edit = edit_text(json.dumps(value, ensure_ascii=False) if value else "", context)
    if edit.changed:
        with contextlib.suppress(ValueError):
            edit.value = json.loads(edit.value) if edit.value.strip() else {}
    return edit

"""Colours: a swatch that opens a picker, and the three linear numbers that are stored. The picker and #rrggbb are sRGB."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from imgui_bundle import imgui

from elys.common.components import FieldDeclaration
from elys.common.components.decimals import shortest_decimal
from elys.editor_node.colors import (
    hex_from_linear,
    linear_from_hex,
    linear_from_srgb,
    split_intensity,
    srgb_from_linear,
    with_intensity,
)
from elys.editor_node.field_values import is_radiance
from elys.editor_node.fields import FieldContext, FieldEdit, inner_spacing
from elys.editor_node.language import tr, tr_label
from elys.editor_node.panels.number_fields import edit_numbers
from elys.editor_node.ui import dim_text

MOST_INTENSITY: Final = 1e5
_HEX_FLAGS: Final = (imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all).value


def edit_color(field: FieldDeclaration, value: Sequence[float], context: FieldContext) -> FieldEdit:
    """What a person did to a colour; of one that may be brighter than white the swatch shows the colour alone."""
    edit = FieldEdit()
    color, intensity = split_intensity(value) if is_radiance(field) else (tuple(value), 1.0)
    shown = [srgb_from_linear(min(element, 1.0)) for element in color]
    height = imgui.get_frame_height()
    flags = imgui.ColorEditFlags_.no_tooltip.value | imgui.ColorEditFlags_.no_alpha.value
    if imgui.color_button("###swatch", imgui.ImVec4(shown[0], shown[1], shown[2], 1.0), flags, (height * 1.3, height)):
        imgui.open_popup("picker")
    context.note("swatch")
    if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
        bright = f", {tr('intensity')} {intensity:.4g}" if intensity > 1.0 else ""
        imgui.set_tooltip(f"{tr('sRGB')} {hex_from_linear(color)}{bright}")
    if imgui.begin_popup("picker"):
        _draw_picker(field, value, context, edit)
        imgui.end_popup()
    imgui.same_line(0.0, inner_spacing())
    numbers = edit_numbers(field, value, context)
    return numbers if numbers.changed or numbers.began or numbers.ended else edit


def _draw_picker(field: FieldDeclaration, value: Sequence[float], context: FieldContext, edit: FieldEdit) -> None:
    may_shine = is_radiance(field)
    color, intensity = split_intensity(value) if may_shine else (tuple(value), 1.0)
    shown = [srgb_from_linear(min(element, 1.0)) for element in color]
    options = (
        imgui.ColorEditFlags_.picker_hue_wheel
        | imgui.ColorEditFlags_.no_side_preview
        | imgui.ColorEditFlags_.no_inputs
        | imgui.ColorEditFlags_.no_alpha
    )
    imgui.set_next_item_width(imgui.get_font_size() * 14.0)
    changed, picked = imgui.color_picker3("###picker", shown, options.value)
    edit.watch()
    context.note("picker")
    if changed:
        linear = tuple(round(linear_from_srgb(element), 5) for element in picked[:3])
        edit.choose(with_intensity(linear, intensity))
    imgui.set_next_item_width(imgui.get_font_size() * 7.0)
    entered, text = imgui.input_text(f"{tr('sRGB')}###hex", hex_from_linear(color), _HEX_FLAGS)
    context.note("hex")
    if entered:
        chosen = linear_from_hex(text)
        if chosen is None:
            context.refuse(tr("'{typed}' is no colour; write it as #rrggbb", typed=text))
        else:
            context.refuse("")
            edit.choose(with_intensity(chosen, intensity))
            edit.began = edit.ended = True
    if may_shine:
        imgui.set_next_item_width(imgui.get_font_size() * 7.0)
        flags = imgui.SliderFlags_.always_clamp.value
        speed = 0.01 * intensity  # a pixel is as much of the light, however much there is
        changed, dragged = imgui.drag_float(
            tr_label("Intensity", "intensity"), intensity, speed, 1.0, MOST_INTENSITY, "%.3f", flags
        )
        edit.watch()
        context.note("intensity")
        if changed:
            edit.choose(with_intensity(color, shortest_decimal(dragged)))
    dim_text(f"{tr('linear')}  {'  '.join(f'{element:.4g}' for element in value)}")

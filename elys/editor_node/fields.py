"""One widget for each kind of field, made from its declaration alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from imgui_bundle import imgui

from elys.common.assets import PRIMITIVES
from elys.common.assets.store import PREFIX, is_reference
from elys.common.assets.texture import split_texture
from elys.common.components import Camera, Collider, Component, FieldDeclaration, Joint, Kind, Light
from elys.common.components.decimals import shortest_decimal
from elys.common.math import quaternion
from elys.editor_node.scene_mirror import EditorScene
from elys.editor_node.theme import AXES, icons
from elys.editor_node.ui import Landmarks, color_code

ENTITY_PAYLOAD: Final = "elys_entity"  # what the hierarchy lets one drag
_MIXED: Final = "—"  # shown where several entities differ
# Fields that matter only to some shapes and joints, and to which.
_SHAPES_WITH: Final = {
    "size": ("box", "height_field"),
    "radius": ("sphere", "capsule", "cylinder"),
    "half_length": ("capsule", "cylinder"),
    "heights": ("height_field",),
}
_WITH_COORDINATE: Final = ("hinge", "slider", "distance", "cone_twist")
_JOINTS_WITH: Final = {
    "axis": ("hinge", "slider", "cone_twist"),
    "swing_limit": ("cone_twist",),
    **dict.fromkeys(("limited", "lower", "upper", "motor_speed", "motor_limit"), _WITH_COORDINATE),
    **dict.fromkeys(("spring_frequency", "spring_damping", "spring_rest", "spring_limit"), _WITH_COORDINATE),
    **dict.fromkeys(("drive_velocity", "drive_spin", "drive_force", "drive_torque"), ("motor",)),
    **dict.fromkeys(("joint_a", "joint_b", "ratio"), ("gear",)),
}


_CAMERAS_WITH: Final = {"field_of_view": "perspective", "ortho_height": "orthographic"}


@dataclass(slots=True)
class FieldEdit:
    """What a person did to a field in this frame."""

    value: Any = None  # the new value, if it changed
    changed: bool = False
    began: bool = False  # took hold of the widget
    ended: bool = False  # let go of it
    axis: int | None = None  # the one element of several that changed

    def watch(self) -> None:
        """Adds what happened to the last ImGui item."""
        self.began |= imgui.is_item_activated()
        self.ended |= imgui.is_item_deactivated()


@dataclass(slots=True)
class FieldContext:
    """What a widget needs besides the value."""

    scene: EditorScene
    landmarks: Landmarks
    path: str  # component/field, for ids
    mixed: tuple[bool, ...]  # for each element whether the selected entities differ


def edit_field(field: FieldDeclaration, value: Any, context: FieldContext) -> FieldEdit:
    """Draws the widget in the rest of the line."""
    match field.kind:
        case Kind.FLOAT:
            return _edit_numbers(field, (value,), context)
        case Kind.VEC3:
            return _edit_numbers(field, value, context)
        case Kind.QUAT:
            return _edit_rotation(field, value, context)
        case Kind.INT:
            return _edit_integer(field, value, context)
        case Kind.BOOL:
            return _edit_switch(value, context)
        case Kind.CHOICE:
            return _edit_choice(field, value, context)
        case Kind.COLOR:
            return _edit_color(field, value, context)
        case Kind.TEXT | Kind.ASSET:
            return _edit_text(field, value, context)
        case Kind.ENTITY:
            return _edit_entity(value, context)


def has_effect(component: Component, field: str) -> bool:
    """Whether a field matters, as the component's other fields stand."""
    match component:
        case Collider(shape=shape) if field in _SHAPES_WITH:
            return shape in _SHAPES_WITH[field]
        case Joint(kind=kind) if field in _JOINTS_WITH:
            return kind in _JOINTS_WITH[field]
        case Camera(projection=projection) if field in _CAMERAS_WITH:
            return projection == _CAMERAS_WITH[field]
        case Light(kind=kind) if field in ("inner_cone_angle", "outer_cone_angle"):
            return kind == "spot"
        case Light(kind=kind) if field == "range":
            return kind != "directional"
        case _:
            return True


def asset_label(field: FieldDeclaration, value: str) -> str:
    """What an asset field says: a content reference by what it is and its first digits, else the value itself."""
    reference, options = split_texture(value)
    if not is_reference(reference):
        return value
    what = field.name if field.name in ("mesh", "heights") else "image"
    return f"{what} {reference.removeprefix(PREFIX)[:8]}{options}"


def element_width(count: int) -> float:
    """Of each of `count` widgets that share the rest of the line."""
    spacing = imgui.get_style().item_inner_spacing.x
    return (imgui.get_content_region_avail().x - spacing * (count - 1)) / count


def _format_of(field: FieldDeclaration, mixed: bool, *, width: float, with_unit: bool) -> str:
    """As many digits as the step asks for and the widget has room for."""
    if mixed:
        return _MIXED
    room = int(width / (0.55 * imgui.get_font_size()) - 3.5)
    digits = max(1, min(3 if field.step < 1.0 else 1, room))
    unit = f" {field.unit}" if field.unit and with_unit else ""
    return f"%.{digits}f{unit}".replace("|", "/")


def _edit_numbers(field: FieldDeclaration, value: Sequence[float], context: FieldContext) -> FieldEdit:
    """A drag for each element; several carry the colours of their axes."""
    edit = FieldEdit()
    count = len(value)
    minimum = field.minimum if field.minimum is not None else 0.0
    maximum = field.maximum if field.maximum is not None else 0.0
    if field.minimum is not None and field.maximum is None:
        maximum = 3.4e38
    elif field.maximum is not None and field.minimum is None:
        minimum = -3.4e38
    width = element_width(count)
    for axis in range(count):
        if axis:
            imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)
        imgui.set_next_item_width(width)
        form = _format_of(field, context.mixed[axis], width=width, with_unit=count == 1 or width > 95.0)
        changed, number = imgui.drag_float(
            f"###{axis}",
            _shown(value[axis]),
            field.step * 0.2,
            minimum,
            maximum,
            form,
            imgui.SliderFlags_.always_clamp.value if field.minimum is not None or field.maximum is not None else 0,
        )
        edit.watch()
        context.landmarks.note(f"{context.path}/{axis}" if count > 1 else context.path)
        if count > 1:
            _mark_axis(axis)
        if changed:  # ImGui works in 32 bits, where the 1.1 that a person meant is 1.10000002384
            changed_value = [*value[:axis], shortest_decimal(number), *value[axis + 1 :]]
            edit.changed, edit.axis = True, axis if count > 1 else None
            edit.value = tuple(changed_value) if count > 1 else changed_value[0]
    return edit


def _shown(number: float) -> float:
    """What rounds to nothing has no sign."""
    return 0.0 if -5e-4 < number < 0.0 else number


def _mark_axis(axis: int) -> None:
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    imgui.get_window_draw_list().add_rect_filled(
        (low.x, low.y), (low.x + 3.0, high.y), color_code(AXES[axis]), 2.0, imgui.ImDrawFlags_.round_left.value
    )


def _edit_rotation(field: FieldDeclaration, value: Any, context: FieldContext) -> FieldEdit:
    """Euler degrees, about the fixed axes x, then y, then z. A tuple of three is kept as angles while it is being edited."""
    angles = value if len(value) == 3 else degrees_from(value)
    edit = FieldEdit()
    width = element_width(3)
    for axis in range(3):
        if axis:
            imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)
        imgui.set_next_item_width(width)
        form = _MIXED if any(context.mixed) else "%.1f°"
        changed, angle = imgui.drag_float(f"###{axis}", angles[axis], 0.5, 0.0, 0.0, form)
        edit.watch()
        context.landmarks.note(f"{context.path}/{axis}")
        _mark_axis(axis)
        if changed:
            edit.changed = True
            edit.value = (*angles[:axis], shortest_decimal(angle), *angles[axis + 1 :])
    return edit


def degrees_from(rotation: Sequence[float]) -> tuple[float, ...]:
    """A quaternion x y z w as Euler degrees, without the dirt of rounding."""
    # + 0.0 turns -0.0 into 0.0.
    return tuple(round(math.degrees(angle), 4) + 0.0 for angle in quaternion.to_euler(np.array(rotation, np.float64)))


def rotation_from(degrees: Sequence[float]) -> tuple[float, ...]:
    """The quaternion x y z w of Euler degrees."""
    return tuple(quaternion.from_euler(np.radians(np.array(degrees, np.float64))).tolist())


def _edit_integer(field: FieldDeclaration, value: int, context: FieldContext) -> FieldEdit:
    edit = FieldEdit()
    imgui.set_next_item_width(element_width(1))
    form = _MIXED if context.mixed[0] else "%d"
    low = int(field.minimum) if field.minimum is not None else 0
    high = int(field.maximum) if field.maximum is not None else 0
    edit.changed, edit.value = imgui.drag_int("###value", value, max(field.step * 0.1, 0.1), low, high, form)
    edit.watch()
    context.landmarks.note(context.path)
    return edit


def _edit_switch(value: bool, context: FieldContext) -> FieldEdit:
    edit = FieldEdit()
    imgui.push_item_flag(imgui.ItemFlags_.mixed_value.value, context.mixed[0])
    edit.changed, edit.value = imgui.checkbox("###value", value)
    imgui.pop_item_flag()
    edit.watch()
    context.landmarks.note(context.path)
    return edit


def _edit_choice(field: FieldDeclaration, value: str, context: FieldContext) -> FieldEdit:
    edit = FieldEdit()
    imgui.set_next_item_width(element_width(1))
    if imgui.begin_combo("###value", _MIXED if context.mixed[0] else value):
        for choice in field.choices:
            pressed, _ = imgui.selectable(choice, choice == value and not context.mixed[0])
            context.landmarks.note(f"{context.path}/{choice}")
            if pressed:
                edit.changed, edit.value = True, choice
        imgui.end_combo()
    else:
        context.landmarks.note(context.path)
    return edit


def _edit_color(field: FieldDeclaration, value: Sequence[float], context: FieldContext) -> FieldEdit:
    """A swatch that opens a picker, and the three linear numbers beside it. The picker works in what the eye sees: sRGB."""
    edit = FieldEdit()
    shown = [srgb_from_linear(min(element, 1.0)) for element in value]
    height = imgui.get_frame_height()
    flags = imgui.ColorEditFlags_.no_tooltip.value | imgui.ColorEditFlags_.no_alpha.value
    if imgui.color_button("###swatch", imgui.ImVec4(shown[0], shown[1], shown[2], 1.0), flags, (height * 1.3, height)):
        imgui.open_popup("picker")
    context.landmarks.note(f"{context.path}/swatch")
    if imgui.begin_popup("picker"):
        options = imgui.ColorEditFlags_.picker_hue_wheel.value | imgui.ColorEditFlags_.no_side_preview.value
        changed, picked = imgui.color_picker3("###picker", shown, options)
        edit.watch()
        if changed:
            edit.changed = True
            edit.value = tuple(round(linear_from_srgb(element), 5) for element in picked[:3])
        imgui.end_popup()
    imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)
    numbers = _edit_numbers(field, value, context)
    return numbers if numbers.changed or numbers.began or numbers.ended else edit


def srgb_from_linear(value: float) -> float:
    """IEC 61966-2-1."""
    return 12.92 * value if value <= 0.0031308 else 1.055 * value ** (1.0 / 2.4) - 0.055


def linear_from_srgb(value: float) -> float:
    """IEC 61966-2-1."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def _edit_text(field: FieldDeclaration, value: str, context: FieldContext) -> FieldEdit:
    """Sent when the person presses Enter or goes elsewhere, not at every letter."""
    edit = FieldEdit()
    offers = tuple(PRIMITIVES) if field.name == "mesh" else ()
    button = imgui.get_frame_height() + imgui.get_style().item_inner_spacing.x if offers else 0.0
    imgui.set_next_item_width(element_width(1) - button)
    hint = "several values" if context.mixed[0] else ""
    shown = "" if context.mixed[0] else asset_label(field, value) if field.kind is Kind.ASSET else value
    _, text = imgui.input_text_with_hint("###value", hint, shown)
    context.landmarks.note(context.path)
    if shown and shown != value:
        imgui.set_item_tooltip(value)
    if imgui.is_item_deactivated_after_edit() and text != shown:
        edit.changed, edit.value = True, text
    if offers:
        imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)
        if imgui.begin_combo("###offers", "", imgui.ComboFlags_.no_preview.value):
            for offer in offers:
                if imgui.selectable(offer, offer == value)[0]:
                    edit.changed, edit.value = True, offer
            imgui.end_combo()
    return edit


def _edit_entity(value: int, context: FieldContext) -> FieldEdit:
    """The entity's name; another one is dropped here from the hierarchy, a click on the cross takes it away."""
    edit = FieldEdit()
    scene = context.scene
    if context.mixed[0]:
        label = _MIXED
    else:
        label = scene.name_of(value) if value else "none"
    button = imgui.get_frame_height() + imgui.get_style().item_inner_spacing.x
    imgui.button(f"{icons.ICON_FA_CUBE}  {label}###value", (element_width(1) - button, 0.0))
    context.landmarks.note(context.path)
    if imgui.begin_drag_drop_target():
        payload = imgui.accept_drag_drop_payload_py_id(ENTITY_PAYLOAD)
        if payload is not None and scene.exists(payload.data_id):
            edit.changed, edit.value = True, payload.data_id
        imgui.end_drag_drop_target()
    imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)
    imgui.begin_disabled(value == 0 and not context.mixed[0])
    if imgui.button(f"{icons.ICON_FA_XMARK}###none"):
        edit.changed, edit.value = True, 0
    imgui.end_disabled()
    return edit

"""Numbers: dragged, or typed as expressions; with a bar where their range is small, in the colours of their axes in vectors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from imgui_bundle import imgui

from elys.common.components import FieldDeclaration
from elys.common.components.decimals import shortest_decimal
from elys.editor_node.expressions import MAX_LENGTH, ExpressionError, read_entry
from elys.editor_node.field_values import has_bar
from elys.editor_node.fields import MIXED, FieldContext, FieldEdit, element_width, inner_spacing
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.theme import AXES
from elys.editor_node.ui import color_code

_UNBOUNDED: Final = 3.4e38
_NARROW: Final = 95.0  # below this a number leaves its unit out
_TYPING_FLAGS: Final = (imgui.InputTextFlags_.auto_select_all | imgui.InputTextFlags_.enter_returns_true).value


def edit_numbers(
    field: FieldDeclaration, value: Sequence[float], context: FieldContext, *, buttons: int = 0
) -> FieldEdit:
    """A number for each element; `buttons` leaves room for square buttons behind them."""
    edit = FieldEdit()
    count = len(value)
    low, high = _range(field)
    width = element_width(count, buttons=buttons)
    for axis in range(count):
        if axis:
            imgui.same_line(0.0, inner_spacing())
        number = _Number(context, field.unit, axis if count > 1 else None, value[axis], width)
        if number.is_typed(edit, mixed=context.mixed[axis]):
            edit.value = tuple(value) if count > 1 else value[0]
            continue
        form = _format_of(field, context.mixed[axis], width=width, with_unit=count == 1 or width > _NARROW)
        speed = field.step * 0.2
        if has_bar(field):
            speed = (high - low) / width  # the pointer stays where in the range the value is
            _draw_bar(0.0 if context.mixed[axis] else (value[axis] - low) / (high - low), width)
        changed, dragged = imgui.drag_float(number.label, _shown(value[axis]), speed, low, high, form, _flags(field))
        if has_bar(field):
            imgui.pop_style_color(3)
        number.finish(edit)
        if changed:  # ImGui works in 32 bits, where the 1.1 that a person meant is 1.10000002384
            changed_value = [*value[:axis], shortest_decimal(dragged), *value[axis + 1 :]]
            edit.changed, edit.axis = True, axis if count > 1 else None
            edit.value = tuple(changed_value) if count > 1 else changed_value[0]
    return edit


def edit_rotation(context: FieldContext) -> FieldEdit:
    """Euler degrees, about the fixed axes x, then y, then z; the value of the edit is the three of them."""
    edit = FieldEdit()
    angles = context.angles
    width = element_width(3)
    for axis in range(3):
        if axis:
            imgui.same_line(0.0, inner_spacing())
        number = _Number(context, "deg", axis, angles[axis], width)
        if number.is_typed(edit, mixed=context.mixed[axis]):
            edit.value = angles
            continue
        form = MIXED if context.mixed[axis] else "%.1f°"
        changed, angle = imgui.drag_float(
            number.label, _shown(angles[axis]), 0.5, 0.0, 0.0, form, imgui.SliderFlags_.no_input.value
        )
        number.finish(edit)
        if changed:
            edit.changed, edit.axis = True, axis
            edit.value = (*angles[:axis], shortest_decimal(angle), *angles[axis + 1 :])
    return edit


def edit_integer(field: FieldDeclaration, value: int, context: FieldContext) -> FieldEdit:
    """A whole number."""
    edit = FieldEdit()
    width = element_width(1)
    number = _Number(context, field.unit, None, value, width)
    if number.is_typed(edit, mixed=context.mixed[0]):
        edit.value = value
        return edit
    low = int(field.minimum) if field.minimum is not None else -(2**31)
    high = int(field.maximum) if field.maximum is not None else 2**31 - 1
    speed = max(field.step * 0.1, 0.1)
    if has_bar(field):
        speed = max((high - low) / width, 0.01)
        _draw_bar(0.0 if context.mixed[0] else (value - low) / (high - low), width)
    form = MIXED if context.mixed[0] else "%d"
    is_bound = field.minimum is not None or field.maximum is not None
    changed, dragged = imgui.drag_int(
        number.label, value, speed, low if is_bound else 0, high if is_bound else 0, form, _flags(field)
    )
    if has_bar(field):
        imgui.pop_style_color(3)
    number.finish(edit)
    if changed:
        edit.changed, edit.value = True, dragged
    return edit


class _Number:
    """One number of a field: the drag that shows it, or the text field in its place."""

    def __init__(self, context: FieldContext, unit: str, axis: int | None, value: float, width: float) -> None:
        self._context = context
        self._unit = unit
        self._axis = axis
        self._place = context.path if axis is None else f"{context.path}/{axis}"
        self._text = f"{value:.9g}"
        self._width = width
        self.label = f"###{axis or 0}"
        context.typing.drawn.append(self._place)
        imgui.set_next_item_width(width)

    def is_typed(self, edit: FieldEdit, *, mixed: bool) -> bool:
        """Draws the text field, if this is the number that is being typed; adds to `edit` what was entered there."""
        typing = self._context.typing
        if typing.wanted == self._place:
            typing.start(self._place, "" if mixed else self._text)
        if typing.place != self._place:
            return False
        starts = typing.starts
        if starts:
            imgui.set_keyboard_focus_here()
            typing.starts = False
        entered, text = imgui.input_text(self.label + "typed", typing.text, _TYPING_FLAGS)
        self._note()
        imgui.set_item_key_owner(imgui.Key.tab)  # it goes on to the next number instead of ImGui's next field
        typing.text = text[:MAX_LENGTH]
        has_tab = imgui.is_item_active() and imgui.is_key_pressed(imgui.Key.tab)
        if entered or has_tab:
            if not self._commit(edit, initial="" if mixed else self._text):
                typing.starts = True  # it stays to be mended
            elif has_tab:
                typing.go_on(self._place, -1 if imgui.get_io().key_shift else 1)
        elif imgui.is_item_deactivated() and not starts:
            if imgui.is_key_pressed(imgui.Key.escape):
                typing.stop()
                self._context.refuse("")
            else:  # what is wrong stays as well, but to take the keys back would take away the click on something else
                self._commit(edit, initial="" if mixed else self._text)
        return True

    def finish(self, edit: FieldEdit) -> None:
        """After the drag was drawn: notes what happened to it, and whether typing begins."""
        edit.watch()
        self._note()
        if self._axis is not None:
            _mark_axis(self._axis)
        is_double = imgui.is_item_hovered() and imgui.get_mouse_clicked_count(0) >= 2
        if is_double or (imgui.is_item_activated() and imgui.get_io().key_ctrl):
            mixed = self._context.mixed[self._axis or 0]
            self._context.typing.start(self._place, "" if mixed else self._text)
            edit.ended, edit.began = True, False  # the drag is gone with the next frame, and does not say so

    def _commit(self, edit: FieldEdit, *, initial: str) -> bool:
        """Works out what was typed; whether it is a value, or what was there before."""
        typing = self._context.typing
        text = typing.text.strip()
        if text in ("", initial):
            typing.stop()
            self._context.refuse("")
            return True
        try:
            edit.entry = read_entry(text, self._unit)
        except (ExpressionError, KeyError) as error:
            why = str(error) if isinstance(error, ExpressionError) else f"no unit {error} is known here"
            self._context.refuse(tr_sentence(why))
            return False
        edit.changed = edit.began = edit.ended = True
        edit.axis = self._axis
        typing.stop()
        self._context.refuse("")
        return True

    def _note(self) -> None:
        self._context.note("" if self._axis is None else str(self._axis))


def _range(field: FieldDeclaration) -> tuple[float, float]:
    """As ImGui takes it: both 0 for none."""
    if field.minimum is None and field.maximum is None:
        return 0.0, 0.0
    low = field.minimum if field.minimum is not None else -_UNBOUNDED
    return low, field.maximum if field.maximum is not None else _UNBOUNDED


def _flags(field: FieldDeclaration) -> int:
    bound = field.minimum is not None or field.maximum is not None
    clamp = imgui.SliderFlags_.always_clamp.value if bound else 0
    return imgui.SliderFlags_.no_input.value | clamp


def _format_of(field: FieldDeclaration, mixed: bool, *, width: float, with_unit: bool) -> str:
    """As many digits as the step asks for and the widget has room for."""
    if mixed:
        return MIXED
    room = int(width / (0.55 * imgui.get_font_size()) - 3.5)
    digits = max(1, min(3 if field.step < 1.0 else 1, room))
    unit = f" {field.unit}" if field.unit and with_unit else ""
    return f"%.{digits}f{unit}".replace("|", "/")


def _shown(number: float) -> float:
    """What rounds to nothing has no sign."""
    return 0.0 if -5e-4 < number < 0.0 else number


def _mark_axis(axis: int) -> None:
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    imgui.get_window_draw_list().add_rect_filled(
        (low.x, low.y), (low.x + 3.0, high.y), color_code(AXES[axis]), 2.0, imgui.ImDrawFlags_.round_left.value
    )


def _draw_bar(share: float, width: float) -> None:
    """Frame and bar of the number that follows, whose own frame is left out: pop three colours after it."""
    corner, height = imgui.get_cursor_screen_pos(), imgui.get_frame_height()
    rounding = imgui.get_style().frame_rounding
    draw_list = imgui.get_window_draw_list()
    frame, bar = imgui.get_color_u32(imgui.Col_.frame_bg), imgui.get_color_u32(imgui.Col_.header)
    draw_list.add_rect_filled(corner, (corner.x + width, corner.y + height), frame, rounding)
    reach = width * min(max(share, 0.0), 1.0)
    if reach > 1.0:
        draw_list.add_rect_filled(corner, (corner.x + reach, corner.y + height), bar, rounding)
    for color in (imgui.Col_.frame_bg, imgui.Col_.frame_bg_hovered, imgui.Col_.frame_bg_active):
        imgui.push_style_color(color, 0)

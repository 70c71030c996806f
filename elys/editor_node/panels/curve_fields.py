"""Curves: keys and the slopes of the one that is chosen are dragged in a small picture; numbers below it are dragged or typed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from imgui_bundle import imgui

from elys.common.components import FieldDeclaration
from elys.common.components.curve import Curve
from elys.common.components.decimals import shortest_decimal
from elys.editor_node import curve_editing
from elys.editor_node.curve_editing import CurveView
from elys.editor_node.fields import MIXED, CurveState, FieldContext, FieldEdit, element_width, inner_spacing
from elys.editor_node.language import tr, tr_label
from elys.editor_node.theme import ACCENT, TEXT, TEXT_DIM
from elys.editor_node.ui import color_code, dim_text

Point = tuple[float, float]

LINES: Final = 6.0  # of text that the picture is high
_STEPS: Final = 64  # of the line
_REACH: Final = 2.6  # of a slope's handle, in lines of text
_KEY: Final = 0.28  # radius of a key, in lines of text


def edit_curve(field: FieldDeclaration, value: Curve, context: FieldContext) -> FieldEdit:
    """What a person did to a curve."""
    state = context.curves
    if state.path != context.path:
        state.path, state.chosen, state.view = context.path, -1, None
    if not state.chosen < len(value):
        state.chosen = -1
    edit = FieldEdit()
    picture = _Picture(field, value, context, edit)
    picture.draw()
    if state.chosen >= 0:
        _edit_numbers(field, picture, state.chosen)
    else:
        dim_text(tr("Double-click to add a key") if not value else tr("{count} keys", count=len(value)))
    return edit


class _Picture:
    """The picture of a curve, in which it is dragged; `change` says what it became."""

    def __init__(self, field: FieldDeclaration, value: Curve, context: FieldContext, edit: FieldEdit) -> None:
        self.value, self.context, self.edit = value, context, edit
        self.state: CurveState = context.curves
        self._low = field.minimum if field.minimum is not None else -float("inf")
        self._high = field.maximum if field.maximum is not None else float("inf")
        # What a key is dragged in stays while it is held: else it would run away from the pointer.
        self._view: CurveView = self.state.view or curve_editing.view_of(value)
        corner, self._line = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
        self._left, self._top = corner.x, corner.y
        self._width, self._height = element_width(1), LINES * self._line
        self._is_held = False

    def change(self, value: Curve) -> None:
        """The curve is another."""
        self.value = value
        self.edit.choose(value)

    def bounded(self, value: float) -> float:
        """A value as the field takes it."""
        return max(min(value, self._high), self._low)

    def draw(self) -> None:
        """The picture with all that can be taken hold of."""
        imgui.set_next_item_allow_overlap()
        imgui.invisible_button("###canvas", (self._width, self._height))
        self.context.note("canvas")
        is_double = imgui.is_item_hovered() and imgui.is_mouse_double_clicked(0)
        self._draw_line()
        for place in range(len(self.value)):
            self._draw_key(place)
        if self.state.chosen >= 0:
            self._draw_slopes(self.state.chosen)
        if is_double:
            curve, place = curve_editing.added(self.value, *self._under_pointer())
            if place >= 0:
                self.state.chosen = place
                self.change(curve)
        self.state.view = self._view if self._is_held else None
        imgui.set_cursor_screen_pos((self._left, self._top + self._height + imgui.get_style().item_spacing.y))

    def _draw_line(self) -> None:
        draw_list = imgui.get_window_draw_list()
        corner = (self._left + self._width, self._top + self._height)
        rounding = imgui.get_style().frame_rounding
        draw_list.add_rect_filled((self._left, self._top), corner, imgui.get_color_u32(imgui.Col_.frame_bg), rounding)
        dim = color_code(TEXT_DIM)
        if self._view.low < 0.0 < self._view.high:
            draw_list.add_line(self._at(self._view.start, 0.0), self._at(self._view.end, 0.0), dim)
        if self.context.mixed[0]:
            draw_list.add_text((self._left + self._line, self._top + self._line), dim, MIXED)
            return
        points = [self._at(*sample) for sample in curve_editing.samples(self.value, self._view, _STEPS)]
        if self.value:
            draw_list.add_polyline([imgui.ImVec2(*point) for point in points], color_code(ACCENT), 2.0, 0)

    def _draw_key(self, place: int) -> None:
        time, value, _, _ = self.value[place]
        is_chosen = place == self.state.chosen
        point, radius = self._at(time, value), _KEY * self._line
        color = color_code(ACCENT if is_chosen else TEXT)
        imgui.get_window_draw_list().add_circle_filled(point, radius, color)
        if self._is_dragged(f"key {place}", point, 1.6 * radius):
            self.change(curve_editing.moved(self.value, place, *self._under_pointer()))
        if imgui.is_item_activated():
            self.state.chosen = place
        self.context.note(f"key/{place}")
        if imgui.begin_popup_context_item(f"menu {place}"):
            self.state.chosen = place
            self._draw_menu(place)
            imgui.end_popup()

    def _draw_menu(self, place: int) -> None:
        made: dict[str, Callable[[], Curve]] = {
            "Smooth": lambda: curve_editing.smoothed(self.value, place),
            "Straight": lambda: curve_editing.straightened(self.value, place),
            "Flat": lambda: curve_editing.sloped(self.value, place, 0.0, 0.0),
            "Remove": lambda: curve_editing.removed(self.value, place),
        }
        for name, make in made.items():
            is_chosen = imgui.menu_item(tr_label(name), "", False)[0]
            self.context.note(f"menu/{name.lower()}")
            if is_chosen:
                self.change(make())
                self.state.chosen = -1 if name == "Remove" else place
                return

    def _draw_slopes(self, place: int) -> None:
        """A handle on each side where there is another key; they go together until the slopes differ."""
        time, value, before, after = self.value[place]
        for name, slope, side in (("slope_before", before, -1.0), ("slope_after", after, 1.0)):
            if not 0 <= place + side < len(self.value):
                continue
            start = self._at(time, value)
            across, down = self._width / (self._view.end - self._view.start), -self._per_value() * slope
            length = (across * across + down * down) ** 0.5
            reach = side * _REACH * self._line / length
            point = (start[0] + across * reach, start[1] + down * reach)
            draw_list, color = imgui.get_window_draw_list(), color_code(TEXT)
            draw_list.add_line(start, point, color)
            draw_list.add_circle(point, 0.6 * _KEY * self._line, color)
            if self._is_dragged(name, point, _KEY * self._line):
                under = self._under_pointer(inside=False)
                if (under[0] - time) * side > 0.0:
                    turned = (under[1] - value) / (under[0] - time)
                    both = before == after
                    sides = (turned, turned) if both else (turned, after) if side < 0.0 else (before, turned)
                    self.change(curve_editing.sloped(self.value, place, *sides))
            self.context.note(name)

    def _is_dragged(self, name: str, point: Point, radius: float) -> bool:
        """Draws what takes hold at a point; whether it is being dragged in this frame."""
        imgui.set_cursor_screen_pos((point[0] - radius, point[1] - radius))
        imgui.set_next_item_allow_overlap()
        imgui.invisible_button(f"###{name}", (2.0 * radius, 2.0 * radius))
        self.edit.watch()
        self._is_held |= imgui.is_item_active()
        moved = imgui.get_io().mouse_delta
        return imgui.is_item_active() and bool(moved.x or moved.y)

    def _per_value(self) -> float:
        return self._height / (self._view.high - self._view.low)

    def _at(self, time: float, value: float) -> Point:
        view = self._view
        across = (time - view.start) / (view.end - view.start)
        return (self._left + across * self._width, self._top + (view.high - value) * self._per_value())

    def _under_pointer(self, *, inside: bool = True) -> Point:
        """Time and value, as the field takes it where it is `inside`."""
        pointer, view = imgui.get_io().mouse_pos, self._view
        time = view.start + (pointer.x - self._left) / self._width * (view.end - view.start)
        value = view.high - (pointer.y - self._top) / self._per_value()
        return time, self.bounded(value) if inside else value


def _edit_numbers(field: FieldDeclaration, picture: _Picture, place: int) -> None:
    """Time, value and slopes of a key."""
    time, value, before, after = picture.value[place]

    def slope_before(number: float) -> Curve:
        return curve_editing.sloped(picture.value, place, number, after)

    def slope_after(number: float) -> Curve:
        return curve_editing.sloped(picture.value, place, before, number)

    numbers: tuple[tuple[str, str, str, float, Callable[[float], Curve]], ...] = (
        ("time", "Key time", "s", time, lambda number: curve_editing.moved(picture.value, place, number, value)),
        (
            "value",
            "Value",
            field.unit,
            value,
            lambda n: curve_editing.moved(picture.value, place, time, picture.bounded(n)),
        ),
        ("before", "Slope before", "1/s", before, slope_before),
        ("after", "Slope after", "1/s", after, slope_after),
    )
    width = element_width(2)
    for number, (name, label, unit, shown, made) in enumerate(numbers):
        if number % 2:
            imgui.same_line(0.0, inner_spacing())
        imgui.set_next_item_width(width)
        form = f"%.3f {unit}".rstrip()
        changed, dragged = imgui.drag_float(f"###{name}", shown, 0.01, 0.0, 0.0, form)
        picture.edit.watch()
        picture.context.note(name)
        imgui.set_item_tooltip(tr(label))
        if changed:
            picture.change(made(shortest_decimal(dragged)))

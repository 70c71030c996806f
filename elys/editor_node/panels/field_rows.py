"""Lines of a name and a widget, of which the person holds at most one: that one shows its own value, all others the host's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

from imgui_bundle import imgui

from elys.common.components import FieldDeclaration, Kind
from elys.editor_node.field_values import (
    FieldChange,
    NameOffer,
    label_of,
    may_keep_proportions,
    shown_number,
    shown_value,
)
from elys.editor_node.fields import CurveState, FieldContext, NumberTyping, PickState, inner_spacing
from elys.editor_node.language import tr, tr_label
from elys.editor_node.panels.plain_fields import edit_field
from elys.editor_node.rotations import Degrees, ShownAngles
from elys.editor_node.theme import ACCENT, ERROR, WARNING, icons
from elys.editor_node.ui import Ui, color_code, dim_text

LABEL_SHARE: Final = 0.36  # of a line
UNUSED_ALPHA: Final = 0.45  # of a field that has no effect on this entity


@dataclass(slots=True)
class _Held:
    """The field a person holds, or has just let go of."""

    path: str
    value: Any
    is_active: bool = True
    stroke: object = field(default_factory=object)


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldState:
    """What is known of a field beside its value in the primary entity; all of it is optional."""

    mixed: tuple[bool, ...] = (False, False, False, False)  # for each element whether entities differ
    is_default: bool = True
    is_used: bool = True  # what has no effect is dimmed
    written_over: Any = None  # what it was set to, where the simulation has changed it since
    prefab_value: Any = None  # what the prefab says, where it is another
    offer: NameOffer | None = None  # what a text may name


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldActions:
    """What the menu of a field does; those without are not offered."""

    reset: Callable[[], object]
    revert: Callable[[], object] | None = None
    take_back: Callable[[Any], object] | None = None  # to what it was set to
    plot: Callable[[], object] | None = None


class FieldRows:
    """Draws fields in a table of two columns; see `begin`. Lines out of sight cost next to nothing."""

    def __init__(self) -> None:
        self.keeps_proportions = False  # the chain of scales and sizes
        self.angles = ShownAngles()
        self._held: _Held | None = None
        self._typing = NumberTyping()
        self._picking = PickState()
        self._curves = CurveState()
        self._refused = ("", "")  # the path of a field and why what was typed there is no value
        self._typed = ("", "")  # what was typed last: place and text, should it be refused later
        self._heights: dict[str, float] = {}  # of lines, when they were last in sight

    @property
    def holds(self) -> bool:
        """Whether the person holds a field right now."""
        return self._held is not None and self._held.is_active

    def begin_frame(self, ui: Ui) -> None:
        """Once the host has answered, its word holds again. Call it at the start of a frame."""
        self._typing.begin_frame()
        held = self._held
        if held is not None and not held.is_active and not ui.model.history.is_stroke_busy(held.stroke):
            self._held = None

    def forget(self) -> None:
        """Others are shown now: what was half typed, and what was wrong with it, is gone."""
        self._typing.stop()
        self._refused = ("", "")
        self._held = None
        self.angles.forget()

    def refuse(self, path: str, sentence: str) -> None:
        """Says beside a field why what was entered there was not sent; what was typed stays to be mended."""
        self._refused = (path, sentence) if sentence else ("", "")
        self._held = None
        place, text = self._typed
        if sentence and place.startswith(path) and not self._typing.place:
            self._typing.start(place, text)

    def show(self, path: str, value: Any) -> None:
        """What a field shows until the host has answered."""
        if self._held is not None and self._held.path == path:
            self._held.value = value

    def begin(self, name: str) -> bool:
        """Starts the table; when True end it with `imgui.end_table`."""
        if not imgui.begin_table(name, 2, imgui.TableFlags_.sizing_stretch_prop.value):
            return False
        imgui.table_setup_column("label", imgui.TableColumnFlags_.width_stretch.value, LABEL_SHARE)
        imgui.table_setup_column("value", imgui.TableColumnFlags_.width_stretch.value, 1.0 - LABEL_SHARE)
        return True

    def draw(
        self, ui: Ui, declared: FieldDeclaration, path: str, value: Any, state: FieldState, actions: FieldActions
    ) -> FieldChange | None:
        """One line for a field; what a person made of it. `value` is the primary entity's."""
        if self._is_out_of_sight(path):
            return None
        top = imgui.get_cursor_screen_pos().y
        alpha = imgui.get_style().alpha * (1.0 if state.is_used else UNUSED_ALPHA)
        imgui.push_style_var(imgui.StyleVar_.alpha, alpha)
        imgui.push_id(path)
        imgui.table_next_row()
        imgui.table_next_column()
        _draw_label(ui, declared, path, state, actions)
        imgui.table_next_column()
        change = self._draw_value(ui, declared, path, value, state)
        if self._refused[0] == path:
            _error_text(self._refused[1])
            ui.landmarks.note(f"{path}/error")
        imgui.pop_id()
        imgui.pop_style_var()
        bottom = max(imgui.get_item_rect_max().y, top + imgui.get_frame_height())
        self._heights[path] = bottom - top + imgui.get_style().cell_padding.y
        return change

    def _is_out_of_sight(self, path: str) -> bool:
        """Leaves as much room as the line took when it was last seen, where it would not be seen now."""
        height = self._heights.get(path)
        if height is None or (self._held is not None and self._held.path == path):
            return False
        if self._typing.place.startswith(path) or self._typing.wanted.startswith(path):
            return False
        top, window = imgui.get_cursor_screen_pos().y, imgui.get_window_pos().y
        if top + 2.0 * height >= window and top - height <= window + imgui.get_window_height():
            return False
        imgui.table_next_row(0, height)
        return True

    def _draw_value(
        self, ui: Ui, declared: FieldDeclaration, path: str, value: Any, state: FieldState
    ) -> FieldChange | None:
        held = self._held if self._held is not None and self._held.path == path else None
        shown = held.value if held is not None else value
        mixed = state.mixed if held is None else (False,) * 4
        if declared.kind is Kind.QUAT:
            mixed = (any(mixed),) * 3
        context = FieldContext(
            ui,
            path,
            mixed,
            self._typing,
            self._picking,
            self._curves,
            lambda sentence: self.refuse(path, sentence),
            self._angles_of(declared, path, shown),
            state.offer,
        )
        is_proportional = may_keep_proportions(declared)
        was_typing = (self._typing.place, self._typing.text)
        imgui.begin_disabled(ui.model.is_replay)
        edit = edit_field(declared, shown, context, buttons=1 if is_proportional else 0)
        if is_proportional:
            self._draw_chain(context)
        imgui.end_disabled()
        if edit.began:
            held = self._held = _Held(path, shown)
        if edit.ended and held is not None:
            # A drag that is let go of and taken again in one frame is held; what was typed is over at once.
            held.is_active = edit.began and edit.entry is None
        if not edit.changed:
            return None
        if held is None:  # a widget that one does not hold, such as a menu
            held = self._held = _Held(path, edit.value, is_active=False)
        if edit.entry is None:
            held.value = edit.value
            self._refused = ("", "")
            if declared.kind is Kind.QUAT:
                self.angles.keep(path, edit.value)
        else:
            self._typed = was_typing
        return FieldChange(
            value=edit.value,
            axis=edit.axis,
            stroke=held.stroke,
            entry=edit.entry,
            keeps_proportions=is_proportional and self.keeps_proportions,
        )

    def _angles_of(self, declared: FieldDeclaration, path: str, shown: Any) -> Degrees:
        if declared.kind is not Kind.QUAT:
            return (0.0, 0.0, 0.0)
        if len(shown) == 3:  # as they are being dragged
            return (shown[0], shown[1], shown[2])
        return self.angles.of(path, shown)

    def _draw_chain(self, context: FieldContext) -> None:
        """The switch that lets all elements of a scale go along with one."""
        imgui.same_line(0.0, inner_spacing())
        color = imgui.Col_.text if self.keeps_proportions else imgui.Col_.text_disabled
        imgui.push_style_color(imgui.Col_.text, imgui.get_style_color_vec4(color))
        imgui.push_style_var_x(imgui.StyleVar_.frame_padding, 0.0)
        icon = icons.ICON_FA_LINK if self.keeps_proportions else icons.ICON_FA_LINK_SLASH
        if imgui.button(f"{icon}###chain", (imgui.get_frame_height(), 0.0)):
            self.keeps_proportions = not self.keeps_proportions
        imgui.pop_style_var()
        imgui.pop_style_color()
        context.note("chain")
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            imgui.set_tooltip(tr("Keep the proportions: all three go along"))


def limits_text(declared: FieldDeclaration) -> str:
    """A field's range in words; empty where any value will do."""
    low, high, unit = declared.minimum, declared.maximum, declared.unit
    if low is not None and high is not None:
        return tr("from {low} to {high}", low=f"{low:g}", high=shown_number(high, unit))
    if low is not None:
        return tr("at least {low}", low=shown_number(low, unit))
    return tr("at most {high}", high=shown_number(high, unit)) if high is not None else ""


def _draw_label(ui: Ui, declared: FieldDeclaration, path: str, state: FieldState, actions: FieldActions) -> None:
    label = tr(label_of(declared))
    is_override = state.prefab_value is not None
    imgui.align_text_to_frame_padding()
    imgui.push_text_wrap_pos(0.0)  # a long one takes two lines
    if is_override:
        imgui.push_font(ui.fonts.bold, 0.0)
        imgui.text_unformatted(label)
        imgui.pop_font()
        _mark_override()
    elif state.is_default:
        dim_text(label)
    else:
        imgui.text_unformatted(label)
    imgui.pop_text_wrap_pos()
    ui.landmarks.note(f"{path}/label")
    if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
        imgui.set_tooltip(_explanation(declared, label, state))
    _draw_field_menu(ui, path, declared, state, actions)
    if state.written_over is not None:
        imgui.same_line(0.0, inner_spacing())
        _draw_dot(ui, path, declared, state.written_over)
    if not state.is_default and not ui.model.is_replay:
        _draw_reset(ui, path, declared, actions)


def _explanation(declared: FieldDeclaration, label: str, state: FieldState) -> str:
    lines = [f"{label} [{declared.unit}]" if declared.unit else label, tr(declared.text), limits_text(declared)]
    lines.append(tr("default {value}", value=shown_value(declared, declared.default)))
    if state.prefab_value is not None:
        lines.append(tr("the prefab has {value}", value=shown_value(declared, state.prefab_value)))
    return "\n".join(line for line in lines if line)


def _draw_field_menu(ui: Ui, path: str, declared: FieldDeclaration, state: FieldState, actions: FieldActions) -> None:
    if not imgui.begin_popup_context_item("field"):
        return
    is_open = not ui.model.is_replay
    if imgui.menu_item(tr_label("Reset to default"), "", False, is_open and not state.is_default)[0]:
        actions.reset()
    ui.landmarks.note(f"{path}/menu/reset")
    if actions.revert is not None:
        if imgui.menu_item(tr_label("Revert to the prefab"), "", False, is_open)[0]:
            actions.revert()
        ui.landmarks.note(f"{path}/menu/revert")
    if actions.take_back is not None and state.written_over is not None:
        text = tr("Set back to {value}", value=shown_value(declared, state.written_over))
        if imgui.menu_item(f"{text}###take back", "", False, is_open)[0]:
            actions.take_back(state.written_over)
        ui.landmarks.note(f"{path}/menu/take_back")
    if actions.plot is not None:
        if imgui.menu_item(tr_label("Plot this field"), "", False)[0]:
            actions.plot()
        ui.landmarks.note(f"{path}/menu/plot")
    imgui.end_popup()


def _draw_dot(ui: Ui, path: str, declared: FieldDeclaration, was: Any) -> None:
    """The mark of a field that the simulation has changed."""
    size = imgui.get_font_size()
    imgui.invisible_button("###written", (size * 0.6, imgui.get_frame_height()))
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    center = ((low.x + high.x) / 2.0, (low.y + high.y) / 2.0)
    imgui.get_window_draw_list().add_circle_filled(center, size * 0.17, color_code(WARNING))
    ui.landmarks.note(f"{path}/written")
    if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
        imgui.set_tooltip(tr("The simulation changed this: was {value}", value=shown_value(declared, was)))


def _draw_reset(ui: Ui, path: str, declared: FieldDeclaration, actions: FieldActions) -> None:
    """A small arrow at the label's end, where the value is not the default."""
    size = imgui.get_frame_height() * 0.85
    room = imgui.get_content_region_avail().x  # of the next line, which is the whole column
    imgui.same_line()
    imgui.set_cursor_pos_x(max(imgui.get_cursor_pos_x(), imgui.get_cursor_start_pos().x + room - size))
    imgui.push_style_color(imgui.Col_.button, 0)
    imgui.push_style_color(imgui.Col_.text, imgui.get_style_color_vec4(imgui.Col_.text_disabled))
    imgui.push_style_var_x(imgui.StyleVar_.frame_padding, 0.0)
    if imgui.button(f"{icons.ICON_FA_ARROW_ROTATE_LEFT}###reset", (size, 0.0)):
        actions.reset()
    imgui.pop_style_var()
    imgui.pop_style_color(2)
    ui.landmarks.note(f"{path}/reset")
    if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
        imgui.set_tooltip(tr("Reset to {value}", value=shown_value(declared, declared.default)))


def _mark_override() -> None:
    """A bar at the panel's edge, beside the label."""
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    left = imgui.get_window_pos().x + 2.0
    imgui.get_window_draw_list().add_rect_filled((left, low.y), (left + 3.0, high.y), color_code(ACCENT))


def _error_text(sentence: str) -> None:
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*ERROR))
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(sentence)
    imgui.pop_text_wrap_pos()
    imgui.pop_style_color()

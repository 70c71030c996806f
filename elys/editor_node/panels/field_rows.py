"""Lines of a name and a widget, of which the person holds at most one: that one shows its own value, all others the host's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from imgui_bundle import imgui

from elys.common.components import FieldDeclaration
from elys.editor_node.fields import FieldContext, edit_field
from elys.editor_node.ui import Ui, dim_text

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
class FieldChange:
    """What a person made of a field: `axis` is the one element of several that changed."""

    value: Any
    axis: int | None
    stroke: object


class FieldRows:
    """Draws fields in a table of two columns; see `begin`."""

    def __init__(self) -> None:
        self._held: _Held | None = None

    def let_go(self, ui: Ui) -> None:
        """Once the host has answered, its word holds again. Call it at the start of a frame."""
        held = self._held
        if held is not None and not held.is_active and not ui.model.history.is_stroke_busy(held.stroke):
            self._held = None

    def begin(self, name: str) -> bool:
        """Starts the table; when True end it with `imgui.end_table`."""
        if not imgui.begin_table(name, 2, imgui.TableFlags_.sizing_stretch_prop.value):
            return False
        imgui.table_setup_column("label", imgui.TableColumnFlags_.width_stretch.value, LABEL_SHARE)
        imgui.table_setup_column("value", imgui.TableColumnFlags_.width_stretch.value, 1.0 - LABEL_SHARE)
        return True

    def draw(
        self,
        ui: Ui,
        declared: FieldDeclaration,
        path: str,
        each: Sequence[Any],
        *,
        reset: Callable[[], object],
        is_used: bool = True,
    ) -> FieldChange | None:
        """One line for a field that has the values `each` in the selected entities, the last of which is shown.

        What has no effect (`is_used` False) is dimmed.
        """
        imgui.push_style_var(imgui.StyleVar_.alpha, imgui.get_style().alpha * (1.0 if is_used else UNUSED_ALPHA))
        imgui.push_id(declared.name)
        imgui.table_next_row()
        imgui.table_next_column()
        _draw_label(declared, is_default=all(value == declared.default for value in each), reset=reset)
        imgui.table_next_column()
        held = self._held if self._held is not None and self._held.path == path else None
        shown = held.value if held is not None else each[-1]
        mixed = _mixed(declared, each) if held is None else (False,) * declared.width
        imgui.begin_disabled(ui.model.is_replay)
        edit = edit_field(declared, shown, FieldContext(ui.model.scene, ui.landmarks, path, mixed))
        imgui.end_disabled()
        imgui.pop_id()
        imgui.pop_style_var()
        if edit.began:
            held = self._held = _Held(path, shown)
        if edit.ended and not edit.began and held is not None:
            held.is_active = False
        if not edit.changed:
            return None
        if held is None:  # a widget that one does not hold, such as a menu
            held = self._held = _Held(path, edit.value, is_active=False)
        held.value = edit.value
        return FieldChange(value=edit.value, axis=edit.axis, stroke=held.stroke)


def _draw_label(declared: FieldDeclaration, *, is_default: bool, reset: Callable[[], object]) -> None:
    imgui.align_text_to_frame_padding()
    label = declared.name.replace("_", " ").capitalize()
    imgui.push_text_wrap_pos(0.0)  # a long one takes two lines
    if is_default:
        dim_text(label)
    else:
        imgui.text_unformatted(label)
    imgui.pop_text_wrap_pos()
    if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
        unit = f" [{declared.unit}]" if declared.unit else ""
        imgui.set_tooltip(f"{label}{unit}\n{declared.text}\nRight click: reset")
    if imgui.begin_popup_context_item("reset"):
        if imgui.menu_item("Reset to default", "", False, not is_default)[0]:
            reset()
        imgui.end_popup()


def _mixed(declared: FieldDeclaration, each: Sequence[Any]) -> tuple[bool, ...]:
    """For each element of a field whether the entities differ in it."""
    if declared.width == 1:
        return (any(value != each[-1] for value in each),)
    return tuple(any(value[axis] != each[-1][axis] for value in each) for axis in range(declared.width))

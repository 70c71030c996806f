"""The tour for those who are here for the first time, in five steps that point at what they are about; and what ELYS is."""

from __future__ import annotations

from typing import Final, NamedTuple

from imgui_bundle import imgui

import elys
from elys.editor_node.language import tr, tr_label
from elys.editor_node.theme import ACCENT, icons
from elys.editor_node.ui import Ui, color_code, dim_text

ABOUT: Final = "About ELYS###about"
_FLAGS: Final = (
    imgui.WindowFlags_.no_decoration.value
    | imgui.WindowFlags_.no_move.value
    | imgui.WindowFlags_.no_saved_settings.value
    | imgui.WindowFlags_.no_docking.value
    | imgui.WindowFlags_.always_auto_resize.value
)


class _Step(NamedTuple):
    landmark: str  # what it points at
    title: str
    text: str
    action: str = ""  # whose keys it names


_STEPS: Final = (
    _Step("viewport/picture", "The viewport", "Click to select, drag the handles to move. Alt and the left button turn "
          "around, the middle button shifts, the wheel zooms, the right button flies with W A S D."),
    _Step("panel/Hierarchy", "The hierarchy", "Every entity of the scene. Search it, drag to move entities below others, "
          "double click or F2 to rename."),
    _Step("panel/Inspector", "The inspector", "The components of what is selected. Drag a number or type one; what you see is "
          "always what the simulation says."),
    _Step("toolbar/play", "Time", "Play, pause, or go on tick by tick. Edits work while it plays as well.", "time.play"),
    _Step("menu/palette", "The command palette", "Everything can be found by its name here, and done without the mouse.",
          "view.palette"),
)  # fmt: skip


class Tour:
    """One step at a time; `start` begins anew."""

    def __init__(self) -> None:
        self.step: int | None = None  # None: it is not shown

    def start(self) -> None:
        """From the first step."""
        self.step = 0

    def draw(self, ui: Ui) -> None:
        """Draws the step, and a frame around what it is about."""
        if self.step is None:
            ui.landmarks.pointed_at = frozenset()
            return
        ui.landmarks.pointed_at = frozenset(step.landmark for step in _STEPS)
        step = _STEPS[self.step]
        area = imgui.get_main_viewport()
        fallback = (
            area.work_pos.x,
            area.work_pos.y,
            area.work_pos.x + area.work_size.x,
            area.work_pos.y + area.work_size.y,
        )
        left, top, right, bottom = ui.landmarks.rectangles.get(step.landmark, fallback)
        draw_list = imgui.get_foreground_draw_list()
        draw_list.add_rect((left - 3.0, top - 3.0), (right + 3.0, bottom + 3.0), color_code(ACCENT), 6.0, thickness=3.0)
        width, height = imgui.get_font_size() * 24.0, imgui.get_font_size() * 11.0
        # Beside it where there is room, else within it.
        x = right + 12.0 if right + width < area.work_size.x else left - width - 12.0
        x = x if x > 0.0 else (left + right - width) / 2.0
        y = min(max(top + 12.0, area.work_pos.y + 12.0), area.work_pos.y + area.work_size.y - height)
        imgui.set_next_window_pos((x, y))
        imgui.set_next_window_size((width, 0.0))
        imgui.set_next_window_focus()
        if imgui.begin("###tour", None, _FLAGS)[0]:
            self._draw_step(ui, step)
        imgui.end()

    def _draw_step(self, ui: Ui, step: _Step) -> None:
        assert self.step is not None
        imgui.push_font(ui.fonts.bold, 0.0)
        imgui.text_unformatted(f"{icons.ICON_FA_COMPASS}  {tr(step.title)}")
        imgui.pop_font()
        keys = ui.keys.label_of(step.action) if step.action else ""
        imgui.push_text_wrap_pos(0.0)
        imgui.text_unformatted(tr(step.text) + (f" ({keys})" if keys else ""))
        imgui.pop_text_wrap_pos()
        imgui.spacing()
        dim_text(f"{self.step + 1} / {len(_STEPS)}")
        imgui.same_line()
        imgui.begin_disabled(self.step == 0)
        if imgui.button(tr_label("Back", "tour back")):
            self.step -= 1
        imgui.end_disabled()
        ui.landmarks.note("tour/back")
        imgui.same_line()
        is_last = self.step == len(_STEPS) - 1
        next_label = tr("Done") if is_last else tr("Next")
        if imgui.button(f"{next_label}###tour next"):
            self._go_on(ui, is_last=is_last)
        ui.landmarks.note("tour/next")
        imgui.same_line()
        if imgui.button(tr_label("Skip the tour", "tour skip")):
            self._go_on(ui, is_last=True)
        ui.landmarks.note("tour/skip")

    def _go_on(self, ui: Ui, *, is_last: bool) -> None:
        assert self.step is not None
        self.step = None if is_last else self.step + 1
        if is_last:
            ui.preferences.has_seen_tour = True
        ui.model.request_redraw(0.0)


def draw_about(ui: Ui) -> None:
    """What this is, if its popup is open."""
    imgui.set_next_window_pos(imgui.get_main_viewport().get_center(), imgui.Cond_.appearing.value, (0.5, 0.5))
    title = f"{tr('About ELYS')}###about"
    if not imgui.begin_popup_modal(title, True, imgui.WindowFlags_.always_auto_resize.value)[0]:
        return
    imgui.push_font(ui.fonts.bold, imgui.get_style().font_size_base * 1.6)
    imgui.text_unformatted(f"ELYS {elys.__version__}")
    imgui.pop_font()
    imgui.text_unformatted(tr("A game engine in Python: processes that talk over a bus."))
    dim_text(tr("The editor changes nothing by itself: it asks the simulation, and shows what that says."))
    imgui.spacing()
    if imgui.button(tr_label("Close", "about close")) or imgui.is_key_pressed(imgui.Key.escape):
        imgui.close_current_popup()
    ui.landmarks.note("about/close")
    imgui.end_popup()

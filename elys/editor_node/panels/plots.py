"""Plots: numbers of entities and of the world over time, each on an axis of its unit; paused, zoomed and exported."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import numpy as np
from imgui_bundle import imgui, implot

from elys.editor_node.field_paths import FieldPathError
from elys.editor_node.instruments import Instruments
from elys.editor_node.language import tr, tr_label, tr_title
from elys.editor_node.panels.plot_style import line_spec, plot_colors
from elys.editor_node.plot_series import AXES, Series, thinned
from elys.editor_node.theme import ERROR, SERIES, icons
from elys.editor_node.ui import Rectangle, Ui, centered_text, color_code, colored_text, dim_text, icon_button

TITLE: Final = f"{icons.ICON_FA_CHART_LINE}  Plots###Plots"
_SPANS: Final = (2.0, 5.0, 10.0, 30.0, 60.0, 600.0)  # [s] that are seen while the newest is followed
_LIST_WIDTH: Final = 24.0  # [letters] of the list of series
_Y_AXES: Final = (implot.ImAxis_.y1.value, implot.ImAxis_.y2.value, implot.ImAxis_.y3.value)
_X: Final = implot.ImAxis_.x1.value


class PlotsPanel:
    """The plot, the list of what is in it, and a field to find more."""

    def __init__(self, instruments: Instruments) -> None:
        self._plots = instruments.plots
        self._text = ""
        self._error = ""  # why what was entered cannot be plotted
        self._focuses = False
        self._puts_cursor_at_end = False
        self._follows = True
        self._span = 10.0  # [s]
        self._export_path = "plots"
        self._rectangle: Rectangle = (0.0, 0.0, 1.0, 1.0)  # where the panel stands

    # --- what can be done ------------------------------------------------------------------------------------------

    def ask_field(self) -> None:
        """Puts the cursor where a field is named."""
        self._focuses = self._puts_cursor_at_end = True

    def plot(self, path: str) -> bool:
        """Plots a field; whether there is such a one. What is wrong stands beside the field otherwise."""
        try:
            self._plots.add(path)
        except FieldPathError as error:
            self._error = str(error)
            return False
        self._error = ""
        return True

    def toggle_pause(self) -> None:
        """Stops reading, or goes on; what came between is a gap."""
        self._plots.is_paused = not self._plots.is_paused

    @property
    def is_paused(self) -> bool:
        """Whether nothing is read."""
        return self._plots.is_paused

    @property
    def has_series(self) -> bool:
        """Whether anything is plotted."""
        return bool(self._plots.table.series)

    def export_csv(self, ui: Ui) -> None:
        """Writes all rows that are kept."""
        path = _with_ending(self._export_path, ".csv")
        try:
            self._plots.table.write_csv(path)
        except OSError as error:
            ui.model.say("error", tr("{path} cannot be written: {reason}", path=path, reason=error.strerror or error))
        else:
            ui.model.say("info", tr("Wrote {path}", path=path))

    def export_picture(self, ui: Ui) -> None:
        """Writes the panel as it is seen."""
        ui.take_picture(_with_ending(self._export_path, ".png"), self._rectangle)

    # --- drawing ---------------------------------------------------------------------------------------------------

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(tr_title(TITLE))[0]:
            low, size = imgui.get_window_pos(), imgui.get_window_size()
            self._rectangle = (low.x, low.y, low.x + size.x, low.y + size.y)
            self._draw_search(ui)
            self._draw_buttons(ui)
            if not self.has_series:
                imgui.dummy((0.0, imgui.get_frame_height() * 0.5))
                centered_text(tr("Name a field to plot it, such as Box 3.Transform.position.y or world.kinetic"),
                              imgui.get_content_region_avail().x)  # fmt: skip
            else:
                width = imgui.get_content_region_avail().x - imgui.get_font_size() * _LIST_WIDTH
                self._draw_plot(ui, max(width, imgui.get_font_size() * 8.0))
                imgui.same_line()
                if imgui.begin_child("###series"):
                    self._draw_list(ui)
                imgui.end_child()
        imgui.end()

    def _draw_search(self, ui: Ui) -> None:
        if self._focuses:
            imgui.set_keyboard_focus_here()
            self._focuses = False
        imgui.set_next_item_width(imgui.get_font_size() * 20.0)
        wanted = imgui.InputTextFlags_
        flags = wanted.enter_returns_true | wanted.callback_always | wanted.callback_completion
        hint = f"{icons.ICON_FA_PLUS}  {tr('Plot a field')}"
        entered, self._text = imgui.input_text_with_hint("###path", hint, self._text, int(flags), self._edit_text)
        is_active = imgui.is_item_active()
        ui.landmarks.note("plots/path")
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        if entered:
            self._take(self._text)
        if is_active and not imgui.is_popup_open("###fields"):
            imgui.open_popup("###fields")
        if self._draw_suggestions(ui, (low.x, high.y + 2.0), high.x - low.x, keeps_open=is_active):
            is_active = True
        if self._error:
            imgui.same_line()
            imgui.align_text_to_frame_padding()
            colored_text(ERROR, self._error)

    def _draw_suggestions(self, ui: Ui, at: tuple[float, float], width: float, *, keeps_open: bool) -> bool:
        """The list below the field, which must not take the keyboard from it; whether something was chosen."""
        if not imgui.is_popup_open("###fields"):
            return False
        imgui.set_next_window_pos(at)
        imgui.set_next_window_size((width * 1.4, 0.0))
        flags = imgui.WindowFlags_.no_focus_on_appearing | imgui.WindowFlags_.no_nav | imgui.WindowFlags_.no_title_bar
        flags |= imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_saved_settings
        chosen = ""
        if imgui.begin_popup("###fields", int(flags)):
            for place, path in enumerate(self._plots.paths.suggestions(self._text)):
                if imgui.selectable(f"{path}###{place}", False, int(imgui.SelectableFlags_.no_auto_close_popups))[0]:
                    chosen = path
                ui.landmarks.note(f"plots/suggestion/{place}")
            is_hovered = imgui.is_window_hovered(imgui.HoveredFlags_.allow_when_blocked_by_active_item.value)
            if not (keeps_open or is_hovered or chosen):
                imgui.close_current_popup()
            imgui.end_popup()
        if chosen:
            self._take(chosen)
        return bool(chosen)

    def _take(self, path: str) -> None:
        """Plots what was entered; what ends with a point, or may go on in one way alone, goes on."""
        if not path.strip():
            return
        if not path.endswith(".") and self.plot(path):
            self._text = ""
            return
        found = self._plots.paths.suggestions(path)
        if path.endswith(".") or len(found) == 1:
            self._text, self._error = (path if path.endswith(".") else found[0]), ""
        self.ask_field()

    def _edit_text(self, data: imgui.InputTextCallbackData) -> int:
        """Tab takes the first suggestion; a field that got the keyboard back goes on at its end."""
        if data.event_flag == imgui.InputTextFlags_.callback_completion:
            found = self._plots.paths.suggestions(self._text)
            if found:
                data.delete_chars(0, data.buf_text_len)
                data.insert_chars(0, found[0])
        elif self._puts_cursor_at_end:
            self._puts_cursor_at_end = False
            data.cursor_pos = data.selection_start = data.selection_end = data.buf_text_len
        return 0

    def _draw_buttons(self, ui: Ui) -> None:
        imgui.same_line()
        paused = self.is_paused
        icon = icons.ICON_FA_PLAY if paused else icons.ICON_FA_PAUSE
        if icon_button(icon, "pause", tr("Go on reading") if paused else tr("Stop reading"), active=paused):
            self.toggle_pause()
        ui.landmarks.note("plots/pause")
        imgui.same_line(0.0, 2.0)
        if icon_button(icons.ICON_FA_ANGLES_RIGHT, "follow", tr("Follow the newest"), active=self._follows):
            self._follows = not self._follows
        ui.landmarks.note("plots/follow")
        imgui.same_line(0.0, 2.0)
        if icon_button(icons.ICON_FA_ERASER, "clear", tr("Forget what was read"), enabled=self.has_series):
            self._plots.clear()
        ui.landmarks.note("plots/clear")
        imgui.same_line()
        imgui.set_next_item_width(imgui.get_font_size() * 5.0)
        if imgui.begin_combo("###span", f"{self._span:g} s"):
            for span in _SPANS:
                if imgui.selectable(f"{span:g} s###{span}", span == self._span)[0]:
                    self._span, self._follows = span, True
                ui.landmarks.note(f"plots/span/{span:g}")
            imgui.end_combo()
        else:
            ui.landmarks.note("plots/span")
        imgui.same_line(0.0, 2.0)
        if icon_button(icons.ICON_FA_FILE_EXPORT, "export", tr("Export"), enabled=self.has_series):
            imgui.open_popup("export")
        ui.landmarks.note("plots/export")
        self._draw_export(ui)

    def _draw_export(self, ui: Ui) -> None:
        if not imgui.begin_popup("export"):
            return
        imgui.set_next_item_width(imgui.get_font_size() * 20.0)
        _, self._export_path = imgui.input_text_with_hint("###where", tr("Path"), self._export_path)
        ui.landmarks.note("plots/export/path")
        if imgui.button(tr_label("Numbers (CSV)")):
            self.export_csv(ui)
            imgui.close_current_popup()
        ui.landmarks.note("plots/export/csv")
        imgui.same_line()
        if imgui.button(tr_label("Picture (PNG)")):
            self.export_picture(ui)
            imgui.close_current_popup()
        ui.landmarks.note("plots/export/png")
        imgui.end_popup()

    # --- the plot --------------------------------------------------------------------------------------------------

    def _draw_plot(self, ui: Ui, width: float) -> None:
        table = self._plots.table
        flags = implot.Flags_.no_title | implot.Flags_.no_legend
        with plot_colors():
            if not implot.begin_plot("###plot", (width, -1.0), int(flags)):
                return
            self._set_up_axes()
            times = table.times
            for place, series in enumerate(table.series):
                if not series.is_shown or not len(table):
                    continue
                implot.set_axes(_X, _Y_AXES[series.axis])
                drawn = self._drawn(times, table.values(series))
                implot.plot_line(f"###{series.path}", *drawn, line_spec(series_color(place)))
            is_moved = bool(imgui.get_io().mouse_wheel) or imgui.is_mouse_dragging(0) or imgui.is_mouse_dragging(1)
            if implot.is_plot_hovered() and is_moved:
                self._follows = False
            implot.end_plot()
        ui.landmarks.note("plots/plot")

    def _drawn(self, times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What of a curve is drawn, while the newest is followed no more than is in sight."""
        if self._follows and len(times):
            near = np.flatnonzero(times < times[-1] - self._span)
            first = max(int(near[-1]), 0) if len(near) else 0
            times, values = times[first:], values[first:]
        drawn_times, drawn = thinned(times, values)
        return np.ascontiguousarray(drawn_times), np.ascontiguousarray(drawn)

    def _set_up_axes(self) -> None:
        table, wanted = self._plots.table, implot.AxisFlags_
        implot.setup_axis(_X, tr("simulated time [s]"), int(wanted.no_highlight))
        if self._follows and len(table):
            newest = float(table.times[-1])
            implot.setup_axis_limits(_X, newest - self._span, newest, implot.Cond_.always.value)
        fit = wanted.auto_fit | wanted.range_fit if self._follows else wanted.none
        for axis in sorted({0, *(series.axis for series in table.series)}):
            units = dict.fromkeys(series.unit for series in table.series if series.axis == axis and series.unit)
            side = wanted.opposite | wanted.no_grid_lines if axis else wanted.none
            implot.setup_axis(_Y_AXES[axis], ", ".join(units), int(wanted.no_highlight | fit | side))

    def _draw_list(self, ui: Ui) -> None:
        table = self._plots.table
        gone: Series | None = None
        for place, series in enumerate(table.series):
            imgui.push_id(series.path)
            at, size = imgui.get_cursor_screen_pos(), imgui.get_frame_height()
            imgui.get_window_draw_list().add_rect_filled(
                (at.x, at.y + 5.0), (at.x + size * 0.4, at.y + size - 5.0), color_code(series_color(place)), 2.0
            )
            imgui.dummy((size * 0.4, size))
            imgui.same_line(0.0, 4.0)
            _, series.is_shown = imgui.checkbox("###shown", series.is_shown)
            ui.landmarks.note(f"plots/shown/{series.path}")
            imgui.same_line(0.0, 4.0)
            imgui.set_next_item_width(size * 1.8)
            if imgui.begin_combo("###axis", str(series.axis + 1), imgui.ComboFlags_.no_arrow_button.value):
                for axis in range(AXES):
                    if imgui.selectable(str(axis + 1), axis == series.axis)[0]:
                        series.axis = axis
                    ui.landmarks.note(f"plots/axis/{axis + 1}")
                imgui.end_combo()
            else:
                ui.landmarks.note(f"plots/axis/{series.path}")
            imgui.set_item_tooltip(tr("Axis"))
            imgui.same_line(0.0, 4.0)
            if icon_button(icons.ICON_FA_XMARK, "remove", tr("Plot it no longer")):
                gone = series
            ui.landmarks.note(f"plots/remove/{series.path}")
            imgui.same_line(0.0, 4.0)
            imgui.align_text_to_frame_padding()
            imgui.text_unformatted(series.path)
            imgui.same_line()
            newest = self._plots.newest(series)
            dim_text("—" if math.isnan(newest) else f"{newest:.6g} {series.unit}")
            imgui.pop_id()
        if gone is not None:
            self._plots.remove(gone)


def series_color(place: int) -> tuple[float, float, float, float]:
    """Of the series that stands there in the list."""
    red, green, blue, alpha = SERIES[place % len(SERIES)]
    return red, green, blue, alpha


def _with_ending(path: str, ending: str) -> Path:
    named = Path(path.strip() or "plots").expanduser()
    return named.with_suffix(ending) if named.suffix in (".csv", ".png") else named.with_name(named.name + ending)

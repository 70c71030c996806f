"""The link to the host: a banner over the viewport while it is gone, its figures, and a field to connect by."""

from __future__ import annotations

import math
from typing import Final

from imgui_bundle import imgui

from elys.bus.state_source import stream_report
from elys.bus.transports.zenoh import DEFAULT_PORT
from elys.editor_node.language import tr, tr_label
from elys.editor_node.panels.key_field import key_field
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.theme import ERROR, GOOD, NOTICE, TEXT, TEXT_DIM, WARNING, Rgba, icons
from elys.editor_node.ui import Ui, colored_text, dim_text

_CONNECT: Final = "Connect to###connect"
_BANNER_FLAGS: Final = (
    imgui.WindowFlags_.no_decoration.value
    | imgui.WindowFlags_.no_move.value
    | imgui.WindowFlags_.no_saved_settings.value
    | imgui.WindowFlags_.no_docking.value
    | imgui.WindowFlags_.no_nav.value
    | imgui.WindowFlags_.no_focus_on_appearing.value
    | imgui.WindowFlags_.always_auto_resize.value
)
_BANNER_REDRAW: Final = 1.0  # [s] its clock goes on


class LinkWindow:
    """Figures of the link, and the dialog of an endpoint."""

    def __init__(self) -> None:
        self.is_open = False
        self._asks = False
        self._endpoint = self._key = ""

    def ask_endpoint(self) -> None:
        """Opens the dialog to connect by."""
        self._asks = True

    def draw(self, ui: Ui) -> None:
        """Draws what is open of it."""
        self._draw_dialog(ui)
        if not self.is_open or not ui.attachments.is_attached:
            return
        title = f"{icons.ICON_FA_PLUG}  {tr('Connection')}###Connection"
        flags = imgui.WindowFlags_.always_auto_resize.value | imgui.WindowFlags_.no_docking.value
        area, edge = imgui.get_main_viewport(), imgui.get_font_size()
        corner = (area.work_pos.x + area.work_size.x - edge, area.work_pos.y + edge)
        imgui.set_next_window_pos(corner, imgui.Cond_.first_use_ever.value, (1.0, 0.0))
        is_shown, is_open = imgui.begin(title, True, flags)
        self.is_open = bool(is_open)
        if is_shown:
            self._draw_figures(ui)
        imgui.end()

    def _draw_figures(self, ui: Ui) -> None:
        meter, attachments = ui.meter, ui.attachments
        meter.look()
        ui.model.request_redraw(_BANNER_REDRAW)
        if imgui.begin_table("figures", 2, imgui.TableFlags_.sizing_fixed_fit.value):
            for label, value, color in link_figures(ui):
                imgui.table_next_column()
                dim_text(label)
                imgui.table_next_column()
                colored_text(color, value)
            imgui.end_table()
        ui.landmarks.note("link/figures")
        if imgui.button(tr_label("Disconnect", "link disconnect")):
            attachments.detach()
        ui.landmarks.note("link/disconnect")
        imgui.set_item_tooltip(tr("Leaves the session, which goes on; back to the start page"))

    def _draw_dialog(self, ui: Ui) -> None:
        attachments = ui.attachments
        if self._asks:
            self._asks, self._endpoint = False, attachments.endpoint
            attachments.error = ""
            imgui.open_popup(_CONNECT)
        imgui.set_next_window_pos(imgui.get_main_viewport().get_center(), imgui.Cond_.appearing.value, (0.5, 0.5))
        name = f"{tr('Connect to')}###connect"
        if not imgui.begin_popup_modal(name, None, imgui.WindowFlags_.always_auto_resize.value)[0]:
            return
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(imgui.get_font_size() * 26.0)
        flags = imgui.InputTextFlags_.enter_returns_true.value
        hint = f"tcp/HOST:{DEFAULT_PORT}"
        entered, self._endpoint = imgui.input_text_with_hint("###endpoint", hint, self._endpoint, flags)
        ui.landmarks.note("connect/endpoint")
        is_confirmed, self._key = key_field(ui, self._key, name="connect/key", width=imgui.get_font_size() * 26.0)
        if attachments.doing:
            dim_text(f"{attachments.doing} ...")
        elif attachments.error:
            imgui.push_text_wrap_pos(imgui.get_font_size() * 26.0)
            colored_text(ERROR, tr_sentence(attachments.error))
            imgui.pop_text_wrap_pos()
            ui.landmarks.note("connect/error")
        if (imgui.button(tr_label("Connect")) or entered or is_confirmed) and self._endpoint.strip():
            attachments.connect(self._endpoint, key=self._key or None)
        ui.landmarks.note("connect/connect")
        imgui.same_line()
        if imgui.button(tr_label("Close")) or imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        ui.landmarks.note("connect/close")
        imgui.end_popup()


def link_figures(ui: Ui) -> list[tuple[str, str, Rgba]]:
    """What is known of the link, line by line: label, value, colour."""
    meter, attachments = ui.meter, ui.attachments
    is_lost = attachments.lost_for is not None
    none = "-"
    trip = f"{meter.round_trip * 1e3:.1f} ms" if meter.round_trip is not None else none
    age = f"{meter.age * 1e3:.0f} ms (± {meter.age_error * 1e3:.1f} ms)" if meter.age is not None else none
    return [
        (tr("State"), tr("reconnecting") if is_lost else tr("connected"), ERROR if is_lost else GOOD),
        (tr("Session"), attachments.seat.name or none, TEXT),
        (tr("Endpoint"), attachments.endpoint or none, TEXT),
        (tr("Round trip"), trip, TEXT),
        (tr("Age of the data"), age, TEXT if ui.model.is_playing else TEXT_DIM),
        (
            tr("Frames dropped in a second"),
            f"{meter.dropped_per_second:.0f}",
            WARNING if meter.dropped_per_second else TEXT,
        ),
        *_stream_figures(ui),
    ]


def _stream_figures(ui: Ui) -> list[tuple[str, str, Rgba]]:
    """What is known of the stream of states, where there is one."""
    report = stream_report(ui.attachments.seat)
    if report is None:
        return []
    error = f"{report.position_error * 1e3:.3g} mm, {math.degrees(report.rotation_error):.2g}°"
    rate = f"{report.rate / 1e3:.0f} / {report.allowed / 1e3:.0f} kB/s"
    loss = f"{100.0 * report.loss:.1f} %"
    return [
        (tr("States by a stream"), rate, TEXT),
        (tr("Age in the last seconds, at most"), f"{report.age_p95 * 1e3:.0f} ms", TEXT),
        (tr("Bodies are off by at most"), error, TEXT),
        (tr("Frames late or lost"), loss, WARNING if report.loss > 0.1 else TEXT),
        (tr("Bodies known"), f"{report.known} / {report.bodies}", TEXT if report.known == report.bodies else WARNING),
    ]


def draw_banner(ui: Ui, rectangle: tuple[float, float, float, float]) -> None:
    """Over the viewport at `rectangle` (x, y, width, height), while the host is gone: since when, and what can be done."""
    attachments = ui.attachments
    lost_for = attachments.lost_for
    if lost_for is None:
        return
    ui.model.request_redraw(_BANNER_REDRAW)
    x, y, width, _ = rectangle
    imgui.set_next_window_pos((x + width / 2.0, y + imgui.get_font_size() * 3.5), 0, (0.5, 0.0))
    imgui.push_style_color(imgui.Col_.window_bg, imgui.ImVec4(*NOTICE))
    imgui.push_style_color(imgui.Col_.border, imgui.ImVec4(*ERROR))
    if imgui.begin("###banner", None, _BANNER_FLAGS)[0]:
        text = tr("The simulation has been gone for {seconds} s", seconds=int(lost_for))
        colored_text(ERROR, f"{icons.ICON_FA_PLUG_CIRCLE_XMARK}  {text}")
        ui.landmarks.note("banner/text")
        if attachments.doing:
            dim_text(f"{attachments.doing} ...")
        elif attachments.error:
            imgui.push_text_wrap_pos(imgui.get_font_size() * 34.0)
            colored_text(WARNING, attachments.error)
            imgui.pop_text_wrap_pos()
            ui.landmarks.note("banner/error")
        else:
            endpoint = attachments.endpoint or attachments.seat.name
            dim_text(
                tr(
                    "Knocking at {endpoint} ten times a second; what is shown is what was known last.",
                    endpoint=endpoint,
                )
            )
        imgui.begin_disabled(attachments.is_busy or not attachments.endpoint)
        if imgui.button(tr_label("Retry", "banner retry")):
            attachments.retry()
        imgui.end_disabled()
        ui.landmarks.note("banner/retry")
        imgui.set_item_tooltip(tr("Joins anew, whoever answers there"))
        imgui.same_line()
        if imgui.button(tr_label("Disconnect", "banner disconnect")):
            attachments.detach()
        ui.landmarks.note("banner/disconnect")
        imgui.set_item_tooltip(tr("Leaves the session, which goes on; back to the start page"))
    imgui.end()
    imgui.pop_style_color(2)

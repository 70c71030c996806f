"""The start page: what there is to attach to, while the editor is attached to nothing."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Final

from imgui_bundle import imgui

import elys
from elys.bus.beacon import FoundSession
from elys.bus.transports.zenoh import DEFAULT_PORT
from elys.editor_node.language import tr, tr_label
from elys.editor_node.panels.key_field import key_field
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.theme import ERROR, TEXT, TEXT_DIM, icons
from elys.editor_node.ui import Ui, color_code, colored_text, dim_text

_FLAGS: Final = (
    imgui.WindowFlags_.no_decoration.value
    | imgui.WindowFlags_.no_move.value
    | imgui.WindowFlags_.no_saved_settings.value
    | imgui.WindowFlags_.no_docking.value
    | imgui.WindowFlags_.no_bring_to_front_on_focus.value
)
_AGE_REDRAW: Final = 20.0  # [s] what is told in minutes goes on
_WIDTH: Final = 62.0  # [letters' heights] of the two columns together


class StartPage:
    """Fills what the menu and the status bar leave. Everything it offers goes through `Attachments`."""

    def __init__(self) -> None:
        self._endpoint = self._key = ""

    def draw(self, ui: Ui) -> None:
        """Draws the page."""
        ui.attachments.look()
        ui.model.request_redraw(_AGE_REDRAW)
        area = imgui.get_main_viewport()
        imgui.set_next_window_pos(area.work_pos)
        imgui.set_next_window_size(area.work_size)
        if imgui.begin("###start", None, _FLAGS)[0]:
            width = min(imgui.get_font_size() * _WIDTH, imgui.get_content_region_avail().x)
            left = (imgui.get_window_width() - width) / 2.0
            imgui.dummy((0.0, imgui.get_window_height() * 0.04))
            imgui.set_cursor_pos_x(left)
            if imgui.begin_child("###page", (width, 0.0)):
                self._draw_title(ui)
                self._draw_state(ui)
                if imgui.begin_table("columns", 2, imgui.TableFlags_.sizing_stretch_same.value):
                    imgui.table_next_column()
                    self._draw_sessions(ui)
                    self._draw_connect(ui)
                    self._draw_nearby(ui)
                    imgui.table_next_column()
                    self._draw_recent(ui)
                    self._draw_samples(ui)
                    imgui.end_table()
            imgui.end_child()
        imgui.end()

    def _draw_title(self, ui: Ui) -> None:
        imgui.push_font(ui.fonts.bold, imgui.get_style().font_size_base * 2.0)
        imgui.text_unformatted("ELYS")
        imgui.pop_font()
        dim_text(tr("Attach to something that runs, or open a scene or a recording.") + f"    {elys.__version__}")
        imgui.dummy((0.0, imgui.get_font_size() * 0.5))

    def _draw_state(self, ui: Ui) -> None:
        attachments = ui.attachments
        if attachments.doing:
            imgui.align_text_to_frame_padding()
            imgui.text_unformatted(f"{icons.ICON_FA_HOURGLASS_HALF}  {attachments.doing} ...")
            imgui.same_line()
            if imgui.button(tr_label("Cancel", "cancel connecting")):
                attachments.cancel()
            ui.landmarks.note("start/cancel")
        elif attachments.error:
            imgui.push_text_wrap_pos(0.0)
            colored_text(ERROR, f"{icons.ICON_FA_TRIANGLE_EXCLAMATION}  {tr_sentence(attachments.error)}")
            imgui.pop_text_wrap_pos()
            ui.landmarks.note("start/error")
        else:
            imgui.align_text_to_frame_padding()
            imgui.text_unformatted("")

    def _draw_sessions(self, ui: Ui) -> None:
        _heading(ui, tr("Running on this machine"))
        sessions = ui.attachments.sessions
        if not sessions:
            dim_text(tr("Nothing runs here now; what starts shows up by itself."))
        for place, record in enumerate(sessions):
            age = tr("started {age} ago", age=age_text(time.time() - record.started))
            details = "   ".join(dict.fromkeys((record.scene, record.endpoint, age)))
            if _offer(f"{_icon_of(record.kind)}   {record.name}", details, f"session {record.place}"):
                ui.attachments.connect(record.place)
            ui.landmarks.note(f"start/session/{place}")

    def _draw_connect(self, ui: Ui) -> None:
        _heading(ui, tr("Elsewhere"))
        imgui.set_next_item_width(-imgui.get_font_size() * 8.0)
        flags = imgui.InputTextFlags_.enter_returns_true.value
        hint = f"tcp/HOST:{DEFAULT_PORT}"
        entered, self._endpoint = imgui.input_text_with_hint("###endpoint", hint, self._endpoint, flags)
        ui.landmarks.note("start/endpoint")
        imgui.same_line()
        is_pressed = imgui.button(tr_label("Connect"), (-1.0, 0.0))
        ui.landmarks.note("start/connect")
        imgui.set_item_tooltip(tr("Attaches to the session that listens there"))
        is_confirmed, self._key = key_field(ui, self._key, name="start/key", width=-imgui.get_font_size() * 8.0)
        if (is_pressed or entered or is_confirmed) and self._endpoint.strip():
            ui.attachments.connect(self._endpoint, key=self._key)
        for place, endpoint in enumerate(ui.preferences.recent_endpoints[:5]):
            if _offer(f"{icons.ICON_FA_PLUG}   {endpoint}", "", f"endpoint {endpoint}"):
                self._endpoint = endpoint
                ui.attachments.connect(endpoint, key=self._key or None)
            ui.landmarks.note(f"start/recent endpoint/{place}")

    def _draw_nearby(self, ui: Ui) -> None:
        attachments = ui.attachments
        imgui.dummy((0.0, imgui.get_font_size() * 0.4))
        imgui.begin_disabled(attachments.is_looking_around)
        if imgui.button(tr_label("Look around in the local network", "look around")):
            attachments.look_around()
        imgui.end_disabled()
        ui.landmarks.note("start/look around")
        imgui.set_item_tooltip(tr("Finds sessions that were started with --discover"))
        if attachments.nearby is None or attachments.is_looking_around:
            return
        if not attachments.nearby:
            dim_text(tr("No session of the local network answers."))
        for place, found in enumerate(attachments.nearby):
            if _offer(f"{_icon_of(found.kind)}   {found.name}", nearby_text(found), f"nearby {found.place}"):
                attachments.connect(found.place, key=self._key or None)
            ui.landmarks.note(f"start/nearby/{place}")

    def _draw_recent(self, ui: Ui) -> None:
        for title, recent, icon, run, name in (
            (tr("Recent scenes"), ui.preferences.recent_scenes, icons.ICON_FA_FILE, ui.attachments.open_scene, "scene"),
            (
                tr("Recent recordings"),
                ui.preferences.recent_recordings,
                icons.ICON_FA_FILM,
                ui.attachments.open_recording,
                "recording",
            ),
        ):
            if not recent:
                continue
            _heading(ui, title)
            for place, path in enumerate(recent[:6]):
                folder = str(Path(path).parent) if "/" in path else tr("a sample")
                if _offer(f"{icon}   {Path(path).name}", folder, f"{name} {path}"):
                    run(path)
                ui.landmarks.note(f"start/{name}/{place}")

    def _draw_samples(self, ui: Ui) -> None:
        if ui.attachments.openers is None:
            return
        _heading(ui, tr("Samples"))
        for name, title in ui.attachments.openers.samples:
            if _offer(f"{icons.ICON_FA_SHAPES}   {name}", tr(title), f"sample {name}"):
                ui.attachments.open_scene(name)
            ui.landmarks.note(f"start/sample/{name}")


def nearby_text(found: FoundSession) -> str:
    """What a session of the local network says of itself, in a line."""
    parts = [found.scene, found.endpoint, tr("started {age} ago", age=age_text(found.age))]
    if found.load >= 0.0:
        parts.append(tr("load {percent} %", percent=round(100 * found.load)))
    if found.needs_secret:
        parts.append(tr("needs a secret"))
    return "   ".join(part for part in parts if part)


def _icon_of(kind: str) -> str:
    return str(icons.ICON_FA_FILM if kind == "replay" else icons.ICON_FA_CUBES)


def age_text(seconds: float) -> str:
    """How long ago, as one says it."""
    if seconds < 60.0:
        return tr("less than a minute")
    if seconds < 3600.0:
        return tr("{count} min", count=int(seconds // 60.0))
    if seconds < 86400.0:
        return tr("{count} h", count=int(seconds // 3600.0))
    return tr("{count} d", count=int(seconds // 86400.0))


def _heading(ui: Ui, text: str) -> None:
    imgui.dummy((0.0, imgui.get_font_size() * 0.6))
    imgui.push_font(ui.fonts.bold, 0.0)
    imgui.text_unformatted(text)
    imgui.pop_font()
    imgui.separator()


def _offer(label: str, details: str, name: str) -> bool:
    """A line to click, with what is known of it in small below."""
    line = imgui.get_text_line_height()
    at = imgui.get_cursor_screen_pos()
    pressed = imgui.selectable(f"###{name}", False, 0, (0.0, line * (2.25 if details else 1.0)))[0]
    draw_list = imgui.get_window_draw_list()
    draw_list.add_text((at.x + 2.0, at.y), color_code(TEXT), label)
    if details:
        draw_list.add_text((at.x + imgui.get_font_size() * 1.8, at.y + line * 1.15), color_code(TEXT_DIM), details)
    return pressed

"""The toolbar along the top and the line of facts along the bottom."""

from __future__ import annotations

import math
from typing import Final

from imgui_bundle import imgui

from elys.editor_node.language import tr, tr_label
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.theme import ACCENT, ERROR, GOOD, TEXT_DIM, WARNING, Rgba, icons
from elys.editor_node.ui import Tool, Ui, action_item, color_code, colored_text, dim_text, icon_button, with_keys

_TOOLS: Final[tuple[tuple[Tool, str, str], ...]] = (
    ("select", icons.ICON_FA_ARROW_POINTER, "Select"),
    ("move", icons.ICON_FA_UP_DOWN_LEFT_RIGHT, "Move; Ctrl snaps"),
    ("rotate", icons.ICON_FA_ROTATE, "Rotate; Ctrl snaps"),
    ("scale", icons.ICON_FA_UP_RIGHT_AND_DOWN_LEFT_FROM_CENTER, "Scale; Ctrl snaps"),
    ("grab", icons.ICON_FA_HAND, "Drag and throw bodies while time goes on"),
)
# Fields of Tools, what they are called, their unit, and the least that handles can do.
_STEPS: Final = (
    ("move_snap", "Move", " m", 1e-3),
    ("rotate_snap", "Rotate", " \N{DEGREE SIGN}", 0.1),
    ("scale_snap", "Scale", "", 1e-3),
)
_RATES: Final = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 0.0)
_BAR_FLAGS: Final = (
    imgui.WindowFlags_.no_scrollbar.value
    | imgui.WindowFlags_.no_saved_settings.value
    | imgui.WindowFlags_.no_docking.value
    | imgui.WindowFlags_.no_nav.value
)


class Toolbar:
    """Undo and tools on the left, time in the middle, how the session does on the right."""

    def draw(self, ui: Ui) -> None:
        """Draws the bar below the menu; it takes its place from what panels are docked in."""
        viewport = imgui.get_main_viewport()
        height = imgui.get_frame_height() + 2.0 * imgui.get_style().window_padding.y - 2.0
        if imgui.internal.begin_viewport_side_bar("###toolbar", viewport, imgui.Dir.up, height, _BAR_FLAGS):
            self._draw_edits(ui)
            imgui.same_line(0.0, 14.0)
            self._draw_tools(ui)
            self._draw_time(ui)
            self._draw_health(ui)
        imgui.end()

    def _draw_edits(self, ui: Ui) -> None:
        model, history = ui.model, ui.model.history
        tooltip = tr("Nothing to undo")
        if history.undo_label:
            tooltip = with_keys(ui, tr_sentence(f"Undo {history.undo_label}"), "edit.undo")
        if icon_button(icons.ICON_FA_ROTATE_LEFT, "undo", tooltip, enabled=bool(history.undo_label)):
            model.undo()
        ui.landmarks.note("toolbar/undo")
        imgui.same_line(0.0, 2.0)
        tooltip = tr("Nothing to redo")
        if history.redo_label:
            tooltip = with_keys(ui, tr_sentence(f"Redo {history.redo_label}"), "edit.redo")
        if icon_button(icons.ICON_FA_ROTATE_RIGHT, "redo", tooltip, enabled=bool(history.redo_label)):
            model.redo()
        ui.landmarks.note("toolbar/redo")

    def _draw_tools(self, ui: Ui) -> None:
        tools = ui.tools
        for tool, icon, words in _TOOLS:
            tooltip = with_keys(ui, tr(words), f"tool.{tool}")
            if icon_button(icon, tool, tooltip, active=tools.tool == tool):
                tools.tool = tool
            ui.landmarks.note(f"toolbar/{tool}")
            imgui.same_line(0.0, 2.0)
        imgui.same_line(0.0, 10.0)
        icon = icons.ICON_FA_CUBE if tools.is_local else icons.ICON_FA_GLOBE
        tooltip = tr("Along the entity's own axes") if tools.is_local else tr("Along the world's axes")
        if icon_button(icon, "space", with_keys(ui, tooltip, "tool.local")):
            tools.is_local = not tools.is_local
        ui.landmarks.note("toolbar/space")
        imgui.same_line(0.0, 2.0)
        is_median = tools.pivot == "median"
        icon = icons.ICON_FA_ARROWS_TO_DOT if is_median else icons.ICON_FA_CIRCLE_DOT
        tooltip = tr("About the middle of what is selected") if is_median else tr("About what was selected last")
        if icon_button(icon, "pivot", with_keys(ui, tooltip, "tool.median")):
            ui.actions.run("tool.median")
        ui.landmarks.note("toolbar/pivot")
        imgui.same_line(0.0, 2.0)
        self._draw_snapping(ui)
        imgui.same_line(0.0, 2.0)
        tooltip = with_keys(ui, tr("Grid"), "view.grid")
        if icon_button(icons.ICON_FA_BORDER_ALL, "grid", tooltip, active=_is_on(ui, "view.grid")):
            ui.actions.run("view.grid")

    def _draw_snapping(self, ui: Ui) -> None:
        """A button that opens the sizes of the steps."""
        tools = ui.tools
        if icon_button(icons.ICON_FA_MAGNET, "snap", tr("Steps of the handles"), active=tools.snaps):
            imgui.open_popup("snapping")
        ui.landmarks.note("toolbar/snap")
        if not imgui.begin_popup("snapping"):
            return
        action_item(ui, "tool.snap")
        imgui.set_item_tooltip(tr("Ctrl turns it about while one drags"))
        for name, label, unit, least in _STEPS:
            imgui.set_next_item_width(imgui.get_font_size() * 6.0)
            value = float(getattr(tools, name))
            changed, value = imgui.input_float(tr_label(label, name), value, 0.0, 0.0, f"%.3g{unit}")
            if changed and math.isfinite(value):
                setattr(tools, name, max(value, least))
            ui.landmarks.note(f"snap/{name}")
        imgui.end_popup()

    def _draw_time(self, ui: Ui) -> None:
        model, status = ui.model, ui.model.status
        height = imgui.get_frame_height()
        combo = height * 3.4
        imgui.same_line((imgui.get_window_width() - height * 3.5 - combo) / 2.0)
        can_play = model.connected and status is not None
        icon = icons.ICON_FA_PAUSE if model.is_playing else icons.ICON_FA_PLAY
        color = WARNING if model.is_playing else GOOD
        tooltip = with_keys(ui, tr("Pause") if model.is_playing else tr("Play"), "time.play")
        if icon_button(icon, "play", tooltip, enabled=can_play, color=color):
            model.toggle_playing()
        ui.landmarks.note("toolbar/play")
        imgui.same_line(0.0, 2.0)
        tooltip = with_keys(ui, tr("One tick on"), "time.step")
        if icon_button(icons.ICON_FA_FORWARD_STEP, "step", tooltip, enabled=can_play):
            model.step()
        ui.landmarks.note("toolbar/step")
        imgui.same_line(0.0, 2.0)
        tooltip = with_keys(ui, tr("Play in this viewport"), "game.play")
        is_on, can_play_here = _is_on(ui, "game.play"), ui.actions.may_run("game.play")
        if icon_button(icons.ICON_FA_GAMEPAD, "game", tooltip, active=is_on, enabled=can_play_here):
            ui.actions.run("game.play")
        ui.landmarks.note("toolbar/game")
        imgui.same_line(0.0, 6.0)
        imgui.set_next_item_width(combo)
        rate = status.rate if status is not None else 1.0
        imgui.begin_disabled(not can_play)
        if imgui.begin_combo("###rate", _rate_label(rate)):
            for offer in _RATES:
                if imgui.selectable(_rate_label(offer), offer == rate)[0]:
                    model.set_rate(offer)
            imgui.end_combo()
        imgui.end_disabled()
        imgui.set_item_tooltip(tr("Simulated seconds in a second"))

    def _draw_health(self, ui: Ui) -> None:
        status = ui.model.status
        lamp, word = _lamp_of(ui)
        texts = []
        if status is not None:
            texts = [tr("tick {tick}", tick=f"{status.tick:,}".replace(",", " ")), f"{status.simulation_time:.2f} s"]
            if status.playing:
                texts.append(tr("{factor}x real time", factor=f"{status.realtime_factor:.2f}"))
        texts.append(word)
        line = "     ".join(texts)
        width = imgui.calc_text_size(line).x + imgui.get_frame_height()
        imgui.same_line(imgui.get_window_width() - width - imgui.get_style().window_padding.x)
        imgui.align_text_to_frame_padding()
        dim_text(line)
        place = imgui.get_item_rect_max()
        if imgui.is_item_clicked():
            ui.actions.run("view.link")
        ui.landmarks.note("toolbar/link")
        imgui.set_item_tooltip(with_keys(ui, tr("How the link to the simulation does"), "view.link"))
        radius = imgui.get_font_size() * 0.28
        middle = (imgui.get_item_rect_min().y + place.y) / 2.0
        imgui.get_window_draw_list().add_circle_filled((place.x + radius * 2.5, middle), radius, color_code(lamp))


class StatusBar:
    """What went wrong last, or what is selected; and the picture's pace."""

    def draw(self, ui: Ui, *, frame_time: float, view_latency: float) -> None:
        """Draws the bar along the bottom; times in seconds."""
        viewport = imgui.get_main_viewport()
        imgui.push_style_var(imgui.StyleVar_.window_padding, (10.0, 3.0))
        height = imgui.get_text_line_height() + 8.0
        if imgui.internal.begin_viewport_side_bar("###status", viewport, imgui.Dir.down, height, _BAR_FLAGS):
            self._draw_message(ui)
            right = pace_text(frame_time, view_latency if ui.model.is_playing else 0.0)
            width = imgui.calc_text_size(right).x
            imgui.same_line(imgui.get_window_width() - width - 10.0)
            dim_text(right)
        imgui.end()
        imgui.pop_style_var()

    def _draw_message(self, ui: Ui) -> None:
        model = ui.model
        model.fade_messages()
        if model.error:
            colored_text(ERROR, f"{icons.ICON_FA_TRIANGLE_EXCLAMATION}  {model.error}")
            if imgui.is_item_clicked():
                model.error = ""
            elif imgui.is_item_hovered():
                imgui.set_tooltip(model.error)
            return
        if model.notice:
            colored_text(GOOD, f"{icons.ICON_FA_CHECK}  {model.notice}")
            return
        if not ui.attachments.is_attached:
            dim_text(tr("not attached"))
            return
        count = len(model.selection)
        selected = model.scene.name_of(model.selection.primary) if count == 1 else tr("{count} selected", count=count)
        entities = tr("{count} entities", count=len(model.scene.mirror.entities))
        dim_text(entities + (f"     {selected}" if count else ""))


def _is_on(ui: Ui, name: str) -> bool:
    """Whether an action that is a switch is on."""
    is_on = ui.actions[name].is_on
    return is_on is not None and is_on()


def pace_text(frame_time: float, view_latency: float) -> str:
    """How old the picture is, where there is anything newer, and what a frame costs; times in seconds."""
    late = tr("picture {milliseconds} ms behind the simulation", milliseconds=f"{view_latency * 1e3:.0f}")
    own = tr("interface {milliseconds} ms", milliseconds=f"{frame_time * 1e3:.1f}")
    return f"{late}     {own}" if view_latency > 0.0 else own


def _rate_label(rate: float) -> str:
    return f"{rate:g}x" if rate else tr("max")


def _lamp_of(ui: Ui) -> tuple[Rgba, str]:
    status = ui.model.status
    if not ui.model.connected:
        return (ERROR, tr("reconnecting")) if ui.attachments.is_attached else (TEXT_DIM, tr("not attached"))
    if status is None:
        return TEXT_DIM, tr("waiting")
    if status.kind == "replay":
        return ACCENT, tr("replay")
    return (GOOD, tr("playing")) if status.playing else (WARNING, tr("paused"))

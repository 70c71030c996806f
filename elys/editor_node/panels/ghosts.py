"""Other runs beside this one: the window that lists them, and the question which to show."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from imgui_bundle import imgui

from elys.bus.messages.ghosts import Color, Ghost
from elys.editor_node.file_choice import FileChoice
from elys.editor_node.language import tr, tr_label
from elys.editor_node.theme import ERROR, icons
from elys.editor_node.ui import Ui, colored_text, dim_text, icon_button

_ASK: Final = "Show another run as ghost"
_WIDTH: Final = 34.0  # letters of the dialog
_RECORDINGS: Final = (".mcap",)


class GhostsWindow:
    """Opens by itself when a ghost is asked for; `is_open` says whether it is."""

    def __init__(self) -> None:
        self.is_open = False
        self._asks = False
        self._starts_now = False
        self._choice = FileChoice(_RECORDINGS)

    def ask(self, ui: Ui) -> None:
        """Asks which recording to show."""
        status = ui.model.status
        here = Path(status.recording).parent if status is not None and status.recording else Path.cwd()
        self._choice.look_at(here if here.is_dir() else Path.cwd())
        ui.attachments.error = ""
        self._asks = True

    def draw(self, ui: Ui) -> None:
        """Draws what is open of it."""
        self._draw_dialog(ui)
        if not self.is_open or not ui.attachments.is_attached:
            return
        title = f"{icons.ICON_FA_GHOST}  {tr('Ghosts')}###Ghosts"
        flags = imgui.WindowFlags_.always_auto_resize.value | imgui.WindowFlags_.no_docking.value
        area, edge = imgui.get_main_viewport(), imgui.get_font_size()
        corner = (area.work_pos.x + area.work_size.x - edge, area.work_pos.y + 4.0 * edge)
        imgui.set_next_window_pos(corner, imgui.Cond_.first_use_ever.value, (1.0, 0.0))
        is_shown, is_open = imgui.begin(title, True, flags)
        self.is_open = bool(is_open)
        if is_shown:
            for place, ghost in enumerate(ui.model.ghosts.all):
                self._draw_ghost(ui, place, ghost)
            if not ui.model.ghosts.all:
                dim_text(tr("No other run is shown."))
            if ui.attachments.doing_beside:
                dim_text(f"{ui.attachments.doing_beside} ...")
            if imgui.button(tr_label("Show another run as ghost...", "add ghost")):
                self.ask(ui)
            ui.landmarks.note("ghosts/add")
        imgui.end()

    def _draw_ghost(self, ui: Ui, place: int, ghost: Ghost) -> None:
        ghosts = ui.model.ghosts
        imgui.push_id(ghost.ghost)
        red, green, blue = (channel / 255.0 for channel in ghost.color)
        flags = imgui.ColorEditFlags_.no_inputs.value | imgui.ColorEditFlags_.no_label.value
        changed, color = imgui.color_edit3("###color", [red, green, blue], flags)
        ui.landmarks.note(f"ghosts/{place}/color")
        if changed:
            ghosts.recolor(ghost, _bytes_of(color))
        imgui.same_line()
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(ghost.title)
        imgui.set_item_tooltip(ghost.file)
        imgui.same_line()
        now = ui.model.timeline.now
        if icon_button(icons.ICON_FA_FLAG_CHECKERED, "begin", tr("Let its run begin now")):
            ghosts.begin_at(ghost, now)
        ui.landmarks.note(f"ghosts/{place}/begin")
        imgui.same_line(0.0, 2.0)
        if icon_button(
            icons.ICON_FA_CLOCK, "along", tr("Show it at the same simulation times"), active=not ghost.offset
        ):
            ghosts.run_along(ghost)
        ui.landmarks.note(f"ghosts/{place}/along")
        imgui.same_line(0.0, 2.0)
        if icon_button(icons.ICON_FA_TRASH, "remove", tr("Do not show it any more")):
            ghosts.remove(ghost)
        ui.landmarks.note(f"ghosts/{place}/remove")
        imgui.pop_id()

    def _draw_dialog(self, ui: Ui) -> None:
        if self._asks:
            self._asks = False
            imgui.open_popup(tr_label(_ASK))
        imgui.set_next_window_pos(imgui.get_main_viewport().get_center(), imgui.Cond_.appearing.value, (0.5, 0.5))
        if not imgui.begin_popup_modal(tr_label(_ASK), None, imgui.WindowFlags_.always_auto_resize.value)[0]:
            return
        width = imgui.get_font_size() * _WIDTH
        dim_text(tr("A fork of this session, or another run of its scene: bodies that have parted are seen twice."))
        dim_text(str(self._choice.folder))
        if imgui.begin_child("###files", (width, imgui.get_text_line_height_with_spacing() * 9.0), 1):
            for place, entry in enumerate(self._choice.entries):
                icon = icons.ICON_FA_FOLDER if entry.is_folder else icons.ICON_FA_FILM
                if imgui.selectable(f"{icon}  {entry.name}###{place}", False, 1 << 0)[0]:
                    self._choice.choose(entry)
                ui.landmarks.note(f"ghost/{entry.name}")
        imgui.end_child()
        imgui.set_next_item_width(width)
        flags = imgui.InputTextFlags_.enter_returns_true.value
        entered, self._choice.text = imgui.input_text("###path", self._choice.text, flags)
        ui.landmarks.note("ghost/path")
        self._starts_now = imgui.checkbox(tr_label("Let its run begin now"), self._starts_now)[1]
        ui.landmarks.note("ghost/now")
        if ui.attachments.error:
            imgui.push_text_wrap_pos(width)
            colored_text(ERROR, ui.attachments.error)
            imgui.pop_text_wrap_pos()
            ui.landmarks.note("ghost/error")
        imgui.begin_disabled(not self._choice.text)
        shows = imgui.button(tr_label("Show"))
        imgui.end_disabled()
        ui.landmarks.note("ghost/show")
        if (shows or entered) and self._choice.text:
            ui.attachments.show_ghost(self._choice.text, color=ui.model.ghosts.next_color, starts_now=self._starts_now)
            self.is_open = True
            imgui.close_current_popup()
        imgui.same_line()
        if imgui.button(tr_label("Cancel")) or imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        ui.landmarks.note("ghost/cancel")
        imgui.end_popup()


def _bytes_of(color: list[float]) -> Color:
    red, green, blue = (min(max(round(255.0 * channel), 0), 255) for channel in color[:3])
    return red, green, blue

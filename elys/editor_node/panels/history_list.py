"""The history: all edits that can be taken back or made again, in a list; a click goes there."""

from __future__ import annotations

from typing import Final

from imgui_bundle import imgui

from elys.editor_node.history_rows import HistoryRow, history_rows
from elys.editor_node.language import tr, tr_label
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.theme import GOOD, TEXT, TEXT_DIM, WARNING, icons
from elys.editor_node.ui import Ui, centered_text

TITLE: Final = f"{icons.ICON_FA_CLOCK_ROTATE_LEFT}  History###History"


class HistoryPanel:
    """The newest edit is last; what was undone stands dim below it until another edit takes its place."""

    def __init__(self) -> None:
        self._shown = -1  # how many entries were made when the list was last scrolled to the newest

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(f"{icons.ICON_FA_CLOCK_ROTATE_LEFT}  {tr_label('History')}")[0]:
            self._draw_conflict(ui)
            rows = history_rows(ui.model.history, saved=ui.model.file.saved_content)
            if len(rows) == 1:
                centered_text(tr("Nothing was edited yet"), imgui.get_content_region_avail().x)
            elif imgui.begin_child("###entries"):
                self._draw_rows(ui, rows)
            if len(rows) > 1:
                imgui.end_child()
        imgui.end()

    def _draw_conflict(self, ui: Ui) -> None:
        """Somebody else has changed what was to be undone: the person may insist."""
        history = ui.model.history
        if history.conflict is None:
            return
        imgui.push_text_wrap_pos(0.0)
        imgui.text_colored(imgui.ImVec4(*WARNING), tr("Somebody else has changed that since."))
        imgui.pop_text_wrap_pos()
        if imgui.button(tr_label("Undo it all the same" if history.conflict == "undo" else "Redo it all the same")):
            history.undo(force=True) if history.conflict == "undo" else history.redo(force=True)
        ui.landmarks.note("history/force")

    def _draw_rows(self, ui: Ui, rows: list[HistoryRow]) -> None:
        clipper = imgui.ListClipper()
        clipper.begin(len(rows), imgui.get_text_line_height_with_spacing())
        done = len(ui.model.history.undoable)
        while clipper.step():
            for place in range(clipper.display_start, clipper.display_end):
                self._draw_row(ui, place, rows[place])
        clipper.end()
        if done != self._shown:
            self._shown = done
            imgui.set_scroll_y(
                max(0.0, done * imgui.get_text_line_height_with_spacing() - imgui.get_window_height() * 0.7)
            )

    def _draw_row(self, ui: Ui, place: int, row: HistoryRow) -> None:
        mark = icons.ICON_FA_FLOPPY_DISK if row.is_saved else icons.ICON_FA_CARET_RIGHT if row.is_now else " "
        color = GOOD if row.is_saved else TEXT if row.is_made else TEXT_DIM
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*color))
        label = tr_sentence(row.label) or tr("As it was at first")
        if imgui.selectable(f"{mark}  {label}###{place}", row.is_now)[0]:
            ui.model.session.start(ui.model.history.go_to(place))
        imgui.pop_style_color()
        ui.landmarks.note(f"history/{place}")
        if row.is_saved and imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            imgui.set_tooltip(tr("The file has the scene as it was here"))

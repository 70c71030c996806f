"""The questions about the scene's file: where to save it, and whether to save it before closing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from imgui_bundle import imgui

from elys.common.errors import ElysError
from elys.common.scene import SCENE_SUFFIX
from elys.editor_node.language import tr, tr_label
from elys.editor_node.theme import ERROR
from elys.editor_node.ui import Ui, colored_text, dim_text

_SAVE: Final = "Save scene###save"
_CLOSE: Final = "Close ELYS###close"


class SaveDialog:
    """At most one question at a time. `close` ends the application."""

    def __init__(self, close: Callable[[], None]) -> None:
        self._close = close
        self._asks = ""
        self._path = ""
        self._error = ""
        self._closes_after = False

    def save(self, ui: Ui) -> None:
        """Saves where it was saved before; asks where, the first time."""
        if ui.model.file.path is None:
            self.ask_where(ui)
        elif not self._write(ui, str(ui.model.file.path)):
            self._path, self._asks = str(ui.model.file.path), _SAVE

    def ask_where(self, ui: Ui) -> None:
        """Asks where to save."""
        status = ui.model.status
        name = (status.scene if status is not None else "").replace("/", "-") or "scene"
        self._path = str(ui.model.file.path or Path.cwd() / f"{name.lower().replace(' ', '-')}{SCENE_SUFFIX}")
        self._error, self._asks = "", _SAVE

    def may_close(self, ui: Ui) -> bool:
        """Whether the window may close now; if not, the person is asked."""
        if not ui.model.file.is_dirty or ui.model.is_replay:
            return True
        self._asks = _CLOSE
        return False

    def draw(self, ui: Ui) -> None:
        """Draws the open question."""
        if self._asks:
            imgui.open_popup(self._asks)
            self._asks = ""
        center = imgui.get_main_viewport().get_center()
        imgui.set_next_window_pos(center, imgui.Cond_.appearing.value, (0.5, 0.5))
        self._draw_where(ui)
        imgui.set_next_window_pos(center, imgui.Cond_.appearing.value, (0.5, 0.5))
        self._draw_close(ui)

    def _draw_where(self, ui: Ui) -> None:
        if not imgui.begin_popup_modal(
            tr_label("Save scene", "save"), None, imgui.WindowFlags_.always_auto_resize.value
        )[0]:
            return
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(imgui.get_font_size() * 34.0)
        flags = imgui.InputTextFlags_.enter_returns_true.value
        entered, self._path = imgui.input_text("###path", self._path, flags)
        dim_text(tr("As it is now, with moving bodies where they are now."))
        if self._path and Path(self._path).is_file() and Path(self._path) != ui.model.file.path:
            dim_text(tr("There is such a file already: it will be replaced."))
        if self._error:
            imgui.push_text_wrap_pos(imgui.get_font_size() * 34.0)
            colored_text(ERROR, self._error)
            imgui.pop_text_wrap_pos()
        saves = imgui.button(tr_label("Save")) or entered
        ui.landmarks.note("save/save")
        imgui.same_line()
        if imgui.button(tr_label("Cancel")) or imgui.is_key_pressed(imgui.Key.escape):
            self._closes_after = False
            imgui.close_current_popup()
        if saves and self._write(ui, self._path):
            imgui.close_current_popup()
        imgui.end_popup()

    def _draw_close(self, ui: Ui) -> None:
        if not imgui.begin_popup_modal(
            tr_label("Close ELYS", "close"), None, imgui.WindowFlags_.always_auto_resize.value
        )[0]:
            return
        imgui.text_unformatted(tr("There are edits that were not saved."))
        imgui.spacing()
        if imgui.button(tr_label("Save and close")):
            self._closes_after = True
            imgui.close_current_popup()
            self.save(ui)
        imgui.same_line()
        if imgui.button(tr_label("Close without saving")):
            imgui.close_current_popup()
            self._close()
        ui.landmarks.note("close/close")
        imgui.same_line()
        if imgui.button(tr_label("Cancel")) or imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        imgui.end_popup()

    def _write(self, ui: Ui, path: str) -> bool:
        try:
            ui.model.save(path)
        except ElysError as error:
            self._error, self._closes_after = str(error), False
            ui.model.say("error", str(error))
            return False
        if self._closes_after:
            self._close()
        return True

"""The questions about the scene's file: which to open, where to save, and what becomes of edits that no file has."""

from __future__ import annotations

import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any, Final

from imgui_bundle import imgui

from elys.common.errors import ElysError
from elys.common.scene import SCENE_SUFFIX
from elys.editor_node.file_choice import FileChoice
from elys.editor_node.language import tr, tr_label
from elys.editor_node.preferences import remember
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.theme import ERROR, icons
from elys.editor_node.ui import Ui, dim_text

_SAVE: Final = "Save scene"
_OPEN: Final = "Open scene"
_CLOSE: Final = "Close ELYS"
_LOSE: Final = "Edits that were not saved"
_RECOVER: Final = "Recovered edits"
_WIDTH: Final = 34.0  # letters of the dialogs with a path


class SaveDialog:
    """At most one question at a time. `close` ends the application."""

    def __init__(self, close: Callable[[], None]) -> None:
        self._close = close
        self._asks = ""
        self._path = ""
        self._error = ""
        self._is_running_state = False
        self._afterwards: Callable[[], None] | None = None  # what was put off until the scene is saved
        self._is_busy = False
        self._opened = 0  # dialogs so far
        self._done = 0  # the last of them whose wish was fulfilled: it closes
        self._choice = FileChoice()
        self._asked_recovery = ""

    # --- what actions do ---------------------------------------------------------------------------------------------

    def save(self, ui: Ui) -> None:
        """Saves where it was saved before or opened from; asks where, the first time."""
        self._is_running_state = False
        if ui.model.file.path is None:
            self.ask_where(ui)
        else:
            self._path = str(ui.model.file.path)
            self._write(ui, on_failure=_SAVE)

    def ask_where(self, ui: Ui, *, running: bool = False) -> None:
        """Asks where to save, the scene as it was edited or a copy as it is now."""
        status = ui.model.status
        name = (status.scene if status is not None else "").replace("/", "-") or "scene"
        name = f"{name.lower().replace(' ', '-')}{'-running' if running else ''}{SCENE_SUFFIX}"
        here = ui.model.file.path
        self._path = str(here if here is not None and not running else (here.parent if here else Path.cwd()) / name)
        self._error, self._asks, self._is_running_state = "", _SAVE, running

    def ask_which(self, ui: Ui) -> None:
        """Asks which scene to open, after what becomes of edits that no file has."""

        def ask() -> None:
            here = ui.model.file.path
            self._choice.look_at(here.parent if here is not None else Path.cwd())
            self._error, self._asks = "", _OPEN

        self._unless_lost(ui, ask)

    def revert(self, ui: Ui) -> None:
        """Goes back to the file, after asking."""
        self._afterwards = lambda: self._start(ui, self._revert(ui), on_failure="")
        if ui.model.file.is_dirty:
            self._asks = _LOSE
        else:
            self._go_on()

    def may_close(self, ui: Ui) -> bool:
        """Whether the window may close now; if not, the person is asked."""
        if not ui.model.file.is_dirty or ui.model.is_replay:
            return True
        if self._is_busy and self._afterwards == self._close:
            return False  # it is being saved for that
        # Whatever another question was about is given up: else a save an hour later would still do it.
        self._asks, self._afterwards = _CLOSE, None
        return False

    # --- drawing -----------------------------------------------------------------------------------------------------

    def draw(self, ui: Ui) -> None:
        """Draws the open question."""
        kept = ui.model.documents.left_behind
        if kept is not None and kept.scene != self._asked_recovery and not self._asks:
            self._asks, self._asked_recovery = _RECOVER, kept.scene
        if self._asks:
            imgui.open_popup(tr_label(self._asks))
            self._asks = ""
            self._opened += 1
        for title, draw in (
            (_SAVE, self._draw_where),
            (_OPEN, self._draw_which),
            (_CLOSE, self._draw_close),
            (_LOSE, self._draw_lose),
            (_RECOVER, self._draw_recover),
        ):
            center = imgui.get_main_viewport().get_center()
            imgui.set_next_window_pos(center, imgui.Cond_.appearing.value, (0.5, 0.5))
            if imgui.begin_popup_modal(tr_label(title), None, imgui.WindowFlags_.always_auto_resize.value)[0]:
                draw(ui)
                imgui.end_popup()

    def _draw_where(self, ui: Ui) -> None:
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(imgui.get_font_size() * _WIDTH)
        flags = imgui.InputTextFlags_.enter_returns_true.value
        entered, self._path = imgui.input_text("###path", self._path, flags)
        if self._is_running_state:
            dim_text(tr("A copy as it is now, with moving bodies where they are now."))
        else:
            dim_text(tr("As it was edited: what has moved since is where it was put."))
        if self._path and Path(self._path).is_file() and Path(self._path) != ui.model.file.path:
            dim_text(tr("There is such a file already: it will be replaced."))
        self._draw_error()
        saves = imgui.button(tr_label("Save")) or entered
        ui.landmarks.note("save/save")
        imgui.same_line()
        if imgui.button(tr_label("Cancel")) or imgui.is_key_pressed(imgui.Key.escape):
            self._afterwards = None
            imgui.close_current_popup()
        if self._done == self._opened:
            imgui.close_current_popup()
        elif saves:
            self._write(ui)

    def _draw_which(self, ui: Ui) -> None:
        width = imgui.get_font_size() * _WIDTH
        recent = [path for path in ui.preferences.recent_scenes if Path(path).is_file()]
        if recent:
            dim_text(tr("Lately"))
        for place, path in enumerate(recent[:6]):
            if imgui.selectable(
                f"{Path(path).name}   {Path(path).parent}###recent{place}", False, 1 << 0, (width, 0.0)
            )[0]:
                self._choice.text = path
                self._open(ui)
            ui.landmarks.note(f"open/recent/{Path(path).name}")
        dim_text(str(self._choice.folder))
        if imgui.begin_child("###files", (width, imgui.get_text_line_height_with_spacing() * 11.0), 1):
            for place, entry in enumerate(self._choice.entries):
                icon = icons.ICON_FA_FOLDER if entry.is_folder else icons.ICON_FA_FILE
                if imgui.selectable(f"{icon}  {entry.name}###{place}", False, 1 << 0)[0]:
                    self._choice.choose(entry)
                ui.landmarks.note(f"open/{entry.name}")
        imgui.end_child()
        imgui.set_next_item_width(width)
        flags = imgui.InputTextFlags_.enter_returns_true.value
        entered, self._choice.text = imgui.input_text("###path", self._choice.text, flags)
        ui.landmarks.note("open/path")
        self._draw_error()
        imgui.begin_disabled(self._is_busy or not self._choice.text)
        opens = imgui.button(tr_label("Open"))
        imgui.end_disabled()
        ui.landmarks.note("open/open")
        imgui.same_line()
        if imgui.button(tr_label("Cancel")) or imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        if self._done == self._opened:
            imgui.close_current_popup()
        elif opens or entered:
            self._open(ui)

    def _draw_close(self, ui: Ui) -> None:
        imgui.text_unformatted(tr("There are edits that were not saved."))
        dim_text(tr("As long as the session runs they are not lost: its host has them."))
        imgui.spacing()
        if not ui.model.file.is_dirty:  # a save that was under way has ended meanwhile
            imgui.close_current_popup()
        imgui.begin_disabled(self._is_busy)  # what is being saved is older, and its end is not that of this
        if imgui.button(tr_label("Save and close")):
            imgui.close_current_popup()
            self._afterwards = self._close
            self.save(ui)
        imgui.end_disabled()
        ui.landmarks.note("close/save")
        imgui.same_line()
        if imgui.button(tr_label("Close without saving")):
            imgui.close_current_popup()
            self._close()
        ui.landmarks.note("close/close")
        imgui.same_line()
        if imgui.button(tr_label("Cancel")) or imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        ui.landmarks.note("close/cancel")

    def _draw_lose(self, ui: Ui) -> None:
        imgui.text_unformatted(tr("There are edits that were not saved. They will be lost."))
        imgui.spacing()
        if imgui.button(tr_label("Go on without them")):
            imgui.close_current_popup()
            self._go_on()
        ui.landmarks.note("lose/lose")
        imgui.same_line()
        if imgui.button(tr_label("Cancel")) or imgui.is_key_pressed(imgui.Key.escape):
            self._afterwards = None
            imgui.close_current_popup()
        ui.landmarks.note("lose/cancel")

    def _draw_recover(self, ui: Ui) -> None:
        kept = ui.model.documents.left_behind
        if kept is None:
            imgui.close_current_popup()
            return
        imgui.text_unformatted(tr("ELYS ended while {name} had edits that were not saved.", name=kept.name))
        at = time.strftime("%Y-%m-%d %H:%M", time.localtime(kept.time))
        dim_text(tr("They were kept at {time}. Opening them replaces what is shown now.", time=at))
        self._draw_error()
        if imgui.button(tr_label("Open them")):
            imgui.close_current_popup()
            self._start(ui, self._recover(ui), on_failure="")
        ui.landmarks.note("recover/open")
        imgui.same_line()
        if imgui.button(tr_label("Throw them away")):
            imgui.close_current_popup()
            ui.model.documents.discard(kept)
        ui.landmarks.note("recover/discard")
        imgui.same_line()
        if imgui.button(tr_label("Later")) or imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        ui.landmarks.note("recover/later")

    def _draw_error(self) -> None:
        if self._error:
            imgui.push_text_wrap_pos(imgui.get_font_size() * _WIDTH)
            imgui.text_colored(imgui.ImVec4(*ERROR), self._error)
            imgui.pop_text_wrap_pos()

    # --- doing -------------------------------------------------------------------------------------------------------

    def _unless_lost(self, ui: Ui, go_on: Callable[[], None]) -> None:
        """Goes on, after asking where edits would be lost."""
        if not ui.model.file.is_dirty or ui.model.is_replay:
            go_on()
            return
        self._afterwards, self._asks = go_on, _LOSE

    def _go_on(self) -> None:
        afterwards, self._afterwards = self._afterwards, None
        if afterwards is not None:
            afterwards()

    def _write(self, ui: Ui, *, on_failure: str = "") -> None:
        self._start(ui, self._save(ui, self._path), on_failure=on_failure)

    def _open(self, ui: Ui) -> None:
        self._start(ui, self._open_file(ui, self._choice.text), on_failure="")

    def _start(self, ui: Ui, work: Coroutine[Any, Any, None], *, on_failure: str) -> None:
        """Does what takes a while; what goes wrong is said where it was asked for, or in a dialog that opens for it."""
        if self._is_busy:
            work.close()
            return

        async def do() -> None:
            try:
                await work
            except ElysError as error:
                self._error, self._afterwards = tr_sentence(str(error)), None
                self._asks = self._asks or on_failure
                ui.model.say("error", self._error)
            else:
                self._done = dialog
                self._go_on()
            finally:
                self._is_busy = False
                ui.model.request_redraw(0.0)

        self._is_busy, self._error = True, ""
        dialog = self._opened
        ui.model.session.start(do())

    async def _save(self, ui: Ui, path: str) -> None:
        await ui.model.save(path, running=self._is_running_state)
        if not self._is_running_state:
            remember(ui.preferences.recent_scenes, str(ui.model.file.path))

    async def _open_file(self, ui: Ui, path: str) -> None:
        opened = await ui.model.documents.open(path)
        remember(ui.preferences.recent_scenes, str(opened.path))
        ui.model.praise(tr("Opened {path}", path=opened.path))

    async def _revert(self, ui: Ui) -> None:
        opened = await ui.model.documents.revert()
        ui.model.praise(tr("Opened {path} again", path=opened.path))

    async def _recover(self, ui: Ui) -> None:
        kept = ui.model.documents.left_behind
        if kept is not None:
            await ui.model.documents.recover(kept)
            ui.model.praise(tr("The edits of {name} are back; save them", name=kept.name))

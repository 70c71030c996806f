"""Questions of the asset browser: which folder, which files to import, and what becomes of those that are there already."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from imgui_bundle import imgui

from elys.editor_node.asset_browsing import AssetBrowsing, choose_folder
from elys.editor_node.asset_import import ImportPlan, OnClash, carry_out, plan_import
from elys.editor_node.asset_library import AssetLibrary
from elys.editor_node.language import tr, tr_label
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.theme import ERROR
from elys.editor_node.ui import Ui, colored_text, dim_text

_FOLDER: Final = "Folder of assets###asset folder"
_IMPORT: Final = "Import###asset import"
_CLASH: Final = "Files of these names are there###asset clash"
_NAMED: Final = 8  # clashes that are listed


class AssetDialogs:
    """At most one question at a time."""

    def __init__(self, library: AssetLibrary, browsing: AssetBrowsing) -> None:
        self._library = library
        self._browsing = browsing
        self._asks = ""
        self._text = ""
        self._error = ""
        self._types_on = False  # the cursor goes back into the text, which was wrong
        self._sources: list[Path] = []
        self._target = Path()
        self._clash = ImportPlan()

    def ask_folder(self) -> None:
        """Asks which folder to show."""
        folder = self._library.folder
        self._text, self._error, self._asks = str(folder.root) if folder is not None else "", "", _FOLDER

    def ask_import(self) -> None:
        """Asks which file to import."""
        self._text, self._error, self._asks = "", "", _IMPORT

    def take_files(self, ui: Ui, sources: Iterable[Path]) -> None:
        """Copies files into the folder that is shown; asks first where others of their names are there."""
        folder = self._library.folder
        if folder is None:
            ui.model.say("warning", tr("Open the browser of assets before you drop files: it shows where they go"))
            return
        self._sources, self._target = list(sources), folder.root / self._browsing.folder
        ui.model.session.start(self._import(ui, "ask"))

    async def _import(self, ui: Ui, on_clash: OnClash) -> None:
        plan = await asyncio.to_thread(plan_import, self._sources, self._target, on_clash=on_clash)
        if plan.clashes and on_clash == "ask":
            self._clash, self._asks = plan, _CLASH
            ui.model.request_redraw(0.0)
            return
        failures = await asyncio.to_thread(carry_out, plan)
        for sentence in (*plan.refused, *failures):
            ui.model.say("error", tr_sentence(sentence))
        count = len(plan.copies) - len(failures)
        if count:
            ui.model.say("info", tr("Imported {count} files into {folder}", count=count, folder=self._target))

    def draw(self, ui: Ui) -> None:
        """Draws the open question."""
        if self._asks:
            imgui.open_popup(self._asks)
            self._asks = ""
        self._draw_folder(ui)
        self._draw_import(ui)
        self._draw_clash(ui)

    def _draw_folder(self, ui: Ui) -> None:
        if not _begin(tr_label("Folder of assets", "asset folder")):
            return
        entered = self._draw_path(ui, tr("Path of a folder"))
        for number, recent in enumerate(ui.preferences.recent_folders):
            if imgui.selectable(f"{recent}###recent {number}", False, imgui.SelectableFlags_.no_auto_close_popups)[0]:
                self._text, entered = recent, True
            ui.landmarks.note(f"assets/recent/{number}")
        if _buttons(ui, tr_label("Show", "show folder")) or entered:
            try:
                folder = choose_folder(ui.preferences, self._text)
            except OSError as error:
                self._error, self._types_on = str(error), True
            else:
                self._browsing.enter("")
                self._library.open(folder)
                imgui.close_current_popup()
        imgui.end_popup()

    def _draw_import(self, ui: Ui) -> None:
        if not _begin(tr_label("Import", "asset import")):
            return
        entered = self._draw_path(ui, tr("Path of a file or folder"))
        dim_text(tr("glTF models, images, .hdr, .exr, scenes and prefabs; or drop them on the window."))
        if _buttons(ui, tr_label("Import", "import file")) or entered:
            path = Path(self._text.strip()).expanduser()
            if self._text.strip() and path.exists():
                self.take_files(ui, (path,))
                imgui.close_current_popup()
            else:
                self._error, self._types_on = tr("There is no file {path}", path=path), True
        imgui.end_popup()

    def _draw_path(self, ui: Ui, hint: str) -> bool:
        if imgui.is_window_appearing() or self._types_on:
            self._types_on = False
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(imgui.get_font_size() * 32.0)
        flags = imgui.InputTextFlags_.enter_returns_true.value
        entered, self._text = imgui.input_text_with_hint("###path", hint, self._text, flags)
        ui.landmarks.note("assets/path")
        if self._error:
            imgui.push_text_wrap_pos(imgui.get_font_size() * 32.0)
            colored_text(ERROR, self._error)
            imgui.pop_text_wrap_pos()
        return entered

    def _draw_clash(self, ui: Ui) -> None:
        if not _begin(tr_label("Files of these names are there", "asset clash")):
            return
        for target in self._clash.clashes[:_NAMED]:
            imgui.text_unformatted(target.name)
        if len(self._clash.clashes) > _NAMED:
            dim_text(tr("and {count} others", count=len(self._clash.clashes) - _NAMED))
        imgui.spacing()
        choices: tuple[tuple[OnClash, str], ...] = (
            ("replace", tr_label("Replace")),
            ("rename", tr_label("Keep both")),
            ("skip", tr_label("Leave them out")),
        )
        for choice, label in choices:
            if imgui.button(label):
                imgui.close_current_popup()
                ui.model.session.start(self._import(ui, choice))
            ui.landmarks.note(f"assets/clash/{choice}")
            imgui.same_line()
        if imgui.button(tr_label("Cancel", "cancel clash")) or imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        imgui.end_popup()


def _begin(label: str) -> bool:
    imgui.set_next_window_pos(imgui.get_main_viewport().get_center(), imgui.Cond_.appearing.value, (0.5, 0.5))
    return imgui.begin_popup_modal(label, None, imgui.WindowFlags_.always_auto_resize.value)[0]


def _buttons(ui: Ui, label: str) -> bool:
    """Does it, or closes; whether to do it."""
    pressed = imgui.button(label)
    ui.landmarks.note("assets/do")
    imgui.same_line()
    if imgui.button(tr_label("Cancel", "cancel assets")) or imgui.is_key_pressed(imgui.Key.escape):
        imgui.close_current_popup()
    return pressed

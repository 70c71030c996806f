"""The question whether a fork of a recording is recorded, before it begins."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from imgui_bundle import imgui

from elys.editor_node.language import tr, tr_label
from elys.editor_node.theme import ERROR
from elys.editor_node.ui import Ui, colored_text, dim_text

_TITLE: Final = "Fork here"
_WIDTH: Final = 34.0  # letters


class ForkDialog:
    """Asks where to record; the fork itself is begun by `Attachments`."""

    def __init__(self) -> None:
        self._asks = False
        self._records = False
        self._path = ""
        self._time = 0.0

    def ask(self, ui: Ui) -> None:
        """Asks about a fork of the recording that is shown, from the instant that is shown."""
        status = ui.model.status
        if status is None or not status.recording:
            return
        if status.playing:
            ui.model.toggle_playing()
        self._time = status.simulation_time
        self._path = str(free_name(Path(status.recording)))
        ui.attachments.error = ""
        self._asks = True

    def draw(self, ui: Ui) -> None:
        """Draws the open question."""
        if self._asks:
            self._asks = False
            imgui.open_popup(tr_label(_TITLE))
        imgui.set_next_window_pos(imgui.get_main_viewport().get_center(), imgui.Cond_.appearing.value, (0.5, 0.5))
        if not imgui.begin_popup_modal(tr_label(_TITLE), None, imgui.WindowFlags_.always_auto_resize.value)[0]:
            return
        status, attachments = ui.model.status, ui.attachments
        if status is None or status.kind != "replay":
            imgui.close_current_popup()  # it is the fork that is shown now
            imgui.end_popup()
            return
        imgui.text_unformatted(tr("A simulation goes on from {time} s of this recording.", time=f"{self._time:.3f}"))
        dim_text(tr("The recording stays as it is, and you can come back to it."))
        self._records = imgui.checkbox(tr_label("Record it to", "records"), self._records)[1]
        ui.landmarks.note("fork/records")
        imgui.begin_disabled(not self._records)
        imgui.set_next_item_width(imgui.get_font_size() * _WIDTH)
        self._path = imgui.input_text("###path", self._path)[1]
        imgui.end_disabled()
        ui.landmarks.note("fork/path")
        if attachments.doing:
            dim_text(f"{attachments.doing} ...")
        elif attachments.error:
            imgui.push_text_wrap_pos(imgui.get_font_size() * _WIDTH)
            colored_text(ERROR, attachments.error)
            imgui.pop_text_wrap_pos()
            ui.landmarks.note("fork/error")
        imgui.begin_disabled(attachments.is_busy or (self._records and not self._path))
        if imgui.button(tr_label("Fork here", "fork")):
            attachments.fork(status.recording, self._time, record=self._path if self._records else "")
        imgui.end_disabled()
        ui.landmarks.note("fork/fork")
        imgui.same_line()
        if imgui.button(tr_label("Cancel")) or imgui.is_key_pressed(imgui.Key.escape):
            attachments.cancel()
            imgui.close_current_popup()
        ui.landmarks.note("fork/cancel")
        imgui.end_popup()


def free_name(recording: Path) -> Path:
    """A name for a fork's recording beside its parent's, that nothing has yet."""
    stem = recording.stem
    names = (recording.with_name(f"{stem}.fork{number}{recording.suffix}") for number in range(1, 10_000))
    return next(name for name in names if not name.exists())

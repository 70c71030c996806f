"""What was edited since the file, entity by entity and field by field."""

from __future__ import annotations

from typing import Final

from imgui_bundle import imgui

from elys.common.errors import ElysError
from elys.editor_node.language import tr, tr_label
from elys.editor_node.scene_diff import DiffKind, DiffLine
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.theme import ERROR, GOOD, WARNING, Rgba, icons
from elys.editor_node.ui import Ui, centered_text, dim_text

TITLE: Final = f"{icons.ICON_FA_CODE_COMPARE}  Changes###Changes"
_SIGNS: Final[dict[DiffKind, tuple[str, Rgba]]] = {
    "added": ("+", GOOD),
    "removed": ("-", ERROR),
    "changed": ("~", WARNING),
}


class ChangesPanel:
    """Compares when the panel is looked at and something was edited since it last did."""

    def __init__(self) -> None:
        self.lines: list[DiffLine] = []
        self._error = ""
        self._key: tuple[object, ...] = ()
        self._is_busy = False

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(f"{icons.ICON_FA_CODE_COMPARE}  {tr_label('Changes')}")[0]:
            self._compare(ui)
            width = imgui.get_content_region_avail().x
            if self._error:
                centered_text(self._error, width)
            elif not self.lines:
                centered_text(tr("Nothing differs from the file"), width)
            else:
                self._draw_lines(ui)
        imgui.end()

    def _compare(self, ui: Ui) -> None:
        file = ui.model.file
        key = (ui.model.scene.mirror.content, ui.model.scene.mirror.epoch, file.path, file.saved_content)
        if key == self._key or self._is_busy or not ui.model.scene.is_known or ui.model.history.is_busy:
            return
        self._key, self._is_busy = key, True

        async def compare() -> None:
            try:
                self.lines, self._error = await ui.model.documents.changes(), ""
            except ElysError as error:
                self.lines, self._error = [], tr_sentence(str(error))
            finally:
                self._is_busy = False
                ui.model.request_redraw(0.0)

        ui.model.session.start(compare())

    def _draw_lines(self, ui: Ui) -> None:
        path = ""
        for place, line in enumerate(self.lines):
            if line.path != path and line.what:
                imgui.text_unformatted(line.path or tr("The scene's settings"))
            path = line.path if line.what else ""
            sign, color = _SIGNS[line.kind]
            imgui.text_colored(imgui.ImVec4(*color), f"{'   ' if line.what else ''}{sign} {line.what or line.path}")
            ui.landmarks.note(f"changes/{place}")
            if line.before or line.after:
                imgui.same_line()
                dim_text(f"{line.before}  {icons.ICON_FA_ARROW_RIGHT}  {line.after}")

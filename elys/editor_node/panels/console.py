"""The console: what every node says, filtered by level and text."""

from __future__ import annotations

import time
from typing import Final

from imgui_bundle import imgui

from elys.bus.messages.session import LogLevel
from elys.editor_node.console_log import LEVELS, ConsoleLine
from elys.editor_node.language import tr, tr_title
from elys.editor_node.theme import ACCENT, ERROR, GOOD, TEXT, TEXT_DIM, WARNING, Rgba, icons
from elys.editor_node.ui import Ui, color_code, icon_button

TITLE: Final = f"{icons.ICON_FA_TERMINAL}  Console###Console"
_COLORS: Final[dict[LogLevel, Rgba]] = {"debug": TEXT_DIM, "info": TEXT, "warning": WARNING, "error": ERROR}
_ICONS: Final[dict[LogLevel, str]] = {
    "debug": icons.ICON_FA_BUG,
    "info": icons.ICON_FA_CIRCLE_INFO,
    "warning": icons.ICON_FA_TRIANGLE_EXCLAMATION,
    "error": icons.ICON_FA_CIRCLE_XMARK,
}
_NODE_COLORS: Final[dict[str, Rgba]] = {"editor": ACCENT, "simulation": GOOD, "render": WARNING}


class ConsolePanel:
    """Follows the newest line as long as the person has not scrolled up."""

    def __init__(self) -> None:
        self._levels: set[LogLevel] = {"info", "warning", "error"}
        self._text = ""
        self._key: tuple[object, ...] = ()
        self._lines: list[ConsoleLine] = []

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(tr_title(TITLE))[0]:
            self._draw_filters(ui)
            if imgui.begin_child("###lines", (0.0, 0.0), 0, imgui.WindowFlags_.horizontal_scrollbar.value):
                imgui.push_font(ui.fonts.mono, 0.0)
                self._draw_lines(ui)
                imgui.pop_font()
                if imgui.get_scroll_y() >= imgui.get_scroll_max_y() - 1.0:
                    imgui.set_scroll_here_y(1.0)
            imgui.end_child()
        imgui.end()

    def _draw_filters(self, ui: Ui) -> None:
        for level in LEVELS:
            is_on = level in self._levels
            tooltip = tr("Hide {what}", what=tr(level)) if is_on else tr("Show {what}", what=tr(level))
            if icon_button(_ICONS[level], level, tooltip, active=is_on, color=_COLORS[level] if is_on else TEXT_DIM):
                self._levels ^= {level}
            imgui.same_line(0.0, 2.0)
        imgui.same_line(0.0, 10.0)
        imgui.set_next_item_width(-imgui.get_frame_height() * 1.15 - imgui.get_style().item_inner_spacing.x)
        hint = f"{icons.ICON_FA_MAGNIFYING_GLASS}  {tr('Filter')}"
        _, self._text = imgui.input_text_with_hint("###filter", hint, self._text)
        ui.landmarks.note("console/filter")
        imgui.same_line(0.0, imgui.get_style().item_inner_spacing.x)
        if icon_button(icons.ICON_FA_TRASH_CAN, "clear", tr("Clear")):
            ui.model.console.clear()

    def _draw_lines(self, ui: Ui) -> None:
        key = (ui.model.console.version, frozenset(self._levels), self._text)
        if key != self._key:
            self._key, self._lines = key, ui.model.console.matching(frozenset(self._levels), self._text)
        clipper = imgui.ListClipper()
        clipper.begin(len(self._lines), imgui.get_text_line_height_with_spacing())
        while clipper.step():
            for place in range(clipper.display_start, clipper.display_end):
                self._draw_line(self._lines[place])
        clipper.end()

    def _draw_line(self, line: ConsoleLine) -> None:
        at, dim = imgui.get_cursor_screen_pos(), color_code(TEXT_DIM)
        letter = imgui.calc_text_size("0").x
        draw_list = imgui.get_window_draw_list()
        stamp = time.strftime("%H:%M:%S", time.localtime(line.time))
        draw_list.add_text((at.x, at.y), dim, stamp)
        tick = f"{line.tick:>8}" if line.tick >= 0 else ""
        draw_list.add_text((at.x + 9 * letter, at.y), dim, tick)
        node_color = _NODE_COLORS.get(line.node, TEXT_DIM)
        draw_list.add_text((at.x + 19 * letter, at.y), color_code(node_color), line.node[:11])
        imgui.dummy((31 * letter, imgui.get_text_line_height()))
        imgui.same_line(0.0, 0.0)
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*_COLORS[line.level]))
        # A traceback's other lines would break the even height that clipping needs; the tooltip has them.
        first, *rest = line.text.split("\n")
        times = f"  ({line.count}x)" if line.count > 1 else ""
        imgui.text_unformatted(f"{first}{' ...' if rest else ''}{times}")
        imgui.pop_style_color()
        is_clipped = imgui.get_item_rect_max().x > imgui.get_window_pos().x + imgui.get_window_width()
        if imgui.is_item_hovered():
            if (rest or is_clipped) and imgui.begin_tooltip():
                imgui.push_text_wrap_pos(imgui.get_font_size() * 45.0)
                imgui.text_unformatted(line.text)
                imgui.pop_text_wrap_pos()
                imgui.end_tooltip()
            if imgui.is_mouse_clicked(1):
                imgui.set_clipboard_text(line.text)

"""The console: what every node says, filtered by level, source and text; a click on a line selects the entity it names."""

from __future__ import annotations

import time
from typing import Final

from imgui_bundle import imgui

from elys.bus.messages.session import LogLevel
from elys.editor_node.console_log import LEVELS, ConsoleView, Filter, Shown, text_of
from elys.editor_node.instruments import Instruments
from elys.editor_node.language import tr, tr_label, tr_title
from elys.editor_node.theme import ACCENT, ERROR, GOOD, HEADER, TEXT, TEXT_DIM, WARNING, Rgba, icons
from elys.editor_node.ui import Ui, color_code, colored_text, icon_button

TITLE: Final = f"{icons.ICON_FA_TERMINAL}  Console###Console"
_COLORS: Final[dict[LogLevel, Rgba]] = {"debug": TEXT_DIM, "info": TEXT, "warning": WARNING, "error": ERROR}
_ICONS: Final[dict[LogLevel, str]] = {
    "debug": icons.ICON_FA_BUG,
    "info": icons.ICON_FA_CIRCLE_INFO,
    "warning": icons.ICON_FA_TRIANGLE_EXCLAMATION,
    "error": icons.ICON_FA_CIRCLE_XMARK,
}
_NODE_COLORS: Final[dict[str, Rgba]] = {"editor": ACCENT, "simulation": GOOD, "render": WARNING}
_COUNT_SHOWN: Final = 9999


class ConsolePanel:
    """Follows the newest line until the person scrolls up, and again when they are back at the end."""

    def __init__(self, instruments: Instruments) -> None:
        self._instruments = instruments
        self._levels: set[LogLevel] = {"info", "warning", "error"}
        self._hidden_nodes: set[str] = set()
        self._text = ""
        self._is_regex = False
        self._merges = False
        self._view: ConsoleView | None = None
        self._follows = True
        self._scroll = 0.0  # of the last frame

    @property
    def follows(self) -> bool:
        """Whether the newest line stays in sight."""
        return self._follows

    def jump_to_newest(self) -> None:
        """Shows the newest line, and follows it."""
        self._follows = True

    def toggle_following(self) -> None:
        """Stays where it is, or goes to the newest line."""
        self._follows = not self._follows

    def draw(self, ui: Ui) -> None:
        """Draws the panel."""
        if imgui.begin(tr_title(TITLE))[0]:
            self._view = self._view or ConsoleView(ui.model.console)
            rows = self._view.rows(self._filter(), merges=self._merges)
            self._draw_filters(ui, rows)
            if self._view.error:
                colored_text(ERROR, tr("this pattern cannot be read: {reason}", reason=self._view.error))
            if imgui.begin_child("###lines", (0.0, 0.0), 0, imgui.WindowFlags_.horizontal_scrollbar.value):
                imgui.push_font(ui.fonts.mono, 0.0)
                self._draw_lines(ui, rows)
                imgui.pop_font()
                self._follow()
            imgui.end_child()
        imgui.end()

    def _filter(self) -> Filter:
        return Filter(
            levels=frozenset(self._levels),
            hidden_nodes=frozenset(self._hidden_nodes),
            text=self._text,
            is_regex=self._is_regex,
        )

    def _follow(self) -> None:
        """A scroll upwards stays there; one to the end follows the newest line again."""
        scroll, end = imgui.get_scroll_y(), imgui.get_scroll_max_y()
        if self._follows and scroll < self._scroll - 1.0 and scroll < end - 1.0:
            self._follows = False
        elif not self._follows and scroll > self._scroll and scroll >= end - 1.0:
            self._follows = True
        if self._follows:
            imgui.set_scroll_here_y(1.0)
        self._scroll = scroll

    # --- filters ---------------------------------------------------------------------------------------------------

    def _draw_filters(self, ui: Ui, rows: list[Shown]) -> None:
        for level in LEVELS:
            self._draw_level(ui, level)
            imgui.same_line(0.0, 2.0)
        imgui.same_line(0.0, 8.0)
        self._draw_sources(ui)
        buttons = 5
        gap = imgui.get_style().item_inner_spacing.x
        imgui.same_line(0.0, 8.0)
        imgui.set_next_item_width(-(imgui.get_frame_height() * 1.15 + gap) * buttons)
        hint = f"{icons.ICON_FA_MAGNIFYING_GLASS}  {tr('Filter')}"
        _, self._text = imgui.input_text_with_hint("###filter", hint, self._text)
        ui.landmarks.note("console/filter")
        imgui.same_line(0.0, gap)
        if icon_button(icons.ICON_FA_ASTERISK, "regex", tr("Search for a pattern"), active=self._is_regex):
            self._is_regex = not self._is_regex
        ui.landmarks.note("console/regex")
        imgui.same_line(0.0, gap)
        if icon_button(icons.ICON_FA_LAYER_GROUP, "merge", tr("Show equal lines as one"), active=self._merges):
            self._merges = not self._merges
        ui.landmarks.note("console/merge")
        imgui.same_line(0.0, gap)
        if icon_button(icons.ICON_FA_COPY, "copy", tr("Copy what is shown"), enabled=bool(rows)):
            imgui.set_clipboard_text(text_of(rows))
        ui.landmarks.note("console/copy")
        imgui.same_line(0.0, gap)
        tooltip = tr("Stay at these lines") if self._follows else tr("Go to the newest line")
        if icon_button(icons.ICON_FA_ANGLES_DOWN, "newest", tooltip, active=self._follows):
            self.toggle_following()
        ui.landmarks.note("console/newest")
        imgui.same_line(0.0, gap)
        if icon_button(icons.ICON_FA_TRASH_CAN, "clear", tr("Clear")):
            ui.model.console.clear()
        ui.landmarks.note("console/clear")

    def _draw_level(self, ui: Ui, level: LogLevel) -> None:
        is_on = level in self._levels
        count = ui.model.console.counts[level]
        color = _COLORS[level] if is_on and count else TEXT_DIM
        imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(*HEADER) if is_on else imgui.ImVec4(0.0, 0.0, 0.0, 0.0))
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*color))
        shown = f"{count}" if count <= _COUNT_SHOWN else f"{_COUNT_SHOWN}+"
        pressed = imgui.button(f"{_ICONS[level]} {shown}###{level}")
        imgui.pop_style_color(2)
        imgui.set_item_tooltip(tr("Hide {what}", what=tr(level)) if is_on else tr("Show {what}", what=tr(level)))
        if pressed:
            self._levels ^= {level}
        ui.landmarks.note(f"console/level/{level}")

    def _draw_sources(self, ui: Ui) -> None:
        nodes = ui.model.console.nodes
        shown = [node for node in nodes if node not in self._hidden_nodes]
        label = tr("All sources") if len(shown) == len(nodes) else ", ".join(shown) or tr("No source")
        imgui.set_next_item_width(imgui.get_font_size() * 8.0)
        is_open = imgui.begin_combo("###sources", label)
        if not is_open:
            ui.landmarks.note("console/sources")
            return
        for node, count in nodes.items():
            pressed, _ = imgui.checkbox(f"{node}  ({count})###{node}", node not in self._hidden_nodes)
            if pressed:
                self._hidden_nodes ^= {node}
            ui.landmarks.note(f"console/source/{node}")
        imgui.end_combo()

    # --- lines -----------------------------------------------------------------------------------------------------

    def _draw_lines(self, ui: Ui, rows: list[Shown]) -> None:
        clipper = imgui.ListClipper()
        clipper.begin(len(rows), imgui.get_text_line_height_with_spacing())
        while clipper.step():
            for place in range(clipper.display_start, clipper.display_end):
                imgui.push_id(place)
                self._draw_line(ui, rows[place])
                ui.landmarks.note(f"console/line/{place}")
                imgui.pop_id()
        clipper.end()

    def _draw_line(self, ui: Ui, row: Shown) -> None:
        line, letter = row.line, imgui.calc_text_size("0").x
        # A traceback's other lines would break the even height that clipping needs; the tooltip has them.
        first, *rest = line.text.split("\n")
        text = f"{first}{' ...' if rest else ''}{f'  ({row.count}x)' if row.count > 1 else ''}"
        at, height = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
        width = 31 * letter + imgui.calc_text_size(text).x
        pressed = imgui.selectable("###line", False, 0, (max(width, imgui.get_content_region_avail().x), height))[0]
        draw_list, dim = imgui.get_window_draw_list(), color_code(TEXT_DIM)
        draw_list.add_text((at.x, at.y), dim, time.strftime("%H:%M:%S", time.localtime(line.time)))
        draw_list.add_text((at.x + 9 * letter, at.y), dim, f"{line.tick:>8}" if line.tick >= 0 else "")
        node_color = color_code(_NODE_COLORS.get(line.node, TEXT_DIM))
        draw_list.add_text((at.x + 19 * letter, at.y), node_color, line.node[:11])
        draw_list.add_text((at.x + 31 * letter, at.y), color_code(_COLORS[line.level]), text)
        if pressed and (entity := self._instruments.mentions.find(line.text)):
            ui.model.selection.replace((entity,))
        if imgui.is_item_hovered():
            is_clipped = at.x + width > imgui.get_window_pos().x + imgui.get_window_width()
            self._draw_tooltip(ui, row, has_more=bool(rest) or is_clipped)
        if imgui.begin_popup_context_item("line"):
            if imgui.menu_item(tr_label("Copy line"), "", False)[0]:
                imgui.set_clipboard_text(line.text)
            ui.landmarks.note("console/menu/copy")
            imgui.end_popup()

    def _draw_tooltip(self, ui: Ui, row: Shown, *, has_more: bool) -> None:
        entity = self._instruments.mentions.find(row.line.text)
        if not (entity or has_more) or not imgui.begin_tooltip():
            return
        if has_more:
            imgui.push_text_wrap_pos(imgui.get_font_size() * 45.0)
            imgui.text_unformatted(row.line.text)
            imgui.pop_text_wrap_pos()
        if entity:
            colored_text(ACCENT, tr("Click: select {name}", name=ui.model.scene.name_of(entity)))
        imgui.end_tooltip()

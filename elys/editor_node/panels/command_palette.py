"""The command palette: type a few letters, Enter does it. Actions, entities, and what was open lately."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from imgui_bundle import imgui

from elys.editor_node.language import tr
from elys.editor_node.palette import EntityNames, Kind, PaletteEntry, action_entries, choose, matching
from elys.editor_node.theme import icons
from elys.editor_node.ui import Ui, dim_text

_POPUP: Final = "###palette"
_ROWS: Final = 14
_ICONS: Final[dict[Kind, str]] = {
    "action": icons.ICON_FA_CHEVRON_RIGHT,
    "entity": icons.ICON_FA_CUBE,
    "scene": icons.ICON_FA_FILE,
    "recording": icons.ICON_FA_FILM,
    "session": icons.ICON_FA_PLUG,
}


class CommandPalette:
    """`others` says what there is beside actions and entities: what was open lately, sessions."""

    def __init__(self, ui: Ui, *, show_entity: Callable[[int], object]) -> None:
        self.others: Callable[[], Iterable[PaletteEntry]] = tuple
        self._entities = EntityNames(ui.model.scene, show_entity)
        self._query = ""
        self._opens = False
        self._place = 0
        self._shown: list[PaletteEntry] = []
        self._chosen: PaletteEntry | None = None  # done in the next frame, when the palette is gone

    def open(self) -> None:
        """Shows it, empty."""
        self._opens = True

    def draw(self, ui: Ui) -> None:
        """Draws it where it is open, and does what was chosen in the last frame."""
        if self._chosen is not None:
            entry, self._chosen = self._chosen, None
            choose(entry, ui.preferences.recent_actions)
        if self._opens:
            self._opens, self._query, self._place = False, "", 0
            imgui.open_popup(_POPUP)
        area, width = imgui.get_main_viewport(), imgui.get_font_size() * 38.0
        imgui.set_next_window_pos((area.pos.x + area.size.x / 2.0, area.pos.y + area.size.y * 0.14), 0, (0.5, 0.0))
        imgui.set_next_window_size((min(width, area.size.x * 0.9), 0.0))
        if not imgui.begin_popup(_POPUP):
            return
        self._draw_query(ui)
        self._draw_rows(ui)
        imgui.end_popup()

    def _draw_query(self, ui: Ui) -> None:
        is_new = imgui.is_window_appearing()
        if is_new:
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(-1.0)
        hint = f"{icons.ICON_FA_MAGNIFYING_GLASS}  {tr('Actions, entities, recent scenes and recordings')}"
        changed, self._query = imgui.input_text_with_hint("###query", hint, self._query)
        ui.landmarks.note("palette/query")
        if changed:
            self._place = 0
        self._shown = self._find(ui)
        step = int(imgui.is_key_pressed(imgui.Key.down_arrow)) - int(imgui.is_key_pressed(imgui.Key.up_arrow))
        step += (_ROWS - 1) * (
            int(imgui.is_key_pressed(imgui.Key.page_down)) - int(imgui.is_key_pressed(imgui.Key.page_up))
        )
        if abs(step) == 1:  # past the end it goes on at the other one
            self._place = (self._place + step) % max(len(self._shown), 1)
        else:
            self._place = min(max(self._place + step, 0), max(len(self._shown) - 1, 0))
        entered = imgui.is_key_pressed(imgui.Key.enter) or imgui.is_key_pressed(imgui.Key.keypad_enter)
        if entered and not is_new and self._place < len(self._shown):
            self._choose(self._shown[self._place])

    def _find(self, ui: Ui) -> list[PaletteEntry]:
        def everything() -> Iterable[PaletteEntry]:
            yield from action_entries(ui.actions, ui.keys)
            yield from self.others()
            yield from self._entities.entries(self._query)

        return matching(self._query, everything(), ui.preferences.recent_actions)

    def _draw_rows(self, ui: Ui) -> None:
        if not self._shown:
            dim_text(tr("Nothing is called '{query}'", query=self._query))
            ui.landmarks.note("palette/nothing")
            return
        row = imgui.get_text_line_height_with_spacing()
        flags = imgui.WindowFlags_.no_nav.value
        if imgui.begin_child("###found", (0.0, row * min(len(self._shown), _ROWS) + 4.0), 0, flags):
            for place, entry in enumerate(self._shown):
                self._draw_row(ui, place, entry)
        imgui.end_child()

    def _draw_row(self, ui: Ui, place: int, entry: PaletteEntry) -> None:
        is_current = place == self._place
        imgui.begin_disabled(not entry.is_possible)
        pressed, _ = imgui.selectable(f"{_ICONS[entry.kind]}   {entry.label}###{entry.key} {place}", is_current)
        imgui.end_disabled()
        ui.landmarks.note(f"palette/{entry.key}")
        if is_current and (imgui.is_window_appearing() or not imgui.is_item_visible()):
            imgui.set_scroll_here_y()
        if pressed:
            self._choose(entry)
        if entry.keys:
            room = imgui.calc_text_size(entry.keys).x + imgui.get_style().scrollbar_size
            imgui.same_line(imgui.get_window_width() - room - imgui.get_style().item_spacing.x)
            dim_text(entry.keys)

    def _choose(self, entry: PaletteEntry) -> None:
        if entry.is_possible:
            self._chosen = entry
            imgui.close_current_popup()

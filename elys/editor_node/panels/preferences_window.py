"""The window of preferences: theme, language, size of text, and the keys of every action. All of it counts at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, get_args

from imgui_bundle import imgui

from elys.editor_node.actions import Action
from elys.editor_node.key_bindings import Chord
from elys.editor_node.language import LANGUAGES, tr, tr_label, use_language
from elys.editor_node.palette import folded
from elys.editor_node.preferences import Preferences, Theme
from elys.editor_node.shortcuts import ChordCapture
from elys.editor_node.theme import WARNING, icons
from elys.editor_node.ui import Ui, colored_text, dim_text

FONT_SCALES: Final = (0.75, 0.9, 1.0, 1.1, 1.25, 1.5, 1.75, 2.0)
_THEME_NAMES: Final[dict[Theme, str]] = {"dark": "Dark", "light": "Light"}


def change_font_scale(preferences: Preferences, direction: int) -> None:
    """The next larger (1) or smaller (-1) size of text; the one of the beginning for 0."""
    if direction == 0:
        preferences.font_scale = 1.0
        return
    sizes = [size for size in FONT_SCALES[::direction] if (size - preferences.font_scale) * direction > 1e-6]
    preferences.font_scale = sizes[0] if sizes else preferences.font_scale


def change_language(preferences: Preferences, code: str) -> None:
    """Speaks another language from the next frame on."""
    preferences.language = code
    use_language(code)


class PreferencesWindow:
    """`capture` hears the chord that is pressed while a new one is asked for; `redraw` asks for a frame."""

    def __init__(self, capture: ChordCapture, redraw: Callable[[], None]) -> None:
        self.is_open = False
        self._capture = capture
        self._redraw = redraw
        self._filter = ""
        self._asked = ""  # the action whose new chord is waited for
        self._taken: tuple[str, Chord, str] | None = None  # action, chord, and who has it

    def draw(self, ui: Ui) -> None:
        """Draws the window, where it is open."""
        if not self.is_open:
            return
        size = imgui.get_font_size()
        imgui.set_next_window_size((40.0 * size, 34.0 * size), imgui.Cond_.first_use_ever.value)
        center = imgui.get_main_viewport().get_center()
        imgui.set_next_window_pos(center, imgui.Cond_.first_use_ever.value, (0.5, 0.5))
        title = f"{icons.ICON_FA_GEAR}  {tr('Preferences')}###Preferences"
        is_shown, is_open = imgui.begin(title, True, imgui.WindowFlags_.no_docking.value)
        self.is_open = bool(is_open)
        if is_shown:
            self._draw_look(ui)
            imgui.separator_text(tr("Keys"))
            self._draw_keys(ui)
        imgui.end()

    def _draw_look(self, ui: Ui) -> None:
        preferences = ui.preferences
        width = imgui.get_font_size() * 14.0
        imgui.set_next_item_width(width)
        if imgui.begin_combo(tr_label("Theme"), tr(_THEME_NAMES[preferences.theme])):
            for theme in get_args(Theme):
                if imgui.selectable(tr_label(_THEME_NAMES[theme]), theme == preferences.theme)[0]:
                    preferences.theme = theme
                ui.landmarks.note(f"preferences/theme/{theme}")
            imgui.end_combo()
        else:
            ui.landmarks.note("preferences/theme")
        imgui.set_next_item_width(width)
        if imgui.begin_combo(tr_label("Language"), LANGUAGES.get(preferences.language, LANGUAGES["en"])):
            for code, name in LANGUAGES.items():
                if imgui.selectable(f"{name}###{code}", code == preferences.language)[0]:
                    change_language(preferences, code)
                ui.landmarks.note(f"preferences/language/{code}")
            imgui.end_combo()
        else:
            ui.landmarks.note("preferences/language")
        imgui.set_next_item_width(width)
        if imgui.begin_combo(tr_label("Size of text"), f"{preferences.font_scale * 100.0:.0f} %"):
            for scale in FONT_SCALES:
                if imgui.selectable(f"{scale * 100.0:.0f} %", scale == preferences.font_scale)[0]:
                    preferences.font_scale = scale
                ui.landmarks.note(f"preferences/size/{scale * 100.0:.0f}")
            imgui.end_combo()
        else:
            ui.landmarks.note("preferences/size")

    def _draw_keys(self, ui: Ui) -> None:
        imgui.set_next_item_width(-imgui.get_font_size() * 13.0)
        hint = f"{icons.ICON_FA_MAGNIFYING_GLASS}  {tr('Filter')}"
        _, self._filter = imgui.input_text_with_hint("###filter", hint, self._filter)
        ui.landmarks.note("preferences/filter")
        imgui.same_line()
        if imgui.button(tr_label("Reset all keys"), (-1.0, 0.0)):
            ui.keys.reset_all()
            self._forget()
        ui.landmarks.note("preferences/reset all")
        self._draw_question(ui)
        flags = imgui.TableFlags_.row_bg.value | imgui.TableFlags_.scroll_y.value
        if not imgui.begin_table("keys", 3, flags):
            return
        imgui.table_setup_column("action", imgui.TableColumnFlags_.width_stretch.value)
        imgui.table_setup_column("keys", imgui.TableColumnFlags_.width_fixed.value, imgui.get_font_size() * 13.0)
        imgui.table_setup_column("reset", imgui.TableColumnFlags_.width_fixed.value, imgui.get_frame_height() * 1.2)
        asked = folded(self._filter.strip())
        for action in ui.actions:
            if asked in folded(tr(action.label)) or asked in folded(f"{action.label} {action.name}"):
                self._draw_row(ui, action)
        imgui.end_table()

    def _draw_question(self, ui: Ui) -> None:
        """A line that is always there, so that what is below does not jump."""
        imgui.align_text_to_frame_padding()
        if self._taken is not None:
            name, chord, owner = self._taken
            taken = tr("{chord} does '{owner}' now.", chord=chord, owner=tr(ui.actions[owner].label))
            colored_text(WARNING, f"{icons.ICON_FA_TRIANGLE_EXCLAMATION}  {taken}")
            ui.landmarks.note("preferences/taken")
            imgui.same_line()
            if imgui.button(tr_label("Swap them")):
                ui.keys.swap(name, chord)
                self._forget()
            ui.landmarks.note("preferences/swap")
            imgui.same_line()
            if imgui.button(tr_label("Leave it", "leave it")):
                self._forget()
            ui.landmarks.note("preferences/leave")
        elif self._asked:
            label = tr(ui.actions[self._asked].label)
            colored_text(WARNING, tr("Press the keys for '{label}'; Escape leaves it as it is.", label=label))
        else:
            dim_text(tr("Click on keys to choose others."))

    def _draw_row(self, ui: Ui, action: Action) -> None:
        imgui.table_next_column()
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(tr(action.label))
        imgui.table_next_column()
        chords = ", ".join(map(str, ui.keys.chords_of(action.name)))
        text = "..." if self._asked == action.name else chords or "-"
        if imgui.button(f"{text}###keys {action.name}", (-1.0, 0.0)):
            self._ask(ui, action.name)
        ui.landmarks.note(f"preferences/keys/{action.name}")
        imgui.table_next_column()
        if action.name in ui.keys.chosen:
            if imgui.button(f"{icons.ICON_FA_ROTATE_LEFT}###reset {action.name}"):
                ui.keys.reset(action.name)
            ui.landmarks.note(f"preferences/reset/{action.name}")
            imgui.set_item_tooltip(tr("Back to {keys}", keys=", ".join(action.keys) or tr("no keys")))

    def _ask(self, ui: Ui, name: str) -> None:
        self._taken, self._asked = None, name

        def heard(chord: Chord | None) -> None:
            self._asked = ""
            owner = ui.keys.action_for(chord) if chord is not None else None
            if chord is not None and owner is not None and owner.name != name:
                self._taken = (name, chord, owner.name)
            elif chord is not None:
                ui.keys.bind(name, chord)
            self._redraw()

        self._capture.wait(heard)

    def _forget(self) -> None:
        self._asked, self._taken = "", None

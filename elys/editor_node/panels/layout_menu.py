"""Layouts of the panels: the one of the beginning, and those that a person gave a name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from imgui_bundle import imgui

from elys.editor_node.language import tr, tr_label
from elys.editor_node.preferences import Layout
from elys.editor_node.theme import WARNING, icons
from elys.editor_node.ui import Ui, action_item, colored_text

_SAVE: Final = "Save layout as###save layout"


class LayoutMenu:
    """`now` says how the panels stand, `use` puts them so in the next frame."""

    def __init__(self, *, now: Callable[[], Layout], use: Callable[[Layout], None]) -> None:
        self._now = now
        self._use = use
        self._asks = False
        self._name = ""

    def ask_name(self) -> None:
        """Asks what to call the layout of now."""
        self._asks = True

    def draw_items(self, ui: Ui) -> None:
        """The lines of the menu."""
        layouts = ui.preferences.layouts
        for name in layouts:
            if imgui.menu_item(f"{name}###layout {name}", "", False)[0]:
                self._use(layouts[name])
            ui.landmarks.note(f"layout/{name}")
        if layouts:
            imgui.separator()
        action_item(ui, "view.save_layout")
        if imgui.begin_menu(tr_label("Delete layout"), bool(layouts)):
            for name in list(layouts):
                if imgui.menu_item(f"{icons.ICON_FA_TRASH_CAN}  {name}###delete {name}", "", False)[0]:
                    del layouts[name]
                ui.landmarks.note(f"layout/delete/{name}")
            imgui.end_menu()
        else:
            ui.landmarks.note("layout/delete")
        action_item(ui, "view.four_views")
        action_item(ui, "view.reset_layout")

    def draw_dialog(self, ui: Ui) -> None:
        """The question for a name, where it is open."""
        if self._asks:
            self._asks, self._name = False, ""
            imgui.open_popup(_SAVE)
        imgui.set_next_window_pos(imgui.get_main_viewport().get_center(), imgui.Cond_.appearing.value, (0.5, 0.5))
        title = f"{tr('Save layout as')}###save layout"
        if not imgui.begin_popup_modal(title, None, imgui.WindowFlags_.always_auto_resize.value)[0]:
            return
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(imgui.get_font_size() * 20.0)
        flags = imgui.InputTextFlags_.enter_returns_true.value
        entered, self._name = imgui.input_text_with_hint("###name", tr("Name"), self._name, flags)
        name = self._name.strip()
        if name in ui.preferences.layouts:
            colored_text(WARNING, tr("There is such a layout already: it will be replaced."))
        imgui.begin_disabled(not name)
        saves = imgui.button(tr_label("Save", "save the layout")) or (entered and bool(name))
        imgui.end_disabled()
        ui.landmarks.note("layout/save")
        imgui.same_line()
        if imgui.button(tr_label("Cancel", "cancel the layout")) or imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        if saves:
            ui.preferences.layouts[name] = self._now()
            imgui.close_current_popup()
        imgui.end_popup()

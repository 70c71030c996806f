"""All panels together: the menu, the docking layout and its default, and which panels are open."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, get_args

from imgui_bundle import imgui

from elys.bus.messages.views import Shows
from elys.editor_node.language import tr, tr_label
from elys.editor_node.panels import console, diagnostics, hierarchy, inspector, keys_help, profiler, timeline, viewport
from elys.editor_node.panels.hierarchy import HierarchyPanel
from elys.editor_node.panels.hierarchy_menus import draw_add_menu, draw_select_menu
from elys.editor_node.panels.keys_help import draw_help
from elys.editor_node.panels.save_dialog import SaveDialog
from elys.editor_node.panels.toolbar import StatusBar, Toolbar
from elys.editor_node.panels.viewport import ViewportPanel
from elys.editor_node.ui import Ui, action_item, dim_text

_DOCK_NAME: Final = "editor"
# Left, right and lower panels take these shares of the window; the viewport has the rest.
_LEFT_SHARE: Final = 0.19
_RIGHT_SHARE: Final = 0.29
_LOWER_SHARE: Final = 0.27
_FOCUS_FRAMES: Final = 4  # until then docked windows take their places, each new one in front


class Workspace:
    """Draws a whole frame of the editor's widgets."""

    def __init__(
        self, ui: Ui, viewport_panel: ViewportPanel, *, ask_to_close: Callable[[], None], close: Callable[[], None]
    ) -> None:
        """`ask_to_close` asks to close the window, `close` closes it."""
        self.ui = ui
        self.hierarchy = HierarchyPanel()
        self.viewport = viewport_panel
        self.save_dialog = SaveDialog(close)
        self.ask_to_close = ask_to_close
        self._toolbar = Toolbar()
        self._status_bar = StatusBar()
        self._panels = {
            "Viewport": self.viewport.draw,
            "Hierarchy": self.hierarchy.draw,
            "Inspector": inspector.InspectorPanel().draw,
            "Console": console.ConsolePanel().draw,
            "Timeline": timeline.TimelinePanel().draw,
            "Profiler": profiler.ProfilerPanel().draw,
            "Diagnostics": diagnostics.DiagnosticsPanel().draw,
        }
        self._hidden: set[str] = set()
        self._resets_layout = False
        self._opens_help = False
        self._frames_to_focus = _FOCUS_FRAMES  # of tabs that share a place the first is to be in front
        self._has_shown_timeline = False
        self.frame_time = 0.0  # [s] of the last frame, for the status bar

    def draw(self, elapsed: float) -> None:
        """One frame."""
        self._draw_menu()
        self._toolbar.draw(self.ui)
        self._status_bar.draw(self.ui, frame_time=self.frame_time, view_latency=self.viewport.stream.latency)
        self._dock()
        for name, draw in self._panels.items():
            if name not in self._hidden:
                draw(self.ui)
        if self._frames_to_focus:
            self._frames_to_focus -= 1
            # A tab comes to the front when its window has kept the focus into the next frame.
            imgui.set_window_focus(console.TITLE if self._frames_to_focus else viewport.TITLE)
        self._show_timeline_once()
        self._draw_help()
        self.save_dialog.draw(self.ui)

    def _show_timeline_once(self) -> None:
        """Who opens a replay wants to go back and forth in it."""
        if self.ui.model.is_replay and not self._has_shown_timeline and not self._frames_to_focus:
            self._has_shown_timeline = True
            imgui.set_window_focus(timeline.TITLE)

    def reset_layout(self) -> None:
        """All panels back to where they were at first."""
        self._resets_layout = True
        self._hidden.clear()

    def show_help(self) -> None:
        """Opens the page of keys."""
        self._opens_help = True

    def _dock(self) -> None:
        """Before the first frame without a saved layout, and when asked for, the default is built."""
        dock = imgui.get_id(_DOCK_NAME)
        is_new = imgui.internal.dock_builder_get_node(dock) is None
        if is_new or self._resets_layout:
            self._resets_layout = False
            _build_layout(dock)
            self._frames_to_focus = _FOCUS_FRAMES
        # Passing through spares a background that panels cover anyway: on software GL every layer of pixels is dear.
        imgui.dock_space_over_viewport(
            dock, imgui.get_main_viewport(), imgui.DockNodeFlags_.passthru_central_node.value
        )

    def _draw_menu(self) -> None:
        if not imgui.begin_main_menu_bar():
            return
        imgui.push_font(self.ui.fonts.bold, 0.0)
        imgui.text_unformatted("ELYS")
        imgui.pop_font()
        self._draw_file_menu()
        self._draw_edit_menu()
        if imgui.begin_menu(tr_label("Add")):
            draw_add_menu(self.ui, parent=0)
            imgui.end_menu()
        self._draw_view_menu()
        if imgui.begin_menu(tr_label("Help")):
            action_item(self.ui, "help.keys")
            imgui.end_menu()
        status = self.ui.model.status
        if status is not None:
            text = "  -  ".join(dict.fromkeys((status.scene, self.ui.model.session.name)))
            imgui.same_line(imgui.get_window_width() - imgui.calc_text_size(text).x - 16.0)
            dim_text(text)
        imgui.end_main_menu_bar()

    def _draw_file_menu(self) -> None:
        if imgui.begin_menu(tr_label("File")):
            action_item(self.ui, "file.save")
            action_item(self.ui, "file.save_as")
            imgui.separator()
            action_item(self.ui, "file.quit")
            imgui.end_menu()

    def _draw_edit_menu(self) -> None:
        history = self.ui.model.history
        self.ui.landmarks.note("menu/edit")
        if not imgui.begin_menu(tr_label("Edit")):
            return
        action_item(self.ui, "edit.undo", f"{tr('Undo')} {history.undo_label}")
        action_item(self.ui, "edit.redo", f"{tr('Redo')} {history.redo_label}")
        imgui.separator()
        for name in (
            "edit.cut",
            "edit.copy",
            "edit.paste",
            "edit.duplicate",
            "edit.rename",
            "edit.group",
            "edit.delete",
        ):
            action_item(self.ui, name)
        imgui.separator()
        action_item(self.ui, "edit.select_all")
        draw_select_menu(self.ui)
        action_item(self.ui, "edit.find")
        imgui.end_menu()

    def _draw_view_menu(self) -> None:
        if not imgui.begin_menu(tr_label("View")):
            self.ui.landmarks.note("menu/view")
            return
        for name in self._panels:
            pressed, _ = imgui.menu_item(tr_label(name), "", name not in self._hidden)
            if pressed:
                self._hidden ^= {name}
        imgui.separator()
        action_item(self.ui, "view.grid")
        is_open = imgui.begin_menu(tr_label("Show"))
        if not is_open:
            self.ui.landmarks.note("menu/show")
        else:
            for view in get_args(Shows):
                action_item(self.ui, f"view.{view}", tr(view.capitalize()))
                self.ui.landmarks.note(f"show/{view}")
            imgui.end_menu()
        action_item(self.ui, "view.reset_layout")
        imgui.end_menu()

    def _draw_help(self) -> None:
        if self._opens_help:
            imgui.open_popup(keys_help.TITLE)
            self._opens_help = False
        draw_help(self.ui)


def _build_layout(dock: int) -> None:
    builder = imgui.internal
    builder.dock_builder_remove_node(dock)
    builder.dock_builder_add_node(dock, imgui.internal.DockNodeFlagsPrivate_.dock_space.value)
    builder.dock_builder_set_node_pos(dock, imgui.get_main_viewport().work_pos)
    builder.dock_builder_set_node_size(dock, imgui.get_main_viewport().work_size)
    left = builder.dock_builder_split_node(dock, imgui.Dir.left, _LEFT_SHARE)
    right = builder.dock_builder_split_node(left.id_at_opposite_dir, imgui.Dir.right, _RIGHT_SHARE)
    lower = builder.dock_builder_split_node(right.id_at_opposite_dir, imgui.Dir.down, _LOWER_SHARE)
    builder.dock_builder_dock_window(hierarchy.TITLE, left.id_at_dir)
    builder.dock_builder_dock_window(inspector.TITLE, right.id_at_dir)
    for title in (console.TITLE, timeline.TITLE, profiler.TITLE, diagnostics.TITLE):
        builder.dock_builder_dock_window(title, lower.id_at_dir)
    builder.dock_builder_dock_window(viewport.TITLE, lower.id_at_opposite_dir)
    builder.dock_builder_finish(dock)

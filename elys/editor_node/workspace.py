"""All panels together: the menu, the docking layout and its default, and which panels are open."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final, get_args

from imgui_bundle import imgui

from elys.bus.messages.views import Shows
from elys.editor_node.instruments import Instruments
from elys.editor_node.language import tr, tr_label
from elys.editor_node.palette import PaletteEntry
from elys.editor_node.panels import assets as assets_panel
from elys.editor_node.panels import (
    changes,
    console,
    diagnostics,
    hierarchy,
    history_list,
    inspector,
    keys_help,
    plan,
    plots,
    profiler,
    timeline,
    topics,
    tour,
    viewport,
)
from elys.editor_node.panels.assets import AssetsPanel
from elys.editor_node.panels.command_palette import CommandPalette
from elys.editor_node.panels.hierarchy import HierarchyPanel
from elys.editor_node.panels.hierarchy_menus import draw_add_menu, draw_select_menu
from elys.editor_node.panels.keys_help import draw_help
from elys.editor_node.panels.layout_menu import LayoutMenu
from elys.editor_node.panels.link import LinkWindow, draw_banner
from elys.editor_node.panels.preferences_window import PreferencesWindow
from elys.editor_node.panels.save_dialog import SaveDialog
from elys.editor_node.panels.start_page import StartPage
from elys.editor_node.panels.toolbar import StatusBar, Toolbar
from elys.editor_node.panels.viewport import ViewportPanel
from elys.editor_node.panels.viewport_menus import draw_camera_menu, draw_debug_menu
from elys.editor_node.preferences import Layout
from elys.editor_node.sentences import tr_sentence
from elys.editor_node.shortcuts import ChordCapture
from elys.editor_node.theme import icons
from elys.editor_node.ui import Ui, action_item, dim_text, with_keys

_DOCK_NAME: Final = "editor"
# Left, right and lower panels take these shares of the window; the viewport has the rest.
_LEFT_SHARE: Final = 0.19
_RIGHT_SHARE: Final = 0.29
_LOWER_SHARE: Final = 0.27
_TIME_MENU: Final = (
    *("time.play", "time.step", "time.step_back", "time.start", "time.end", "time.resume"),
    *("time.previous_marker", "time.next_marker", "time.bookmark"),
    *("time.loop", "time.loop_start", "time.loop_end", "time.forget_loop"),
)
_FOCUS_FRAMES: Final = 4  # until then docked windows take their places, each new one in front


class Workspace:
    """Draws a whole frame of the editor's widgets."""

    def __init__(
        self,
        ui: Ui,
        viewport_panel: ViewportPanel,
        *,
        ask_to_close: Callable[[], None],
        close: Callable[[], None],
        load_docking: Callable[[str], None],
        capture: ChordCapture,
        assets: AssetsPanel,
    ) -> None:
        """`ask_to_close` asks to close the window, `close` closes it; `load_docking` places the panels before the next frame."""
        self.ui = ui
        self.hierarchy = HierarchyPanel()
        self.inspector = inspector.InspectorPanel()
        self.viewport = viewport_panel
        self.assets = assets
        self.save_dialog = SaveDialog(close)
        self.ask_to_close = ask_to_close
        self.changes = changes.ChangesPanel()
        self._toolbar = Toolbar()
        self._status_bar = StatusBar()
        self.instruments = Instruments(ui.model)
        self.console = console.ConsolePanel(self.instruments)
        self.profiler = profiler.ProfilerPanel(self.instruments)
        self.plots = plots.PlotsPanel(self.instruments)
        ui.plot_field = self.plot_field
        self._panels = {
            "Viewport": self.viewport.draw,
            "Hierarchy": self.hierarchy.draw,
            "Inspector": self.inspector.draw,
            "Console": self.console.draw,
            "Assets": self.assets.draw,
            "Timeline": timeline.TimelinePanel().draw,
            "Profiler": self.profiler.draw,
            "Plots": self.plots.draw,
            "Diagnostics": diagnostics.DiagnosticsPanel(self.instruments).draw,
            "Topics": topics.TopicsPanel(self.instruments).draw,
            "Plan": plan.PlanPanel(self.instruments).draw,
            "History": history_list.HistoryPanel().draw,
            "Changes": self.changes.draw,
        }
        self.start_page = StartPage()
        self.link = LinkWindow()
        self.tour = tour.Tour()
        self.preferences = PreferencesWindow(capture, lambda: ui.model.request_redraw(0.0))
        self.palette = CommandPalette(ui, show_entity=self._show_entity)
        self.palette.others = self._recent_entries
        self.layouts = LayoutMenu(now=self.layout, use=self._use_layout)
        self._load_docking = load_docking
        self._hidden: set[str] = set(ui.preferences.hidden_panels)
        self._opens_about = False
        self._resets_layout = False
        self._opens_help = False
        self._comes_to_front = ""
        self._frames_to_focus = _FOCUS_FRAMES  # of tabs that share a place the first is to be in front
        self._has_shown_timeline = False
        self.frame_time = 0.0  # [s] of the last frame, for the status bar

    def draw(self, elapsed: float) -> None:
        """One frame."""
        self._draw_menu()
        if self.ui.attachments.is_attached:
            self._toolbar.draw(self.ui)
        self._status_bar.draw(self.ui, frame_time=self.frame_time, view_latency=self.viewport.stream.latency)
        if self.ui.attachments.is_attached:
            self._draw_panels()
        else:
            self.viewport.is_hovered = False
            self.start_page.draw(self.ui)
        self._draw_help()
        self.save_dialog.draw(self.ui)
        self.layouts.draw_dialog(self.ui)
        self.link.draw(self.ui)
        self.preferences.draw(self.ui)
        self.palette.draw(self.ui)
        self.ui.watches.end_frame()

    def _draw_panels(self) -> None:
        self._dock()
        for name, draw in self._panels.items():
            if name not in self._hidden:
                draw(self.ui)
        if self._frames_to_focus:
            self._frames_to_focus -= 1
            # A tab comes to the front when its window has kept the focus into the next frame.
            imgui.set_window_focus(console.TITLE if self._frames_to_focus else viewport.TITLE)
        if self._comes_to_front:
            imgui.set_window_focus(self._comes_to_front)
            self._comes_to_front = ""
        self._show_timeline_once()
        self._note_panels()
        draw_banner(self.ui, self.viewport.rectangle)
        self.tour.draw(self.ui)

    def _note_panels(self) -> None:
        """Where the panels came to stand, for those who point at them."""
        landmarks = self.ui.landmarks
        for name in self._panels:
            place = f"panel/{name}"
            if landmarks.is_wanted or place in landmarks.pointed_at:
                window = imgui.internal.find_window_by_name(f"###{name}")
                if window is not None:
                    low, size = window.pos, window.size
                    landmarks.rectangles[place] = (low.x, low.y, low.x + size.x, low.y + size.y)

    def plot_field(self, entity: int, component: str, field: str) -> None:
        """Plots a field of an entity, each of its elements, where they can be seen."""
        self.show(plots.TITLE)
        for path in self.instruments.plots.paths.paths_to(entity, component, field):
            self.plots.plot(path)

    def ask_field_to_plot(self) -> None:
        """Shows the plots and asks for a field."""
        self.show(plots.TITLE)
        self.plots.ask_field()

    def _show_entity(self, entity: int) -> None:
        self.ui.model.selection.replace((entity,))
        self.ui.actions.run("view.frame")

    def _recent_entries(self) -> list[PaletteEntry]:
        """What was open lately, for the palette."""
        attachments, preferences = self.ui.attachments, self.ui.preferences
        found: list[PaletteEntry] = []
        for path in preferences.recent_scenes if attachments.openers is not None else ():
            run = partial(attachments.open_scene, path)
            label = tr("Open scene {name}", name=path)
            found.append(PaletteEntry(key=f"scene:{path}", kind="scene", label=label, words=(label, path), run=run))
        for path in preferences.recent_recordings if attachments.openers is not None else ():
            run = partial(attachments.open_recording, path)
            label = tr("Open recording {name}", name=path)
            found.append(
                PaletteEntry(key=f"recording:{path}", kind="recording", label=label, words=(label, path), run=run)
            )
        for endpoint in preferences.recent_endpoints:
            run = partial(attachments.connect, endpoint)
            label = tr("Connect to {endpoint}", endpoint=endpoint)
            found.append(PaletteEntry(key=f"session:{endpoint}", kind="session", label=label, words=(label,), run=run))
        return found

    def layout(self) -> Layout:
        """How the panels stand now."""
        return Layout(docking=imgui.save_ini_settings_to_memory(), hidden_panels=tuple(sorted(self._hidden)))

    def _use_layout(self, layout: Layout) -> None:
        self._hidden = set(layout.hidden_panels)
        self._load_docking(layout.docking)

    def show_about(self) -> None:
        """Opens the box that says what this is."""
        self._opens_about = True

    def _show_timeline_once(self) -> None:
        """Who opens a replay wants to go back and forth in it."""
        if self.ui.model.is_replay and not self._has_shown_timeline and not self._frames_to_focus:
            self._has_shown_timeline = True
            imgui.set_window_focus(timeline.TITLE)

    def reset_layout(self) -> None:
        """All panels back to where they were at first."""
        self._resets_layout = True
        self._hidden.clear()

    @property
    def hidden_panels(self) -> tuple[str, ...]:
        """Those that are closed, by name."""
        return tuple(sorted(self._hidden))

    def show(self, title: str) -> None:
        """Brings a panel to the front, open if it was not."""
        self._hidden.discard(title.rpartition("###")[2])
        self._comes_to_front = title

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
        if self.ui.attachments.is_attached and imgui.begin_menu(tr_label("Add")):
            draw_add_menu(self.ui, parent=0)
            imgui.end_menu()
        if imgui.begin_menu(tr_label("Time")):
            for name in _TIME_MENU:
                action_item(self.ui, name)
            imgui.end_menu()
        self._draw_view_menu()
        self._draw_help_menu()
        if imgui.menu_item(f"{icons.ICON_FA_MAGNIFYING_GLASS}###palette", "", False)[0]:
            self.palette.open()
        self.ui.landmarks.note("menu/palette")
        imgui.set_item_tooltip(with_keys(self.ui, tr("Find and do anything"), "view.palette"))
        status = self.ui.model.status
        if status is not None:
            text = "  -  ".join(dict.fromkeys((status.scene, self.ui.model.session.name)))
            imgui.same_line(imgui.get_window_width() - imgui.calc_text_size(text).x - 16.0)
            dim_text(text)
        imgui.end_main_menu_bar()

    def _draw_file_menu(self) -> None:
        if imgui.begin_menu(tr_label("File")):
            action_item(self.ui, "file.open")
            action_item(self.ui, "file.save")
            action_item(self.ui, "file.save_as")
            action_item(self.ui, "file.save_running")
            action_item(self.ui, "file.revert")
            action_item(self.ui, "file.changes")
            imgui.separator()
            action_item(self.ui, "assets.import")
            action_item(self.ui, "assets.folder")
            imgui.separator()
            action_item(self.ui, "file.connect")
            action_item(self.ui, "file.detach")
            imgui.separator()
            action_item(self.ui, "file.preferences")
            action_item(self.ui, "file.quit")
            imgui.end_menu()
        else:
            self.ui.landmarks.note("menu/file")

    def _draw_help_menu(self) -> None:
        if imgui.begin_menu(tr_label("Help")):
            for name in ("help.keys", "help.tour", "help.about"):
                action_item(self.ui, name)
            imgui.end_menu()
        else:
            self.ui.landmarks.note("menu/help")

    def _draw_edit_menu(self) -> None:
        history = self.ui.model.history
        self.ui.landmarks.note("menu/edit")
        if not imgui.begin_menu(tr_label("Edit")):
            return
        action_item(self.ui, "edit.undo", tr_sentence(f"Undo {history.undo_label}".strip()))
        action_item(self.ui, "edit.redo", tr_sentence(f"Redo {history.redo_label}".strip()))
        action_item(self.ui, "edit.history")
        imgui.separator()
        for name in (
            "edit.cut",
            "edit.copy",
            "edit.paste",
            "edit.duplicate",
            "edit.rename",
            "edit.group",
            "edit.drop",
            "edit.delete",
        ):
            action_item(self.ui, name)
        imgui.separator()
        action_item(self.ui, "edit.select_all")
        draw_select_menu(self.ui)
        action_item(self.ui, "edit.find")
        for name in ("search", "add_component", "fold_all", "unfold_all", "revert_all"):
            action_item(self.ui, f"inspector.{name}")
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
        draw_camera_menu(self.ui)
        is_open = imgui.begin_menu(tr_label("Show"))
        if not is_open:
            self.ui.landmarks.note("menu/show")
        else:
            for view in get_args(Shows):
                action_item(self.ui, f"view.{view}", tr(view.capitalize()))
                self.ui.landmarks.note(f"show/{view}")
            imgui.end_menu()
        draw_debug_menu(self.ui)
        if imgui.begin_menu(tr_label("Layout")):
            self.layouts.draw_items(self.ui)
            imgui.end_menu()
        else:
            self.ui.landmarks.note("menu/layout")
        for name in ("view.larger_text", "view.smaller_text", "view.link"):
            action_item(self.ui, name)
        imgui.end_menu()

    def _draw_help(self) -> None:
        if self._opens_help:
            imgui.open_popup(keys_help.TITLE)
            self._opens_help = False
        if self._opens_about:
            imgui.open_popup(tour.ABOUT)
            self._opens_about = False
        draw_help(self.ui)
        tour.draw_about(self.ui)


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
    for title in (
        console.TITLE,
        assets_panel.TITLE,
        timeline.TITLE,
        profiler.TITLE,
        plots.TITLE,
        diagnostics.TITLE,
        topics.TITLE,
        plan.TITLE,
        history_list.TITLE,
        changes.TITLE,
    ):
        builder.dock_builder_dock_window(title, lower.id_at_dir)
    builder.dock_builder_dock_window(viewport.TITLE, lower.id_at_opposite_dir)
    builder.dock_builder_finish(dock)

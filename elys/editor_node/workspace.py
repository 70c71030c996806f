"""All panels together: the menu, the docking layout and its default, and which panels are open."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

from imgui_bundle import imgui

from elys.editor_node.docking import Docking
from elys.editor_node.instruments import Instruments
from elys.editor_node.language import tr, tr_label
from elys.editor_node.palette import PaletteEntry
from elys.editor_node.panels import (
    changes,
    console,
    diagnostics,
    history_list,
    inspector,
    keys_help,
    plan,
    plots,
    profiler,
    timeline,
    topics,
    tour,
)
from elys.editor_node.panels.assets import AssetsPanel
from elys.editor_node.panels.command_palette import CommandPalette
from elys.editor_node.panels.fork_dialog import ForkDialog
from elys.editor_node.panels.ghosts import GhostsWindow
from elys.editor_node.panels.hierarchy import HierarchyPanel
from elys.editor_node.panels.hierarchy_menus import draw_add_menu
from elys.editor_node.panels.keys_help import draw_help
from elys.editor_node.panels.layout_menu import LayoutMenu
from elys.editor_node.panels.link import LinkWindow, draw_banner
from elys.editor_node.panels.main_menus import draw_edit_menu, draw_file_menu, draw_help_menu
from elys.editor_node.panels.preferences_window import PreferencesWindow
from elys.editor_node.panels.save_dialog import SaveDialog
from elys.editor_node.panels.start_page import StartPage
from elys.editor_node.panels.toolbar import StatusBar, Toolbar
from elys.editor_node.panels.viewport import ViewportPanel
from elys.editor_node.panels.viewport_menus import draw_camera_menu, draw_debug_menu, draw_show_menu
from elys.editor_node.preferences import Layout
from elys.editor_node.shortcuts import ChordCapture
from elys.editor_node.theme import icons
from elys.editor_node.ui import Ui, action_item, dim_text, with_keys
from elys.editor_node.viewports import Viewports

_TIME_MENU: Final = (
    *("time.play", "game.play", "time.step", "time.step_back", "time.start", "time.end", "time.resume"),
    *("time.previous_marker", "time.next_marker", "time.bookmark"),
    *("time.loop", "time.loop_start", "time.loop_end", "time.forget_loop", "time.keep_last"),
    *("time.fork", "time.back_to_recording"),
)
_FOCUS_FRAMES: Final = 4  # until then docked windows take their places, each new one in front


class Workspace:
    """Draws a whole frame of the editor's widgets."""

    def __init__(
        self,
        ui: Ui,
        viewports: Viewports,
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
        self.viewports = viewports
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
        self.ghosts = GhostsWindow()
        self.fork_dialog = ForkDialog()
        self.tour = tour.Tour()
        self.preferences = PreferencesWindow(capture, lambda: ui.model.request_redraw(0.0))
        self.palette = CommandPalette(ui, show_entity=self._show_entity)
        self.palette.others = self._recent_entries
        self.layouts = LayoutMenu(now=self.layout, use=self._use_layout)
        self._docking = Docking(viewports, load=load_docking)
        self._hidden: set[str] = set(ui.preferences.hidden_panels)
        self._opens_about = False
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
        self._status_bar.draw(self.ui, frame_time=self.frame_time, view_latency=self.viewports.used.stream.latency)
        if self.ui.attachments.is_attached:
            self._draw_panels()
        else:
            self.viewports.rest()
            self.start_page.draw(self.ui)
        self._draw_help()
        self.save_dialog.draw(self.ui)
        self.layouts.draw_dialog(self.ui)
        self.link.draw(self.ui)
        self.ghosts.draw(self.ui)
        self.fork_dialog.draw(self.ui)
        self.preferences.draw(self.ui)
        self.palette.draw(self.ui)
        self.ui.watches.end_frame()

    def _draw_panels(self) -> None:
        if self._docking.submit():
            self._frames_to_focus = _FOCUS_FRAMES
        self._draw_viewports()
        for name, draw in self._panels.items():
            if name not in self._hidden:
                draw(self.ui)
        if self._frames_to_focus:
            self._frames_to_focus -= 1
            # A tab comes to the front when its window has kept the focus into the next frame.
            imgui.set_window_focus(console.TITLE if self._frames_to_focus else self.viewports.first.title)
        if self._comes_to_front:
            imgui.set_window_focus(self._comes_to_front)
            self._comes_to_front = ""
        self._show_timeline_once()
        self._note_panels()
        draw_banner(self.ui, self.viewports.used.rectangle)
        self.tour.draw(self.ui)

    def _note_panels(self) -> None:
        """Where the panels came to stand, for those who point at them."""
        landmarks = self.ui.landmarks
        for name in (*(panel.name for panel in self.viewports), *self._panels):
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
        return Layout(
            docking=imgui.save_ini_settings_to_memory(),
            hidden_panels=self.hidden_panels,
            viewports=tuple(panel.number for panel in self.viewports),
        )

    def _use_layout(self, layout: Layout) -> None:
        self._hidden = set(layout.hidden_panels)
        self._docking.load(layout.docking)
        self.viewports.keep_open(layout.viewports)

    def show_about(self) -> None:
        """Opens the box that says what this is."""
        self._opens_about = True

    def _show_timeline_once(self) -> None:
        """Who opens a replay wants to go back and forth in it."""
        if self.ui.model.is_replay and not self._has_shown_timeline and not self._frames_to_focus:
            self._has_shown_timeline = True
            imgui.set_window_focus(timeline.TITLE)

    def reset_layout(self) -> None:
        """All panels back to where they were at first, with one viewport."""
        self.viewports.keep_open((1,))
        self._docking.reset()
        self._hidden.clear()

    def show_four_views(self) -> None:
        """In perspective, from above, from the front and from the right, with the panels around as at first."""
        self.viewports.look_four_ways()
        self._docking.reset()
        self._hidden.discard(self.viewports.first.name)

    # --- viewports -------------------------------------------------------------------------------------------------

    @property
    def may_open_viewport(self) -> bool:
        """Whether there is room for another one."""
        return self.viewports.first.name in self._hidden or self.viewports.free_number > 0

    def open_viewport(self) -> None:
        """Opens another one beside the one used last, looking as that does; the first again if it was closed."""
        if self.viewports.first.name in self._hidden:
            self.show(self.viewports.first.title)
            return
        beside = self.viewports.used
        panel = self.viewports.open(self.viewports.free_number)
        self._docking.place(panel, beside)
        self.viewports.use(panel)
        self._comes_to_front = panel.title

    @property
    def may_close_viewport(self) -> bool:
        """Whether another one stays."""
        return len(self.viewports) > 1

    def close_viewport(self, panel: ViewportPanel | None = None) -> None:
        """Closes one, the one that keys mean where none is named."""
        panel = panel or self.viewports.current
        if panel is self.viewports.first:
            self._hidden.add(panel.name)
        else:
            self.viewports.close(panel)

    def _draw_viewports(self) -> None:
        self.viewports.draw(self.ui, hides_first=self.viewports.first.name in self._hidden)
        for panel in self.viewports:
            if panel.wants_close:
                self.close_viewport(panel)

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

    def _draw_menu(self) -> None:
        if not imgui.begin_main_menu_bar():
            return
        imgui.push_font(self.ui.fonts.bold, 0.0)
        imgui.text_unformatted("ELYS")
        imgui.pop_font()
        draw_file_menu(self.ui)
        draw_edit_menu(self.ui)
        if self.ui.attachments.is_attached and imgui.begin_menu(tr_label("Add")):
            draw_add_menu(self.ui, parent=0)
            imgui.end_menu()
        if imgui.begin_menu(tr_label("Time")):
            for name in _TIME_MENU:
                action_item(self.ui, name)
            imgui.end_menu()
        self._draw_view_menu()
        draw_help_menu(self.ui)
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

    def _draw_view_menu(self) -> None:
        if not imgui.begin_menu(tr_label("View")):
            self.ui.landmarks.note("menu/view")
            return
        action_item(self.ui, "view.new_viewport")
        action_item(self.ui, "view.close_viewport")
        imgui.separator()
        for name in (self.viewports.first.name, *self._panels):
            pressed, _ = imgui.menu_item(tr_label(name), "", name not in self._hidden)
            self.ui.landmarks.note(f"panel item/{name}")
            if pressed:
                self._hidden ^= {name}
        imgui.separator()
        action_item(self.ui, "view.grid")
        draw_camera_menu(self.ui)
        draw_show_menu(self.ui)
        draw_debug_menu(self.ui)
        action_item(self.ui, "view.ghost")
        action_item(self.ui, "view.ghosts")
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

"""The editor's actions and the keys they have at first: the one list that menus, keys and the palette show."""

from __future__ import annotations

from collections.abc import Callable
from typing import get_args

from elys.editor_node.actions import Action, Actions
from elys.editor_node.camera_views import CameraViews
from elys.editor_node.game_layer import GameLayer
from elys.editor_node.language import LANGUAGES
from elys.editor_node.model import EditorModel
from elys.editor_node.other_run_actions import other_run_actions
from elys.editor_node.panels import changes, history_list
from elys.editor_node.panels.assets import AssetsPanel
from elys.editor_node.panels.inspector import InspectorPanel
from elys.editor_node.panels.preferences_window import change_font_scale, change_language
from elys.editor_node.preferences import Theme
from elys.editor_node.tool_actions import tool_actions
from elys.editor_node.tree_actions import tree_actions
from elys.editor_node.ui import Ui
from elys.editor_node.viewport_actions import camera_actions, game_actions, look_actions
from elys.editor_node.viewport_layer import ViewportLayer
from elys.editor_node.workspace import Workspace


def add_actions(
    actions: Actions,
    ui: Ui,
    workspace: Workspace,
    viewport: ViewportLayer,
    camera_views: CameraViews,
    game: GameLayer,
) -> None:
    """Fills `actions` with all there is."""
    actions.add(
        *_file_actions(ui, workspace),
        *_edit_actions(ui, workspace),
        *_inspector_actions(ui, workspace.inspector),
        *_asset_actions(workspace.assets),
        *tree_actions(ui, workspace.hierarchy),
        *_time_actions(ui.model),
        *other_run_actions(ui, workspace.ghosts, workspace.fork_dialog),
        *game_actions(game),
        *tool_actions(ui.tools),
        *_view_actions(ui, workspace, viewport),
        *camera_actions(camera_views),
        *look_actions(lambda: workspace.viewports.current.look),
        *_instrument_actions(ui, workspace),
    )


def _file_actions(ui: Ui, workspace: Workspace) -> tuple[Action, ...]:
    dialog = workspace.save_dialog

    def has_file() -> bool:
        return ui.model.file.path is not None and not ui.model.is_replay

    return (
        Action(
            name="file.open",
            label="Open...",
            keys=("Ctrl+O",),
            run=lambda: dialog.ask_which(ui),
            is_possible=lambda: not ui.model.is_replay,
        ),
        Action(name="file.save", label="Save", keys=("Ctrl+S",), run=lambda: dialog.save(ui)),
        Action(name="file.save_as", label="Save as...", keys=("Ctrl+Shift+S",), run=lambda: dialog.ask_where(ui)),
        Action(
            name="file.connect",
            label="Connect to...",
            keys=("Ctrl+Shift+O",),
            run=workspace.link.ask_endpoint,
            needs_session=False,
        ),
        Action(name="file.detach", label="Disconnect", run=ui.attachments.detach),
        Action(
            name="file.retry",
            label="Connect again",
            run=ui.attachments.retry,
            is_possible=lambda: ui.attachments.lost_for is not None,
        ),
        Action(
            name="file.preferences",
            label="Preferences...",
            keys=("Ctrl+,",),
            run=lambda: setattr(workspace.preferences, "is_open", not workspace.preferences.is_open),
            needs_session=False,
        ),
        Action(
            name="file.save_running",
            label="Save the running state as...",
            run=lambda: dialog.ask_where(ui, running=True),
        ),
        Action(name="file.revert", label="Revert to the file", run=lambda: dialog.revert(ui), is_possible=has_file),
        Action(
            name="file.changes",
            label="What changed since the file",
            run=lambda: workspace.show(changes.TITLE),
            is_possible=has_file,
        ),
        Action(name="file.quit", label="Quit", keys=("Ctrl+Q",), run=workspace.ask_to_close, needs_session=False),
    )


def _edit_actions(ui: Ui, workspace: Workspace) -> tuple[Action, ...]:
    model = ui.model
    history, selection = model.history, model.selection

    def any_selected() -> bool:
        return len(selection) > 0

    def rename() -> None:
        workspace.hierarchy.start_renaming(ui, selection.primary)

    def select_all() -> None:
        rows = workspace.hierarchy.rows(ui)
        selection.replace(e for e in rows.entities if not rows.is_filtered or e in rows.found)

    def may_undo() -> bool:
        return bool(history.undo_label) or history.is_busy

    def may_redo() -> bool:
        return bool(history.redo_label) or history.is_busy

    return (
        Action(name="edit.undo", label="Undo", keys=("Ctrl+Z",), run=model.undo, is_possible=may_undo, repeats=True),
        Action(
            name="edit.redo",
            label="Redo",
            keys=("Ctrl+Y", "Ctrl+Shift+Z"),
            run=model.redo,
            is_possible=may_redo,
            repeats=True,
        ),
        Action(name="edit.history", label="History", run=lambda: workspace.show(history_list.TITLE)),
        Action(
            name="edit.duplicate",
            label="Duplicate",
            keys=("Ctrl+D",),
            run=model.edit.duplicate,
            is_possible=any_selected,
        ),
        Action(name="edit.rename", label="Rename", keys=("F2",), run=rename, is_possible=any_selected),
        Action(name="edit.delete", label="Delete", keys=("Delete",), run=model.edit.delete, is_possible=any_selected),
        Action(
            name="edit.drop",
            label="Drop to the ground",
            keys=("Ctrl+End",),
            run=lambda: model.edit.drop(selection),
            is_possible=any_selected,
        ),
        Action(name="edit.select_all", label="Select all", keys=("Ctrl+A",), run=select_all),
        Action(name="edit.select_nothing", label="Select nothing", keys=("Escape",), run=selection.clear),
    )


def _inspector_actions(ui: Ui, panel: InspectorPanel) -> tuple[Action, ...]:
    model = ui.model

    def is_editable() -> bool:
        return len(model.selection) > 0 and not model.is_replay

    return (
        Action(name="inspector.search", label="Find a field", keys=("Ctrl+Shift+F",), run=panel.search),
        Action(name="inspector.add_component", label="Add component", run=panel.add_component, is_possible=is_editable),
        Action(name="inspector.fold_all", label="Fold all components", run=lambda: panel.fold_all(ui, True)),
        Action(name="inspector.unfold_all", label="Unfold all components", run=lambda: panel.fold_all(ui, False)),
        Action(
            name="inspector.revert_all",
            label="Revert to the prefab",
            run=lambda: panel.revert_all(ui),
            is_possible=is_editable,
        ),
    )


def _asset_actions(panel: AssetsPanel) -> tuple[Action, ...]:
    library = panel.library
    return (
        Action(name="assets.search", label="Find an asset", keys=("Ctrl+Shift+A",), run=panel.search),
        Action(name="assets.import", label="Import files...", keys=("Ctrl+Shift+I",), run=panel.dialogs.ask_import),
        Action(name="assets.folder", label="Choose the folder of assets...", run=panel.dialogs.ask_folder),
        Action(
            name="assets.missing",
            label="Missing assets",
            run=panel.toggle_missing,
            is_on=lambda: panel.shows_missing,
        ),
        Action(
            name="assets.follow",
            label="Follow assets that change on disk",
            run=lambda: setattr(library, "reloads", not library.reloads),
            is_on=lambda: library.reloads,
        ),
    )


def _time_actions(model: EditorModel) -> tuple[Action, ...]:
    line = model.timeline

    def can_wind() -> bool:
        return line.can_wind

    def wind(name: str, label: str, key: str, run: Callable[[], object], *, repeats: bool = False) -> Action:
        keys = (key,) if key else ()
        return Action(name=f"time.{name}", label=label, keys=keys, run=run, is_possible=can_wind, repeats=repeats)

    return (
        Action(name="time.play", label="Play or pause", keys=("Space",), run=model.toggle_playing),
        Action(name="time.step", label="One tick on", keys=(".",), run=model.step, repeats=True),
        wind("step_back", "One tick back", ",", lambda: model.step(-1), repeats=True),
        wind("start", "To the oldest kept", "Shift+,", line.go_to_start),
        wind("end", "To the newest", "Shift+.", line.go_to_end),
        Action(
            name="time.resume",
            label="Go on from here",
            run=line.go_on_from_here,
            is_possible=lambda: line.is_rewound,
        ),
        wind("previous_marker", "To the marker before", "Alt+,", lambda: line.go_to_next(-1)),
        wind("next_marker", "To the next marker", "Alt+.", lambda: line.go_to_next(1)),
        wind("bookmark", "Bookmark this instant", "Ctrl+B", line.add_bookmark),
        Action(name="time.loop", label="Loop", keys=("L",), run=line.toggle_loop, is_on=lambda: line.loops),
        wind("loop_start", "Loop from here", "[", line.set_loop_start),
        wind("loop_end", "Loop up to here", "]", line.set_loop_end),
        Action(
            name="time.forget_loop",
            label="Forget the loop",
            run=line.forget_loop,
            is_possible=lambda: line.loop_start is not None or line.loop_end is not None,
        ),
        wind("show_all", "Show the whole timeline", "", line.show_all),
        Action(
            name="time.keep_last",
            label="Write the last seconds down",
            keys=("Ctrl+Shift+K",),
            run=line.keep_last,
            is_possible=lambda: line.is_live,
        ),
    )


def _view_actions(ui: Ui, workspace: Workspace, viewport: ViewportLayer) -> tuple[Action, ...]:
    return (
        Action(name="view.frame", label="Look at the selection", keys=("F",), run=viewport.frame_selection),
        Action(
            name="view.new_viewport",
            label="New viewport",
            keys=("Ctrl+Shift+V",),
            run=workspace.open_viewport,
            is_possible=lambda: workspace.may_open_viewport,
        ),
        Action(
            name="view.close_viewport",
            label="Close this viewport",
            run=workspace.close_viewport,
            is_possible=lambda: workspace.may_close_viewport,
        ),
        Action(name="view.four_views", label="Four views", run=workspace.show_four_views),
        Action(name="view.reset_layout", label="Reset layout", run=workspace.reset_layout),
        Action(name="view.save_layout", label="Save layout as...", run=workspace.layouts.ask_name),
        Action(
            name="view.link",
            label="Connection",
            run=lambda: setattr(workspace.link, "is_open", not workspace.link.is_open),
            is_on=lambda: workspace.link.is_open,
        ),
        *_look_actions(ui, workspace),
    )


def _look_actions(ui: Ui, workspace: Workspace) -> tuple[Action, ...]:
    """What can be done without a session as well: how the editor looks and what it says of itself."""
    preferences = ui.preferences

    def use(theme: Theme) -> Action:
        return Action(
            name=f"view.{theme}_theme",
            label=f"{theme.capitalize()} theme",
            run=lambda: setattr(preferences, "theme", theme),
            is_on=lambda: preferences.theme == theme,
            needs_session=False,
        )

    def speak(code: str, name: str) -> Action:
        return Action(
            name=f"view.language_{code}",
            label=name,
            run=lambda: change_language(preferences, code),
            is_on=lambda: preferences.language == code,
            needs_session=False,
        )

    def size(name: str, label: str, direction: int, *keys: str) -> Action:
        return Action(
            name=f"view.{name}",
            label=label,
            keys=keys,
            run=lambda: change_font_scale(preferences, direction),
            needs_session=False,
            repeats=True,
        )

    return (
        Action(
            name="view.palette", label="Find and do", keys=("Ctrl+P",), run=workspace.palette.open, needs_session=False
        ),
        *(use(theme) for theme in get_args(Theme)),
        *(speak(code, name) for code, name in LANGUAGES.items()),
        size("larger_text", "Larger text", 1, "Ctrl+="),
        size("smaller_text", "Smaller text", -1, "Ctrl+-"),
        size("normal_text", "Text as large as at first", 0, "Ctrl+0"),
        Action(name="help.keys", label="Keys and mouse", keys=("F1",), run=workspace.show_help, needs_session=False),
        Action(name="help.tour", label="Tour", run=workspace.tour.start),
        Action(name="help.about", label="About ELYS", run=workspace.show_about, needs_session=False),
    )


def _instrument_actions(ui: Ui, workspace: Workspace) -> tuple[Action, ...]:
    """What the lower panels can do."""
    console, plots, profiler = workspace.console, workspace.plots, workspace.profiler

    def has_track() -> bool:
        return profiler.track is not None

    def has_series() -> bool:
        return plots.has_series

    return (
        Action(
            name="console.newest",
            label="Follow the newest line",
            run=console.toggle_following,
            is_on=lambda: console.follows,
        ),
        Action(name="console.clear", label="Clear the console", run=ui.model.console.clear),
        Action(
            name="profiler.hold_worst",
            label="Hold the worst tick of the last minute",
            run=profiler.hold_worst,
            is_possible=has_track,
        ),
        Action(
            name="profiler.release", label="Show the newest tick again", run=profiler.release, is_possible=has_track
        ),
        Action(name="plots.add", label="Plot a field...", run=workspace.ask_field_to_plot),
        Action(
            name="plots.pause",
            label="Stop reading plots",
            run=plots.toggle_pause,
            is_on=lambda: plots.is_paused,
            is_possible=has_series,
        ),
        Action(
            name="plots.export_csv",
            label="Export plots as numbers",
            run=lambda: plots.export_csv(ui),
            is_possible=has_series,
        ),
        Action(
            name="plots.export_png",
            label="Export plots as a picture",
            run=lambda: plots.export_picture(ui),
            is_possible=has_series,
        ),
    )

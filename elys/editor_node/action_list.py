"""The editor's actions and the keys they have at first: the one list that menus, keys and the palette show."""

from __future__ import annotations

from typing import get_args

from elys.bus.messages.views import Shows
from elys.editor_node.actions import Action, Actions
from elys.editor_node.model import EditorModel
from elys.editor_node.tree_actions import tree_actions
from elys.editor_node.ui import Tool, Tools, Ui
from elys.editor_node.viewport_layer import ViewportLayer
from elys.editor_node.workspace import Workspace


def add_actions(actions: Actions, ui: Ui, workspace: Workspace, viewport: ViewportLayer) -> None:
    """Fills `actions` with all there is."""
    actions.add(
        *_file_actions(ui, workspace),
        *_edit_actions(ui, workspace),
        *tree_actions(ui, workspace.hierarchy),
        *_time_actions(ui.model),
        *_tool_actions(ui.tools),
        *_view_actions(ui, workspace, viewport),
    )


def _file_actions(ui: Ui, workspace: Workspace) -> tuple[Action, ...]:
    dialog = workspace.save_dialog
    return (
        Action(name="file.save", label="Save", keys=("Ctrl+S",), run=lambda: dialog.save(ui)),
        Action(name="file.save_as", label="Save as...", keys=("Ctrl+Shift+S",), run=lambda: dialog.ask_where(ui)),
        Action(name="file.quit", label="Quit", keys=("Ctrl+Q",), run=workspace.ask_to_close),
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
        Action(
            name="edit.duplicate",
            label="Duplicate",
            keys=("Ctrl+D",),
            run=model.edit.duplicate,
            is_possible=any_selected,
        ),
        Action(name="edit.rename", label="Rename", keys=("F2",), run=rename, is_possible=any_selected),
        Action(name="edit.delete", label="Delete", keys=("Delete",), run=model.edit.delete, is_possible=any_selected),
        Action(name="edit.select_all", label="Select all", keys=("Ctrl+A",), run=select_all),
        Action(name="edit.select_nothing", label="Select nothing", keys=("Escape",), run=selection.clear),
    )


def _time_actions(model: EditorModel) -> tuple[Action, ...]:
    return (
        Action(name="time.play", label="Play or pause", keys=("Space",), run=model.toggle_playing),
        Action(name="time.step", label="One tick on", keys=(".",), run=model.step, repeats=True),
    )


def _tool_actions(tools: Tools) -> tuple[Action, ...]:
    def take(tool: Tool, label: str, key: str) -> Action:
        return Action(
            name=f"tool.{tool}",
            label=label,
            keys=(key,),
            run=lambda: setattr(tools, "tool", tool),
            is_on=lambda: tools.tool == tool,
        )

    return (
        take("select", "Select", "Q"),
        take("move", "Move", "W"),
        take("rotate", "Rotate", "E"),
        take("scale", "Scale", "R"),
        Action(
            name="tool.local",
            label="Along the entity's own axes",
            run=lambda: setattr(tools, "is_local", not tools.is_local),
            is_on=lambda: tools.is_local,
        ),
    )


def _view_actions(ui: Ui, workspace: Workspace, viewport: ViewportLayer) -> tuple[Action, ...]:
    tools = ui.tools

    def show(view: Shows) -> Action:
        return Action(
            name=f"view.{view}",
            label=f"Show {view}",
            run=lambda: setattr(tools, "shows", view),
            is_on=lambda: tools.shows == view,
        )

    return (
        Action(name="view.frame", label="Look at the selection", keys=("F",), run=viewport.frame_selection),
        Action(
            name="view.grid",
            label="Grid",
            run=lambda: setattr(tools, "shows_grid", not tools.shows_grid),
            is_on=lambda: tools.shows_grid,
        ),
        *(show(view) for view in get_args(Shows)),
        Action(name="view.reset_layout", label="Reset layout", run=workspace.reset_layout),
        Action(name="help.keys", label="Keys and mouse", keys=("F1",), run=workspace.show_help),
    )

"""The lowest layer: keys that nobody above wanted."""

from __future__ import annotations

from collections.abc import Callable

from elys.editor_node.events import Event, KeyPressed, Modifiers
from elys.editor_node.keys import Key
from elys.editor_node.model import EditorModel
from elys.editor_node.ui import Tool, Tools, Ui
from elys.editor_node.viewport_layer import ViewportLayer
from elys.editor_node.workspace import Workspace


class ShortcutLayer:
    """Keys to operations."""

    def __init__(self, ui: Ui, workspace: Workspace, viewport: ViewportLayer) -> None:
        model, tools, dialog = ui.model, ui.tools, workspace.save_dialog
        self._plain: dict[int, Callable[[], object]] = {
            Key.DELETE: model.edit.delete,
            Key.F2: lambda: workspace.hierarchy.start_renaming(ui, model.selection.primary),
            Key.F: viewport.frame_selection,
            Key.Q: lambda: _take(tools, "select"),
            Key.W: lambda: _take(tools, "move"),
            Key.E: lambda: _take(tools, "rotate"),
            Key.R: lambda: _take(tools, "scale"),
            Key.SPACE: model.toggle_playing,
            Key.PERIOD: model.step,
            Key.ESCAPE: model.selection.clear,
        }
        self._with_ctrl: dict[int, Callable[[], object]] = {
            Key.Z: model.undo,
            Key.Y: model.redo,
            Key.D: model.edit.duplicate,
            Key.A: lambda: _select_all(model),
            Key.S: lambda: dialog.save(ui),
        }
        self._with_ctrl_shift: dict[int, Callable[[], object]] = {
            Key.Z: model.redo,
            Key.S: lambda: dialog.ask_where(ui),
        }

    def on_event(self, event: Event) -> bool:
        """Consumes the keys that mean something."""
        if not isinstance(event, KeyPressed):
            return False
        held = event.modifiers & (Modifiers.CTRL | Modifiers.SHIFT | Modifiers.ALT | Modifiers.SUPER)
        # On a Mac the command key does what Ctrl does elsewhere.
        held = held & ~Modifiers.SUPER | Modifiers.CTRL if held & Modifiers.SUPER else held
        bindings = {
            Modifiers.NONE: self._plain,
            Modifiers.CTRL: self._with_ctrl,
            Modifiers.CTRL | Modifiers.SHIFT: self._with_ctrl_shift,
        }.get(held, {})
        operation = bindings.get(event.key)
        repeats = event.key in (Key.Z, Key.Y, Key.PERIOD)
        if operation is None or (event.repeated and not repeats):
            return False
        operation()
        return True

    def update(self, elapsed: float) -> None:
        """Nothing moves here."""


def _take(tools: Tools, tool: Tool) -> None:
    tools.tool = tool


def _select_all(model: EditorModel) -> None:
    model.selection.replace(row.entity for row in model.scene.rows())

"""The lowest layer: keys that nobody above wanted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from elys.editor_node.events import Event, KeyPressed, Modifiers
from elys.editor_node.keys import Key
from elys.editor_node.model import EditorModel
from elys.editor_node.panels.hierarchy import HierarchyPanel
from elys.editor_node.ui import Tools, Ui
from elys.editor_node.viewport_layer import ViewportLayer

# What the help shows; the same keys are bound in `ShortcutLayer`.
SHORTCUTS: Final = (
    ("Ctrl+Z", "undo"),
    ("Ctrl+Y, Ctrl+Shift+Z", "redo"),
    ("Ctrl+D", "duplicate"),
    ("Ctrl+A", "select all"),
    ("Delete", "delete"),
    ("F2", "rename"),
    ("F", "look at the selection"),
    ("Q  W  E  R", "select, move, rotate, scale"),
    ("Space", "play or pause"),
    (".", "one tick"),
    ("Escape", "select nothing"),
    ("Alt + left button", "orbit"),
    ("middle button", "pan"),
    ("wheel", "zoom to the pointer"),
    ("right button + W A S D Q E", "fly; Shift is fast, the wheel sets the speed"),
    ("Ctrl while dragging the gizmo", "snap"),
)


class ShortcutLayer:
    """Keys to operations."""

    def __init__(self, ui: Ui, hierarchy: HierarchyPanel, viewport: ViewportLayer) -> None:
        model, tools = ui.model, ui.tools
        self._plain: dict[int, Callable[[], object]] = {
            Key.DELETE: model.edit.delete,
            Key.F2: lambda: hierarchy.start_renaming(ui, model.selection.primary),
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
        }
        self._with_ctrl_shift: dict[int, Callable[[], object]] = {Key.Z: model.redo}

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


def _take(tools: Tools, tool: str) -> None:
    tools.tool = tool  # type: ignore[assignment]


def _select_all(model: EditorModel) -> None:
    model.selection.replace(row.entity for row in model.scene.rows())

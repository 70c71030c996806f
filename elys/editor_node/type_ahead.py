"""The layer that hears names being typed while the hierarchy has the keyboard."""

from __future__ import annotations

from typing import Protocol

from elys.editor_node.events import CharacterTyped, Event, KeyPressed, Modifiers
from elys.editor_node.key_bindings import Chord, KeyBindings
from elys.editor_node.tree_walk import TreeWalk


class Focusable(Protocol):
    """A panel that may have the keyboard."""

    is_focused: bool


class TypeAheadLayer:
    """Letters that are no keys of their own begin a name (with Shift the others do, too); while one is typed all belong to it."""

    def __init__(self, walk: TreeWalk, panel: Focusable, keys: KeyBindings) -> None:
        self._walk = walk
        self._panel = panel
        self._keys = keys
        self._is_taken = False  # whether the key that is down does something else

    def on_event(self, event: Event) -> bool:
        """Consumes what belongs to a name."""
        if not self._panel.is_focused:
            return False
        match event:
            case KeyPressed(modifiers=modifiers):
                is_command = bool(modifiers & (Modifiers.CTRL | Modifiers.ALT | Modifiers.SUPER))
                chord = Chord.of(event)
                goes_on = self._walk.is_typing and not is_command and _is_printed(event)
                is_bound = chord is not None and any(a.is_possible() for a in self._keys.actions_for(chord))
                self._is_taken = is_command or (is_bound and not goes_on)
                return goes_on
            case CharacterTyped(codepoint) if not self._is_taken:
                self._walk.type(chr(codepoint))
                return True
        return False

    def update(self, elapsed: float) -> None:
        """Nothing moves here."""


def _is_printed(event: KeyPressed) -> bool:
    """Whether the key makes a character: keys beyond Latin-1 in GLFW's numbers are for commands."""
    return event.key < 256

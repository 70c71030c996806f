"""The lowest layer: keys that nobody above wanted."""

from __future__ import annotations

from elys.editor_node.actions import Actions
from elys.editor_node.events import Event, KeyPressed
from elys.editor_node.key_bindings import Chord, KeyBindings


class ShortcutLayer:
    """Keys to actions."""

    def __init__(self, actions: Actions, keys: KeyBindings) -> None:
        self._actions = actions
        self._keys = keys

    def on_event(self, event: Event) -> bool:
        """Consumes the keys that mean something."""
        if not isinstance(event, KeyPressed):
            return False
        chord = Chord.of(event)
        action = self._keys.action_for(chord) if chord is not None else None
        if action is None or (event.repeated and not action.repeats):
            return False
        self._actions.run(action.name)
        return True

    def update(self, elapsed: float) -> None:
        """Nothing moves here."""

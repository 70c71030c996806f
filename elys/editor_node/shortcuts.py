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
        claimants = self._keys.actions_for(chord) if chord is not None else []
        # A key may mean one thing in one panel and another elsewhere: whoever can do something now has it.
        action = next((claimant for claimant in claimants if claimant.is_possible()), next(iter(claimants), None))
        if action is None or (event.repeated and not action.repeats):
            return False
        self._actions.run(action.name)
        return True

    def update(self, elapsed: float) -> None:
        """Nothing moves here."""

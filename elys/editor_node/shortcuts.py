"""The lowest layer, keys that nobody above wanted; and the highest, which takes the one chord that is to be bound."""

from __future__ import annotations

from collections.abc import Callable

from elys.editor_node.actions import Actions
from elys.editor_node.events import Event, KeyPressed
from elys.editor_node.key_bindings import Chord, KeyBindings
from elys.editor_node.keys import Key


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


class ChordCapture:
    """Takes the next chord from everybody, while somebody waits for one."""

    def __init__(self) -> None:
        self._wanted_by: Callable[[Chord | None], object] | None = None

    @property
    def is_waiting(self) -> bool:
        """Whether the next chord is taken."""
        return self._wanted_by is not None

    def wait(self, callback: Callable[[Chord | None], object]) -> None:
        """Calls `callback` with the next chord that is pressed; with None for Escape, which is no chord to bind."""
        self._wanted_by = callback

    def on_event(self, event: Event) -> bool:
        """Consumes the chord; modifiers alone go on to others, who must know of them."""
        if self._wanted_by is None or not isinstance(event, KeyPressed):
            return False
        chord = Chord.of(event)
        if chord is None:
            return False
        wanted_by, self._wanted_by = self._wanted_by, None
        wanted_by(None if chord == Chord(Key.ESCAPE) else chord)
        return True

    def update(self, elapsed: float) -> None:
        """Nothing moves here."""

"""Which keys do what: chords of one key and modifiers, bound to actions, and bound anew by the person."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from elys.editor_node.actions import Action, Actions
from elys.editor_node.events import KeyPressed, Modifiers
from elys.editor_node.keys import Key

_log = logging.getLogger(__name__)

_NAMES: Final = {Key.PERIOD: ".", Key.COMMA: ",", Key.SLASH: "/", Key.MINUS: "-", Key.EQUAL: "=", Key.SEMICOLON: ";",
                 Key.APOSTROPHE: "'", Key.LEFT_BRACKET: "[", Key.RIGHT_BRACKET: "]", Key.BACKSLASH: "\\",
                 Key.GRAVE_ACCENT: "`"}  # fmt: skip
_MODIFIERS: Final = (("Ctrl", Modifiers.CTRL), ("Shift", Modifiers.SHIFT), ("Alt", Modifiers.ALT))
_HELD: Final = frozenset({Key.LEFT_SHIFT, Key.LEFT_CTRL, Key.LEFT_ALT, Key.LEFT_SUPER,
                          Key.RIGHT_SHIFT, Key.RIGHT_CTRL, Key.RIGHT_ALT, Key.RIGHT_SUPER})  # fmt: skip


def _name_of(key: Key) -> str:
    if key in _NAMES:
        return _NAMES[key]
    return key.name.removeprefix("DIGIT_").replace("_", " ").title()


_KEYS: Final = {_name_of(key).lower(): key for key in Key if key not in _HELD}


@dataclass(frozen=True, slots=True)
class Chord:
    """A key together with the modifiers that are held."""

    key: int
    modifiers: Modifiers = Modifiers.NONE

    @classmethod
    def parse(cls, text: str) -> Chord:
        """From "Ctrl+Shift+Z", in any case of letters; ValueError says what is wrong."""
        *held, key = (part.strip().lower() for part in text.replace("++", "+=").split("+"))
        modifiers = Modifiers.NONE
        for name in held:
            found = next((flag for label, flag in _MODIFIERS if label.lower() == name), None)
            if found is None:
                raise ValueError(f"{text!r}: {name!r} is no modifier (Ctrl, Shift, Alt)")
            modifiers |= found
        if key not in _KEYS:
            raise ValueError(f"{text!r}: there is no key {key!r}")
        return cls(_KEYS[key], modifiers)

    @classmethod
    def of(cls, event: KeyPressed) -> Chord | None:
        """What was pressed; None for a modifier alone and for keys without a name."""
        if event.key in _HELD or event.key not in set(Key):
            return None
        held = event.modifiers & (Modifiers.CTRL | Modifiers.SHIFT | Modifiers.ALT)
        # On a Mac the command key does what Ctrl does elsewhere.
        return cls(event.key, held | Modifiers.CTRL if event.modifiers & Modifiers.SUPER else held)

    def __str__(self) -> str:
        return "+".join([label for label, flag in _MODIFIERS if self.modifiers & flag] + [_name_of(Key(self.key))])


class KeyBindings:
    """Chords to actions. What the person chose replaces an action's own keys, all of them."""

    def __init__(self, actions: Actions, chosen: Mapping[str, Iterable[str]] | None = None) -> None:
        """`chosen` are chords by the names of actions; one that cannot be read is said in the log and left out."""
        self._actions = actions
        self._chosen: dict[str, tuple[Chord, ...]] = {}
        for name, chords in (chosen or {}).items():
            try:
                self._chosen[name] = tuple(map(Chord.parse, chords))
            except ValueError as error:
                _log.warning("the keys of %s stay as they were: %s", name, error)

    @property
    def chosen(self) -> dict[str, tuple[str, ...]]:
        """What differs from the actions' own keys, as preferences keep it."""
        return {name: tuple(map(str, chords)) for name, chords in self._chosen.items()}

    def chords_of(self, name: str) -> tuple[Chord, ...]:
        """The chords that do an action now."""
        if name in self._chosen:
            return self._chosen[name]
        return tuple(map(Chord.parse, self._actions[name].keys)) if name in self._actions else ()

    def label_of(self, name: str) -> str:
        """The first chord of an action, for menus; empty where it has none."""
        chords = self.chords_of(name)
        return str(chords[0]) if chords else ""

    def action_for(self, chord: Chord) -> Action | None:
        """What a chord does; where two actions claim it, the one that was added first."""
        return next((action for action in self._actions if chord in self.chords_of(action.name)), None)

    def actions_for(self, chord: Chord) -> list[Action]:
        """All that claim a chord, in the order in which they were added."""
        return [action for action in self._actions if chord in self.chords_of(action.name)]

    def bind(self, name: str, chord: Chord) -> str:
        """Lets `chord` alone do an action. Who had it loses it: the name of that action, or nothing."""
        owner = self.action_for(chord)
        loser = owner.name if owner is not None and owner.name != name else ""
        if loser:
            self._chosen[loser] = tuple(other for other in self.chords_of(loser) if other != chord)
        self._chosen[name] = (chord,)
        return loser

    def swap(self, name: str, chord: Chord) -> None:
        """Lets `chord` do an action; who had it takes the chord that the action had before, if it had any."""
        before = self.chords_of(name)[:1]
        loser = self.bind(name, chord)
        if loser:
            self._chosen[loser] = (*self.chords_of(loser), *(old for old in before if old != chord))

    def reset(self, name: str) -> None:
        """Gives an action its own keys back, and takes them from those who have them now."""
        self._chosen.pop(name, None)
        own = self.chords_of(name)
        for other in list(self._chosen):
            self._chosen[other] = tuple(chord for chord in self._chosen[other] if chord not in own)

    def reset_all(self) -> None:
        """Gives all actions their own keys back."""
        self._chosen.clear()

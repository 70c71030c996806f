"""What a person can do, by name. Menus, keys and the command palette all call the same actions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass


def _always() -> bool:
    return True


@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """One thing that can be done at once, without further questions than a dialog of its own."""

    name: str  # "edit.duplicate": what a file of keys calls it
    label: str  # in English, as menus and the palette show it, translated
    run: Callable[[], object]
    keys: tuple[str, ...] = ()  # chords that do it until the person chooses others, as `Chord.parse` reads them
    is_possible: Callable[[], bool] = _always
    is_on: Callable[[], bool] | None = None  # for a switch: whether it is on
    repeats: bool = False  # whether holding its key does it again and again
    needs_session: bool = True  # whether there must be a scene to do it to


class Actions:
    """All actions of an editor in the order in which they were added, by group (what stands before the name's point)."""

    def __init__(self) -> None:
        self._actions: dict[str, Action] = {}
        self.has_session: Callable[[], bool] = _always

    def __iter__(self) -> Iterator[Action]:
        return iter(self._actions.values())

    def __contains__(self, name: str) -> bool:
        return name in self._actions

    def __getitem__(self, name: str) -> Action:
        """The action of that name; KeyError for none."""
        return self._actions[name]

    def add(self, *actions: Action) -> None:
        """Makes actions known; ValueError for a name that is taken."""
        for action in actions:
            if action.name in self._actions:
                raise ValueError(f"there is an action {action.name} already")
            self._actions[action.name] = action

    def may_run(self, name: str) -> bool:
        """Whether it is possible now."""
        action = self._actions[name]
        return (self.has_session() or not action.needs_session) and action.is_possible()

    def run(self, name: str) -> bool:
        """Does it, if it is possible now; whether it was."""
        action = self._actions[name]
        if not self.may_run(name):
            return False
        action.run()
        return True

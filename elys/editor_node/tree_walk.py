"""Walking through the rows of the tree with the keyboard: up and down, in and out, to a name that is typed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from elys.bus.mirror import SceneMirror
from elys.bus.tree.rows import TreeRows
from elys.editor_node.selection import Selection

TYPE_AHEAD_PAUSE: Final = 1.0  # [s] after which a letter begins another name


class TreeWalk:
    """Moves the selection from row to row; the primary entity is where the walker stands."""

    def __init__(
        self, mirror: SceneMirror, rows: TreeRows, selection: Selection, *, clock: Callable[[], float]
    ) -> None:
        self._mirror = mirror
        self._rows = rows
        self._selection = selection
        self._clock = clock
        self._typed = ""
        self._typed_at = -TYPE_AHEAD_PAUSE

    def step(self, count: int, *, extends: bool = False) -> None:
        """`count` rows down (up if negative), as far as there are rows; `extends` selects all in between."""
        here = self._place()
        if here < 0:
            self.go_to(0 if count > 0 else len(self._rows) - 1)
            return
        self.go_to(min(max(here + count, 0), len(self._rows) - 1), extends=extends)

    def go_to(self, place: int, *, extends: bool = False) -> None:
        """To a row; negative ones count from the last."""
        if not self._rows:
            return
        entity = self._rows.entities[place]
        if extends:
            self._selection.extend(self._rows.entities, entity)
        elif self._selection.entities != (entity,):
            self._selection.replace((entity,))

    def go_in(self) -> None:
        """Opens the row, or goes to the first below it if it is open."""
        here = self._place()
        if here < 0:
            return
        row = self._rows[here]
        if row.has_children and not row.is_open:
            self._rows.set_open(row.entity, True)
        elif row.has_children:
            self.go_to(here + 1)

    def go_out(self) -> None:
        """Closes the row, or goes to its parent if there is nothing to close."""
        here = self._place()
        if here < 0:
            return
        row = self._rows[here]
        if row.is_open and not self._rows.is_filtered:
            self._rows.set_open(row.entity, False)
            return
        parent = self._mirror.entities[row.entity].parent
        if parent in self._rows:
            self._selection.replace((parent,))

    @property
    def is_typing(self) -> bool:
        """Whether a letter would go on with a name."""
        return self._clock() - self._typed_at < TYPE_AHEAD_PAUSE

    def type(self, letter: str) -> None:
        """Goes to the next row whose name begins with what is typed; the same letter again goes to the next one of it."""
        typed = self._typed if self.is_typing else ""
        letter = letter.casefold()
        self._typed_at = self._clock()
        self._typed = typed if typed and set(typed) == {letter} else typed + letter
        entities, rows = self._mirror.entities, self._rows.entities
        here = max(self._place(), 0)
        # A name that still fits stays; a new one, and the same letter again, begin behind where we are.
        start = here + (len(self._typed) == 1)
        for entity in (*rows[start:], *rows[:start]):
            if entities[entity].name.casefold().startswith(self._typed):
                if self._selection.entities != (entity,):
                    self._selection.replace((entity,))
                return

    def _place(self) -> int:
        return self._rows.place_of(self._selection.primary)

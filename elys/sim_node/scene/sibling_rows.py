"""Children in order, for thousands of changes one after the other: each costs what it moves past, in blocks and not one by one.

The tree itself is linked (see `hierarchy.py`): there the place of the 20,000th child is 20,000 steps away.
"""

from __future__ import annotations

from collections.abc import Iterable, Set
from typing import Final

from elys.sim_node.scene.hierarchy import Hierarchy

BLOCK: Final = 256  # children; a block is cut in two when it has twice as many


class SiblingRow:
    """The children of one parent."""

    def __init__(self, places: Iterable[int]) -> None:
        everyone = list(places)
        self._blocks = [everyone[first : first + BLOCK] for first in range(0, len(everyone), BLOCK)] or [[]]
        self._block_of = {place: block for block in self._blocks for place in block}
        self._count = len(everyone)

    def take(self, place: int) -> int:
        """Takes a child out; returns at which index it stood. KeyError if it is none."""
        holder = self._block_of.pop(place)
        index = number = 0
        while (block := self._blocks[number]) is not holder:
            index += len(block)
            number += 1
        within = holder.index(place)
        del holder[within]
        if not holder and len(self._blocks) > 1:
            del self._blocks[number]
        self._count -= 1
        return index + within

    def put(self, place: int, index: int = -1) -> int:
        """Puts a child at an index (-1 or beyond the end: last); returns that index."""
        index = self._count if index < 0 else min(index, self._count)
        self._count += 1
        if index == self._count - 1:
            number, within = len(self._blocks) - 1, len(self._blocks[-1])
        else:
            number, within = 0, index
            while within > len(self._blocks[number]):
                within -= len(self._blocks[number])
                number += 1
        block = self._blocks[number]
        block.insert(within, place)
        self._block_of[place] = block
        if len(block) > 2 * BLOCK:
            self._cut(number)
        return index

    def places(self) -> list[int]:
        """All children in order."""
        return [place for block in self._blocks for place in block]

    def _cut(self, number: int) -> None:
        block = self._blocks[number]
        later = block[BLOCK:]
        del block[BLOCK:]
        self._blocks.insert(number + 1, later)
        self._block_of.update(dict.fromkeys(later, later))


class SiblingRows:
    """The children of those parents of a hierarchy that are asked for, until `write` makes the tree what the rows are."""

    def __init__(self, hierarchy: Hierarchy) -> None:
        self._hierarchy = hierarchy
        self._rows: dict[int, SiblingRow] = {}

    def of(self, parent: int, *, without: Set[int] = frozenset()) -> SiblingRow:
        """The children of the entity at a place, when they are first asked for without some."""
        row = self._rows.get(parent)
        if row is None:
            children = self._hierarchy.children_in_order(parent)
            row = self._rows[parent] = SiblingRow(place for place in children if place not in without)
        return row

    def write(self) -> None:
        """Orders the children in the tree as they stand here."""
        self._hierarchy.arrange({parent: row.places() for parent, row in self._rows.items()})

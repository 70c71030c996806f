"""What a viewer has of the bodies: for each the last that it was told, in steps, of which frame and of when.

The receiver keeps one, and copies it whenever it acknowledges; the sender works the same out from acknowledgements. Told rows
can be merged in any order: of each body the one of the latest frame stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.state_packing.bodies import rows_before
from elys.bus.state_packing.compact import Codes, no_codes


class Tail(NamedTuple):
    """What is animated, as it stands at the end of a state frame, and the frame that told it."""

    number: int
    data: bytes


NO_TAIL = Tail(0, b"")


@dataclass(frozen=True, slots=True)
class Told:
    """What one frame told: rows of its table, all of one time."""

    number: int
    table: int
    entities: NDArray[np.uint32]  # [N] the table
    rows: NDArray[np.intp]  # [n] in it
    codes: Codes  # n of them
    time: float  # [s] of simulation
    tail: Tail

    def moved_to(self, table: int, entities: NDArray[np.uint32]) -> Told:
        """The same for another table; who is not in it is left out."""
        places, is_there = rows_before(self.codes.entity, entities)
        kept = np.flatnonzero(is_there)
        return Told(self.number, table, entities, places[kept], self.codes.rows(kept), self.time, self.tail)


class Held:
    """Rows of N bodies in the order of a table. `number` is 0 where nothing was told yet."""

    __slots__ = ("codes", "number", "table", "tail", "time")

    def __init__(
        self,
        table: int,
        codes: Codes,
        number: NDArray[np.uint32],
        time: NDArray[np.float64],
        tail: Tail = NO_TAIL,
    ) -> None:
        self.table = table
        self.codes = codes
        self.number = number  # [N]
        self.time = time  # [N] s
        self.tail = tail

    @classmethod
    def nothing(cls, table: int, entities: NDArray[np.uint32]) -> Held:
        """Nothing of any of them."""
        count = len(entities)
        return cls(table, no_codes(count, entities), np.zeros(count, np.uint32), np.zeros(count))

    @property
    def entities(self) -> NDArray[np.uint32]:
        """[N] the table."""
        return self.codes.entity

    @property
    def is_known(self) -> NDArray[np.bool_]:
        """[N] whether anything was told."""
        return self.number > 0

    @property
    def size(self) -> int:
        """Bytes that it takes."""
        return self.number.nbytes + self.time.nbytes + len(self.tail.data) + sum(c.nbytes for c in self.codes)

    def copy(self) -> Held:
        """One that changes for itself."""
        columns = [column.copy() for column in self.codes[:5]]
        codes = Codes._make((*columns, self.codes.entity))
        return Held(self.table, codes, self.number.copy(), self.time.copy(), self.tail)

    def moved_to(self, table: int, entities: NDArray[np.uint32]) -> Held:
        """The same in the order of another table: who is not in it is forgotten, who is new is not known. A copy."""
        if table == self.table:
            return self.copy()
        moved = Held.nothing(table, entities)
        moved.tail = self.tail
        places, was_there = rows_before(entities, self.entities)
        kept = np.flatnonzero(was_there)
        if len(kept):
            moved.put(kept, self.codes.rows(places[kept]), self.number[places[kept]], self.time[places[kept]])
        return moved

    def merge(self, told: Told) -> None:
        """Takes what a frame of the same table told, as far as nothing later is here."""
        assert told.table == self.table
        is_newer = self.number[told.rows] < told.number
        if is_newer.all():
            self.put(told.rows, told.codes, told.number, told.time)
        elif is_newer.any():
            newer = np.flatnonzero(is_newer)
            self.put(told.rows[newer], told.codes.rows(newer), told.number, told.time)
        if told.tail.number > self.tail.number:
            self.tail = told.tail

    def put(
        self,
        rows: NDArray[np.intp],
        codes: Codes,
        number: int | NDArray[np.uint32],
        time: float | NDArray[np.float64],
    ) -> None:
        """Writes rows."""
        columns: Any = zip(self.codes[:5], codes[:5], strict=True)
        for column, new in columns:
            column[..., rows] = new
        self.number[rows] = number
        self.time[rows] = time

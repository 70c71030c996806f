"""The storage of one component: packed columns, a row for each entity that has it.

    entity -> row    row_of[index of the entity], -1 where it has not the component
    row -> entity    entities[row]

Rows are packed: a removed row is filled with the last one, so a column is one piece of memory that a kernel can run over.
Columns are replaced when they grow: take them anew after structural changes and keep none.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.components import ComponentDeclaration
from elys.common.components.columns import Column, column_of
from elys.common.errors import ComponentError
from elys.sim_node.ecs.entities import Entities, Indices, grown, indices_of

NO_ROW: Final = -1
_INITIAL_ROWS: Final = 16
_FEW: Final = 8  # up to so many removed rows are filled one by one; more are closed up in one pass


class ComponentTable:
    """All values of one component.

    Attributes:
        declaration: of the component.
        count: how many entities have it.
        row_of: [entity capacity] int32, the row of the entity at each place, -1 for none.
        structure_version: rises when an entity gains or loses the component, and so when rows move.
    """

    def __init__(self, declaration: ComponentDeclaration, entity_capacity: int) -> None:
        self.declaration = declaration
        self.count = 0
        self.row_of = np.full(entity_capacity, NO_ROW, np.int32)
        self.structure_version = 0
        self._entities: Entities = np.zeros(_INITIAL_ROWS, np.uint32)
        self._columns: dict[str, Column] = {field.name: column_of(field, _INITIAL_ROWS) for field in declaration.fields}

    @property
    def entities(self) -> Entities:
        """[count] the entity of each row: a view."""
        return self._entities[: self.count]

    def column(self, field: str) -> Column:
        """[count] or [count, width]: a view to read and write; ComponentError if there is no such field."""
        return self.whole_column(field)[: self.count]

    def whole_column(self, field: str) -> Column:
        """`column` with the spare rows behind it, for kernels that find rows through `row_of`."""
        try:
            return self._columns[field]
        except KeyError:
            self.declaration.field(field)  # says which fields there are
            raise

    def columns(self) -> dict[str, Column]:
        """All columns by field: views."""
        return {name: column[: self.count] for name, column in self._columns.items()}

    def rows(self, entities: Entities) -> NDArray[np.int32]:
        """The rows of [N] living entities, -1 where one has not the component."""
        return self.row_of[indices_of(entities)]

    def reserve_entities(self, capacity: int) -> None:
        """Makes room for that many entities in the world."""
        if capacity > len(self.row_of):
            self.row_of = grown(self.row_of, capacity, fill=NO_ROW)

    def insert(self, entities: Entities, columns: Mapping[str, Any]) -> None:
        """Appends a row for each of [N] entities that have none; `columns` has [N] stored values, or one, for every field."""
        first, self.count = self.count, self.count + len(entities)
        self._reserve_rows(self.count)
        self._entities[first : self.count] = entities
        self.row_of[indices_of(entities)] = np.arange(first, self.count, dtype=np.int32)
        for name, column in self._columns.items():
            column[first : self.count] = columns[name]
        self.structure_version += 1

    def write(self, row: int, values: Mapping[str, Any]) -> None:
        """Stores one value for each of the fields named."""
        for name, value in values.items():
            self._columns[name][row] = value

    def read(self, row: int) -> dict[str, Any]:
        """The stored value of every field, as numpy has it."""
        return {name: column[row] for name, column in self._columns.items()}

    def remove(self, indices: Indices) -> None:
        """Drops the rows of those entities at [N] places that have one."""
        rows = self.row_of[indices]
        rows = rows[rows != NO_ROW]
        if not rows.size:
            return
        self.row_of[indices] = NO_ROW
        if rows.size <= _FEW:
            for row in np.sort(rows)[::-1].tolist():  # from the back, so that the last row is never one to be dropped
                self._fill_with_last(row)
        else:
            self._close_up(rows)
        self.structure_version += 1

    def clear(self) -> None:
        """Drops all rows."""
        self.row_of.fill(NO_ROW)
        self.count = 0
        self.structure_version += 1

    def _fill_with_last(self, row: int) -> None:
        self.count -= 1
        if row == self.count:
            return
        for column in self._columns.values():
            column[row] = column[self.count]
        moved = self._entities[self.count]
        self._entities[row] = moved
        self.row_of[indices_of(moved)] = row

    def _close_up(self, rows: NDArray[np.int32]) -> None:
        kept = np.ones(self.count, np.bool_)
        kept[rows] = False
        remaining = self.count - len(rows)
        for column in (self._entities, *self._columns.values()):
            column[:remaining] = column[: self.count][kept]
        self.count = remaining
        self.row_of[indices_of(self.entities)] = np.arange(remaining, dtype=np.int32)

    def _reserve_rows(self, needed: int) -> None:
        capacity = len(self._entities)
        if needed <= capacity:
            return
        capacity = max(2 * capacity, needed)
        self._entities = grown(self._entities, capacity)
        self._columns = {name: grown(column, capacity) for name, column in self._columns.items()}


def require_row(table: ComponentTable, index: int, owner: str) -> int:
    """The row of the entity at a place; ComponentError, naming `owner`, if it has none."""
    row = int(table.row_of[index])
    if row == NO_ROW:
        raise ComponentError(f"{owner} has no {table.declaration.name}; add one first")
    return row

"""Which entities have what a system wants, kept until components come or go.

A query's signature is the set of components an entity must have, and those it must not. Its entities stand in the order of
their places in the tables: the order in which systems, and so the solver, see them does not depend on the order of edits.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from elys.common.components import Component
from elys.common.components.columns import Column
from elys.common.errors import ComponentError
from elys.sim_node.ecs.columns import NO_ROW, ComponentTable
from elys.sim_node.ecs.entities import Entities, Indices, indices_of
from elys.sim_node.scene.hierarchy import Hierarchy


class Query:
    """The entities that match a signature, and where their components stand."""

    def __init__(
        self,
        hierarchy: Hierarchy,
        required: Sequence[ComponentTable],
        *,
        excluded: Sequence[ComponentTable] = (),
        enabled_only: bool = False,
    ) -> None:
        if not required:
            raise ComponentError("a query needs at least one component to look for")
        self._hierarchy = hierarchy
        self._required = tuple(required)
        self._excluded = tuple(excluded)
        self._enabled_only = enabled_only
        self._seen: tuple[int, ...] = ()
        self._version = 0
        self._indices: Indices = np.zeros(0, np.intp)
        self._entities: Entities = np.zeros(0, np.uint32)
        self._rows: dict[str, NDArray[np.int32]] = {}

    @property
    def version(self) -> int:
        """Rises when entities may have come to match or ceased to: what was derived from the query is stale then."""
        self._refresh()
        return self._version

    @property
    def entities(self) -> Entities:
        """[N] the matching entities, by place; read-only."""
        self._refresh()
        return self._entities

    @property
    def indices(self) -> Indices:
        """[N] their places in the tables, rising; read-only."""
        self._refresh()
        return self._indices

    def __len__(self) -> int:
        return len(self.entities)

    def rows(self, component: type[Component]) -> NDArray[np.int32]:
        """[N] the rows of one of the required components; read-only."""
        self._refresh()
        try:
            return self._rows[component.__name__]
        except KeyError:
            wanted = ", ".join(self._rows)
            raise ComponentError(f"the query looks for {wanted}, so it has no rows of {component.__name__}") from None

    def values(self, component: type[Component], field: str) -> Column:
        """[N] or [N, width]: a copy of one field of the matching entities."""
        rows = self.rows(component)
        return self._table(component).column(field)[rows]

    def write(self, component: type[Component], field: str, values: Column) -> None:
        """Writes [N] or [N, width] values into one field of the matching entities, without logging changes."""
        rows = self.rows(component)
        self._table(component).column(field)[rows] = values

    def _table(self, component: type[Component]) -> ComponentTable:
        return next(table for table in self._required if table.declaration.name == component.__name__)

    def _refresh(self) -> None:
        tables = (*self._required, *self._excluded)
        seen = tuple(table.structure_version for table in tables)
        if self._enabled_only:
            seen = (*seen, self._hierarchy.enabled_version)
        if seen == self._seen:
            return
        self._seen = seen
        self._version += 1
        self._match()

    def _match(self) -> None:
        rarest = min(self._required, key=lambda table: table.count)
        candidates = np.sort(indices_of(rarest.entities))
        matching = np.ones(len(candidates), np.bool_)
        for table in self._required:
            matching &= table.row_of[candidates] != NO_ROW
        for table in self._excluded:
            matching &= table.row_of[candidates] == NO_ROW
        if self._enabled_only:
            matching &= self._hierarchy.enabled_in_hierarchy[candidates]
        self._indices = _read_only(candidates[matching])
        self._rows = {table.declaration.name: _read_only(table.row_of[self._indices]) for table in self._required}
        rows = self._rows[rarest.declaration.name]
        self._entities = _read_only(rarest.entities[rows])


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    array.setflags(write=False)
    return array

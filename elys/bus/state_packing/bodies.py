"""The bodies of a state frame as columns for packing, one coordinate after the other, and their rows against a frame before."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import HEADER

_POSITION, _ROTATION, _LINEAR, _ANGULAR = 24, 40, 52, 64  # [bytes] of a row's columns so far
Rows = NDArray[np.intp] | slice


class Bodies(NamedTuple):
    """Columns of N bodies. `change` is what a difference found the linear velocity to have changed by; None: by nothing."""

    position: NDArray[np.float64]  # [3, N] m
    rotation: NDArray[np.float32]  # [4, N] x y z w
    linear: NDArray[np.float32]  # [3, N] m/s
    angular: NDArray[np.float32]  # [3, N] rad/s
    entity: NDArray[np.uint32]  # [N]
    change: NDArray[np.float32] | None = None  # [3, N] m/s

    @property
    def body_count(self) -> int:
        """N."""
        return len(self.entity)

    def rows(self, rows: Rows) -> Bodies:
        """Some of them."""
        if isinstance(rows, slice):
            return self
        return Bodies._make(None if column is None else column.take(rows, axis=-1) for column in self)

    def replaced(self, rows: Rows, told: Bodies) -> Bodies:
        """The same with other rows in these places, without `change`."""
        columns: list[Any] = [column.copy() for column in self[:4]]
        for column, told_column in zip(columns, told[:4], strict=True):
            column[:, rows] = told_column
        return Bodies._make((*columns, self.entity, None))

    def with_change(self, before: Bodies | None) -> Bodies:
        """The same with what its linear velocities have changed by since `before`, if that says anything."""
        return self if before is None else self._replace(change=self.linear - before.linear)

    def without_change(self) -> Bodies:
        """The same, as if nothing had changed since."""
        return self if self.change is None else self._replace(change=None)


def bodies_of(body: bytes | memoryview, count: int) -> Bodies:
    """The columns of a whole frame of `count` bodies, as it is on the bus."""
    start = HEADER.size

    def column(dtype: str, width: int, before: int) -> NDArray[np.generic]:
        rows = np.frombuffer(body, dtype, count * width, start + before * count).reshape(count, width)
        return np.ascontiguousarray(rows.T)

    return Bodies(
        column("<f8", 3, 0),  # type: ignore[arg-type]
        column("<f4", 4, _POSITION),  # type: ignore[arg-type]
        column("<f4", 3, _ROTATION),  # type: ignore[arg-type]
        column("<f4", 3, _LINEAR),  # type: ignore[arg-type]
        np.frombuffer(body, "<u4", count, start + _ANGULAR * count),
    )


def bytes_of(bodies: Bodies) -> list[bytes]:
    """The columns as they stand in a frame."""
    columns = [np.ascontiguousarray(column.T).tobytes() for column in bodies[:4]]
    return [*columns, bodies.entity.tobytes()]


def no_bodies(count: int, entity: NDArray[np.uint32]) -> Bodies:
    """Rows of zeros: what bodies are told against that were not there before."""
    return Bodies(
        np.zeros((3, count)),
        np.zeros((4, count), np.float32),
        np.zeros((3, count), np.float32),
        np.zeros((3, count), np.float32),
        entity,
    )


def rows_before(entity: NDArray[np.uint32], before: NDArray[np.uint32]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Where each of `entity` stood in `before`, and whether it was there at all. Of equal ones any, always the same."""
    if not len(before):
        return np.zeros(len(entity), np.intp), np.zeros(len(entity), np.bool_)
    order = np.argsort(before, kind="stable")
    place = np.minimum(np.searchsorted(before[order], entity), len(before) - 1)
    rows = order[place]
    return rows, before[rows] == entity


def aligned(before: Bodies, entity: NDArray[np.uint32]) -> Bodies:
    """Rows of `before` in the order of `entity`; zeros for those that were not there."""
    rows, was_there = rows_before(entity, before.entity)
    if not was_there.any():
        return no_bodies(len(entity), entity)
    found = before.rows(rows)
    if not was_there.all():
        for column in (*found[:4], found.change):
            if column is not None:
                column[..., ~was_there] = 0
    return found._replace(entity=entity)


def changed_rows(now: Bodies, before: Bodies) -> NDArray[np.bool_]:
    """[N] whether any bit of a row is another."""
    changed = np.zeros(now.body_count, np.bool_)
    columns: Any = zip(now[:4], before[:4], strict=True)
    for column, earlier in columns:
        width = f"u{column.itemsize}"
        for row, earlier_row in zip(column.view(width), earlier.view(width), strict=True):
            changed |= row != earlier_row
    return changed

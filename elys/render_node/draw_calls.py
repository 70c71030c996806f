"""Draw calls of a picture, and the instances that they draw lined up one behind the other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.render_node.crowd import Crowd
from elys.render_node.instances import Batch
from elys.render_node.render_world import RenderWorld
from elys.render_node.scene_tables import Rows


class DrawCall(NamedTuple):
    """A run of instances of one batch in the picture's instance buffer."""

    batch: Batch
    first: int
    instance_count: int


class RowCollector:
    """Lines up the instances of all draw calls of a picture, without those that are left out."""

    def __init__(self, world: RenderWorld, crowd: Crowd, left_out: Rows) -> None:
        self._world, self._crowd = world, crowd
        self._left_out = left_out
        self._parts: list[NDArray[np.uint32]] = []
        self._known: list[tuple[Rows, list[DrawCall]]] = []
        self._count = 0

    def add_seen(self, groups: Rows, depth: NDArray[np.float32], outside: Rows) -> list[DrawCall]:
        """Groups without those of their instances that are `outside` of the view, one call a batch. The least deep come first, by
        the `depth` of all groups: what is hidden by something drawn before is not shaded.
        """
        batch = self._crowd.batch[groups]
        order = np.argsort(depth[groups], kind="stable")
        if (batch != batch[:1]).any():
            order = order[np.argsort(batch[order], kind="stable")]
        calls = self._calls_of(groups[order], outside)
        if not len(outside):
            self._known.append((groups, calls))
        return calls

    def add_groups(self, groups: Rows) -> list[DrawCall]:
        """Ascending groups, one call a batch; those that stand there already, as of casters that are all seen, are used again."""
        for known, calls in self._known:
            if np.array_equal(known, groups):
                return calls
        calls = self._calls_of(groups[np.argsort(self._crowd.batch[groups], kind="stable")], groups[:0])
        self._known.append((groups, calls))
        return calls

    def add_rows(self, rows: Rows) -> list[DrawCall]:
        """Ascending instances, one call a batch."""
        return self._calls(self._world.instances.batch_of[rows], rows.astype(np.uint32), None)

    def add_sorted(self, rows: Rows, distance: NDArray[np.float32]) -> list[DrawCall]:
        """Instances (N,) farthest first by their distances, a call for each run of one batch."""
        return self.add_rows(rows[np.argsort(-distance, kind="stable")]) if len(rows) else []

    def all(self) -> NDArray[np.uint32]:
        """The instances of all calls in order."""
        if len(self._parts) == 1:
            return self._parts[0]
        return np.concatenate(self._parts) if self._parts else np.zeros(0, np.uint32)

    def _calls_of(self, groups: Rows, outside: Rows) -> list[DrawCall]:
        removed = outside if not len(self._left_out) else np.concatenate([self._left_out, outside])
        rows, size = self._crowd.listed_without(groups, removed)
        return self._calls(self._crowd.batch[groups], rows, size)

    def _calls(self, batch: Rows, rows: NDArray[np.uint32], size: Rows | None) -> list[DrawCall]:
        """Calls for the runs of one batch among rows that come in portions of a batch and a size; None for one row each."""
        if not len(rows):
            return []
        turns = np.flatnonzero(batch[1:] != batch[:-1]) + 1
        begins = [0, *turns.tolist()]
        starts = begins if size is None or not len(turns) else [0, *np.cumsum(size)[turns - 1].tolist()]
        calls = [
            DrawCall(self._world.batches[batch[begin]], self._count + start, stop - start)
            for begin, start, stop in zip(begins, starts, [*starts[1:], len(rows)], strict=True)
            if stop > start
        ]
        self._parts.append(rows)
        self._count += len(rows)
        return calls

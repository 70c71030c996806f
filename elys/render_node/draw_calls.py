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
        self._is_left_out: NDArray[np.bool_] | None = None
        if len(left_out):
            self._is_left_out = np.zeros(world.instance_count, np.bool_)
            self._is_left_out[left_out] = True
        self._parts: list[NDArray[np.uint32]] = []
        self._known: list[tuple[Rows, list[DrawCall]]] = []
        self._count = 0

    def add_groups(self, groups: Rows, depth: NDArray[np.float32] | None = None) -> list[DrawCall]:
        """Ascending groups, one call a batch, of which the least deep come first where the `depth` of all groups is given: what
        is hidden by something drawn before is not shaded. Groups that stand there already, as of casters that are all seen,
        are used again.
        """
        for known, calls in self._known:
            if np.array_equal(known, groups):
                return calls
        batch = self._crowd.batch[groups]
        if depth is not None:
            order = np.argsort(depth[groups], kind="stable")
            if len(groups) and batch[0] != batch[-1]:
                order = order[np.argsort(batch[order], kind="stable")]
            ordered = groups[order]
        else:
            ordered = groups[np.argsort(batch, kind="stable")]
        calls = self._calls(self._crowd.batch[ordered], self._crowd.listed(ordered), self._crowd.size[ordered])
        self._known.append((groups, calls))
        return calls

    def add_rows(self, rows: Rows) -> list[DrawCall]:
        """Ascending instances, one call a batch."""
        return self._calls(self._world.instances.batch_of[rows], rows.astype(np.uint32))

    def add_sorted(self, rows: Rows, distance: NDArray[np.float32]) -> list[DrawCall]:
        """Instances (N,) farthest first by their distances, a call for each run of one batch."""
        return self.add_rows(rows[np.argsort(-distance, kind="stable")]) if len(rows) else []

    def all(self) -> NDArray[np.uint32]:
        """The instances of all calls in order."""
        if len(self._parts) == 1:
            return self._parts[0]
        return np.concatenate(self._parts) if self._parts else np.zeros(0, np.uint32)

    def _calls(self, batch: Rows, rows: NDArray[np.uint32], size: Rows | None = None) -> list[DrawCall]:
        """Calls for the runs of one batch among rows that come in portions, one each by default, of a batch and a size."""
        if self._is_left_out is not None:
            kept = ~self._is_left_out[rows]
            batch, rows, size = (batch if size is None else np.repeat(batch, size))[kept], rows[kept], None
        if not len(rows):
            return []
        begins = np.append(0, np.flatnonzero(batch[1:] != batch[:-1]) + 1)
        ends = np.append(begins[1:], len(batch))
        if size is not None:
            reached = np.append(0, np.cumsum(size))
            starts, stops = reached[begins], reached[ends]
        else:
            starts, stops = begins, ends
        calls = [
            DrawCall(self._world.batches[number], self._count + start, stop - start)
            for number, start, stop in zip(batch[begins].tolist(), starts.tolist(), stops.tolist(), strict=True)
        ]
        self._parts.append(rows)
        self._count += len(rows)
        return calls

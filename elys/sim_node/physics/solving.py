"""The tables that the solver works in, and the room they need: nothing in them outlives a step."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.sim_node.physics.contacts import ContactStore
from elys.sim_node.physics.kernels.batch import FLOATS
from elys.sim_node.physics.kernels.colouring import KEYS, OVERFLOW
from elys.sim_node.physics.kernels.groups import MOST_CHUNKS
from elys.sim_node.physics.kernels.simd import LANES
from elys.sim_node.physics.kernels.tables import (
    BODY,
    COLLIDER,
    GROUP,
    ISLAND,
    POINTS,
    ROW,
    ROW_POINT,
    SOLVER_BODY,
    SOLVER_DRIVE,
    SPAN,
    START,
    SolverWork,
)
from elys.sim_node.physics.settings import MOST_STRENGTHS

Array = np.ndarray[Any, Any]

_LINE = 64  # bytes of a line of the cache: what straddles two costs twice


class SolverRoom:
    """Room for the bodies and contacts of one step."""

    def __init__(self) -> None:
        self._work: SolverWork | None = None
        self.island_version = 0  # how often islands were found anew
        most = 1 + MOST_STRENGTHS + MOST_CHUNKS
        self.all_groups = np.zeros(most, GROUP)
        self.present = np.zeros(most, np.int32)
        self.spans = np.zeros(most * (OVERFLOW + 1), SPAN)
        self._all_starts = np.zeros(most * KEYS + 1, np.int32)
        self.colour_counts = np.zeros(2 * most, np.int32)
        self.use_groups(1)
        self.places = np.zeros(2, BODY)
        self.inertia = np.zeros(6)
        self.shapes = np.zeros(2, COLLIDER)
        self._make_body_room(0)
        self._make_contact_room(0)
        self.make_batch_room(16)

    def work(self, contacts: ContactStore) -> SolverWork:
        """All that the contact solver works on; made anew when one of the tables was."""
        if self._work is None or self._work.manifolds is not contacts.manifolds:
            self._work = self._gathered(contacts)
        return self._work

    def _gathered(self, contacts: ContactStore) -> SolverWork:
        return SolverWork(
            self.groups,
            self.spans,
            self.held,
            self.body_a,
            self.body_b,
            self.slots,
            self.counts,
            self.batches,
            self.solver_bodies,
            self.solver,
            self.drives,
            self.drive,
            contacts.manifolds,
            contacts.flat_manifolds,
            self.rows,
            self.row_points,
        )

    def use_groups(self, count: int) -> None:
        """Has just so many groups from now on."""
        self._work = None
        self.groups = self.all_groups[:count]
        self.starts = self._all_starts[: count * KEYS + 1]

    def reserve(self, body_count: int, contact_count: int) -> bool:
        """Makes room, by doubling, for so many bodies and touching pairs.

        Returns whether anything was made anew: then contacts have to be dealt out again.
        """
        is_enough = body_count <= len(self.parent) and contact_count <= len(self.keys)
        if body_count > len(self.parent):
            self._make_body_room(max(body_count, 2 * len(self.parent)))
        if contact_count > len(self.keys):
            self._make_contact_room(max(contact_count, 2 * len(self.keys)))
        return not is_enough

    def calm(self) -> None:
        """Empties what steps worked on: what is no number would come back where lanes are empty, for nothing times it is none."""
        for table in (self.solver, self.drive, self.batches, self.rows, self.row_points):
            table[:] = np.zeros((), table.dtype)

    def _make_body_room(self, count: int) -> None:
        self._work = None
        self.parent = np.zeros(count, np.int32)
        self.islands = np.zeros(count, ISLAND)
        self.held = np.zeros(count, np.int32)
        self.group_of = np.zeros(count, np.int32)
        self.masks = np.zeros(count, np.uint64)
        self.starts_of_bodies = np.zeros(count, START)
        self.fractions = np.ones(count)
        self.last_asleep = np.zeros(count, np.int32)
        # One row more, for everything that never moves.
        self.solver_bodies = _aligned(count + 1, SOLVER_BODY)
        self.solver = self.solver_bodies.view(np.float32)
        self.drives = _aligned(count + 1, SOLVER_DRIVE)
        self.drive = self.drives.view(np.float32)

    def _make_contact_room(self, count: int) -> None:
        self._work = None
        self.keys = np.zeros(count, np.int32)
        self.order = np.zeros(count, np.int32)
        self.rows = np.zeros(count, ROW)
        self.row_points = np.zeros(count * POINTS, ROW_POINT)

    def make_batch_room(self, count: int) -> None:
        """Makes room for so many batches, and some more."""
        self._work = None
        count += count // 2
        self.body_a = np.zeros(count * LANES, np.int32)
        self.body_b = np.zeros(count * LANES, np.int32)
        self.slots = np.zeros(count * LANES, np.int32)
        self.counts = np.zeros(count, np.int32)
        self.batches = _aligned(count * FLOATS, np.dtype(np.float32))


def _aligned(count: int, dtype: np.dtype[Any]) -> Array:
    """Zeroed rows that begin on a line of the cache."""
    raw = np.zeros(count * dtype.itemsize + _LINE, np.uint8)
    start = -raw.ctypes.data % _LINE
    return raw[start : start + count * dtype.itemsize].view(dtype)

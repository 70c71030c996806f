"""Who is awake: the bodies and colliders that a step has to look at."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.colliders import ColliderTable
from elys.sim_node.physics.contacts import ContactStore
from elys.sim_node.physics.kernels.sleeping import ASLEEP, WAKING, list_awake, put_to_sleep, wake_marked
from elys.sim_node.physics.kernels.tables import Table

Array = np.ndarray[Any, Any]


class Activity:
    """Rows of awake bodies, and of their colliders with those that are new; made anew only when somebody wakes or sleeps."""

    def __init__(self, bodies: BodyTable, colliders: ColliderTable, contacts: ContactStore) -> None:
        self._bodies = bodies
        self._colliders = colliders
        self._contacts = contacts
        self.is_outdated = True  # somebody woke, slept, came or went since the lists were made
        self.version = 0  # how often they were made
        self.bodies = np.zeros(0, np.int32)
        self.body_count = 0
        self.colliders = np.zeros(0, np.int32)
        self.collider_count = 0
        self.has_fresh = False  # whether there are colliders among them of bodies that are not awake
        self.moved = np.zeros(0, np.int32)  # room for colliders with new fat boxes

    def outdate(self) -> None:
        """Something came, went, or is moved otherwise than before."""
        self.is_outdated = True
        self._contacts.is_outdated = True

    def update(self) -> None:
        """Lists anew if need be."""
        if not self.is_outdated:
            return
        self.version += 1
        bodies, colliders = self._bodies.rows, self._colliders.rows
        if len(bodies) > len(self.bodies):
            self.bodies = np.zeros(2 * len(bodies), np.int32)
        if len(colliders) > len(self.colliders):
            self.colliders = np.zeros(2 * len(colliders), np.int32)
            self.moved = np.zeros(2 * len(colliders), np.int32)
        lists = (self.bodies, self.colliders)
        self.body_count, self.collider_count, fresh = list_awake(bodies, colliders, self._colliders.proxies, *lists)
        self.is_outdated = self.has_fresh = fresh > 0  # what never moves needs its box once

    def wake(self, rows: Array) -> None:
        """Wakes bodies in rows (M,), each with its island."""
        asleep = rows[self._bodies.rows["asleep"][rows] == ASLEEP]
        if len(asleep):
            self._bodies.rows["asleep"][asleep] = WAKING
            self.wake_marked()

    def wake_touching(self, rows: Array) -> None:
        """Wakes what has a pair with bodies in rows (M,)."""
        colliders = self._colliders.rows_on(rows)
        pairs = self._contacts.live_pairs
        others = np.concatenate(
            [pairs["b"][np.isin(pairs["a"], colliders)], pairs["a"][np.isin(pairs["b"], colliders)]]
        )
        self.wake(np.unique(self._colliders.rows["body"][others]))

    def wake_all(self) -> None:
        """Wakes every body."""
        self.wake(np.flatnonzero(self._bodies.rows["asleep"] == ASLEEP))

    def wake_marked(self) -> None:
        """Wakes what a step has marked."""
        wake_marked(self._bodies.rows)
        self.outdate()

    def put_to_sleep(self, parent: Array, islands: Array, last: Array, constants: Table) -> None:
        """Puts islands to sleep that have been at rest for long enough."""
        bodies = self._bodies
        fallen = put_to_sleep(bodies.rows, bodies.poses, self.bodies, self.body_count, parent, islands, last, constants)
        if fallen:
            self.outdate()

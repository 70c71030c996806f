"""The table of bodies: who is in which row, and how a body's frame relates to its entity's.

Rows are ordered by the entity's index, whatever order bodies were added in: the order of impulses, and with it every bit of
the motion, must not depend on the order of spawning.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError
from elys.common.ids import MAX_ENTITIES
from elys.common.math import quaternion
from elys.sim_node.physics import checks
from elys.sim_node.physics.kernels.integrator import publish_poses
from elys.sim_node.physics.kernels.tables import BODY, DYNAMIC, FORCE, FRESH, KINEMATIC, POSE, STATIC, STEP_REPORT
from elys.sim_node.physics.mass_properties import SHAPELESS_RADIUS, MassProperties
from elys.sim_node.physics.rows import joined_rows, picked_rows

Array = np.ndarray[Any, Any]


class BodyTable:
    """Bodies by row. `rows` and `poses` are what kernels work on, `mass` [kg] is what was asked for."""

    def __init__(self) -> None:
        self.rows = np.zeros(0, BODY)
        self.poses = np.zeros(0, POSE)
        self.mass = np.zeros(0)
        self.inertia = np.zeros((0, 3))  # principal moments for 1 kg [m^2]
        self.given_inertia = np.zeros((0, 3))  # the same where it was asked for, along the entity's axes; else 0
        self.forces = np.zeros(0, FORCE)
        self.can_lock = False  # some body has a locked axis
        self.has_fresh = False  # some body has come since the last step
        self.report = np.zeros(1, STEP_REPORT)
        self.faulty_room = np.zeros(0, np.int32)
        self._index = np.zeros(0, np.int64)  # the entities' indices, ascending

    @property
    def entities(self) -> Array:
        """(N,) uint32."""
        return np.ascontiguousarray(self.rows["entity"])

    def rows_of(self, entities: Array) -> Array:
        """The rows of entities (M,); PhysicsError for one that has no body."""
        rows = np.searchsorted(self._index, entities & MAX_ENTITIES)
        known = rows < len(self.rows)
        known[known] = self.rows["entity"][rows[known]] == entities[known]
        if not known.all():
            raise PhysicsError(
                f"{checks.named(entities[~known][0])} has no body: add it with add_bodies, or it was removed"
            )
        return rows

    def has(self, entities: Array) -> Array:
        """Which of the entities (M,) have a body."""
        rows = np.minimum(np.searchsorted(self._index, entities & MAX_ENTITIES), max(len(self.rows) - 1, 0))
        if not len(self.rows):
            return np.zeros(len(entities), bool)
        return np.asarray(self.rows["entity"][rows] == entities)

    def add(self, entities: Array, rows: Array, mass: Array, given_inertia: Array) -> Array:
        """Inserts rows of new bodies; returns where each old row is now."""
        taken = np.isin(entities & MAX_ENTITIES, self._index)
        if taken.any():
            raise PhysicsError(
                f"{checks.named(entities[taken][0])} has a body already, or its predecessor still has: remove that first"
            )
        old_count = len(self.rows)
        index = np.concatenate([self._index, (entities & MAX_ENTITIES).astype(np.int64)])
        order = np.argsort(index, kind="stable")
        poses = np.zeros(len(entities), POSE)
        poses["axes"] = quaternion.IDENTITY
        self._index = index[order]
        self.faulty_room = np.zeros(len(order), np.int32)
        self.rows = picked_rows(joined_rows(self.rows, rows), order)
        self.poses = picked_rows(joined_rows(self.poses, poses), order)
        self.mass = np.concatenate([self.mass, mass])[order]
        self.inertia = np.concatenate([self.inertia, np.ones((len(entities), 3))])[order]
        self.given_inertia = np.concatenate([self.given_inertia, given_inertia])[order]
        self.forces = picked_rows(joined_rows(self.forces, np.zeros(len(entities), FORCE)), order)
        self._look_for_locks()
        place = np.empty(len(order), np.int64)
        place[order] = np.arange(len(order))
        self._follow_rings(place)
        return place[:old_count]

    def remove(self, removed: Array) -> Array:
        """Takes rows out; returns where each old row is now, -1 for the removed ones."""
        keep = np.ones(len(self.rows), bool)
        keep[removed] = False
        kept = np.flatnonzero(keep)
        self.rows, self.poses, self.forces = (
            picked_rows(table, kept) for table in (self.rows, self.poses, self.forces)
        )
        self.mass, self._index = self.mass[kept], self._index[kept]
        self.inertia, self.given_inertia = self.inertia[kept], self.given_inertia[kept]
        self._look_for_locks()
        place = np.where(keep, np.cumsum(keep) - 1, -1)
        self._follow_rings(place)
        return place

    def set_locked(self, rows: Array, locked: Array) -> None:
        """Locks axes of bodies in rows (M,): bits (M,) as in BODY, and nothing else."""
        self.rows["locked"][rows] = locked
        self._look_for_locks()

    def mark_fresh(self, rows: Array) -> None:
        """Has the next step look whether bodies in rows were put deep into others."""
        self.rows["told"][rows] |= FRESH
        self.has_fresh = True

    def mark_pushed(self, rows: Array) -> None:
        """Notes in bodies in rows whether anything in `forces` acts on them."""
        forces = self.forces[rows]
        self.rows["pushed"][rows] = (forces["once"] != 0.0).any(1) | (forces["lasting"] != 0.0).any(1)

    def _look_for_locks(self) -> None:
        self.can_lock = bool((self.rows["locked"] != 0).any())

    def _follow_rings(self, place: Array) -> None:
        """Sleeping islands are rings of rows, and rows have changed: `place` (old N,) says where they are."""
        asleep = self.rows["asleep"] != 0
        self.rows["next_asleep"][asleep] = place[self.rows["next_asleep"][asleep]]

    def entity_poses(self, rows: Array) -> tuple[Array, Array]:
        """Positions (M, 3) and rotations (M, 4) of the entities in rows, in float64."""
        poses = self.poses[rows]
        rotation = quaternion.multiply(self.rows["rotation"][rows], quaternion.conjugate(poses["axes"]))
        return self.rows["position"][rows] - quaternion.rotate(rotation, poses["center"]), rotation

    def place(self, rows: Array, position: Array, rotation: Array) -> None:
        """Puts the entities in rows at positions (M, 3) with rotations (M, 4)."""
        self.rows["position"][rows] = position + quaternion.rotate(rotation, self.poses["center"][rows])
        self.rows["rotation"][rows] = quaternion.multiply(rotation, self.poses["axes"][rows])

    def set_mass_properties(self, rows: Array, properties: MassProperties) -> None:
        """Moves the bodies' frames to new centres of mass and axes; the entities stay where they are."""
        position, rotation = self.entity_poses(rows)
        given = self.given_inertia[rows]
        is_given = np.asarray((given > 0.0).all(1))[:, None]
        self.poses["center"][rows] = properties.center
        self.poses["axes"][rows] = np.where(is_given, quaternion.IDENTITY, properties.axes)
        self.inertia[rows] = np.where(is_given, given, properties.inertia)
        self.place(rows, position, rotation)
        self.update_inverses(rows)

    def set_extents(self, rows: Array, of_shapes: Array, extents: Array) -> None:
        """How far the bodies in rows reach: `extents` (M,) [m] of the shapes on body rows `of_shapes` (M,)."""
        self.rows["extent"][rows] = SHAPELESS_RADIUS
        self.rows["extent"][of_shapes] = 0.0
        np.maximum.at(self.rows["extent"], of_shapes, extents)

    def update_inverses(self, rows: Array) -> None:
        """Inverse mass and inertia from mass, moments and motion: nothing for what no force moves."""
        dynamic = self.rows["motion"][rows] == DYNAMIC
        mass = self.mass[rows]
        self.rows["inverse_mass"][rows] = np.where(dynamic, 1.0 / mass, 0.0)
        moments = mass[:, None] * self.inertia[rows]
        self.rows["inverse_inertia"][rows] = np.where(dynamic[:, None], 1.0 / moments, 0.0)
        self.rows["velocity"][rows[self.rows["motion"][rows] == STATIC]] = 0.0

    def load(self, snapshot: dict[str, Array]) -> None:
        """Takes the bodies of a snapshot."""
        self.rows = checks.saved_table(snapshot, "bodies", BODY)
        self.poses = checks.saved_table(snapshot, "poses", POSE)
        self.faulty_room = np.zeros(len(self.rows), np.int32)
        self.mass = snapshot["mass"].copy()
        self.inertia = snapshot["inertia"].copy()
        self.given_inertia = snapshot["given_inertia"].copy()
        self.forces = checks.saved_table(snapshot, "forces", FORCE)
        self.has_fresh = bool((self.rows["told"] & FRESH).any())
        self._look_for_locks()
        self._index = (self.rows["entity"] & MAX_ENTITIES).astype(np.int64)

    def publish(self) -> None:
        """Brings `poses` up to date after a change from outside."""
        if len(self.rows):
            publish_poses(self.rows, self.poses)


def new_rows(
    entities: Array,
    motion: ArrayLike,
    position: ArrayLike,
    rotation: ArrayLike,
    linear_velocity: ArrayLike,
    angular_velocity: ArrayLike,
    linear_damping: ArrayLike,
    angular_damping: ArrayLike,
    gravity_scale: ArrayLike,
    locked: ArrayLike,
) -> Array:
    """Checked rows of bodies that have no mass yet; PhysicsError names the entity with a bad value."""
    rows = np.zeros(len(entities), BODY)
    rows["entity"] = entities
    rows["motion"] = checks.choice_column("motion", motion, entities, KINEMATIC + 2)
    rows["position"] = checks.number_column("position", position, entities, width=3)
    rows["rotation"] = checks.rotation_column("rotation", rotation, entities)
    rows["velocity"][:, :3] = checks.number_column("linear_velocity", linear_velocity, entities, width=3)
    rows["velocity"][:, 3:] = checks.number_column("angular_velocity", angular_velocity, entities, width=3)
    rows["linear_damping"] = checks.number_column("linear_damping", linear_damping, entities, minimum=0.0)
    rows["angular_damping"] = checks.number_column("angular_damping", angular_damping, entities, minimum=0.0)
    rows["gravity_scale"] = checks.number_column("gravity_scale", gravity_scale, entities)
    rows["locked"] = checks.switch_column("locked", locked, entities, 6)
    return rows

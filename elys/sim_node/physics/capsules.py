"""Kinematic capsules that somebody else moves: what kernels beside those of physics see of a world, and do to it.

Between `opened` and `put_back` the colliders may stand elsewhere than their bodies, for instance where those will be.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from elys.common.math import quaternion
from elys.sim_node.physics.kernels.placement import place_colliders
from elys.sim_node.physics.kernels.query_tree import refit_query_tree
from elys.sim_node.physics.kernels.tables import CAPSULE, KINEMATIC, Geometry
from elys.sim_node.physics.world import PhysicsWorld

Array = np.ndarray[Any, Any]


class SweptTables(NamedTuple):
    """Tables of bodies, their masses [kg], colliders and shapes, and the query tree over them with its stack."""

    bodies: Array
    mass: Array
    colliders: Array
    geometry: Geometry
    nodes: Array
    stack: Array


class KinematicCapsules:
    """The kinematic bodies of one world whose own collider is a capsule."""

    def __init__(self, physics: PhysicsWorld) -> None:
        self._physics = physics

    def opened(self) -> SweptTables:
        """The tables, with colliders where their bodies are and the query tree around them."""
        physics = self._physics
        bodies, colliders, tree = physics._bodies, physics._colliders, physics._query_tree
        tree.follow(bodies.rows, colliders.rows, colliders.geometry.arrays)
        return SweptTables(bodies.rows, bodies.mass, colliders.rows, colliders.geometry.arrays, tree.nodes, tree.stack)

    def follow_boxes(self) -> None:
        """The boxes of colliders have been changed: the query tree around them follows."""
        refit_query_tree(self._physics._colliders.rows["box"], self._physics._query_tree.nodes)

    def put_back(self, colliders: Array) -> None:
        """Puts colliders in rows (M,) back to where their bodies are."""
        physics = self._physics
        rows = physics._colliders.rows
        place_colliders(physics._bodies.rows, rows, colliders, len(colliders), physics._colliders.geometry.arrays)
        physics._query_tree.outdate()

    def body_rows(self, entities: Array) -> Array:
        """Body rows (N,) of entities, -1 for those that have none and for 0."""
        bodies = self._physics._bodies
        rows = np.full(len(entities), -1, np.int64)
        if entities.any():
            here = bodies.has(entities) & (entities != 0)
            rows[here] = bodies.rows_of(entities[here])
        return rows

    def rows_of(self, entities: Array) -> tuple[Array, Array]:
        """Body rows (N,) of entities, and the collider rows (N,) of their own capsules; -1 for who has no such body."""
        physics = self._physics
        bodies, colliders = np.full(len(entities), -1, np.int64), np.full(len(entities), -1, np.int64)
        found = self.body_rows(entities)
        here = found >= 0
        if not here.any():
            return bodies, colliders
        rows = found[here]
        table = physics._colliders.rows
        first = np.minimum(np.searchsorted(table["body"], rows), max(len(table) - 1, 0))
        own = np.full(len(rows), -1, np.int64)
        for place, (row, at, entity) in enumerate(
            zip(rows.tolist(), first.tolist(), entities[here].tolist(), strict=True)
        ):
            while at < len(table) and table["body"][at] == row:
                if table["entity"][at] == entity:
                    own[place] = at
                    break
                at += 1
        fit = (own >= 0) & (physics._bodies.rows["motion"][rows] == KINEMATIC)
        fit[fit] = table["kind"][own[fit]] == CAPSULE
        places = np.flatnonzero(here)[fit]
        bodies[places], colliders[places] = rows[fit], own[fit]
        return bodies, colliders

    def feet(self, bodies: Array) -> Array:
        """Where the entities of body rows (N,) are, (N, 3) [m]."""
        return self._physics._bodies.entity_poses(bodies)[0]

    def drive(self, bodies: Array, velocity: Array, rotation: Array) -> None:
        """Has the next step move bodies in rows (N,) by velocities (N, 3) [m/s], turned at once as quaternions (N, 4) say."""
        rows, poses = self._physics._bodies.rows, self._physics._bodies.poses
        rows["velocity"][bodies, :3] = velocity
        rows["velocity"][bodies, 3:] = 0.0
        rows["rotation"][bodies] = quaternion.multiply(rotation, poses["axes"][bodies])

    def resize(self, bodies: Array, colliders: Array, half_length: Array) -> None:
        """Makes capsules in rows (N,) longer or shorter, each standing where it stood; their contacts and visits go on."""
        physics = self._physics
        table = physics._colliders
        radius = table.rows["half_extents"][colliders, 0]
        table.rows["half_extents"][colliders, 1] = half_length
        table.rows["reach"][colliders] = half_length + radius
        table.shapes["position"][colliders, 1] = half_length + radius
        table.forget_boxes(colliders)
        physics._update_mass(np.sort(bodies))

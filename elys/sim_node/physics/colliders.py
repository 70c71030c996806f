"""The table of colliders: the shapes of bodies, in the order of the bodies and of the entities that carry them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from elys.common.math import quaternion
from elys.sim_node.physics import checks
from elys.sim_node.physics.kernels.tables import COLLIDER, SPHERE
from elys.sim_node.physics.kernels.tree import FAR
from elys.sim_node.physics.mass_properties import Shapes

Array = np.ndarray[Any, Any]

SHAPE_COUNT = 2

# A shape as it was asked for, in the space of its body's entity.
SHAPE = np.dtype([("position", "f8", 3), ("rotation", "f8", 4)], align=True)


class ColliderTable:
    """Colliders by row. `rows` is what kernels work on, `shapes` where each shape sits on its entity."""

    def __init__(self) -> None:
        self.rows = np.zeros(0, COLLIDER)
        self.shapes = np.zeros(0, SHAPE)
        self.can_bounce = False

    def rows_on(self, bodies: Array) -> Array:
        """The rows of all colliders on body rows (M,), ascending."""
        return np.flatnonzero(np.isin(self.rows["body"], bodies))

    def shapes_on(self, bodies: Array, rows: Array) -> Shapes:
        """The shapes in collider rows, their bodies counted as places in `bodies`, which ascend."""
        chosen = self.rows[rows]
        return Shapes(
            np.searchsorted(bodies, chosen["body"]),
            chosen["kind"],
            chosen["half_extents"],
            self.shapes["position"][rows],
            self.shapes["rotation"][rows],
        )

    def insert(self, rows: Array, shapes: Array) -> Array:
        """Adds colliders in their places; returns where each old row is now."""
        old_count = len(self.rows)
        rows = np.concatenate([self.rows, rows])
        shapes = np.concatenate([self.shapes, shapes])
        order = np.lexsort((checks.index_column(rows["entity"]), rows["body"]))
        self.rows, self.shapes = rows[order], shapes[order]
        self._changed()
        place = np.empty(len(order), np.int64)
        place[order] = np.arange(len(order))
        return place[:old_count]

    def remove(self, removed: Array) -> Array:
        """Takes rows out; returns where each old row is now, -1 for the removed ones."""
        keep = np.ones(len(self.rows), bool)
        keep[removed] = False
        self.rows, self.shapes = self.rows[keep], self.shapes[keep]
        self._changed()
        return np.where(keep, np.cumsum(keep) - 1, -1)

    def follow_bodies(self, place: Array) -> None:
        """Bodies have moved to other rows: `place` (old N,) says where."""
        self.rows["body"] = place[self.rows["body"]]

    def attach(self, rows: Array, center: Array, axes: Array) -> None:
        """Expresses the shapes in rows in their bodies' frames, given for each: centre of mass and entity_from_principal."""
        principal_from_entity = quaternion.conjugate(axes)
        away = self.shapes["position"][rows] - center
        self.rows["local_position"][rows] = quaternion.rotate(principal_from_entity, away)
        self.rows["local_rotation"][rows] = quaternion.multiply(principal_from_entity, self.shapes["rotation"][rows])

    def forget_boxes(self, rows: Array) -> None:
        """Makes the next step find the pairs of these colliders anew."""
        self.rows["fat_box"][rows, :3] = FAR
        self.rows["fat_box"][rows, 3:] = -FAR

    def load(self, snapshot: dict[str, Array]) -> None:
        """Takes the colliders of a snapshot."""
        self.rows = checks.saved_table(snapshot, "colliders", COLLIDER)
        self.shapes = checks.saved_table(snapshot, "shapes", SHAPE)
        self._changed()

    def _changed(self) -> None:
        self.can_bounce = bool((self.rows["restitution"] > 0.0).any())


def new_colliders(
    entities: Array,
    bodies: Array,
    owners: Array,
    shape: ArrayLike,
    size: ArrayLike,
    radius: ArrayLike,
    position: ArrayLike,
    rotation: ArrayLike,
    friction: ArrayLike,
    restitution: ArrayLike,
) -> tuple[Array, Array]:
    """Checked rows for colliders of entities (M,) in body rows (M,); PhysicsError names the entity with a bad value."""
    rows = np.zeros(len(entities), COLLIDER)
    shapes = np.zeros(len(entities), SHAPE)
    rows["body"] = bodies
    rows["entity"] = owners
    rows["kind"] = checks.choice_column("shape", shape, entities, SHAPE_COUNT)
    sphere = (rows["kind"] == SPHERE)[:, None]
    # A box's radius and a sphere's size say nothing and are not judged.
    size = checks.number_column("size", np.where(sphere, 1.0, size), entities, width=3, minimum=0.0, above=True)
    radii = np.where(sphere[:, 0], radius, 1.0)
    radii = checks.number_column("radius", radii, entities, minimum=0.0, above=True)
    rows["half_extents"] = np.where(sphere, radii[:, None], 0.5 * size)
    rows["reach"] = np.where(sphere[:, 0], radii, np.linalg.norm(0.5 * size, axis=1))
    shapes["position"] = checks.number_column("collider position", position, entities, width=3)
    shapes["rotation"] = checks.rotation_column("collider rotation", rotation, entities)
    rows["friction"] = checks.number_column("friction", friction, entities, minimum=0.0)
    restitution = checks.number_column("restitution", restitution, entities, minimum=0.0)
    checks.refuse(restitution > 1.0, entities, restitution, "restitution must be at most 1")
    rows["restitution"] = restitution
    rows["fat_box"][:, :3] = FAR  # no box yet: the next step finds the pairs
    rows["fat_box"][:, 3:] = -FAR
    return rows, shapes

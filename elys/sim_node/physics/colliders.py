"""The table of colliders: the shapes of bodies, in the order of the bodies and of the entities that carry them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError
from elys.common.math import quaternion
from elys.sim_node.physics import checks
from elys.sim_node.physics.geometry import GeometryStore
from elys.sim_node.physics.kernels.tables import (
    BOX,
    CAPSULE,
    COLLIDER,
    CYLINDER,
    DYNAMIC,
    HEIGHT_FIELD,
    HULL,
    MESH,
    PLANE,
    PROXY,
    SPHERE,
    STATIC,
)
from elys.sim_node.physics.kernels.tree import FAR
from elys.sim_node.physics.mass_properties import Shapes, moved_centers, tensors, volumes
from elys.sim_node.physics.rows import joined_rows, picked_rows

Array = np.ndarray[Any, Any]

SHAPE_NAMES = ("box", "sphere", "capsule", "cylinder", "hull", "mesh", "plane", "height field")
EVERY_LAYER = 0xFFFFFFFF
BOUNDLESS = 1e9  # half the size of the box around a half-space [m]
NO_BOX = (FAR, FAR, FAR, -FAR, -FAR, -FAR)  # yet: the next step makes one and finds the pairs

# A shape as it was asked for, in the space of its body's entity: the place of its centre, and 0 for no density.
SHAPE = np.dtype([("position", "f8", 3), ("rotation", "f8", 4), ("density", "f8")], align=True)


class ColliderTable:
    """Colliders by row. `rows` is what kernels work on, `shapes` where each sits on its entity, `proxies` its fat box."""

    def __init__(self) -> None:
        self.rows = np.zeros(0, COLLIDER)
        self.shapes = np.zeros(0, SHAPE)
        self.proxies = np.zeros(0, PROXY)
        self.geometry = GeometryStore()
        self.can_bounce = False
        self.is_simple = True  # boxes and balls alone
        self.can_roll = False  # some collider resists rolling or spinning

    def rows_on(self, bodies: Array) -> Array:
        """The rows of all colliders on body rows (M,), ascending."""
        return np.flatnonzero(np.isin(self.rows["body"], bodies))

    def shapes_on(self, bodies: Array, rows: Array) -> Shapes:
        """The shapes in collider rows, their bodies counted as places in `bodies`, which ascend."""
        chosen = self.rows[rows]
        body = np.searchsorted(bodies, chosen["body"])
        volume, tensor = self._volumes(rows)
        weight = volume * self.shapes["density"][rows]
        dense = np.bincount(body, weight, len(bodies))[body] > 0.0
        position, rotation = self.shapes["position"][rows], self.shapes["rotation"][rows]
        return Shapes(
            body, chosen["kind"], chosen["half_extents"], position, rotation, np.where(dense, weight, volume), tensor
        )

    def dense_mass(self, bodies: Array, rows: Array) -> Array:
        """(M,) mass of bodies, ascending, by the density of their collider rows [kg]; 0 where none has one."""
        volume, _ = self._volumes(rows)
        body = np.searchsorted(bodies, self.rows["body"][rows])
        return np.bincount(body, volume * self.shapes["density"][rows], len(bodies))

    def _volumes(self, rows: Array) -> tuple[Array, Array]:
        """Volumes (C,) [m^3] and tensors (C, 3, 3) for 1 kg of collider rows."""
        kind, half, handle = (self.rows[name][rows] for name in ("kind", "half_extents", "geometry"))
        volume, tensor = volumes(kind, half), tensors(kind, half)
        for place in np.flatnonzero(kind == HULL):
            solid = self.geometry.solids[handle[place]]
            volume[place], tensor[place] = solid.volume, solid.tensor
        return volume, tensor

    def refuse_motion(self, entities: Array, motion: Array, kinds: Array) -> None:
        """PhysicsError for a shape (C,) of a body that moves (C,) as such a shape cannot."""
        moving = ((kinds == MESH) | (kinds == HEIGHT_FIELD)) & (motion != STATIC)
        moving |= (kinds == PLANE) & (motion == DYNAMIC)
        if moving.any():
            first = int(np.flatnonzero(moving)[0])
            name = SHAPE_NAMES[int(kinds[first])]
            raise PhysicsError(
                f"{checks.named(entities[first])} moves, and a {name} cannot: make its motion static, or give it a hull "
                f"or several simpler shapes"
            )

    def insert(self, rows: Array, shapes: Array) -> Array:
        """Adds colliders in their places; returns where each old row is now."""
        old_count = len(self.rows)
        rows = joined_rows(self.rows, rows)
        shapes = joined_rows(self.shapes, shapes)
        proxies = joined_rows(self.proxies, np.zeros(len(rows) - old_count, PROXY))
        proxies["fat_box"][old_count:] = NO_BOX
        order = np.lexsort((checks.index_column(rows["entity"]), rows["body"]))
        self.rows, self.shapes, self.proxies = (picked_rows(table, order) for table in (rows, shapes, proxies))
        self._changed()
        place = np.empty(len(order), np.int64)
        place[order] = np.arange(len(order))
        return place[:old_count]

    def remove(self, removed: Array) -> Array:
        """Takes rows out; returns where each old row is now, -1 for the removed ones."""
        keep = np.ones(len(self.rows), bool)
        keep[removed] = False
        kept = np.flatnonzero(keep)
        self.rows, self.shapes, self.proxies = (
            picked_rows(table, kept) for table in (self.rows, self.shapes, self.proxies)
        )
        self._changed()
        return np.where(keep, np.cumsum(keep) - 1, -1)

    def follow_bodies(self, place: Array) -> None:
        """Bodies have moved to other rows: `place` (old N,) says where."""
        self.rows["body"] = self.proxies["body"] = place[self.rows["body"]]

    def attach(self, rows: Array, center: Array, axes: Array) -> None:
        """Expresses the shapes in rows in their bodies' frames, given for each: centre of mass and entity_from_principal."""
        principal_from_entity = quaternion.conjugate(axes)
        away = self.shapes["position"][rows] - center
        self.rows["local_position"][rows] = quaternion.rotate(principal_from_entity, away)
        self.rows["local_rotation"][rows] = quaternion.multiply(principal_from_entity, self.shapes["rotation"][rows])

    def extents(self, rows: Array) -> tuple[Array, Array]:
        """The body row of each collider in rows (M,), and how far it reaches from that body's centre of mass [m]."""
        chosen = self.rows[rows]
        return chosen["body"], np.linalg.norm(chosen["local_position"], axis=1) + chosen["reach"]

    def forget_boxes(self, rows: Array) -> None:
        """Makes the next step find the pairs of these colliders anew."""
        self.proxies["fat_box"][rows] = NO_BOX

    def load(self, snapshot: dict[str, Array]) -> None:
        """Takes the colliders of a snapshot."""
        self.geometry.load(snapshot)
        self.rows = checks.saved_table(snapshot, "colliders", COLLIDER)
        self.shapes = checks.saved_table(snapshot, "shapes", SHAPE)
        self.proxies = checks.saved_table(snapshot, "proxies", PROXY)
        self._changed()

    def _changed(self) -> None:
        self.can_bounce = bool((self.rows["restitution"] > 0.0).any())
        self.is_simple = bool((self.rows["kind"] <= SPHERE).all())
        self.can_roll = bool(((self.rows["rolling_friction"] > 0.0) | (self.rows["spin_friction"] > 0.0)).any())


def new_colliders(
    store: GeometryStore,
    entities: Array,
    bodies: Array,
    owners: Array,
    *,
    shape: ArrayLike,
    size: ArrayLike,
    radius: ArrayLike,
    half_length: ArrayLike,
    geometry: ArrayLike,
    position: ArrayLike,
    rotation: ArrayLike,
    friction: ArrayLike,
    restitution: ArrayLike,
    rolling_friction: ArrayLike,
    spin_friction: ArrayLike,
    density: ArrayLike,
    layer: ArrayLike,
    mask: ArrayLike,
    trigger: ArrayLike,
) -> tuple[Array, Array]:
    """Checked rows for colliders of entities (M,) in body rows (M,); PhysicsError names the entity with a bad value."""
    rows = np.zeros(len(entities), COLLIDER)
    shapes = np.zeros(len(entities), SHAPE)
    rows["body"] = bodies
    rows["entity"] = owners
    rows["kind"] = checks.choice_column("shape", shape, entities, len(SHAPE_NAMES))
    shapes["position"] = checks.number_column("collider position", position, entities, width=3)
    shapes["rotation"] = checks.rotation_column("collider rotation", rotation, entities)
    shapes["density"] = checks.number_column("density", density, entities, minimum=0.0)
    _set_lengths(rows, entities, size, radius, half_length)
    _set_geometry(rows, shapes, store, entities, geometry)
    rows["friction"] = checks.number_column("friction", friction, entities, minimum=0.0)
    rows["rolling_friction"] = checks.number_column("rolling_friction", rolling_friction, entities, minimum=0.0)
    rows["spin_friction"] = checks.number_column("spin_friction", spin_friction, entities, minimum=0.0)
    restitution = checks.number_column("restitution", restitution, entities, minimum=0.0)
    checks.refuse(restitution > 1.0, entities, restitution, "restitution must be at most 1")
    rows["restitution"] = restitution
    rows["layer"] = checks.bits_column("layer", layer, entities)
    rows["mask"] = checks.bits_column("mask", mask, entities)
    rows["trigger"] = checks.choice_column("trigger", np.asarray(trigger, np.int64), entities, 3)
    return rows, shapes


def _set_lengths(rows: Array, entities: Array, size: ArrayLike, radius: ArrayLike, half_length: ArrayLike) -> None:
    """Half extents and reach. What a shape has not, as a box a radius, says nothing and is not judged."""
    kind = rows["kind"]
    box, sphere, capsule, cylinder = (kind == which for which in (BOX, SPHERE, CAPSULE, CYLINDER))
    long = capsule | cylinder
    size = checks.number_column("size", np.where(box[:, None], size, 1.0), entities, width=3, minimum=0.0, above=True)
    radii = np.where(sphere | long, radius, 1.0)
    radii = checks.number_column("radius", radii, entities, minimum=0.0, above=True)
    halves = np.where(long, half_length, 1.0)
    halves = checks.number_column("half_length", halves, entities, minimum=0.0, above=True)
    rows["half_extents"] = np.where(box[:, None], 0.5 * size, radii[:, None])
    rows["half_extents"][long, 1] = halves[long]
    rows["reach"] = np.select(
        [box, sphere, capsule],
        [np.linalg.norm(0.5 * size, axis=1), radii, halves + radii],
        np.hypot(halves, radii),
    )
    boundless = kind == PLANE
    rows["half_extents"][boundless] = BOUNDLESS
    rows["reach"][boundless] = BOUNDLESS


def _set_geometry(rows: Array, shapes: Array, store: GeometryStore, entities: Array, geometry: ArrayLike) -> None:
    """Geometry handles, and what follows from them: extents, and the place of the centre."""
    handles = np.broadcast_to(np.asarray(geometry), (len(entities),))
    kinds = rows["kind"]
    rows["geometry"] = -1
    for place in np.flatnonzero((kinds == HULL) | (kinds == MESH) | (kinds == HEIGHT_FIELD)):
        name = SHAPE_NAMES[int(kinds[place])]
        handle = int(handles[place])
        if not 0 <= handle < len(store.solids) or store.solids[handle].kind != kinds[place]:
            raise PhysicsError(
                f"{checks.named(entities[place])} has a {name} without its geometry: make it with "
                f"add_{name.replace(' ', '_')} and give what that returns as `geometry`, not {handle}"
            )
        solid = store.solids[handle]
        rows["geometry"][place] = handle
        rows["half_extents"][place] = solid.half_extents
        rows["reach"][place] = solid.reach
        one = slice(place, place + 1)
        shapes["position"][one] = moved_centers(shapes["position"][one], shapes["rotation"][one], solid.center[None])

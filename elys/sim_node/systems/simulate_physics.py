"""simulate_physics: columns -> kernels -> columns. Here bodies follow components, and poses come back.

An entity with a RigidBody is a body, made of its own Collider and those below it that have no body of their own; a Collider
under no body is an immovable one. Components are the truth that people edit: a body whose components changed by hand is made
anew from them, unless it was only put elsewhere or given another velocity. What physics moves is written back into the columns
each tick. Joints follow likewise (`scene_joints.py`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.store import AssetStore
from elys.common.components import Collider, RigidBody, Transform
from elys.common.components.columns import Column
from elys.common.ids import NO_ENTITY, Entity, index_of
from elys.common.math import quaternion
from elys.common.math.matrix import transform_points
from elys.sim_node.ecs.changes import ComponentOf, EntityReparented, EntitySpawned, WorldChanges
from elys.sim_node.ecs.entities import Entities
from elys.sim_node.ecs.world import World
from elys.sim_node.physics.states import Problem
from elys.sim_node.physics.world import PhysicsWorld
from elys.sim_node.systems.collider_shapes import collider_columns, geometries, stretched_lengths
from elys.sim_node.systems.scene_joints import SceneJoints

STATIC: Final = 2  # place of "static" among the choices of RigidBody.motion
REACH: Final = 1e9  # [m] what lies farther from the origin, or is larger, is left out of physics
OUT_OF_REACH: Final = f"it must lie within {REACH:g} m of the origin and be no larger; move or scale it back"
LOCKS: Final = tuple(f"lock_{what}_{axis}" for what in ("move", "turn") for axis in "xyz")  # as `add_bodies` has them
_POSE, _VELOCITIES = frozenset({"position", "rotation"}), frozenset({"linear_velocity", "angular_velocity"})
_PHYSICAL: Final = ("RigidBody", "Collider", "Transform", "MeshRenderer")


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingBodies:
    """Bodies that can move, in the order of their places: positions [N, 3] f64 m, rotations [N, 4] f32, velocities [N, 3] f32."""

    entity: Entities
    position: NDArray[np.float64]
    rotation: NDArray[np.float32]
    linear_velocity: NDArray[np.float32]
    angular_velocity: NDArray[np.float32]


class LightChanges(NamedTuple):
    """Changes that leave bodies what they are: which bodies are put elsewhere, which get other velocities, by which entries."""

    placed: list[int]
    pushed: list[int]
    keys: set[ComponentOf]


class RigidBodies:
    """Keeps the bodies of physics equal to the components of the world."""

    def __init__(self, world: World, physics: PhysicsWorld, assets: AssetStore) -> None:
        self._world = world
        self._physics = physics
        self._assets = assets
        self._colliders = world.query(Collider, enabled_only=True)
        self._bodies = world.query(RigidBody, enabled_only=True)
        self._present: set[int] = set()
        self._owner_of: dict[int, int] = {}  # collider's entity -> its body's
        self._members: dict[int, list[int]] = {}  # body's entity -> its colliders'
        self._seen: tuple[int, ...] = ()
        self._moving_rows: NDArray[np.intp] | None = None
        self._moving: Entities = np.zeros(0, np.uint32)
        self._problems: list[Problem] = []
        self.joints = SceneJoints(world, physics, self._body_of)

    def take_problems(self) -> list[Problem]:
        """What had to be left out of physics since this was last asked."""
        problems, self._problems = self._problems, []
        return problems + self.joints.take_problems()

    def follow(self, changes: WorldChanges) -> list[Entity]:
        """Makes bodies anew where their components, places or switches were changed.

        Returns the entities that live and physics does not move any more: frames tell no longer where they are.
        """
        affected = None
        if not changes.overflowed:
            light = self._light_changes(changes)
            affected = self._affected(changes, light.keys)
            self._put(light, affected)
        stale = self._present if affected is None else self._present & affected
        if stale:
            self.joints.release(stale)
            self._physics.remove_bodies(np.array(sorted(stale), np.uint32))
            self._present -= stale
        self._find_owners()
        wanted: set[int] = set()
        if affected is None or affected:
            wanted = {*self._bodies.entities.tolist(), *self._owner_of.values()} - self._present
        if affected is not None:
            wanted &= affected
        if wanted:
            added = self._add_bodies(np.array(sorted(wanted, key=index_of), np.uint32))
            self._present.update(added.tolist())
        self.joints.follow(None if affected is None else affected | _entities_with("Joint", changes))
        if not (stale or wanted):
            return []
        self._moving_rows = None
        before, self._moving = self._moving, self._physics.bodies.entity[self._rows_of_moving()]
        stopped = np.setdiff1d(before, self._moving, assume_unique=True).tolist()
        return [Entity(entity) for entity in stopped if self._world.is_alive(entity)]

    def outdate(self) -> None:
        """The world was put back to another time: what follows from it is found anew."""
        self._seen = ()
        self._moving_rows = None

    def moving(self) -> MovingBodies:
        """Where the bodies are that are not immovable."""
        bodies = self._physics.bodies_at(self._span_of_moving())
        return MovingBodies(
            entity=bodies.entity,
            position=bodies.position,
            rotation=bodies.rotation,
            linear_velocity=bodies.linear_velocity,
            angular_velocity=bodies.angular_velocity,
        )

    def _span_of_moving(self) -> slice | NDArray[np.intp]:
        """Their rows. What can move mostly stands together, behind what cannot: a slice is much faster than rows one by one."""
        rows = self._rows_of_moving()
        is_run = len(rows) > 0 and int(rows[-1]) - int(rows[0]) + 1 == len(rows)
        return slice(int(rows[0]), int(rows[-1]) + 1) if is_run else rows

    def write_back(self) -> None:
        """Poses and velocities of what moves, into the columns."""
        bodies, span = self._physics.bodies, self._span_of_moving()
        entities = bodies.entity[span]
        if not len(entities):
            return
        self._world.transforms.set_world_poses(entities, bodies.position[span], bodies.rotation[span])
        table = self._world.table(RigidBody)
        rows = table.rows(entities)
        table.column("linear_velocity")[rows] = bodies.linear_velocity[span]
        table.column("angular_velocity")[rows] = bodies.angular_velocity[span]

    def _rows_of_moving(self) -> NDArray[np.intp]:
        if self._moving_rows is None:
            table = self._world.table(RigidBody)
            rows = table.rows(self._physics.bodies.entity)
            self._moving_rows = np.flatnonzero(_rows_or(table.column("motion"), rows, STATIC) != STATIC)
        return self._moving_rows

    # --- what leaves bodies what they are ---------------------------------------------------------------------------

    def _light_changes(self, changes: WorldChanges) -> LightChanges:
        """What only puts bodies elsewhere, or gives them other velocities."""
        placed: dict[int, None] = {}
        pushed: list[int] = []
        keys: set[ComponentOf] = set()
        held: set[int] | None = None
        for key, fields in changes.fields.items():
            entity, component = key
            if entity not in self._present:
                continue
            if component == "RigidBody" and _VELOCITIES.issuperset(fields):
                pushed.append(entity)
                keys.add(key)
            elif component == "Transform" and _POSE.issuperset(fields) and self._stands_upright(entity):
                bodies = self._subtree(entity) & self._present
                held = self.joints.ends if held is None else held
                if held.isdisjoint(bodies):  # joints begin anew where their bodies are put elsewhere
                    placed.update(dict.fromkeys(sorted(bodies, key=index_of)))
                    keys.add(key)
        return LightChanges(list(placed), pushed, keys)

    def _stands_upright(self, entity: Entity) -> bool:
        """Whether nothing above an entity is stretched more one way than another: turned, it keeps its shape."""
        above = self._world.hierarchy.parent_of(entity)
        while above != NO_ENTITY:
            place = self._world.try_get(above, Transform)
            if place is not None and not place.scale[0] == place.scale[1] == place.scale[2]:
                return False
            above = self._world.hierarchy.parent_of(above)
        return True

    def _put(self, light: LightChanges, affected: set[int]) -> None:
        """Where bodies that are not made anew are, and how fast; those that got out of reach are made anew, and left out."""
        placed = np.array([entity for entity in light.placed if entity not in affected], np.uint32)
        if len(placed):
            poses = self._world.transforms.world_poses(placed)
            usable = _is_within_reach(poses.position) & np.isfinite(poses.rotation).all(axis=1)
            affected.update(placed[~usable].tolist())
            self._physics.set_poses(placed[usable], position=poses.position[usable], rotation=poses.rotation[usable])
        pushed = np.array([entity for entity in light.pushed if entity not in affected], np.uint32)
        if len(pushed):
            table = self._world.table(RigidBody)
            rows = table.rows(pushed)
            linear, angular = (table.column(name)[rows] for name in ("linear_velocity", "angular_velocity"))
            self._physics.set_velocities(pushed, linear=linear, angular=angular)

    # --- which bodies there shall be -------------------------------------------------------------------------------

    def _affected(self, changes: WorldChanges, light: set[ComponentOf]) -> set[int]:
        """The bodies, as they were and as they will be, that a change touches which is not among the `light` ones."""
        touched: set[int] = set()
        for change in changes.structure:
            if isinstance(change, EntitySpawned):
                touched.add(change.entity)
            elif isinstance(change, EntityReparented):
                touched |= self._subtree(change.entity)
        for entity in changes.switched:
            touched |= self._subtree(entity)
        for entity, component in (*changes.added, *(key for key in changes.set if key not in light), *changes.removed):
            if component == "Transform":
                touched |= self._subtree(entity)  # what stands below moves along
            elif component in _PHYSICAL:
                touched |= self._subtree(entity) if component == "RigidBody" else {entity}
        if changes.despawned:
            touched |= {entity for entity in self._present if not self._world.is_alive(entity)}
            touched |= {entity for entity in self._owner_of if not self._world.is_alive(entity)}
        owners = {self._owner_of[entity] for entity in touched if entity in self._owner_of}
        return touched | owners | self._new_owners(touched)

    def _subtree(self, entity: Entity) -> set[int]:
        if not self._world.is_alive(entity):
            return set()
        return set(self._world.hierarchy.subtree_of(entity).tolist())

    def _new_owners(self, entities: Iterable[int]) -> set[int]:
        return {self._owner(Entity(entity)) for entity in entities if self._world.is_alive(entity)}

    def _owner(self, entity: Entity) -> int:
        """The nearest entity from here up that has a RigidBody; the entity itself if there is none."""
        above = entity
        while above != NO_ENTITY:
            if self._world.has(above, RigidBody):
                return above
            above = self._world.hierarchy.parent_of(above)
        return entity

    def _body_of(self, entity: Entity) -> int:
        """The body that an entity is, or is part of; 0 where physics has none."""
        owner = self._owner(entity)
        return owner if owner in self._present else NO_ENTITY

    def _find_owners(self) -> None:
        seen = (self._colliders.version, self._bodies.version, self._world.hierarchy.version)
        if seen == self._seen:
            return
        self._seen = seen
        self._owner_of.clear()
        self._members.clear()
        hierarchy, bodies = self._world.hierarchy, self._world.table(RigidBody)
        colliders = self._colliders.entities.tolist()
        indices = self._colliders.indices
        own = bodies.row_of[indices] >= 0
        rooted = hierarchy.parent[indices] == 0
        simple = own | rooted
        for entity, is_simple in zip(colliders, simple.tolist(), strict=True):
            owner = entity if is_simple else self._owner(Entity(entity))
            self._owner_of[entity] = owner
            self._members.setdefault(owner, []).append(entity)

    # --- making them -----------------------------------------------------------------------------------------------

    def _add_bodies(self, owners: Entities) -> Entities:
        """Makes bodies of those that physics can work with, and returns them."""
        table = self._world.table(RigidBody)
        placeless = (table.rows(owners) >= 0) & (self._world.table(Transform).rows(owners) < 0)
        self._leave_out(owners[placeless], "cannot be moved by physics: give it a Transform")
        owners = owners[~placeless]
        poses = self._world.transforms.world_poses(owners)
        usable = _is_within_reach(poses.position) & np.isfinite(poses.rotation).all(axis=1)
        self._leave_out(owners[~usable], f"is left out of physics: {OUT_OF_REACH}")
        if not usable.all():
            return self._add_bodies(owners[usable])
        if not len(owners):
            return owners
        rows = table.rows(owners)
        still = {"motion": STATIC, "linear_velocity": 0.0, "angular_velocity": 0.0}  # a Collider without a RigidBody
        values = {
            field.name: _rows_or(table.column(field.name), rows, still.get(field.name, field.default))
            for field in table.declaration.fields
        }
        values["locked"] = np.stack([values.pop(name) for name in LOCKS], axis=1)
        self._physics.add_bodies(owners, position=poses.position, rotation=poses.rotation, **values)
        self._add_colliders(owners, poses.position, poses.rotation, values["motion"])
        return owners

    def _add_colliders(
        self, owners: Entities, positions: NDArray[np.float64], rotations: NDArray[np.float32], motions: NDArray[Any]
    ) -> None:
        world = self._world
        place = {owner: row for row, owner in enumerate(owners.tolist())}
        pairs = [(member, row) for owner, row in place.items() for member in self._members.get(owner, ())]
        if not pairs:
            return
        entities = np.array([member for member, _ in pairs], np.uint32)
        of_body = np.array([row for _, row in pairs], np.intp)
        rows = world.table(Collider).rows(entities)
        poses = world.transforms.world_poses(entities)
        centre = transform_points(
            world.transforms.world_affines(entities), world.table(Collider).column("offset")[rows]
        )
        body_from_world = quaternion.conjugate(rotations[of_body].astype(np.float64))
        scale = poses.scale.astype(np.float64)
        columns = {
            **collider_columns(world, entities),
            **stretched_lengths(world, entities, scale),
            "position": quaternion.rotate(body_from_world, centre - positions[of_body]),
            "rotation": quaternion.multiply(body_from_world, poses.rotation.astype(np.float64)),
        }
        usable = _is_within_reach(columns["size"], columns["radius"][:, None], columns["position"])
        usable &= _is_within_reach(columns["half_length"][:, None])
        usable &= np.isfinite(columns["rotation"]).all(axis=1)
        if not usable.all():
            self._leave_out(entities[~usable], f"collides with nothing: {OUT_OF_REACH}")
            entities, of_body = entities[usable], of_body[usable]
            columns = {name: column[usable] for name, column in columns.items()}
            scale = scale[usable]
        columns["geometry"], usable = geometries(
            world, self._physics, self._assets, entities, motions[of_body], scale, self._leave_out
        )
        if not usable.all():
            entities, of_body = entities[usable], of_body[usable]
            columns = {name: column[usable] for name, column in columns.items()}
        if len(entities):
            self._physics.add_colliders(owners[of_body], owners=entities, **columns)

    def _leave_out(self, entities: Entities, why: str) -> None:
        for entity in entities.tolist():
            self._problems.append(Problem(entity, f"{self._world.describe(Entity(entity))} {why}"))


def _entities_with(component: str, changes: WorldChanges) -> set[int]:
    """Those whose component of that name was changed."""
    return {entity for entity, name in (*changes.added, *changes.set, *changes.removed) if name == component}


def _is_within_reach(*columns: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
    """[N] whether all lengths [N, ...] of a row are numbers that physics can work with; NaN is none."""
    return np.logical_and.reduce([(np.abs(column) <= REACH).all(axis=1) for column in columns])


def _rows_or(column: Column, rows: NDArray[np.int32], fallback: float) -> Column:
    """[N] or [N, width] the values at `rows`, the fallback where a row is -1."""
    values = np.full((len(rows), *column.shape[1:]), fallback, column.dtype)
    present = rows >= 0
    values[present] = column[rows[present]]
    return values

"""A world of rigid bodies: arrays in, one step after the other, arrays out. It knows nothing of components or scenes.

world = PhysicsWorld(PhysicsSettings())
world.add_bodies([1, 2], motion=[2, 0], position=[[0, -0.5, 0], [0, 3, 0]])
world.set_colliders([1, 2], shape=[0, 1], size=[[20, 1, 20], [1, 1, 1]], radius=0.5, restitution=0.8)
for _ in range(600):
    world.step(1 / 60)
world.bodies.position
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError
from elys.common.math import quaternion
from elys.sim_node.physics import checks
from elys.sim_node.physics.bodies import new_rows
from elys.sim_node.physics.colliders import EVERY_LAYER, new_colliders
from elys.sim_node.physics.joint_world import WorldJoints
from elys.sim_node.physics.kernels.state_hash import hash_bodies
from elys.sim_node.physics.kernels.tables import BOX, DYNAMIC, STATIC
from elys.sim_node.physics.mass_properties import mass_properties
from elys.sim_node.physics.measures import energy_of, momentum_of
from elys.sim_node.physics.settings import PhysicsSettings, step_constants, step_strengths
from elys.sim_node.physics.solving import SolverRoom
from elys.sim_node.physics.states import BodyStates, ContactPoints, Energy, Momentum, Problem
from elys.sim_node.physics.stepping import Step

Array = np.ndarray[Any, Any]


class PhysicsWorld(WorldJoints):
    """Rigid bodies, their shapes, contacts and joints. Methods take entity ids and arrays with one row for each."""

    def __init__(self, settings: PhysicsSettings | None = None) -> None:
        self.settings = settings or PhysicsSettings()
        super().__init__()
        self._room = SolverRoom()
        self._step: Step | None = None
        self._step_plan: tuple[float, PhysicsSettings, bool] | None = None
        self._problems: list[Problem] = []

    # ---------------------------------------------------------------- what there is

    @property
    def bodies(self) -> BodyStates:
        """Where every body is, as the last step or change left it."""
        poses = self._bodies.poses
        return BodyStates(
            self._bodies.rows["entity"],
            self._bodies.rows["motion"],
            poses["position"],
            poses["rotation"],
            poses["linear_velocity"],
            poses["angular_velocity"],
        )

    @property
    def contacts(self) -> ContactPoints:
        """Where bodies touched in the last step."""
        return self._contacts.contact_points(self._bodies.rows, self._colliders.rows)

    @property
    def touching_count(self) -> int:
        """How many pairs of shapes touched in the last step."""
        return int(self._contacts.touching_count)

    @property
    def body_count(self) -> int:
        """How many bodies there are."""
        return len(self._bodies.rows)

    def take_problems(self) -> list[Problem]:
        """What went wrong inside steps since the last call."""
        problems, self._problems = self._problems, []
        return problems

    def has(self, entities: ArrayLike) -> Array:
        """Which entities (N,) have a body, as (N,) bool."""
        return self._bodies.has(checks.entity_column(entities, unique=False))

    def add_bodies(
        self,
        entities: ArrayLike,
        *,
        motion: ArrayLike = DYNAMIC,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike = (0.0, 0.0, 0.0, 1.0),
        linear_velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
        mass: ArrayLike = 1.0,
        linear_damping: ArrayLike = 0.0,
        angular_damping: ArrayLike = 0.0,
        gravity_scale: ArrayLike = 1.0,
    ) -> None:
        """Adds bodies without shapes. One value stands for all entities, else there is a row for each.

        Parameters: ids (N,), motion 0 dynamic, 1 kinematic, 2 static, position (N, 3) [m] and rotation (N, 4) of the
        entity, velocities (N, 3) of the centre of mass, mass (N,) [kg], damping (N,) [1/s], gravity_scale (N,).

        Raises:
            PhysicsError: a value is not finite or out of its range, or an entity has a body already.
        """
        column = checks.entity_column(entities)
        rows = new_rows(
            column,
            motion,
            position,
            rotation,
            linear_velocity,
            angular_velocity,
            linear_damping,
            angular_damping,
            gravity_scale,
        )
        weights = checks.number_column("mass", mass, column, minimum=0.0, above=True)
        place = self._bodies.add(column, rows, weights)
        self._colliders.follow_bodies(place)
        self._joints.follow_bodies(place)
        self._update_mass(self._bodies.rows_of(column))

    def remove_bodies(self, entities: ArrayLike) -> None:
        """Removes bodies with their shapes, contacts and joints; PhysicsError for an entity without a body."""
        rows = self._bodies.rows_of(checks.entity_column(entities))
        self._wake(rows)
        self._activity.wake_touching(rows)
        self._remove_colliders(self._colliders.rows_on(rows))
        self._joints.remove(self._joints.rows_on(rows))
        place = self._bodies.remove(rows)
        self._colliders.follow_bodies(place)
        self._joints.follow_bodies(place)
        self._activity.outdate()
        self._query_tree.outdate()

    def add_colliders(
        self,
        entities: ArrayLike,
        *,
        shape: ArrayLike = BOX,
        size: ArrayLike = (1.0, 1.0, 1.0),
        radius: ArrayLike = 0.5,
        half_length: ArrayLike = 0.5,
        geometry: ArrayLike = -1,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike = (0.0, 0.0, 0.0, 1.0),
        friction: ArrayLike = 0.5,
        restitution: ArrayLike = 0.0,
        density: ArrayLike = 0.0,
        layer: ArrayLike = 1,
        mask: ArrayLike = EVERY_LAYER,
        trigger: ArrayLike = False,
        owners: ArrayLike | None = None,
    ) -> None:
        """Gives bodies shapes, beside those they have. An entity named M times gets M shapes.

        Parameters: the bodies' entities (M,), and for each

        - shape: BOX, SPHERE, CAPSULE, CYLINDER, HULL, MESH, PLANE or HEIGHT_FIELD. Capsules and cylinders lie along
          their y axis; a plane fills what is below it along y and may not be on a dynamic body; meshes and height fields
          are static;
        - full edge lengths (M, 3) [m] of boxes, radius (M,) [m] of spheres, capsules and cylinders, half_length (M,) [m]
          of capsules, without their caps, and of cylinders;
        - geometry (M,): of hulls, meshes and height fields, what `add_hull`, `add_mesh` or `add_height_field` returned;
        - pose of the shape in the entity's space (M, 3) [m] and (M, 4), friction and restitution (M,);
        - density (M,) [kg/m^3]: where a body has one with it, its mass is the sum over those shapes. Without, the body's
          mass is shared among its shapes by volume. Centre of mass and inertia follow;
        - layer and mask (M,), 32 bits each: two shapes meet when each one's layer is in the other's mask;
        - trigger (M,): notices what touches it, and pushes nothing;
        - owners (M,): the entities that carry the colliders where those are not the bodies' own.

        Raises:
            PhysicsError: a value is out of its range, or an entity has no body.
        """
        column = checks.entity_column(entities, unique=False)
        carriers = column if owners is None else checks.entity_column(owners, unique=False)
        bodies = self._bodies.rows_of(column)
        rows, shapes = new_colliders(
            self._colliders.geometry,
            column,
            bodies,
            carriers,
            shape=shape,
            size=size,
            radius=radius,
            half_length=half_length,
            geometry=geometry,
            position=position,
            rotation=rotation,
            friction=friction,
            restitution=restitution,
            density=density,
            layer=layer,
            mask=mask,
            trigger=trigger,
        )
        self._colliders.refuse_motion(column, self._bodies.rows["motion"][bodies], rows["kind"])
        self._contacts.follow_colliders(self._colliders.insert(rows, shapes))
        self._contacts.set_collider_count(len(self._colliders.rows))
        self._update_mass(np.unique(bodies))

    def add_hull(self, points: ArrayLike) -> int:
        """A convex hull for `add_colliders`, from points (N, 3) [m] in the shape's space. Equal points give one hull.

        Raises:
            PhysicsError: a point is not finite, or the points span no volume.
        """
        return self._colliders.geometry.add_hull(points)

    def add_mesh(self, vertices: ArrayLike, triangles: ArrayLike) -> int:
        """A static mesh for `add_colliders`: vertices (V, 3) [m], triangles (T, 3), counter-clockwise seen from outside.

        Raises:
            PhysicsError: a vertex is not finite, a triangle names one that is not there, or none has an area.
        """
        return self._colliders.geometry.add_mesh(vertices, triangles)

    def add_height_field(self, heights: ArrayLike, size: ArrayLike) -> int:
        """A static ground for `add_colliders`: heights (M, N) [m] over a grid of `size` (2,) [m] along x and z.

        Raises:
            PhysicsError: a height is not finite, or the grid is smaller than 2 by 2.
        """
        return self._colliders.geometry.add_height_field(heights, size)

    def set_colliders(self, entities: ArrayLike, **shapes: Any) -> None:
        """Gives bodies shapes in place of all they had; takes what `add_colliders` takes."""
        self.remove_colliders(np.unique(checks.entity_column(entities, unique=False)))
        self.add_colliders(entities, **shapes)

    def remove_colliders(self, entities: ArrayLike) -> None:
        """Takes all shapes from bodies (N,); PhysicsError for an entity without a body."""
        rows = self._bodies.rows_of(checks.entity_column(entities))
        self._remove_colliders(self._colliders.rows_on(rows))
        self._update_mass(np.sort(rows))

    # ---------------------------------------------------------------- changes from outside

    def set_poses(self, entities: ArrayLike, *, position: ArrayLike, rotation: ArrayLike) -> None:
        """Puts entities (N,) elsewhere at once: position (N, 3) [m], rotation (N, 4)."""
        column = checks.entity_column(entities)
        where = checks.number_column("position", position, column, width=3)
        turn = checks.rotation_column("rotation", rotation, column)
        rows = self._bodies.rows_of(column)
        self._wake(rows)
        self._bodies.place(rows, where, turn)
        fixed = rows[self._bodies.rows["motion"][rows] == STATIC]
        if len(fixed):
            self._activity.wake_touching(fixed)
            self._colliders.forget_boxes(self._colliders.rows_on(fixed))
        self._changed()

    def set_velocities(
        self, entities: ArrayLike, *, linear: ArrayLike | None = None, angular: ArrayLike | None = None
    ) -> None:
        """Sets velocities (N, 3) of centres of mass [m/s] and about them [rad/s]; what is not given stays."""
        column = checks.entity_column(entities)
        rows = self._bodies.rows_of(column)
        self._wake(rows)
        velocity = self._bodies.rows["velocity"][rows]
        if linear is not None:
            velocity[:, :3] = checks.number_column("linear velocity", linear, column, width=3)
        if angular is not None:
            velocity[:, 3:] = checks.number_column("angular velocity", angular, column, width=3)
        self._bodies.rows["velocity"][rows] = velocity
        self._bodies.update_inverses(rows)
        self._changed()

    def set_properties(
        self,
        entities: ArrayLike,
        *,
        motion: ArrayLike | None = None,
        mass: ArrayLike | None = None,
        linear_damping: ArrayLike | None = None,
        angular_damping: ArrayLike | None = None,
        gravity_scale: ArrayLike | None = None,
    ) -> None:
        """Changes what bodies (N,) are, as in `add_bodies`; what is not given stays."""
        column = checks.entity_column(entities)
        rows = self._bodies.rows_of(column)
        self._wake(rows)
        table = self._bodies.rows
        changes: dict[str, Array] = {}
        if linear_damping is not None:
            changes["linear_damping"] = checks.number_column("linear_damping", linear_damping, column, minimum=0.0)
        if angular_damping is not None:
            changes["angular_damping"] = checks.number_column("angular_damping", angular_damping, column, minimum=0.0)
        if gravity_scale is not None:
            changes["gravity_scale"] = checks.number_column("gravity_scale", gravity_scale, column)
        if motion is not None:
            changes["motion"] = checks.choice_column("motion", motion, column, 3)
            on = self._colliders.rows_on(rows)
            each = np.searchsorted(np.sort(rows), self._colliders.rows["body"][on])
            each = np.argsort(rows)[each]
            self._colliders.refuse_motion(column[each], changes["motion"][each], self._colliders.rows["kind"][on])
        if mass is not None:
            self._bodies.mass[rows] = checks.number_column("mass", mass, column, minimum=0.0, above=True)
        if motion is not None:
            self._forget_pairs(rows[table["motion"][rows] != changes["motion"]])
        for name, values in changes.items():
            table[name][rows] = values
        self._bodies.update_inverses(rows)
        self._changed()

    def apply_impulse(self, entity: int, impulse: ArrayLike, point: ArrayLike | None = None) -> None:
        """Changes a body's momentum by an impulse (3,) [N s], at its centre of mass or at a point (3,) in world space [m]."""
        row, push = self._one("impulse", entity, impulse)
        body = self._bodies.rows[row]
        body["velocity"][:3] += body["inverse_mass"] * push
        if point is not None:
            away = self._one("point", entity, point)[1] - body["position"]
            self._spin(row, np.cross(away, push))
        self._changed()

    def apply_angular_impulse(self, entity: int, impulse: ArrayLike) -> None:
        """Changes a body's angular momentum by (3,) [N m s]."""
        row, push = self._one("angular impulse", entity, impulse)
        self._spin(row, push)
        self._changed()

    # ---------------------------------------------------------------- time

    def step(self, dt: float, profile: dict[str, float] | None = None) -> None:
        """Moves the world on by `dt` seconds. The seconds that each stage took go into `profile`.

        A body whose numbers stop being finite is taken out of motion where it was last seen, and told by `take_problems`.
        """
        if not (np.isfinite(dt) and dt > 0.0):
            raise PhysicsError(f"A step must take a finite time above 0 s, not {dt!r}")
        profile = {} if profile is None else profile
        faulty, broken = self._step_of(dt).run(profile)
        self._query_tree.outdate()
        if len(broken):
            self._break_joints(broken)
        if len(faulty):
            self._stop(faulty)

    def _step_of(self, dt: float) -> Step:
        """The step of this length with the present settings; made anew when one of them changes."""
        plan = (dt, self.settings, self._colliders.can_bounce)
        if self._step is None or self._step_plan != plan:
            if self._step_plan is not None and self._step_plan[1] != self.settings:
                self._activity.wake_all()
            constants = step_constants(self.settings, dt, can_bounce=self._colliders.can_bounce)
            strengths = step_strengths(self.settings, dt)
            self._step = Step(
                self._bodies,
                self._colliders,
                self._contacts,
                self._joints,
                self._activity,
                self._room,
                constants,
                strengths,
                sleeping=self.settings.sleeping,
            )
            self._step_plan = plan
        return self._step

    def _stop(self, rows: Array) -> None:
        """Takes bodies that are not finite any more out of motion, where they were last seen."""
        table = self._bodies.rows
        poses = self._bodies.poses[rows]
        for row in rows:
            entity = int(table["entity"][row])
            text = (
                f"{checks.named(entity)} got numbers that are not finite in a physics step; it stays where it was, without "
                f"motion: look for extreme masses, sizes or velocities there, then set its motion again"
            )
            self._problems.append(Problem(entity, text))
        self._forget_pairs(rows)
        table["motion"][rows] = STATIC
        table["velocity"][rows] = 0.0
        self._bodies.update_inverses(rows)
        self._bodies.place(rows, poses["position"], np.asarray(poses["rotation"], np.float64))
        self._changed()

    # ---------------------------------------------------------------- questions

    def energy(self) -> Energy:
        """Kinetic and potential energy of all dynamic bodies [J]."""
        return energy_of(self._bodies, self.settings.gravity)

    def momentum(self) -> Momentum:
        """Linear momentum of all dynamic bodies, and angular momentum about the origin."""
        return momentum_of(self._bodies)

    def state_hash(self) -> int:
        """64 bits over ids, poses and velocities of all bodies and what joints remember: equal states are equal in it."""
        rows = self._bodies.rows
        words = rows.view(np.uint64).reshape(len(rows), rows.itemsize // 8)
        total = int(hash_bodies(self._bodies.entities, words))
        if not len(self._joints.rows):
            return total
        return total ^ int(hash_bodies(self._joints.living, self._joints.memory()))

    # ---------------------------------------------------------------- the whole state

    def snapshot(self) -> dict[str, Array]:
        """Everything that the next steps depend on, as arrays that nothing else holds; the settings are not among them."""
        return {
            "bodies": self._bodies.rows.copy(),
            "poses": self._bodies.poses.copy(),
            "mass": self._bodies.mass.copy(),
            "inertia": self._bodies.inertia.copy(),
            "colliders": self._colliders.rows.copy(),
            "shapes": self._colliders.shapes.copy(),
            "joints": self._joints.rows.copy(),
            **self._colliders.geometry.saved(),
            **self._contacts.saved(),
        }

    def restore(self, snapshot: dict[str, Array]) -> None:
        """Goes back to a snapshot: the steps from there give the same bits as they did.

        Raises:
            PhysicsError: the arrays are not a snapshot of this version.
        """
        self._bodies.load(snapshot)
        self._colliders.load(snapshot)
        self._contacts.load(snapshot, len(self._colliders.rows))
        self._joints.load(snapshot)
        self._activity.outdate()
        self._query_tree.outdate()

    # ---------------------------------------------------------------- within

    def _one(self, name: str, entity: int, vector: ArrayLike) -> tuple[int, Array]:
        column = checks.entity_column([entity])
        self._wake(self._bodies.rows_of(column))
        return int(self._bodies.rows_of(column)[0]), checks.number_column(name, vector, column, width=3)[0]

    def _spin(self, row: int, angular_impulse: Array) -> None:
        body = self._bodies.rows[row : row + 1]
        local = quaternion.rotate(quaternion.conjugate(body["rotation"]), angular_impulse[None])
        body["velocity"][:, 3:] += quaternion.rotate(body["rotation"], body["inverse_inertia"] * local)

    def _update_mass(self, bodies: Array) -> None:
        """Centre of mass, axes and inertia of body rows (ascending) from their shapes."""
        bodies = np.sort(bodies)
        rows = self._colliders.rows_on(bodies)
        mass = self._colliders.dense_mass(bodies, rows)
        self._bodies.mass[bodies[mass > 0.0]] = mass[mass > 0.0]
        self._bodies.set_mass_properties(bodies, mass_properties(self._colliders.shapes_on(bodies, rows), len(bodies)))
        on = self._bodies.poses[self._colliders.rows["body"][rows]]
        self._colliders.attach(rows, on["center"], on["axes"])
        self._bodies.set_extents(bodies, *self._colliders.extents(rows))
        self._joints.attach(self._bodies, self._joints.rows_on(bodies))
        self._changed()

    def _remove_colliders(self, rows: Array) -> None:
        self._contacts.follow_colliders(self._colliders.remove(rows))
        self._contacts.set_collider_count(len(self._colliders.rows))

    def _forget_pairs(self, bodies: Array) -> None:
        """Ends all pairs of body rows; the next step finds those that may still be."""
        rows = self._colliders.rows_on(bodies)
        pairs = self._contacts.live_pairs
        self._contacts.drop(pairs["slot"][np.isin(pairs["a"], rows) | np.isin(pairs["b"], rows)])
        self._colliders.forget_boxes(rows)

    def _changed(self) -> None:
        self._activity.outdate()
        self._joints.outdate()
        self._bodies.publish()
        self._query_tree.outdate()

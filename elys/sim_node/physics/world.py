"""A world of rigid bodies: arrays in, one step after the other, arrays out. It knows nothing of components or scenes.

world = PhysicsWorld(PhysicsSettings())
world.add_bodies([1, 2], motion=[2, 0], position=[[0, -0.5, 0], [0, 3, 0]])
world.set_colliders([1, 2], shape=[0, 1], size=[[20, 1, 20], [1, 1, 1]], radius=0.5, restitution=0.8)
for _ in range(600):
    world.step(1 / 60)
world.bodies.position
"""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError
from elys.common.math import quaternion
from elys.sim_node.physics import checks
from elys.sim_node.physics.bodies import BodyTable, new_rows
from elys.sim_node.physics.colliders import ColliderTable, new_colliders
from elys.sim_node.physics.contacts import BoxTree, ContactStore
from elys.sim_node.physics.joint_making import JointDescription, JointDrive, changed_joints, new_joints
from elys.sim_node.physics.joints import BrokenJoint, JointStates, JointTable
from elys.sim_node.physics.kernels.state_hash import hash_bodies
from elys.sim_node.physics.kernels.tables import BOX, DYNAMIC, STATIC
from elys.sim_node.physics.mass_properties import mass_properties
from elys.sim_node.physics.measures import energy_of, momentum_of
from elys.sim_node.physics.raycasting import query_tree, raycast
from elys.sim_node.physics.settings import PhysicsSettings, step_constants
from elys.sim_node.physics.states import BodyStates, ContactPoints, Energy, Momentum, Problem, RayHits
from elys.sim_node.physics.stepping import step_bodies

Array = np.ndarray[Any, Any]


class PhysicsWorld:
    """Rigid bodies, their shapes and their contacts. Methods take entity ids and arrays with one row for each."""

    def __init__(self, settings: PhysicsSettings | None = None) -> None:
        self.settings = settings or PhysicsSettings()
        self._bodies = BodyTable()
        self._colliders = ColliderTable()
        self._contacts = ContactStore()
        self._joints = JointTable()
        self._broken_joints: list[BrokenJoint] = []
        self._problems: list[Problem] = []
        self._query_tree: BoxTree | None = None

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

    @property
    def joints(self) -> JointStates:
        """All joints, as the last step left them."""
        return self._joints.states()

    def take_broken_joints(self) -> list[BrokenJoint]:
        """Which joints broke since the last call, in the order of steps and ids."""
        broken, self._broken_joints = self._broken_joints, []
        return broken

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
        self._remove_colliders(self._colliders.rows_on(rows))
        self._joints.remove(self._joints.rows_on(rows))
        place = self._bodies.remove(rows)
        self._colliders.follow_bodies(place)
        self._joints.follow_bodies(place)
        self._query_tree = None

    def add_colliders(
        self,
        entities: ArrayLike,
        *,
        shape: ArrayLike = BOX,
        size: ArrayLike = (1.0, 1.0, 1.0),
        radius: ArrayLike = 0.5,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike = (0.0, 0.0, 0.0, 1.0),
        friction: ArrayLike = 0.5,
        restitution: ArrayLike = 0.0,
        owners: ArrayLike | None = None,
    ) -> None:
        """Gives bodies shapes, beside those they have. An entity named M times gets M shapes.

        Parameters: the bodies' entities (M,), shape 0 box or 1 sphere, full edge lengths (M, 3) [m] of boxes, radii (M,)
        [m] of spheres, pose of the shape in the entity's space (M, 3) [m] and (M, 4), friction and restitution (M,);
        `owners` (M,) are the entities that carry the colliders where those are not the bodies' own. Mass is shared among a
        body's shapes by volume; centre of mass and inertia follow.

        Raises:
            PhysicsError: a value is out of its range, or an entity has no body.
        """
        column = checks.entity_column(entities, unique=False)
        carriers = column if owners is None else checks.entity_column(owners, unique=False)
        bodies = self._bodies.rows_of(column)
        rows, shapes = new_colliders(
            column, bodies, carriers, shape, size, radius, position, rotation, friction, restitution
        )
        self._contacts.follow_colliders(self._colliders.insert(rows, shapes))
        self._contacts.set_collider_count(len(self._colliders.rows))
        self._update_mass(np.unique(bodies))

    def set_colliders(self, entities: ArrayLike, **shapes: Any) -> None:
        """Gives bodies shapes in place of all they had; takes what `add_colliders` takes."""
        self.remove_colliders(np.unique(checks.entity_column(entities, unique=False)))
        self.add_colliders(entities, **shapes)

    def remove_colliders(self, entities: ArrayLike) -> None:
        """Takes all shapes from bodies (N,); PhysicsError for an entity without a body."""
        rows = self._bodies.rows_of(checks.entity_column(entities))
        self._remove_colliders(self._colliders.rows_on(rows))
        self._update_mass(np.sort(rows))

    # ---------------------------------------------------------------- joints

    def add_joints(self, joints: ArrayLike, **description: Unpack[JointDescription]) -> None:
        """Joins bodies, or bodies and the world, as they stand: ids (N,) of the caller's choice, and what they are.

        Raises:
            PhysicsError: a value is out of its range, an entity has no body, or there is a joint with that id.
        """
        rows = new_joints(joints, self._bodies, self._joints.rows, description)
        self._joints.add(rows)
        self._joints.attach(self._bodies, self._joints.rows_of(rows["id"]))
        self._forget_pairs(np.unique(rows["body"][rows["body"] >= 0]))

    def remove_joints(self, joints: ArrayLike) -> None:
        """Removes joints (N,) and the gears on them; PhysicsError for one that does not exist."""
        rows = self._joints.rows_of(joints)
        bodies = self._joints.rows["body"][rows]
        self._joints.remove(rows)
        self._forget_pairs(np.unique(bodies[bodies >= 0]))

    def set_joints(self, joints: ArrayLike, **changes: Unpack[JointDrive]) -> None:
        """Changes motors, springs and limits of joints (N,), as in `add_joints`; what is not given stays."""
        rows = self._joints.rows_of(joints)
        self._joints.rows[rows] = changed_joints(self._joints.rows[rows], changes)

    # ---------------------------------------------------------------- changes from outside

    def set_poses(self, entities: ArrayLike, *, position: ArrayLike, rotation: ArrayLike) -> None:
        """Puts entities (N,) elsewhere at once: position (N, 3) [m], rotation (N, 4)."""
        column = checks.entity_column(entities)
        where = checks.number_column("position", position, column, width=3)
        turn = checks.rotation_column("rotation", rotation, column)
        self._bodies.place(self._bodies.rows_of(column), where, turn)
        self._changed()

    def set_velocities(
        self, entities: ArrayLike, *, linear: ArrayLike | None = None, angular: ArrayLike | None = None
    ) -> None:
        """Sets velocities (N, 3) of centres of mass [m/s] and about them [rad/s]; what is not given stays."""
        column = checks.entity_column(entities)
        rows = self._bodies.rows_of(column)
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
        constants = step_constants(self.settings, dt, can_bounce=self._colliders.can_bounce)
        profile = {} if profile is None else profile
        faulty, broken = step_bodies(self._bodies, self._colliders, self._contacts, self._joints, constants, profile)
        self._query_tree = None
        if len(broken):
            self._break_joints(broken)
        if len(faulty):
            self._stop(faulty)

    def _break_joints(self, rows: Array) -> None:
        """Tells of joints that broke; the bodies they held may collide from now on."""
        for joint in self._joints.rows[rows]:
            a, b = joint["entity"].tolist()
            self._broken_joints.append(
                BrokenJoint(int(joint["id"]), a, b, float(joint["force"]), float(joint["torque"]))
            )
        self._joints.set_broken(rows)
        bodies = self._joints.rows["body"][rows]
        self._forget_pairs(np.unique(bodies[bodies >= 0]))

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
        table["displacement"][rows] = 0.0
        self._bodies.update_inverses(rows)
        self._bodies.place(rows, poses["position"], np.asarray(poses["rotation"], np.float64))
        self._changed()

    # ---------------------------------------------------------------- questions

    def raycast(self, origins: ArrayLike, directions: ArrayLike, max_distance: ArrayLike = np.inf) -> RayHits:
        """The first collider that each ray meets.

        Parameters: origins (R, 3) [m], directions (R, 3) of any length but 0, farthest distances (R,) or one for all [m].
        A ray that begins inside a shape hits it at distance 0.
        """
        if self._query_tree is None:
            self._query_tree = query_tree(self._bodies.rows, self._colliders.rows)
        return raycast(self._colliders.rows, self._query_tree, origins, directions, max_distance)

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
        self._query_tree = None

    # ---------------------------------------------------------------- within

    def _one(self, name: str, entity: int, vector: ArrayLike) -> tuple[int, Array]:
        column = checks.entity_column([entity])
        return int(self._bodies.rows_of(column)[0]), checks.number_column(name, vector, column, width=3)[0]

    def _spin(self, row: int, angular_impulse: Array) -> None:
        body = self._bodies.rows[row : row + 1]
        local = quaternion.rotate(quaternion.conjugate(body["rotation"]), angular_impulse[None])
        body["velocity"][:, 3:] += quaternion.rotate(body["rotation"], body["inverse_inertia"] * local)

    def _update_mass(self, bodies: Array) -> None:
        """Centre of mass, axes and inertia of body rows (ascending) from their shapes."""
        bodies = np.sort(bodies)
        rows = self._colliders.rows_on(bodies)
        self._bodies.set_mass_properties(bodies, mass_properties(self._colliders.shapes_on(bodies, rows), len(bodies)))
        on = self._bodies.poses[self._colliders.rows["body"][rows]]
        self._colliders.attach(rows, on["center"], on["axes"])
        self._joints.attach(self._bodies, self._joints.rows_on(bodies))
        self._changed()

    def _remove_colliders(self, rows: Array) -> None:
        self._contacts.follow_colliders(self._colliders.remove(rows))
        self._contacts.set_collider_count(len(self._colliders.rows))

    def _forget_pairs(self, bodies: Array) -> None:
        """Ends all pairs of body rows; the next step finds those that may still be."""
        rows = self._colliders.rows_on(bodies)
        pairs = self._contacts.live_pairs
        self._contacts.drop(np.isin(pairs["a"], rows) | np.isin(pairs["b"], rows))
        self._colliders.forget_boxes(rows)

    def _changed(self) -> None:
        self._bodies.publish()
        self._query_tree = None

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

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError
from elys.sim_node.physics import checks, diagnostics, forces
from elys.sim_node.physics.bodies import new_rows
from elys.sim_node.physics.colliders import EVERY_LAYER, new_colliders
from elys.sim_node.physics.debug_geometry import Lines, Tables, debug_lines
from elys.sim_node.physics.joint_world import WorldJoints
from elys.sim_node.physics.kernels.state_hash import hash_bodies
from elys.sim_node.physics.kernels.tables import BOX, DYNAMIC, SOLID, STATIC, Table
from elys.sim_node.physics.mass_properties import mass_properties
from elys.sim_node.physics.measures import energy_of, momentum_of, thickness_of
from elys.sim_node.physics.measuring import Measuring
from elys.sim_node.physics.plan import PlannedStage, Switches, without_exact
from elys.sim_node.physics.rows import copied_rows, kept_rows
from elys.sim_node.physics.settings import PhysicsSettings, SceneTraits, step_constants, step_strengths
from elys.sim_node.physics.solving import SolverRoom
from elys.sim_node.physics.states import (
    BodyStates,
    ContactPoints,
    Energy,
    EventChanges,
    Momentum,
    Problem,
    StepDiagnostics,
    WorldEvents,
)
from elys.sim_node.physics.stepping import Step
from elys.sim_node.physics.team import Team

Array = np.ndarray[Any, Any]

_COPIED = frozenset(
    {"bodies", "poses", "mass", "inertia", "given_inertia", "forces", "colliders", "shapes", "proxies", "joints"}
)


class PhysicsWorld(WorldJoints):
    """Rigid bodies, their shapes, contacts and joints. Methods take entity ids and arrays with one row for each."""

    def __init__(self, settings: PhysicsSettings | None = None) -> None:
        self.settings = settings or PhysicsSettings()
        self.named: diagnostics.Named = checks.named  # whoever knows names puts them here
        super().__init__()
        self._switches = Switches(self._bodies, self._colliders, self._contacts, self._joints)
        self._room = SolverRoom()
        self._team = Team(self.settings.threads)
        self._step: Step | None = None
        self._step_plan: tuple[float, PhysicsSettings, SceneTraits] | None = None
        self._problems: list[Problem] = []
        tables = (self._bodies, self._colliders, self._contacts, self._joints, self._activity)
        self._measuring = Measuring(*tables)

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

    def bodies_at(self, rows: slice | Array) -> BodyStates:
        """The same of some rows, as they are now and stay: the table is copied as a whole, which is faster than its columns."""
        table = self._bodies.rows
        poses = kept_rows(self._bodies.poses, rows)
        return BodyStates(
            table["entity"][rows].copy(),
            table["motion"][rows].copy(),
            poses["position"],
            poses["rotation"],
            poses["linear_velocity"],
            poses["angular_velocity"],
        )

    @property
    def masses(self) -> Array:
        """The mass of each of `bodies`, (N,) [kg]; also of those that no force moves."""
        return self._bodies.mass

    @property
    def radii(self) -> Array:
        """Radius of the ball that holds the largest collider of each of `bodies`, (N,) [m]; 0 where there is none."""
        radii = np.zeros(len(self._bodies.rows))
        np.maximum.at(radii, self._colliders.rows["body"], self._colliders.rows["reach"])
        return radii

    @property
    def contacts(self) -> ContactPoints:
        """Where bodies touched in the last step."""
        return self._contacts.contact_points(self._bodies.rows, self._colliders.rows)

    @property
    def events(self) -> WorldEvents:
        """What the last step began, what goes on and what ended: contacts, and visits to triggers; see docs/physics-events.md."""
        return self._events.events(self._bodies.rows, self._colliders.rows)

    @property
    def event_changes(self) -> EventChanges:
        """Of `events` what began and ended, which costs next to nothing to ask for."""
        return self._events.changes()

    @property
    def touching_count(self) -> int:
        """How many pairs of shapes touched in the last step."""
        return int(self._contacts.touching_count)

    @property
    def body_count(self) -> int:
        """How many bodies there are."""
        return len(self._bodies.rows)

    def plan(self) -> tuple[PlannedStage, ...]:
        """What steps do that only some worlds need, and why the rest is switched off: as the world is after the last step."""
        return self._switches.plan(self.settings, self._team.threads)

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
        locked: ArrayLike = (False,) * 6,
        inertia: ArrayLike | None = None,
    ) -> None:
        """Adds bodies without shapes. One value stands for all entities, else there is a row for each.

        Parameters: ids (N,), motion 0 dynamic, 1 kinematic, 2 static, position (N, 3) [m] and rotation (N, 4) of the
        entity, velocities (N, 3) of the centre of mass, mass (N,) [kg], damping (N,) [1/s], gravity_scale (N,);
        locked (N, 6) bool: axes of the world along which (the first three) and about which a dynamic body never moves;
        inertia (N, 3) [kg m^2] about the entity's axes through the centre of mass, in place of what its shapes give: it
        grows with the mass when that is changed.

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
            locked,
        )
        weights = checks.number_column("mass", mass, column, minimum=0.0, above=True)
        moments = np.zeros((len(column), 3)) if inertia is None else checks.inertia_column(inertia, weights, column)
        place = self._bodies.add(column, rows, weights, moments)
        self._colliders.follow_bodies(place)
        self._joints.follow_bodies(place)
        added = self._bodies.rows_of(column)
        self._update_mass(added)
        self._bodies.mark_fresh(added)

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
        rolling_friction: ArrayLike = 0.0,
        spin_friction: ArrayLike = 0.0,
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
        - rolling_friction and spin_friction (M,) [m]: the arm of the normal force that resists rolling, and turning about
          the normal beside what the contact's area does. Of two shapes the larger one counts;
        - density (M,) [kg/m^3]: where a body has one with it, its mass is the sum over those shapes. Without, the body's
          mass is shared among its shapes by volume. Centre of mass and inertia follow;
        - layer and mask (M,), 32 bits each: two shapes meet when each one's layer is in the other's mask;
        - trigger (M,): notices what touches it, and pushes nothing. True or NOTICES_MOVING for what is dynamic or kinematic,
          NOTICES_ALL for what is static too, where the trigger itself is not;
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
            rolling_friction=rolling_friction,
            spin_friction=spin_friction,
            density=density,
            layer=layer,
            mask=mask,
            trigger=trigger,
        )
        self._colliders.refuse_motion(column, self._bodies.rows["motion"][bodies], rows["kind"])
        self._contacts.follow_colliders(self._colliders.insert(rows, shapes))
        self._contacts.set_collider_count(len(self._colliders.rows))
        self._update_mass(np.unique(bodies))
        self._bodies.mark_fresh(np.unique(bodies))

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
        self._bodies.mark_fresh(rows[self._bodies.rows["motion"][rows] == DYNAMIC])
        motion = self._bodies.rows["motion"][rows]
        if (motion != DYNAMIC).any():
            self._activity.wake_touching(rows[motion != DYNAMIC])
            self._colliders.forget_boxes(self._colliders.rows_on(rows[motion == STATIC]))
        self._changed()

    def set_velocities(
        self, entities: ArrayLike, *, linear: ArrayLike | None = None, angular: ArrayLike | None = None
    ) -> None:
        """Sets velocities (N, 3) of centres of mass [m/s] and about them [rad/s]; what is not given stays.

        What touches bodies that forces do not move wakes where these begin to go another way.
        """
        column = checks.entity_column(entities)
        rows = self._bodies.rows_of(column)
        self._wake(rows)
        velocity = self._bodies.rows["velocity"][rows]
        before = velocity.copy()
        if linear is not None:
            velocity[:, :3] = checks.number_column("linear velocity", linear, column, width=3)
        if angular is not None:
            velocity[:, 3:] = checks.number_column("angular velocity", angular, column, width=3)
        self._bodies.rows["velocity"][rows] = velocity
        driven = rows[(self._bodies.rows["motion"][rows] != DYNAMIC) & (velocity != before).any(axis=1)]
        if len(driven):
            self._activity.wake_touching(driven)
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
        locked: ArrayLike | None = None,
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
        if locked is not None:
            self._bodies.set_locked(rows, checks.switch_column("locked", locked, column, 6))
        if mass is not None:
            self._bodies.mass[rows] = checks.number_column("mass", mass, column, minimum=0.0, above=True)
        if motion is not None:
            self._forget_pairs(rows[table["motion"][rows] != changes["motion"]])
        for name, values in changes.items():
            table[name][rows] = values
        self._bodies.update_inverses(rows)
        self._changed()

    def motion_at(self, entities: ArrayLike, point: ArrayLike) -> tuple[Array, Array]:
        """Velocities (N, 3) [m/s] of points (N, 3) of bodies (N,), in world space, and the least mass (N,) [kg] felt there."""
        column, where = self._vectors("point", entities, point)
        return forces.motion_at(self._bodies, self._bodies.rows_of(column), where)

    def apply_force(self, entities: ArrayLike, force: ArrayLike, point: ArrayLike | None = None) -> None:
        """Pushes bodies during the next step, and no longer: what shall go on is applied again before each step.

        Parameters: entities (N,), force (N, 3) or one for all [N], point (N, 3) or one for all in world space [m]; without
        it the centres of mass. What is applied several times, in one call too, adds up. Bodies that are not dynamic feel nothing.
        """
        column, push = self._vectors("force", entities, force, unique=False)
        where = None if point is None else checks.number_column("point", point, column, width=3)
        rows = self._woken(column)
        forces.push_once(self._bodies, rows, forces.wrenches(self._bodies, rows, push, np.zeros_like(push), where))

    def apply_torque(self, entities: ArrayLike, torque: ArrayLike) -> None:
        """Turns bodies (N,) during the next step by torques (N, 3) or one for all [N m]; adds up as forces do."""
        column, turn = self._vectors("torque", entities, torque, unique=False)
        forces.push_once(self._bodies, self._woken(column), np.hstack([np.zeros_like(turn), turn]))

    def set_forces(
        self, entities: ArrayLike, *, force: ArrayLike = (0.0, 0.0, 0.0), torque: ArrayLike = (0.0, 0.0, 0.0)
    ) -> None:
        """Pushes bodies (N,) in every step from now on, in place of what was set before; zero ends it.

        Force (N, 3) [N] at the centre of mass and torque (N, 3) [N m], in world axes, beside what `apply_force` adds.
        """
        column, push = self._vectors("force", entities, force)
        turn = checks.number_column("torque", torque, column, width=3)
        forces.push_always(self._bodies, self._woken(column), np.hstack([push, turn]))

    def apply_impulse(self, entities: ArrayLike, impulse: ArrayLike, point: ArrayLike | None = None) -> None:
        """Changes the momentum of bodies at once, by impulses at their centres of mass or at points in world space.

        Parameters: one entity or (N,), impulse (3,) for all or (N, 3) [N s], point (3,) or (N, 3) [m].
        """
        column, push = self._vectors("impulse", entities, impulse)
        where = None if point is None else checks.number_column("point", point, column, width=3)
        rows = self._woken(column)
        forces.strike(self._bodies, rows, forces.wrenches(self._bodies, rows, push, np.zeros_like(push), where))
        self._changed()

    def apply_angular_impulse(self, entities: ArrayLike, impulse: ArrayLike) -> None:
        """Changes the angular momentum of one body or (N,) by (3,) for all or (N, 3) [N m s]."""
        column, turn = self._vectors("angular impulse", entities, impulse)
        forces.strike(self._bodies, self._woken(column), np.hstack([np.zeros_like(turn), turn]))
        self._changed()

    # ---------------------------------------------------------------- time

    def step(self, dt: float, profile: dict[str, float] | None = None) -> None:
        """Moves the world on by `dt` seconds. The seconds that each stage took go into `profile`.

        A body whose numbers stop being finite is taken out of motion where it was last seen, and told by `take_problems`.
        """
        if not (np.isfinite(dt) and dt > 0.0):
            raise PhysicsError(f"A step must take a finite time above 0 s, not {dt!r}")
        profile = {} if profile is None else profile
        step = self._step_of(dt)
        faulty, broken = step.run(profile)
        self._query_tree.outdate()
        if len(broken):
            self._break_joints(broken)
        self._tell(step, dt)
        if len(faulty):
            self._stop(faulty)

    def _step_of(self, dt: float) -> Step:
        """The step of this length with the present settings; made anew when one of them changes."""
        traits = SceneTraits(self._colliders.can_bounce, self._colliders.can_roll, self._bodies.can_lock)
        plan = (dt, self.settings, traits)
        if self._step is None or self._step_plan != plan:
            if self._step_plan is not None and without_exact(self._step_plan[1]) != without_exact(self.settings):
                self._activity.wake_all()
            if self._team.asked != self.settings.threads:
                self._team = Team(self.settings.threads)
            self._switches.force(self.settings.forced)
            if "sleepers" in self.settings.forced:  # those too who slept when this world was made from a snapshot
                self._activity.wake_all()
            has_events = self.settings.events or "contact_events" in self.settings.forced
            if not has_events:
                self._events.forget()
            constants = step_constants(self.settings, dt, traits)
            strengths = step_strengths(self.settings, dt)
            self._step = Step(
                self._bodies,
                self._colliders,
                self._contacts,
                self._joints,
                self._activity,
                self._events if has_events else None,
                self._switches,
                self._room,
                self._team,
                constants,
                strengths,
                sleeping=self.settings.sleeping and "sleepers" not in self.settings.forced,
            )
            self._step_plan = plan
        return self._step

    def _tell(self, step: Step, dt: float) -> None:
        """Notes what the step has found to be wrong."""
        slots, depths = step.take_deep()
        if len(slots):
            pairs = self._contacts.pairs[slots]
            self._problems += diagnostics.deep_overlaps(
                self._bodies, self._colliders.rows["body"], pairs, depths, self.named
            )
        fast_count = int(self._bodies.report["fast_count"][0])
        if fast_count:
            room = self._bodies.faulty_room
            rows = np.sort(room[len(room) - fast_count :])
            self._problems += diagnostics.too_fast(self._bodies, rows, self.settings, self.named)
        self._problems += diagnostics.explosion(self._bodies, self.settings, dt, self.named)

    def _stop(self, rows: Array) -> None:
        """Takes bodies that are not finite any more out of motion, where they were last seen."""
        table = self._bodies.rows
        poses = self._bodies.poses[rows]
        self._problems += diagnostics.not_finite(self._bodies, rows, self.named)
        self._joints.calm()
        self._forget_pairs(rows)
        self._contacts.calm()
        self._room.calm()
        table["motion"][rows] = STATIC
        table["velocity"][rows] = 0.0
        self._bodies.update_inverses(rows)
        self._bodies.place(rows, poses["position"], np.asarray(poses["rotation"], np.float64))
        self._changed()

    # ---------------------------------------------------------------- questions

    def energy(self) -> Energy:
        """Kinetic and potential energy of all dynamic bodies [J]."""
        return energy_of(self._bodies, self.settings.gravity, self.settings.attractors)

    def momentum(self) -> Momentum:
        """Linear momentum of all dynamic bodies, and angular momentum about the origin."""
        return momentum_of(self._bodies)

    @property
    def diagnostics(self) -> StepDiagnostics:
        """What the last step has left, measured now: energy, momentum, overlap, errors of joints, what the solver did not do."""
        return self._measuring.whole(*self._measured_state())

    def watch(self) -> StepDiagnostics:
        """The same for under a fiftieth of what a step costs, where it is asked for after each step.

        Bodies and joints are measured all, of contacts a part in turn: the worst is told of this round and the one before,
        a round being the steps, at most 64, in which all have their turn. Up to 16 contacts are all looked at each time.
        """
        return self._measuring.part(*self._measured_state())

    def _measured_state(self) -> tuple[Array, int, Table]:
        """Where islands stand, their version, and the constants of the step; as the next will have them if there was none."""
        step = self._step
        if step is not None and self._step_plan is not None and self._step_plan[1] is self.settings:
            return self._room.parent, step.islands, step.constants
        traits = SceneTraits(self._colliders.can_bounce, self._colliders.can_roll, self._bodies.can_lock)
        return self._room.parent, 0, step_constants(self.settings, 1.0, traits)

    def thickness_of(self, entity: int) -> float:
        """How thick an entity's body is where its thinnest shape is [m]; infinite for what has no inside, or no body."""
        return thickness_of(self._bodies, self._colliders, entity)

    def state_hash(self) -> int:
        """64 bits over ids, poses and velocities of all bodies and what joints remember: equal states are equal in it."""
        rows = self._bodies.rows
        words = rows.view(np.uint64).reshape(len(rows), rows.itemsize // 8)
        total = int(hash_bodies(self._bodies.entities, words))
        if not len(self._joints.rows):
            return total
        return total ^ int(hash_bodies(self._joints.living, self._joints.memory()))

    def debug_lines(self, kind: str) -> Lines:
        """How physics sees the world, as lines of a kind: as `debug_geometry.LINES` names them."""
        return debug_lines(Tables(self._bodies, self._colliders, self._contacts, self._joints, self.settings), kind)

    # ---------------------------------------------------------------- the whole state

    def snapshot(self) -> dict[str, Array]:
        """Everything that the next steps depend on, as arrays that nothing else holds; the settings are not among them."""
        live = self._live()
        return {name: copied_rows(live[name]) if name in _COPIED else live[name] for name in live}

    def _live(self) -> dict[str, Array]:
        """What a snapshot holds: `_COPIED` as they are worked on, the rest made anew."""
        return {
            "bodies": self._bodies.rows,
            "poses": self._bodies.poses,
            "mass": self._bodies.mass,
            "inertia": self._bodies.inertia,
            "given_inertia": self._bodies.given_inertia,
            "forces": self._bodies.forces,
            "colliders": self._colliders.rows,
            "shapes": self._colliders.shapes,
            "proxies": self._colliders.proxies,
            "joints": self._joints.rows,
            **self._colliders.geometry.saved(),
            **self._contacts.saved(),
            **self._events.saved(),
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
        self._events.load(snapshot)
        self._activity.outdate()
        self._query_tree.outdate()

    def saved(self) -> dict[str, Any]:
        """`snapshot`, and with it what no step reads but the next change of settings, or who asks what has gone wrong.

        Tables are those that are worked on: whoever keeps them copies them.
        """
        return {
            **self._live(),
            "settings": self.settings,
            "step_plan": self._step_plan,
            "problems": tuple(self._problems),
            "broken_joints": tuple(self._broken_joints),
        }

    def load(self, saved: dict[str, Any]) -> None:
        """Takes back what `saved` gave; as many threads work on a step as before.

        Raises:
            PhysicsError: it is not what this version saves.
        """
        threads = self.settings.threads
        self.restore(saved)
        self.settings = msgspec.structs.replace(saved["settings"], threads=threads)
        self._step, self._step_plan = None, saved["step_plan"]
        if self._step_plan is not None:  # other threads than those of the last step are no reason to wake anybody
            dt, settings, traits = self._step_plan
            self._step_plan = (dt, msgspec.structs.replace(settings, threads=threads), traits)
        self._problems, self._broken_joints = list(saved["problems"]), list(saved["broken_joints"])

    # ---------------------------------------------------------------- within

    def _vectors(
        self, name: str, entities: ArrayLike, vectors: ArrayLike, *, unique: bool = True
    ) -> tuple[Array, Array]:
        column = checks.entity_column(entities, unique=unique)
        return column, checks.number_column(name, vectors, column, width=3)

    def _woken(self, entities: Array) -> Array:
        rows = self._bodies.rows_of(entities)
        self._wake(rows)
        return rows

    def _update_mass(self, bodies: Array) -> None:
        """Centre of mass, axes and inertia of body rows (ascending) from their shapes."""
        bodies = np.sort(bodies)
        rows = self._colliders.rows_on(bodies)
        solid = rows[self._colliders.rows["trigger"][rows] == SOLID]
        mass = self._colliders.dense_mass(bodies, solid)
        self._bodies.mass[bodies[mass > 0.0]] = mass[mass > 0.0]
        self._bodies.set_mass_properties(bodies, mass_properties(self._colliders.shapes_on(bodies, solid), len(bodies)))
        on = self._bodies.poses[self._colliders.rows["body"][rows]]
        self._colliders.attach(rows, on["center"], on["axes"])
        self._bodies.set_extents(bodies, *self._colliders.extents(solid))
        self._joints.attach(self._bodies, self._joints.rows_on(bodies))
        self._changed()

    def _remove_colliders(self, rows: Array) -> None:
        self._events.note_removed(self._bodies.rows, self._colliders.rows, rows)
        self._contacts.follow_colliders(self._colliders.remove(rows))
        self._contacts.set_collider_count(len(self._colliders.rows))

    def _forget_pairs(self, bodies: Array) -> None:
        """Ends all pairs of body rows; the next step finds those that may still be."""
        rows = self._colliders.rows_on(bodies)
        self._events.note_removed(self._bodies.rows, self._colliders.rows, rows)
        pairs = self._contacts.live_pairs
        self._contacts.drop(pairs["slot"][np.isin(pairs["a"], rows) | np.isin(pairs["b"], rows)])
        self._colliders.forget_boxes(rows)

    def _changed(self) -> None:
        self._activity.outdate()
        self._joints.outdate()
        self._bodies.publish()
        self._query_tree.outdate()

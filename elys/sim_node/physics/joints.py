"""The table of joints: what holds bodies together, in the order of the joints' ids.

The order of impulses, and with it every bit of the motion, does not depend on the order of adding.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError
from elys.common.math import quaternion
from elys.sim_node.physics import checks
from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.joint_checks import joint_column, joint_named
from elys.sim_node.physics.joint_parts import parts_of, ranges_of
from elys.sim_node.physics.joint_plan import JointPlan
from elys.sim_node.physics.kernels.tables import (
    BALL,
    BODY,
    CONE,
    DISTANCE,
    FIXED,
    GEAR,
    HINGE,
    JOINT,
    JOINT_GROUP,
    JOINT_PART,
    JOINT_ROW,
    JOINT_ROWS,
    SLIDER,
    Joints,
)

Array = np.ndarray[Any, Any]


_MEMORY = (
    "impulse",
    "spring_impulse",
    "motor_impulse",
    "lower_impulse",
    "upper_impulse",
    "gear_impulse",
    "swing_impulse",
)
NO_PLAN = JointPlan(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2), np.int32))


class JointStates(NamedTuple):
    """All joints in the order of their ids, as the last step left them: copies."""

    joint: Array  # (J,) uint32
    kind: Array  # (J,) uint8, the places of names in JOINT_KINDS
    entity_a: Array  # (J,) uint32, 0 for the world
    entity_b: Array
    coordinate: Array  # (J,) angle, counted over turns [rad], way or length [m]; 0 where there is none
    swing: Array  # (J,) of cone-twist joints [rad]
    speed: Array  # (J,) of the coordinate [rad/s] or [m/s]
    force: Array  # (J,) between the bodies, mean over the last step [N]
    torque: Array  # (J,) between the bodies, at the anchor of b [N m]
    broken: Array  # (J,) bool


class BrokenJoint(NamedTuple):
    """A joint that broke in a step; it holds nothing any more but stays listed until it is removed."""

    joint: int
    entity_a: int
    entity_b: int
    force: float  # [N]
    torque: float  # [N m]


class JointTable:
    """Joints by row, and the room that solving them needs."""

    def __init__(self) -> None:
        self.rows = np.zeros(0, JOINT)
        self.solver_rows = np.zeros(0, JOINT_ROW)
        self.broken_room = np.zeros(0, np.int32)
        self.unpaired = np.zeros(0, np.int64)
        self.links = np.zeros((0, 2), np.int32)  # body rows that living joints connect, -1 for the world
        self._plan = NO_PLAN
        self._is_outdated = True
        self._groups = np.zeros(0, JOINT_GROUP)
        self._order = np.zeros(0, np.int32)
        self._parts = np.zeros(0, JOINT_PART)
        self._part_order = np.zeros(0, np.int32)
        self._loads = np.zeros((0, 6))
        self._rest = np.zeros((0, 6))
        self._turned = np.zeros((0, 3))
        self._body_rows = np.zeros(0, BODY)

    def rows_of(self, joints: ArrayLike) -> Array:
        """The rows of joints (M,); PhysicsError for one that does not exist."""
        ids = joint_column(joints)
        rows = np.searchsorted(self.rows["id"], ids)
        known = rows < len(self.rows)
        known[known] = self.rows["id"][rows[known]] == ids[known]
        if not known.all():
            raise PhysicsError(
                f"There is no {joint_named(ids[~known][0])}: add it with add_joints, or it went with one of its bodies"
            )
        return rows

    @property
    def connections(self) -> Array:
        """(L, 2) body rows that living joints connect, -1 for the world; a gear connects all it couples."""
        held = self.rows[self.rows["broken"] == 0]
        gears = held[held["kind"] == GEAR]
        one, two = (self.rows["body"][gears["gear_row"][:, side]] for side in range(2))
        across = [np.stack([one[:, a], two[:, b]], axis=1) for a in range(2) for b in range(2)]
        return np.concatenate([held["body"][held["kind"] != GEAR], *across]).astype(np.int32)

    def add(self, rows: Array) -> None:
        """Inserts checked rows."""
        taken = np.isin(rows["id"], self.rows["id"])
        if taken.any():
            raise PhysicsError(f"There is a {joint_named(rows['id'][taken][0])} already: remove it first")
        merged = np.concatenate([self.rows, rows])
        self._take(merged[np.argsort(merged["id"], kind="stable")])

    def remove(self, rows: Array) -> None:
        """Takes rows out, and the gears that couple them."""
        gone = np.isin(self.rows["geared"], self.rows["id"][rows]).any(1) & (self.rows["kind"] == GEAR)
        gone[rows] = True
        self._forget(np.flatnonzero(gone))
        self._take(self.rows[~gone])

    def rows_on(self, bodies: Array) -> Array:
        """The joints of body rows (M,)."""
        return np.flatnonzero(np.isin(self.rows["body"], bodies[bodies >= 0]).any(1) & (self.rows["kind"] != GEAR))

    def bodies_of(self, rows: Array) -> Array:
        """The bodies of joint rows, those that gears couple included: body rows, sorted."""
        gears = rows[self.rows["kind"][rows] == GEAR]
        bodies = self.rows["body"][np.concatenate([rows, self.rows["gear_row"][gears].ravel()])]
        return np.unique(bodies[bodies >= 0])

    def with_joined(self, bodies: Array) -> Array:
        """Body rows (M,) and those that joints connect to them."""
        if not len(self.links):
            return bodies
        joined = self.links[np.isin(self.links, bodies).any(1)].ravel()
        return np.union1d(bodies, joined[joined >= 0])

    def follow_bodies(self, place: Array) -> None:
        """Bodies have moved to other rows, `place` (old N,) says where."""
        body = self.rows["body"]
        if len(place):
            self.rows["body"] = np.where(body >= 0, place[body], -1)
        self._index()

    def attach(self, bodies: BodyTable, rows: Array) -> None:
        """Expresses the frames of joint rows in their bodies' frames, which have changed."""
        chosen = self.rows[rows]
        for side in range(2):
            body = chosen["body"][:, side]
            anchor = chosen["anchor"][:, 3 * side : 3 * side + 3]
            rotation = chosen["rotation"][:, 4 * side : 4 * side + 4]
            center = np.zeros((len(rows), 3))
            axes = np.tile(quaternion.IDENTITY, (len(rows), 1))
            held = body >= 0
            center[held] = bodies.poses["center"][body[held]]
            axes[held] = bodies.poses["axes"][body[held]]
            principal_from_entity = quaternion.conjugate(axes)
            self.rows["local_anchor"][rows, 3 * side : 3 * side + 3] = quaternion.rotate(
                principal_from_entity, anchor - center
            )
            self.rows["local_rotation"][rows, 4 * side : 4 * side + 4] = quaternion.multiply(
                principal_from_entity, rotation
            )
        self.rows["stiffness"][rows] = -1.0

    def outdate(self) -> None:
        """Something that joints hold is moved otherwise than before."""
        self._is_outdated = True

    def prepare(self, bodies: BodyTable, strength_count: int) -> None:
        """Makes room for a step, and plans anew how rigid joints are solved together when what they hold has changed."""
        if len(self._groups) != strength_count:
            self._groups = np.zeros(strength_count, JOINT_GROUP)
        if not self._is_outdated:
            return
        self._is_outdated = False
        self._body_rows = bodies.rows
        if len(self._loads) != len(bodies.rows):
            self._loads = np.zeros((len(bodies.rows), 6))
            self._rest = np.zeros((len(bodies.rows), 6))
            self._turned = np.zeros((len(bodies.rows), 3))
        self._update_plan(bodies)

    @property
    def tables(self) -> Joints:
        """What kernels take; `prepare` has to be called first in each step."""
        plan = self._plan
        return Joints(
            self._body_rows,
            self.rows,
            self.solver_rows,
            self._groups,
            self._parts,
            self._part_order,
            self._order,
            plan.columns,
            plan.blocks,
            plan.updates,
            self._loads,
            self._rest,
            self._turned,
        )

    def _update_plan(self, bodies: BodyTable) -> None:
        r = self.rows
        body = r["body"]
        free = (body >= 0) & (bodies.rows["inverse_mass"][body] > 0.0)
        coupled = np.where(free, body, -1)
        part = parts_of(coupled, r["broken"] == 0, r["kind"] == GEAR, r["gear_row"])
        rigid = (r["frequency"] == 0.0) & (part >= 0)
        held = np.isin(r["kind"], (FIXED, BALL, HINGE, SLIDER, CONE))
        rod = (r["kind"] == DISTANCE) & (r["lower"] == r["upper"])
        direct = np.flatnonzero(rigid & (held | rod))
        if not self._plan.is_for(part, direct, coupled[direct]):
            self._plan = JointPlan(part, direct, coupled[direct])
        r["direct"], r["part"] = self._plan.direct, part
        self._order = np.argsort(part, kind="stable")[np.count_nonzero(part < 0) :].astype(np.int32)
        self._parts = np.zeros(part.max(initial=-1) + 1, JOINT_PART)
        self._parts["first"], self._parts["last"] = ranges_of(part[self._order], len(self._parts))
        columns = part[self._plan.columns["joint"]]
        self._parts["first_column"], self._parts["last_column"] = ranges_of(columns, len(self._parts))
        self._part_order = np.zeros(len(self._parts), np.int32)

    def calm(self) -> None:
        """Joints whose numbers stopped being finite begin anew: what is no number would spoil their bodies in every step."""
        lost = np.flatnonzero(~np.isfinite(self._remembered(self.rows)).all(1))
        names = JOINT.names or ()
        work = names[names.index("shift") :]  # the loads of the last substep among it, which the next one reads
        for name in (*_MEMORY, "coordinate", "impulse_time", "speed", "force", "torque", *work):
            self.rows[name][lost] = 0
        self.rows["stiffness"][lost] = -1.0
        for room in (self._loads, self._rest, self._turned):
            room[:] = 0.0

    def set_broken(self, rows: Array) -> None:
        """Joints that broke hold nothing any more, nor do the gears that couple them."""
        gears = self.rows["kind"] == GEAR
        broken = gears & (self.rows["broken"] == 0) & np.isin(self.rows["geared"], self.rows["id"][rows]).any(1)
        self.rows["broken"][broken] = 1
        self._forget(rows)
        self._index()

    def states(self) -> JointStates:
        """What the last step left."""
        r = self.rows
        return JointStates(
            r["id"].copy(),
            r["kind"].copy(),
            r["entity"][:, 0].copy(),
            r["entity"][:, 1].copy(),
            r["coordinate"].copy(),
            r["swing"].copy(),
            r["speed"].copy(),
            r["force"].copy(),
            r["torque"].copy(),
            r["broken"] != 0,
        )

    @property
    def living(self) -> Array:
        """(L,) uint32 ids of the joints that hold."""
        return np.ascontiguousarray(self.rows["id"][self.rows["broken"] == 0])

    def memory(self) -> Array:
        """(L, 14) uint64: what joints that hold carry from step to step, as bits."""
        return self._remembered(self.rows[self.rows["broken"] == 0]).view(np.uint64)

    @staticmethod
    def _remembered(rows: Array) -> Array:
        columns = [rows["impulse"], *(rows[name][:, None] for name in (*_MEMORY[1:], "coordinate", "impulse_time"))]
        return np.ascontiguousarray(np.concatenate(columns, axis=1))

    def load(self, snapshot: dict[str, Array]) -> None:
        """Takes the joints of a snapshot."""
        self._take(checks.saved_table(snapshot, "joints", JOINT))

    def _take(self, rows: Array) -> None:
        self.rows = rows
        self.solver_rows = np.zeros(JOINT_ROWS * len(rows), JOINT_ROW)
        self.broken_room = np.zeros(len(rows), np.int32)
        gears = np.flatnonzero(rows["kind"] == GEAR)
        rows["gear_row"][gears] = np.searchsorted(rows["id"], rows["geared"][gears])
        self._index()

    def _forget(self, rows: Array) -> None:
        """What hung together with joint rows that hold no more begins anew: much of what it pushed, pushed against them.

        Joints that are only swept keep their impulses: they would take long to find them again.
        """
        r = self.rows
        hung = np.isin(r["part"], r["part"][rows]) & (r["part"] >= 0)
        r["gear_impulse"][hung] = 0.0
        exact = hung & ((r["direct"] != 0) | (r["geared_by"] != 0) | (r["kind"] == GEAR))
        exact[rows] = True
        for name in _MEMORY:
            r[name][exact] = 0.0

    def _index(self) -> None:
        """Finds what is connected, and the sorted keys of pairs of body rows that do not collide."""
        self._is_outdated = True
        self.links = self.connections
        apart = (self.rows["collide_connected"] == 0) & (self.rows["broken"] == 0) & (self.rows["body"] >= 0).all(1)
        body = self.rows["body"][apart & (self.rows["kind"] != GEAR)]
        self.unpaired = np.unique(pair_keys(body[:, 0], body[:, 1]))


def pair_keys(a: Array, b: Array) -> Array:
    """Pairs of body rows as numbers (M,) int64, whatever their order: the smaller row times 2^32 plus the larger."""
    return (np.minimum(a, b).astype(np.int64) << 32) + np.maximum(a, b)

"""What a world does with joints.

world.add_joints([1], kind="hinge", entity_a=4, entity_b=5, anchor_a=[0, 1, 0], axis_a=[0, 0, 1], lower=-1.0, upper=1.0)
world.set_joints([1], motor_speed=3.0, motor_limit=20.0)
world.joints.coordinate, world.joints.force
"""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from elys.sim_node.physics.activity import Activity
from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.colliders import ColliderTable
from elys.sim_node.physics.contacts import ContactStore
from elys.sim_node.physics.events import EventLog
from elys.sim_node.physics.joint_making import JointDescription, JointDrive, changed_joints, new_joints
from elys.sim_node.physics.joints import BrokenJoint, JointStates, JointTable, pair_keys
from elys.sim_node.physics.queries import WorldQueries

Array = np.ndarray[Any, Any]


class WorldJoints(WorldQueries):
    """Joints between a world's bodies, or between bodies and the world. Methods take ids of joints."""

    def __init__(self) -> None:
        super().__init__(BodyTable(), ColliderTable())
        self._contacts = ContactStore()
        self._activity = Activity(self._bodies, self._colliders, self._contacts)
        self._events = EventLog(self._contacts)
        self._joints = JointTable()
        self._broken_joints: list[BrokenJoint] = []

    @property
    def joints(self) -> JointStates:
        """All joints, as the last step left them."""
        return self._joints.states()

    def take_broken_joints(self) -> list[BrokenJoint]:
        """Which joints broke since the last call, in the order of steps and ids."""
        broken, self._broken_joints = self._broken_joints, []
        return broken

    def add_joints(self, joints: ArrayLike, **description: Unpack[JointDescription]) -> None:
        """Joins bodies, or bodies and the world, as they stand: ids (N,) of the caller's choice, and what they are.

        Raises:
            PhysicsError: a value is out of its range, an entity has no body, or there is a joint with that id.
        """
        rows = new_joints(joints, self._bodies, self._joints.rows, description)
        self._joints.add(rows)
        added = self._joints.rows_of(rows["id"])
        self._joints.attach(self._bodies, added)
        self._wake(self._joints.bodies_of(added))
        pairs = self._contacts.live_pairs
        body = self._colliders.rows["body"]
        parted = np.isin(pair_keys(body[pairs["a"]], body[pairs["b"]]), self._joints.unpaired)
        if parted.any():
            self._events.note_dropped(self._bodies.rows, self._colliders.rows, pairs["slot"][parted])
            self._contacts.drop(pairs["slot"][parted])

    def remove_joints(self, joints: ArrayLike) -> None:
        """Removes joints (N,) and the gears on them; PhysicsError for one that does not exist."""
        rows = self._joints.rows_of(joints)
        bodies = self._joints.bodies_of(rows)
        self._wake(bodies)
        self._joints.remove(rows)
        self._pair_anew(bodies)

    def set_joints(self, joints: ArrayLike, **changes: Unpack[JointDrive]) -> None:
        """Changes motors, springs and limits of joints (N,), as in `add_joints`; what is not given stays."""
        rows = self._joints.rows_of(joints)
        self._joints.rows[rows] = changed_joints(self._joints.rows[rows], changes)
        self._joints.outdate()
        self._wake(self._joints.bodies_of(rows))

    def _break_joints(self, rows: Array) -> None:
        """Tells of joints that broke; the bodies they held may collide from now on."""
        for joint in self._joints.rows[rows]:
            a, b = joint["entity"].tolist()
            self._broken_joints.append(
                BrokenJoint(int(joint["id"]), a, b, float(joint["force"]), float(joint["torque"]))
            )
        self._joints.set_broken(rows)
        self._pair_anew(self._joints.bodies_of(rows))

    def _pair_anew(self, bodies: Array) -> None:
        """Lets the next step look for all pairs of body rows."""
        self._colliders.forget_boxes(self._colliders.rows_on(bodies))
        self._activity.outdate()

    def _wake(self, rows: Array) -> None:
        """Wakes bodies that are changed from outside, with what is joined to them, and lets them stay awake for a while."""
        rows = self._joints.with_joined(rows)
        self._activity.wake(rows)
        self._bodies.rows["still_time"][rows] = 0.0

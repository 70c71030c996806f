"""What a step has left, measured when somebody asks: the whole, or little by little each tick."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from elys.sim_node.physics.activity import Activity
from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.colliders import ColliderTable
from elys.sim_node.physics.contacts import ContactStore
from elys.sim_node.physics.joints import JointTable
from elys.sim_node.physics.kernels.measuring import measure_joints, measure_step, sleeping_potential
from elys.sim_node.physics.kernels.tables import GLANCE, MEASURES, Table
from elys.sim_node.physics.states import StepDiagnostics

Array = np.ndarray[Any, Any]

TURNS: Final = 64  # `watch` has looked at every contact once after so many steps
FEWEST: Final = 16  # contacts that it looks at in each
NO_JOINTS: Final = (0.0, 0.0, 0, 0)  # their errors, and which they are


class Measuring:
    """Measures a world's tables, which it only reads."""

    def __init__(
        self,
        bodies: BodyTable,
        colliders: ColliderTable,
        contacts: ContactStore,
        joints: JointTable,
        activity: Activity,
    ) -> None:
        self._bodies = bodies
        self._colliders = colliders
        self._contacts = contacts
        self._joints = joints
        self._activity = activity
        self._room = np.zeros(14)
        self._glances = np.zeros(2, GLANCE)
        self._glance = np.zeros(2, GLANCE)  # of a look at everything
        self._measures = np.zeros(1, MEASURES)
        self._next = 0  # place among the touching pairs that is looked at next
        self._asleep: tuple[int, Table | None] = (-1, None)  # what `_sleeping` was added up for
        self._islands_of = -1  # for which version of the islands they were counted
        self._sleeping = 0.0  # potential energy of what sleeps [J]
        self._still: tuple[int, int, Table | None] = (
            -1,
            -1,
            None,
        )  # what `_found` was measured for, while nothing moves
        self._found: StepDiagnostics | None = None

    def whole(self, parent: Array, islands: int, constants: Table) -> StepDiagnostics:
        """Everything, exactly as the last step left it.

        Parameters: parent (N,) says where islands stand; `islands` is another number whenever they are others, 0 for none.
        """
        return self._measured(parent, islands, constants, 0, self._contacts.touching_count, self._glance)

    def part(self, parent: Array, islands: int, constants: Table) -> StepDiagnostics:
        """Bodies and joints exactly, and the worst contact of the last two rounds: each step looks at a part of them, in turn.

        While nothing is awake and nothing changes the answer is the last one, the same object.
        """
        activity, count = self._activity, self._contacts.touching_count
        is_still = activity.body_count == 0 and count == 0 and not activity.is_outdated
        if is_still:
            version, of, under = self._still
            if self._found is not None and under is constants and (version, of) == (activity.version, islands):
                return self._found
        share = max(FEWEST, -(-count // TURNS))
        begin = self._next if self._next < count else 0
        self._next = end = min(begin + share, count)
        found = self._measured(parent, islands, constants, begin, end, self._glances)
        self._found = found if is_still else None
        self._still = (activity.version, islands, constants)
        return found

    def _measured(
        self,
        parent: Array,
        islands: int,
        constants: Table,
        begin: int,
        end: int,
        glances: Table,
    ) -> StepDiagnostics:
        activity, bodies, contacts, joints = self._activity, self._bodies, self._contacts, self._joints.rows
        rows = bodies.rows
        # Once somebody woke, slept or came, the list of who is awake is no longer good. And a few sleepers are passed over
        # faster than the others are picked.
        is_listed = not activity.is_outdated and 2 * activity.body_count < len(rows)
        measure_step(
            rows,
            bodies.mass,
            bodies.inertia,
            activity.bodies,
            activity.body_count if is_listed else len(rows),
            is_listed,
            parent,
            islands not in (0, self._islands_of),
            self._colliders.rows,
            contacts.pairs,
            contacts.touching,
            contacts.touching_count,
            begin,
            end,
            contacts.manifolds,
            self._room,
            glances,
            self._measures,
            constants,
        )
        self._islands_of = islands
        has_joints = len(joints) > 0
        if has_joints:
            measure_joints(rows, joints, self._room, self._measures)
        found: Any = self._measures.item()
        asleep = self._potential_of_sleepers(constants) if is_listed else 0.0
        off = found[14:18] if has_joints else NO_JOINTS
        return StepDiagnostics._make(
            (
                found[0],
                found[1] + asleep,
                found[2:5],
                found[5:8],
                found[8],
                found[10:12],
                found[9],
                found[12:14],
                *off,
                found[18],
                contacts.touching_count,
                found[19] if islands else 0,
            )
        )

    def _potential_of_sleepers(self, constants: Table) -> float:
        """Of all dynamic bodies that sleep [J], added up anew only when others sleep or gravity is another."""
        version, of = self._asleep
        if version != self._activity.version or of is not constants:
            self._asleep = (self._activity.version, constants)
            self._sleeping = sleeping_potential(self._bodies.rows, self._bodies.mass, constants)
        return self._sleeping

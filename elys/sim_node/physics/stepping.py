"""One step, as a table of contents."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.colliders import ColliderTable
from elys.sim_node.physics.contacts import ContactStore
from elys.sim_node.physics.joints import JointTable
from elys.sim_node.physics.kernels.integrator import finish_step
from elys.sim_node.physics.kernels.joint_preparation import prepare_joints
from elys.sim_node.physics.kernels.joints import finish_joints
from elys.sim_node.physics.kernels.narrow_phase import update_manifolds
from elys.sim_node.physics.kernels.placement import fatten_boxes, place_colliders, place_inertia
from elys.sim_node.physics.kernels.preparation import prepare_contacts
from elys.sim_node.physics.kernels.solver import solve_contacts
from elys.sim_node.physics.kernels.tables import Table

Array = np.ndarray[Any, Any]
Result = TypeVar("Result")


def step_bodies(
    bodies: BodyTable,
    colliders: ColliderTable,
    contacts: ContactStore,
    joints: JointTable,
    constants: Table,
    profile: dict[str, float],
) -> tuple[Array, Array]:
    """Moves everything by one step, the seconds of each stage going into `profile`.

    Returns the rows of bodies whose numbers are not finite any more, and the rows of joints that broke.
    """
    _timed(profile, "place_bodies", lambda: _place_bodies(bodies, colliders))
    _timed(profile, "update_pairs", lambda: _update_pairs(bodies, colliders, contacts, joints, constants))
    _timed(profile, "update_manifolds", lambda: _update_manifolds(bodies, colliders, contacts, constants))
    _timed(profile, "prepare_contacts", lambda: _prepare_contacts(bodies, colliders, contacts, constants))
    _timed(profile, "prepare_joints", lambda: _prepare_joints(bodies, joints, constants))
    _timed(profile, "solve_contacts", lambda: _solve_contacts(bodies, contacts, joints, constants))
    broken = _timed(profile, "finish_joints", lambda: _finish_joints(bodies, joints, constants))
    return _timed(profile, "finish_step", lambda: _finish_step(bodies)), broken


def _place_bodies(bodies: BodyTable, colliders: ColliderTable) -> None:
    place_inertia(bodies.rows, bodies.axes_room)
    place_colliders(bodies.rows, colliders.rows)


def _update_pairs(
    bodies: BodyTable, colliders: ColliderTable, contacts: ContactStore, joints: JointTable, constants: Table
) -> None:
    moved = fatten_boxes(bodies.rows, colliders.rows, constants)
    if moved:
        contacts.update_pairs(bodies.rows, colliders.rows, joints.unpaired, moved)


def _update_manifolds(bodies: BodyTable, colliders: ColliderTable, contacts: ContactStore, constants: Table) -> None:
    contacts.touching_count = update_manifolds(
        bodies.rows,
        colliders.rows,
        contacts.pairs,
        contacts.pair_count,
        contacts.manifolds,
        contacts.points,
        contacts.found,
        constants,
        contacts.touching,
    )


def _prepare_contacts(bodies: BodyTable, colliders: ColliderTable, contacts: ContactStore, constants: Table) -> None:
    contacts.make_rows(contacts.touching_count)
    prepare_contacts(
        bodies.rows,
        colliders.rows,
        contacts.pairs,
        contacts.touching,
        contacts.touching_count,
        contacts.manifolds,
        contacts.points,
        contacts.rows,
        contacts.row_points,
        constants,
    )


def _prepare_joints(bodies: BodyTable, joints: JointTable, constants: Table) -> None:
    joints.update_plan(bodies)
    prepare_joints(bodies.rows, joints.rows, joints.solver_rows, len(joints.rows), joints.loads, constants)


def _finish_joints(bodies: BodyTable, joints: JointTable, constants: Table) -> Array:
    room = joints.broken_room
    count = finish_joints(bodies.rows, joints.rows, joints.solver_rows, len(joints.rows), constants, room)
    return room[:count].copy()


def _solve_contacts(bodies: BodyTable, contacts: ContactStore, joints: JointTable, constants: Table) -> None:
    solve_contacts(
        bodies.rows,
        contacts.manifolds,
        contacts.points,
        contacts.rows,
        contacts.row_points,
        contacts.touching_count,
        joints.rows,
        joints.solver_rows,
        len(joints.rows),
        joints.plan.columns,
        joints.plan.blocks,
        joints.plan.updates,
        joints.loads,
        constants,
    )


def _finish_step(bodies: BodyTable) -> Array:
    count = finish_step(bodies.rows, bodies.poses, bodies.faulty_room)
    return bodies.faulty_room[:count].copy()


def _timed(profile: dict[str, float], name: str, stage: Callable[[], Result]) -> Result:
    began = time.perf_counter()
    result = stage()
    profile[name] = time.perf_counter() - began
    return result

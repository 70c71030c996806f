"""Impulses of joints: the bodies' velocities are copied into the joint, worked on there and written back.

`moving` is what moves: the solver's rows of bodies, and what their single precision has left over (N, 6).
"""

from __future__ import annotations

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.tables import AXIS, LOCKED, SWING


@inner
def load_motion(moving, joint):
    """Copies velocities and displacements of both bodies into the joint; what never moves rests."""
    for side in range(2):
        row = joint.mover[side]
        at = 6 * side
        if row < 0:
            for c in range(6):
                joint.velocity[at + c] = 0.0
                joint.shift[at + c] = 0.0
            continue
        bodies, rest = moving
        body = bodies[row]
        for c in range(6):
            joint.velocity[at + c] = body.velocity[c] + rest[row, c]
            joint.shift[at + c] = body.displacement[c]


@inner
def load_velocity(moving, joint):
    bodies, rest = moving
    for side in range(2):
        row = joint.mover[side]
        if row >= 0:
            for c in range(6):
                joint.velocity[6 * side + c] = bodies[row].velocity[c] + rest[row, c]


@inner
def load_path(moving, drives, joint):
    """Copies the mean of the velocities before and after the substep: that is what the integrator moves bodies by.

    Returns by how much that is another one than before, at most.
    """
    load_velocity(moving, joint)
    most = 0.0
    for side in range(2):
        row = joint.mover[side]
        if row >= 0:
            for c in range(6):
                at = 6 * side + c
                mean = 0.5 * (joint.velocity[at] + drives[row].start_velocity[c])
                most = max(most, abs(mean - joint.path[at]))
                joint.path[at] = mean
    return most


@inner
def store_velocity(moving, joint):
    bodies, rest = moving
    for side in range(2):
        row = joint.mover[side]
        if row >= 0 and joint.inverse_mass[side] > 0.0:
            for c in range(6):
                exact = joint.velocity[6 * side + c]
                bodies[row].velocity[c] = exact
                rest[row, c] = exact - bodies[row].velocity[c]


@inner
def push(joint, row, impulse):
    """Applies an impulse of one row."""
    v = joint.velocity
    given = joint.given
    d = row.direction
    turn = row.turn
    arm = row.arm
    applied = joint.applied
    mass = joint.axis_mass
    for c in range(3):
        for at, change in (
            (c, -impulse * mass[c] * d[c]),
            (3 + c, -impulse * turn[c]),
            (6 + c, impulse * mass[3 + c] * d[c]),
            (9 + c, impulse * turn[3 + c]),
        ):
            v[at] += change
            given[at] += change
        applied[c] += impulse * d[c]
        applied[3 + c] -= impulse * arm[c]
        applied[6 + c] += impulse * arm[3 + c]


@inner
def push_free(joint, rows, first, row, impulse):
    """Applies an impulse of a free row, and the locked rows' answer to it."""
    if impulse == 0.0:
        return
    push(joint, row, impulse)
    for k in range(joint.locked):
        change = -row.answer[k] * impulse
        joint.impulse[k] += change
        push(joint, rows[first + k], change)


@inner
def axis_impulse(joint):
    """All that acts on the coordinate."""
    held = joint.lower_impulse - joint.upper_impulse
    return joint.spring_impulse + joint.motor_impulse + held + joint.gear_impulse


@inner
def push_all(joint, rows, first):
    """Applies all accumulated impulses along the rows as they are written, in place of what was applied before."""
    for c in range(12):
        joint.velocity[c] -= joint.given[c]
        joint.given[c] = 0.0
    for c in range(9):
        joint.applied[c] = 0.0
    for k in range(joint.locked):
        push(joint, rows[first + k], joint.impulse[k])
    if joint.free > 0:
        push(joint, rows[first + AXIS], axis_impulse(joint))
    if joint.free > 1:
        push(joint, rows[first + SWING], -joint.swing_impulse)


@inner
def forget_impulses(joint):
    """Begins anew with no impulses at all."""
    for k in range(LOCKED):
        joint.impulse[k] = 0.0
    for c in range(12):
        joint.given[c] = 0.0
    for c in range(9):
        joint.applied[c] = 0.0
    joint.spring_impulse = 0.0
    joint.motor_impulse = 0.0
    joint.lower_impulse = 0.0
    joint.upper_impulse = 0.0
    joint.gear_impulse = 0.0
    joint.swing_impulse = 0.0

"""The locked rows of joints: rigid ones one by one or all together, soft ones, and drives that only hold so much."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.joint_direct import SOFTNESS, substitute
from elys.sim_node.physics.kernels.joint_impulses import load_velocity, push, store_velocity
from elys.sim_node.physics.kernels.joint_mass import solve_factor
from elys.sim_node.physics.kernels.joint_rows import correction, row_rate
from elys.sim_node.physics.kernels.tables import JOINT_ROWS


@inner
def clamp_drive(joint, at, most):
    """Shortens three impulses of `work` so that with the accumulated ones they stay within a length."""
    x = joint.impulse[at] + joint.work[at]
    y = joint.impulse[at + 1] + joint.work[at + 1]
    z = joint.impulse[at + 2] + joint.work[at + 2]
    squared = x * x + y * y + z * z
    scale = most / math.sqrt(squared) if squared > most * most else 1.0
    joint.work[at] = scale * x - joint.impulse[at]
    joint.work[at + 1] = scale * y - joint.impulse[at + 1]
    joint.work[at + 2] = scale * z - joint.impulse[at + 2]


@inner
def drive_rate(joint, k):
    """The rate that a drive wants in one of its rows, in world axes."""
    wanted = joint.drive_velocity
    a = joint.axis_a
    at = 3 if k >= 3 else 0
    c = k - at
    return wanted[at] * a[c] + wanted[at + 1] * a[3 + c] + wanted[at + 2] * a[6 + c]


@inner
def locked_rates(joint, rows, first, h, biased):
    """Writes what the impulses of the locked rows have to change, into `work`; returns the largest of it."""
    most = 0.0
    for k in range(joint.locked):
        row = rows[first + k]
        rate = row_rate(joint, row) + row.lead
        if biased:
            rate += correction(row.error, h)
        joint.work[k] = -rate
        most = max(most, abs(rate))
    return most


@inner
def push_work(joint, rows, first):
    """Applies the impulses in `work` to the locked rows."""
    for k in range(joint.locked):
        joint.impulse[k] += joint.work[k]
        push(joint, rows[first + k], joint.work[k])


@inner
def solve_locked(joint, rows, first, h, biased):
    """The locked rows of a rigid joint as one block; returns the largest rate that was left."""
    most = locked_rates(joint, rows, first, h, biased)
    solve_factor(joint, joint.work)
    push_work(joint, rows, first)
    return most


@inner
def solve_soft(joint, rows, first, h):
    """Locked rows that give way like damped springs, by the trapezoidal rule in units of the block's mass."""
    omega = 2.0 * math.pi * joint.frequency
    stiff = h * omega * omega
    half = 0.25 * h * stiff + h * joint.damping_ratio * omega
    work = joint.work
    for k in range(joint.locked):
        row = rows[first + k]
        rate = row_rate(joint, row) + row.lead
        work[k] = -(stiff * row.error + half * (row.start_rate + rate)) / (1.0 + half)
    solve_factor(joint, work)
    for k in range(joint.locked):
        work[k] -= joint.impulse[k] / (1.0 + half)
    push_work(joint, rows, first)


@inner
def solve_drive(joint, rows, first, h):
    """Gives b a velocity against a, as far as force and torque allow.

    One after the other: a force that counts on a torque which is then cut off would drive the bodies on instead.
    """
    work = joint.work
    for part in range(2):
        for k in range(joint.locked):
            row = rows[first + k]
            is_meant = k // 3 == part
            work[k] = drive_rate(joint, k) - row_rate(joint, row) - row.lead if is_meant else 0.0
        solve_factor(joint, work)
        clamp_drive(joint, 3 * part, joint.drive_limit[part] * h)
        push_work(joint, rows, first)


@inner
def solve_direct(moving, joints, rows, columns, first, last, blocks, h, biased, settled):
    """The locked rows of joints that are solved together, in columns [first, last); returns the largest rate left."""
    most = 0.0
    for c in range(first, last):
        j = columns[c].joint
        joint = joints[j]
        load_velocity(moving, joint)
        locked_rates(joint, rows, JOINT_ROWS * j, h, biased)
        for k in range(joint.locked):
            joint.work[k] -= SOFTNESS * rows[JOINT_ROWS * j + k].own * joint.impulse[k]
            most = max(most, abs(joint.work[k]))
    if most <= settled:
        return most
    substitute(joints, columns, first, last, blocks)
    for c in range(first, last):
        j = columns[c].joint
        load_velocity(moving, joints[j])
        push_work(joints[j], rows, JOINT_ROWS * j)
        store_velocity(moving, joints[j])
    return most

"""Joints as a step begins: frames, rows, masses and the stiffness of springs."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.joint_loads import spread_loads
from elys.sim_node.physics.kernels.joint_mass import prepare_masses, turn_inertia
from elys.sim_node.physics.kernels.joint_rows import (
    has_coordinate,
    is_rod,
    locked_count,
    measure,
    place_frames,
    row_rate,
    write_rows,
)
from elys.sim_node.physics.kernels.rotation import multiplied, rotated
from elys.sim_node.physics.kernels.tables import AXIS, CONE, GEAR, JOINT_ROWS


@inner
def place_start(bodies, joint):
    """Masses, inertias and frames as the step begins."""
    anchor = joint.local_anchor
    turn = joint.local_rotation
    arm = joint.start_arm
    frame = joint.start_frame
    offset = joint.start_offset
    for c in range(3):
        offset[c] = 0.0
    for side in range(2):
        r = 3 * side
        q = 4 * side
        sign = 1.0 if side == 1 else -1.0
        row = joint.body[side]
        if row < 0:
            for c in range(3):
                arm[r + c] = anchor[r + c]
                joint.arm[r + c] = anchor[r + c]
                offset[c] += sign * anchor[r + c]
            for c in range(4):
                frame[q + c] = turn[q + c]
                joint.frame[q + c] = turn[q + c]
            joint.inverse_mass[side] = 0.0
            for c in range(6):
                joint.start_inertia[6 * side + c] = 0.0
            continue
        body = bodies[row]
        p = body.rotation
        arm[r], arm[r + 1], arm[r + 2] = rotated(p[0], p[1], p[2], p[3], anchor[r], anchor[r + 1], anchor[r + 2])
        x, y, z, w = multiplied(p[0], p[1], p[2], p[3], turn[q], turn[q + 1], turn[q + 2], turn[q + 3])
        frame[q], frame[q + 1], frame[q + 2], frame[q + 3] = x, y, z, w
        for c in range(3):
            offset[c] += sign * (body.position[c] + arm[r + c])
        joint.inverse_mass[side] = body.inverse_mass
        for c in range(6):
            joint.start_inertia[6 * side + c] = body.world_inverse_inertia[c]


@inner
def free_count(joint):
    """How many free rows something acts on."""
    if not has_coordinate(joint.kind) or is_rod(joint):
        return 0
    if joint.kind == CONE:
        return 2
    held = joint.lower > -math.inf or joint.upper < math.inf or joint.geared_by != 0
    return 1 if held or joint.spring_frequency > 0.0 or joint.motor_limit > 0.0 else 0


@inner
def prepare_spring(joint, row):
    """Stiffness and friction from frequency and damping ratio, for the masses and the pose that the spring begins with."""
    if joint.spring_frequency > 0.0 and joint.stiffness < 0.0:
        omega = 2.0 * math.pi * joint.spring_frequency
        joint.stiffness = row.effective_mass * omega * omega
        joint.spring_friction = 2.0 * joint.spring_damping * row.effective_mass * omega


@inner
def find_gears(joints, joint_count):
    for j in range(joint_count):
        joints[j].geared_by = 0
    for j in range(joint_count):
        joint = joints[j]
        if joint.kind == GEAR and joint.broken == 0:
            joints[joint.gear_row[0]].geared_by = 1
            joints[joint.gear_row[1]].geared_by = 1


@inner
def prepare_joint(bodies, joint, rows, first):
    joint.locked = locked_count(joint)
    joint.free = free_count(joint)
    for c in range(12):
        joint.shift[c] = 0.0
        joint.velocity[c] = 0.0
    for side in range(2):
        row = joint.body[side]
        if row >= 0:
            for c in range(6):
                joint.velocity[6 * side + c] = bodies[row].velocity[c]
    for c in range(12):
        joint.given[c] = 0.0
    for c in range(6):
        joint.step_impulse[c] = 0.0
    place_frames(joint, 0.0)
    measure(joint, rows, first)
    turn_inertia(joint)


@inner
def prepare_rows(joint, rows, first):
    write_rows(joint, rows, first)
    prepare_masses(joint, rows, first)
    for k in range(joint.locked):
        rows[first + k].start_rate = row_rate(joint, rows[first + k])
    for k in range(AXIS, AXIS + joint.free):
        rows[first + k].start_rate = row_rate(joint, rows[first + k])
    if joint.free > 0:
        prepare_spring(joint, rows[first + AXIS])


@kernel
def prepare_joints(bodies, joints, joint_rows, joint_count, loads, all_constants):
    """Frames, rows and masses of all joints as the step begins; the world inertias of the bodies must be up to date.

    `loads` (N, 6) is room to work in, with a row for each body.
    """
    find_gears(joints, joint_count)
    for j in range(joint_count):
        joint = joints[j]
        joint.live = 0
        if joint.kind != GEAR and joint.broken == 0:
            place_start(bodies, joint)
            joint.live = 1 if joint.inverse_mass[0] + joint.inverse_mass[1] > 0.0 else 0
            prepare_joint(bodies, joint, joint_rows, JOINT_ROWS * j)
    spread_loads(joints, joint_count, loads, all_constants[0].substep)
    for j in range(joint_count):
        joint = joints[j]
        if joint.kind != GEAR and joint.broken == 0:
            prepare_rows(joint, joint_rows, JOINT_ROWS * j)
    for j in range(joint_count):
        joint = joints[j]
        if joint.kind == GEAR and joint.broken == 0:
            joint.live = min(joints[joint.gear_row[0]].live, joints[joint.gear_row[1]].live)

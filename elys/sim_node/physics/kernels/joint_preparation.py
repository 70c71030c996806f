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
from elys.sim_node.physics.kernels.locks import TURNS, free_part
from elys.sim_node.physics.kernels.rotation import multiplied, rotated
from elys.sim_node.physics.kernels.tables import AXIS, CONE, DYNAMIC, GEAR, JOINT_ROWS, LOCKED, MOTOR, STATIC

APART = 0.1  # error of a rigid joint that bodies do not fall asleep with [m], [rad]


@inner
def place_start(bodies, drives, joint):
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
        joint.mover[side] = -1
        joint.inverse_mass[side] = 0.0
        joint.turns_locked[side] = 0
        for c in range(3):
            joint.axis_mass[3 * side + c] = 0.0
        for c in range(6):
            joint.start_inertia[6 * side + c] = 0.0
            joint.velocity[6 * side + c] = 0.0
        x, y, z, w = 0.0, 0.0, 0.0, 1.0
        if row >= 0:
            body = bodies[row]
            x, y, z, w = body.rotation[0], body.rotation[1], body.rotation[2], body.rotation[3]
            for c in range(3):
                offset[c] += sign * body.position[c]
            if body.motion != STATIC:
                joint.mover[side] = row
                for c in range(6):
                    joint.velocity[6 * side + c] = body.velocity[c]
            if body.motion == DYNAMIC:
                joint.inverse_mass[side] = body.inverse_mass
                joint.turns_locked[side] = 1 if body.locked & TURNS else 0
                for c in range(3):
                    joint.axis_mass[3 * side + c] = body.inverse_mass * free_part(body.locked, c)
                for c in range(6):
                    joint.start_inertia[6 * side + c] = drives[row].inverse_inertia[c]
        arm[r], arm[r + 1], arm[r + 2] = rotated(x, y, z, w, anchor[r], anchor[r + 1], anchor[r + 2])
        x, y, z, w = multiplied(x, y, z, w, turn[q], turn[q + 1], turn[q + 2], turn[q + 3])
        frame[q], frame[q + 1], frame[q + 2], frame[q + 3] = x, y, z, w
        for c in range(3):
            offset[c] += sign * arm[r + c]
            joint.arm[r + c] = arm[r + c]
        for c in range(4):
            joint.frame[q + c] = frame[q + c]


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
def awake_row(bodies, joint):
    """The row of a body that a joint pushes, -1 for none."""
    for side in range(2):
        row = joint.body[side]
        if row >= 0 and bodies[row].motion == DYNAMIC and bodies[row].asleep == 0:
            return row
    return -1


@inner
def find_strengths(bodies, joints):
    """Writes which joints hold something that is awake, and how strongly its island is solved."""
    for j in range(joints.shape[0]):
        joint = joints[j]
        joint.live = 0
        if joint.broken != 0:
            continue
        row = awake_row(bodies, joint)
        if joint.kind == GEAR:
            row = awake_row(bodies, joints[joint.gear_row[0]])
            if awake_row(bodies, joints[joint.gear_row[1]]) < 0:
                row = -1
        if row >= 0:
            joint.live = 1
            joint.strength = bodies[row].strength


@inner
def list_parts(joints, order, parts, groups, part_order):
    """Sorts awake parts by strength. All bodies of one fall asleep together."""
    at = 0
    for g in range(groups.shape[0]):
        groups[g].first = at
        for p in range(parts.shape[0]):
            joint = joints[order[parts[p].first]]
            if joint.live != 0 and joint.strength == g:
                part_order[at] = p
                at += 1
        groups[g].last = at


@inner
def is_driven(joint):
    """Whether a motor wants something to move."""
    driven = joint.motor_limit > 0.0 and joint.motor_speed != 0.0
    if joint.kind == MOTOR:
        for c in range(6):
            driven = driven or joint.drive_velocity[c] != 0.0
    return driven


@inner
def is_apart(joint, rows, first):
    """Whether a rigid joint is so far off that its bodies are still on their way, though at rest after each substep."""
    most = 0.0
    if joint.kind != MOTOR and joint.frequency == 0.0:
        for k in range(joint.locked):
            most = max(most, abs(rows[first + k].error))
    return most > APART


@inner
def keep_awake(bodies, joint):
    for side in range(2):
        if joint.body[side] >= 0:
            bodies[joint.body[side]].still_time = 0.0


@inner
def rescale(joint, h):
    """Impulses of a substep of another length become those of one of length h."""
    if joint.impulse_time > 0.0 and joint.impulse_time != h:
        scale = h / joint.impulse_time
        for c in range(LOCKED):
            joint.impulse[c] *= scale
        for c in range(9):
            joint.applied[c] *= scale
        joint.spring_impulse *= scale
        joint.motor_impulse *= scale
        joint.lower_impulse *= scale
        joint.upper_impulse *= scale
        joint.gear_impulse *= scale
        joint.swing_impulse *= scale
    joint.impulse_time = h


@inner
def prepare_joint(joint, rows, first):
    joint.locked = locked_count(joint)
    joint.free = free_count(joint)
    for c in range(12):
        joint.shift[c] = 0.0
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


@inner
def prepare_part(system, part, drives, h):
    """Frames, rows and masses of one part's joints."""
    bodies, joints, rows, order = system.bodies, system.rows, system.solver_rows, system.order
    for place in range(part.first, part.last):
        j = order[place]
        rescale(joints[j], h)
        if joints[j].kind == GEAR:
            joints[j].mover[0] = joints[j].mover[1] = -1  # it moves what its joints hold
            continue
        place_start(bodies, drives, joints[j])
        prepare_joint(joints[j], rows, JOINT_ROWS * j)
        if is_driven(joints[j]) or is_apart(joints[j], rows, JOINT_ROWS * j):
            keep_awake(bodies, joints[j])
        for side in range(2):
            row = joints[j].mover[side]
            if row >= 0:
                for c in range(3):
                    system.turned[row, c] = 0.0
                for c in range(6):
                    system.rest[row, c] = bodies[row].velocity[c] - drives[row].free_velocity[c]
    spread_loads(joints, order, part.first, part.last, system.loads, h)
    for place in range(part.first, part.last):
        j = order[place]
        if joints[j].kind != GEAR:
            prepare_rows(joints[j], rows, JOINT_ROWS * j)


@kernel
def prepare_joints(system, drives, strengths):
    """Frames, rows and masses of all joints as the step begins; the solver's bodies must be prepared.

    Parameters: system is a Joints, drives (N,) and strengths (S,) as the solver has them.
    """
    find_strengths(system.bodies, system.rows)
    list_parts(system.rows, system.order, system.parts, system.groups, system.part_order)
    find_gears(system.rows, system.rows.shape[0])
    for g in range(system.groups.shape[0]):
        for place in range(system.groups[g].first, system.groups[g].last):
            prepare_part(system, system.parts[system.part_order[place]], drives, strengths[g].substep)

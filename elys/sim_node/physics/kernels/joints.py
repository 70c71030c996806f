"""Joints, solved by accumulated impulses beside the contacts.

The locked rows of a joint are solved as one block; limits, motors and springs act on its free coordinate with the locked
rows held, so that none of them has to be undone by the others. The bodies' velocities are copied into the joint, worked on
in double precision and written back, whatever precision the bodies have.

A substep keeps energy over minutes because it is the same forwards and backwards in time: impulses act along the rows as
they stand in the MIDDLE of the substep and make the velocities fit the rows as they stand at its END. The integrator moves
bodies by the mean of the old and the new velocity (`take_back`), so that the middle is where the impulses do no work: the
implicit midpoint rule for constrained motion, Hairer, Lubich & Wanner, "Geometric Numerical Integration" (2006), VII.1.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.joint_direct import SOFTNESS, factor_joints, substitute
from elys.sim_node.physics.kernels.joint_mass import prepare_masses, solve_factor, turn_inertia
from elys.sim_node.physics.kernels.joint_rows import (
    has_coordinate,
    is_rod,
    locked_count,
    measure,
    place_frames,
    row_rate,
    write_free,
    write_locked,
)
from elys.sim_node.physics.kernels.rotation import cross, multiplied, rotated
from elys.sim_node.physics.kernels.tables import AXIS, CONE, GEAR, JOINT_ROWS, MOTOR, SWING

SWEEPS = 16
SETTLED = 1e-6  # rates below it are not worth another sweep [m/s], [rad/s]
CORRECTION = 0.25
LARGEST_ERROR = 0.2  # what is farther off comes back as if it were not [m], [rad]


@inner
def is_active(joint):
    """Whether a joint has rows of its own, which a gear has not."""
    return joint.live != 0 and joint.kind != GEAR


@inner
def load_motion(bodies, joint):
    """Copies velocities and displacements of both bodies into the joint; the world rests."""
    for side in range(2):
        row = joint.body[side]
        at = 6 * side
        if row < 0:
            for c in range(6):
                joint.velocity[at + c] = 0.0
                joint.shift[at + c] = 0.0
            continue
        body = bodies[row]
        for c in range(6):
            joint.velocity[at + c] = body.velocity[c]
            joint.shift[at + c] = body.displacement[c]


@inner
def load_velocity(bodies, joint):
    for side in range(2):
        row = joint.body[side]
        if row >= 0:
            for c in range(6):
                joint.velocity[6 * side + c] = bodies[row].velocity[c]


@inner
def store_velocity(bodies, joint):
    for side in range(2):
        row = joint.body[side]
        if row >= 0 and joint.inverse_mass[side] > 0.0:
            for c in range(6):
                bodies[row].velocity[c] = joint.velocity[6 * side + c]


@inner
def push(joint, row, impulse):
    """Applies an impulse of one row."""
    v = joint.velocity
    given = joint.given
    d = row.direction
    turn = row.turn
    arm = row.arm
    applied = joint.applied
    ma = impulse * joint.inverse_mass[0]
    mb = impulse * joint.inverse_mass[1]
    for c in range(3):
        for at, change in (
            (c, -ma * d[c]),
            (3 + c, -impulse * turn[c]),
            (6 + c, mb * d[c]),
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
    if has_coordinate(joint.kind):
        push(joint, rows[first + AXIS], axis_impulse(joint))
    if joint.kind == CONE:
        push(joint, rows[first + SWING], -joint.swing_impulse)


@inner
def write_rows(joint, rows, first):
    write_locked(joint, rows, first)
    write_free(joint, rows, first)


@inner
def begin_substep(joint, rows, first, h):
    """Writes the rows as they will stand in the middle of the substep, and how they differ from those at its end."""
    place_frames(joint, 0.0)
    measure(joint, rows, first)
    joint.spring_start = joint.coordinate
    turn_inertia(joint)  # impulses act before the bodies turn: with any other inertia they would change the spin
    place_frames(joint, h)
    write_rows(joint, rows, first)
    for k in range(JOINT_ROWS):
        rows[first + k].lead = row_rate(joint, rows[first + k])
    place_frames(joint, 0.5 * h)
    write_rows(joint, rows, first)
    for k in range(JOINT_ROWS):
        rows[first + k].lead -= row_rate(joint, rows[first + k])
    prepare_masses(joint, rows, first)


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
            rate += CORRECTION / h * min(max(row.error, -LARGEST_ERROR), LARGEST_ERROR)
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
    if most > SETTLED:
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
    """Gives b a velocity against a, as far as force and torque allow."""
    work = joint.work
    for k in range(joint.locked):
        row = rows[first + k]
        work[k] = drive_rate(joint, k) - row_rate(joint, row) - row.lead
    solve_factor(joint, work)
    clamp_drive(joint, 0, joint.drive_limit[0] * h)
    clamp_drive(joint, 3, joint.drive_limit[1] * h)
    push_work(joint, rows, first)


@inner
def solve_direct(bodies, joints, rows, columns, blocks, h, biased):
    """The locked rows of all joints that are solved together; returns the largest rate that was left."""
    most = 0.0
    for c in range(columns.shape[0]):
        j = columns[c].joint
        joint = joints[j]
        load_velocity(bodies, joint)
        locked_rates(joint, rows, JOINT_ROWS * j, h, biased)
        for k in range(joint.locked):
            joint.work[k] -= SOFTNESS * rows[JOINT_ROWS * j + k].own * joint.impulse[k]
            most = max(most, abs(joint.work[k]))
    if most <= SETTLED:
        return most
    substitute(joints, columns, blocks)
    for c in range(columns.shape[0]):
        j = columns[c].joint
        load_velocity(bodies, joints[j])
        push_work(joints[j], rows, JOINT_ROWS * j)
        store_velocity(bodies, joints[j])
    return most


@inner
def solve_spring(joint, rows, first, row, h):
    """A damped spring by the trapezoidal rule: loses no energy but to its damper, whatever the step."""
    half = h * (0.25 * h * joint.stiffness + 0.5 * joint.spring_friction)
    rate = row_rate(joint, row) + row.lead
    stretch = joint.spring_start - joint.spring_rest
    change = -h * joint.stiffness * stretch - half * (row.start_rate + rate) - joint.spring_impulse
    change /= 1.0 + half / row.effective_mass
    most = joint.spring_limit * h
    new = min(max(joint.spring_impulse + change, -most), most)
    change = new - joint.spring_impulse
    joint.spring_impulse = new
    push_free(joint, rows, first, row, change)


@inner
def limit_impulse(old, mass, opening, start, gap, h, biased):
    """The accumulated impulse of a limit; `gap` [m] or [rad] is left, `opening` is its rate and `start` what that was.

    What the integrator will take back is given beforehand, so that a blow ends on the limit and not behind it.
    """
    if biased:
        lead = 0.5 * min(start, 0.0)
        share = 1.0 if gap > 0.0 else CORRECTION  # a gap may be used up, but not more
        return max(old - mass * (opening + lead + share / h * max(gap, -LARGEST_ERROR)), 0.0)
    if old == 0.0 and gap > 0.0:
        return 0.0
    return max(old - mass * opening, 0.0)


@inner
def solve_limits(joint, rows, first, row, h, biased):
    """Keeps the coordinate between its limits, or on them where they are equal."""
    mass = row.effective_mass
    if joint.lower == joint.upper:
        rate = row_rate(joint, row) + row.lead
        if biased:
            error = joint.coordinate - joint.lower
            rate += CORRECTION / h * min(max(error, -LARGEST_ERROR), LARGEST_ERROR)
        joint.lower_impulse -= mass * rate
        push_free(joint, rows, first, row, -mass * rate)
        return abs(rate)
    most = 0.0
    gap = joint.coordinate - joint.lower
    if gap < math.inf:
        rate = row_rate(joint, row) + row.lead
        new = limit_impulse(joint.lower_impulse, mass, rate, row.start_rate, gap, h, biased)
        change = new - joint.lower_impulse
        joint.lower_impulse = new
        push_free(joint, rows, first, row, change)
        most = abs(change)
    gap = joint.upper - joint.coordinate
    if gap < math.inf:
        rate = row_rate(joint, row) + row.lead
        new = limit_impulse(joint.upper_impulse, mass, -rate, -row.start_rate, gap, h, biased)
        change = new - joint.upper_impulse
        joint.upper_impulse = new
        push_free(joint, rows, first, row, -change)
        most = max(most, abs(change))
    return most / mass


@inner
def solve_motor(joint, rows, first, row, h):
    rate = row_rate(joint, row) + row.lead - joint.motor_speed
    most = joint.motor_limit * h
    new = min(max(joint.motor_impulse - row.effective_mass * rate, -most), most)
    change = new - joint.motor_impulse
    joint.motor_impulse = new
    push_free(joint, rows, first, row, change)


@inner
def solve_free(joint, rows, first, h, biased):
    """Springs, motors and limits; returns the largest rate that was left."""
    row = rows[first + AXIS]
    most = 0.0
    if row.effective_mass > 0.0:
        if joint.spring_frequency > 0.0 and joint.stiffness >= 0.0:
            solve_spring(joint, rows, first, row, h)
        if joint.motor_limit > 0.0:
            solve_motor(joint, rows, first, row, h)
        most = solve_limits(joint, rows, first, row, h, biased)
    if joint.kind == CONE:
        row = rows[first + SWING]
        if row.effective_mass > 0.0:
            rate = row_rate(joint, row) + row.lead
            old = joint.swing_impulse
            gap = joint.swing_limit - joint.swing
            new = limit_impulse(old, row.effective_mass, -rate, -row.start_rate, gap, h, biased)
            joint.swing_impulse = new
            push_free(joint, rows, first, row, old - new)
            most = max(most, abs(new - old) / row.effective_mass)
    return most


@inner
def solve_gear(bodies, joints, rows, gear, h, biased):
    """Couples two coordinates; returns the rate that was left."""
    j = gear.gear_row[0]
    k = gear.gear_row[1]
    one = joints[j]
    two = joints[k]
    first = rows[JOINT_ROWS * j + AXIS]
    second = rows[JOINT_ROWS * k + AXIS]
    load_velocity(bodies, one)
    load_velocity(bodies, two)
    ratio = gear.ratio
    rate = row_rate(one, first) + first.lead
    rate = ratio * rate - row_rate(two, second) - second.lead
    if biased:
        error = ratio * one.coordinate - two.coordinate - gear.gear_offset
        rate += CORRECTION / h * min(max(error, -LARGEST_ERROR), LARGEST_ERROR)
    give = 0.0
    if first.effective_mass > 0.0:
        give += ratio * ratio / first.effective_mass
    if second.effective_mass > 0.0:
        give += 1.0 / second.effective_mass
    if give == 0.0:
        return 0.0
    impulse = -rate / give
    gear.impulse[0] += impulse
    one.gear_impulse += ratio * impulse
    two.gear_impulse -= impulse
    push_free(one, rows, JOINT_ROWS * j, first, ratio * impulse)
    store_velocity(bodies, one)
    load_velocity(bodies, two)  # the two may share a body
    push_free(two, rows, JOINT_ROWS * k, second, -impulse)
    store_velocity(bodies, two)
    return abs(rate)


@inner
def solve_joint(bodies, joints, rows, j, h, biased):
    """One joint once; returns the largest rate that was left before."""
    joint = joints[j]
    if joint.live == 0 or (joint.direct != 0 and joint.idle != 0):
        return 0.0
    if joint.kind == GEAR:
        return solve_gear(bodies, joints, rows, joint, h, biased)
    first = JOINT_ROWS * j
    load_velocity(bodies, joint)
    most = 0.0
    if joint.kind == MOTOR:
        solve_drive(joint, rows, first, h)
    elif joint.frequency > 0.0:
        solve_soft(joint, rows, first, h)
    elif joint.direct == 0:
        most = solve_locked(joint, rows, first, h, biased)
    if has_coordinate(joint.kind):
        most = max(most, solve_free(joint, rows, first, h, biased))
    store_velocity(bodies, joint)
    return most


@inner
def end_substep(bodies, joint, rows, first):
    """Adds up what was applied, and keeps the rates that springs begin the next substep with."""
    load_velocity(bodies, joint)
    for k in range(JOINT_ROWS):
        rows[first + k].start_rate = row_rate(joint, rows[first + k])
    total = joint.step_impulse
    p = joint.applied
    r = joint.arm
    x, y, z = cross(r[3], r[4], r[5], p[0], p[1], p[2])
    for c in range(3):
        total[c] += p[c]
    total[3] += p[6] - x
    total[4] += p[7] - y
    total[5] += p[8] - z


@inner
def begin_joints(bodies, joints, rows, joint_count, columns, blocks, updates, h):
    """Rows and masses for a substep, and the impulses of the last one along the new rows."""
    for j in range(joint_count):
        if is_active(joints[j]):
            load_motion(bodies, joints[j])
            begin_substep(joints[j], rows, JOINT_ROWS * j, h)
    for j in range(joint_count):
        if is_active(joints[j]):
            load_velocity(bodies, joints[j])
            push_all(joints[j], rows, JOINT_ROWS * j)
            store_velocity(bodies, joints[j])
    factor_joints(joints, rows, columns, blocks, updates)


@inner
def solve_joints(bodies, joints, rows, joint_count, columns, blocks, updates, constants, biased):
    """All joints, until they agree: forwards and backwards, so that a chain is no better from one end.

    With `biased` errors of position are taken out, which the pass after the bodies have moved takes out of the velocities
    again. The bodies must begin a substep with the impulses of the last one, as `integrate_velocities` lets them.
    """
    h = constants.substep
    if biased:
        begin_joints(bodies, joints, rows, joint_count, columns, blocks, updates, h)
    else:
        for j in range(joint_count):
            if is_active(joints[j]) and has_coordinate(joints[j].kind):  # limits need to know what is left
                load_motion(bodies, joints[j])
                place_frames(joints[j], 0.0)
                measure(joints[j], rows, JOINT_ROWS * j)
    for sweep in range(SWEEPS):
        most = solve_direct(bodies, joints, rows, columns, blocks, h, biased)
        for place in range(joint_count):
            j = place if sweep % 2 == 0 else joint_count - 1 - place
            most = max(most, solve_joint(bodies, joints, rows, j, h, biased))
        if most <= SETTLED:
            break
    if not biased:
        for j in range(joint_count):
            if is_active(joints[j]):
                end_substep(bodies, joints[j], rows, JOINT_ROWS * j)


@inner
def warm_start_joints(bodies, joints, joint_rows, joint_count):
    """Begins the step with the impulses of the last one."""
    for j in range(joint_count):
        joint = joints[j]
        if is_active(joint):
            load_velocity(bodies, joint)
            push_all(joint, joint_rows, JOINT_ROWS * j)
            store_velocity(bodies, joint)


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
                offset[c] += sign * anchor[r + c]
            for c in range(4):
                frame[q + c] = turn[q + c]
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
def is_idle(joint):
    """Whether nothing acts on the coordinate of a joint but gears."""
    if not has_coordinate(joint.kind) or is_rod(joint):
        return True
    held = joint.lower > -math.inf or joint.upper < math.inf or joint.kind == CONE
    return not (held or joint.spring_frequency > 0.0 or joint.motor_limit > 0.0)


@inner
def prepare_spring(joint, row):
    """Stiffness and friction from frequency and damping ratio, for the masses and the pose that the spring begins with."""
    if joint.spring_frequency > 0.0 and joint.stiffness < 0.0:
        omega = 2.0 * math.pi * joint.spring_frequency
        joint.stiffness = row.effective_mass * omega * omega
        joint.spring_friction = 2.0 * joint.spring_damping * row.effective_mass * omega


@kernel
def prepare_joints(bodies, joints, joint_rows, joint_count):
    """Frames, rows and masses of all joints as the step begins; the world inertias of the bodies must be up to date."""
    for j in range(joint_count):
        joint = joints[j]
        first = JOINT_ROWS * j
        if joint.kind == GEAR or joint.broken != 0:
            joint.live = 0
            continue
        place_start(bodies, joint)
        joint.live = 1 if joint.inverse_mass[0] + joint.inverse_mass[1] > 0.0 else 0
        joint.locked = locked_count(joint)
        joint.idle = 1 if is_idle(joint) else 0
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
        measure(joint, joint_rows, first)
        write_rows(joint, joint_rows, first)
        turn_inertia(joint)
        prepare_masses(joint, joint_rows, first)
        for k in range(JOINT_ROWS):
            joint_rows[first + k].lead = 0.0
            joint_rows[first + k].start_rate = row_rate(joint, joint_rows[first + k])
        prepare_spring(joint, joint_rows[first + AXIS])
    for j in range(joint_count):
        joint = joints[j]
        if joint.kind == GEAR and joint.broken == 0:
            joint.live = min(joints[joint.gear_row[0]].live, joints[joint.gear_row[1]].live)


@kernel
def finish_joints(bodies, joints, joint_rows, joint_count, all_constants, broken):
    """Forces and coordinates as the step ends; joints whose force was too large break.

    Returns how many did; their rows are listed in `broken` (J,).
    """
    constants = all_constants[0]
    rate = 1.0 / (constants.substep * constants.substeps)
    count = 0
    for j in range(joint_count):
        joint = joints[j]
        if not is_active(joint):
            continue
        load_motion(bodies, joint)
        place_frames(joint, 0.0)
        measure(joint, joint_rows, JOINT_ROWS * j)
        write_free(joint, joint_rows, JOINT_ROWS * j)
        joint.speed = row_rate(joint, joint_rows[JOINT_ROWS * j + AXIS]) if has_coordinate(joint.kind) else 0.0
        p = joint.step_impulse
        joint.force = rate * math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
        joint.torque = rate * math.sqrt(p[3] * p[3] + p[4] * p[4] + p[5] * p[5])
        if joint.force > joint.break_force or joint.torque > joint.break_torque:
            joint.broken = 1
            broken[count] = j
            count += 1
    return count

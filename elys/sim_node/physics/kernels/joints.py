"""Joints, solved by accumulated impulses beside the contacts.

The locked rows of a joint are solved as one block; limits, motors and springs act on its free coordinate with the locked
rows held, so that none of them has to be undone by the others. The bodies' velocities are copied into the joint, worked on
in double precision and written back, whatever precision the bodies have.

A substep keeps energy over minutes because it is the same forwards and backwards in time: impulses act along the rows as
they stand in the MIDDLE of the substep and make the velocities fit the rows as they stand at its END. The integrator moves
bodies by the mean of the old and the new velocity (`take_back`), so that the middle is where the impulses do no work: the
implicit midpoint rule for constrained motion, Hairer, Lubich & Wanner, "Geometric Numerical Integration" (2006), VII.1.

Where the middle and the end are depends on the impulses that are sought: at first on those of the last substep, and where the
new ones lead elsewhere, the rows are written and solved anew. Without that, every taut row of links gains energy: its tension
would act along where its links would have been, had nothing changed.

A blow may turn links so far within a substep that rewriting does not converge, and what it would lead to gains energy. Such a
part is solved as a blow in this substep: impulses act along the rows as they stand at its BEGINNING, bodies move by their new
velocities alone, and where they come to the rows are written once more for the velocities that stay. Either solution is a
projection, which only takes energy out.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.joint_axes import solve_free, solve_gear
from elys.sim_node.physics.kernels.joint_direct import factor_joints
from elys.sim_node.physics.kernels.joint_impulses import (
    forget_impulses,
    load_motion,
    load_path,
    load_velocity,
    push_all,
    store_velocity,
)
from elys.sim_node.physics.kernels.joint_loads import spread_loads
from elys.sim_node.physics.kernels.joint_locks import solve_direct, solve_drive, solve_locked, solve_soft
from elys.sim_node.physics.kernels.joint_mass import prepare_masses, turn_inertia
from elys.sim_node.physics.kernels.joint_rows import (
    has_coordinate,
    measure,
    place_frames,
    row_rate,
    write_free,
    write_rows,
)
from elys.sim_node.physics.kernels.limits import limit_pair
from elys.sim_node.physics.kernels.rotation import cross
from elys.sim_node.physics.kernels.tables import AXIS, GEAR, JOINT_ROWS, MOTOR

SWEEPS = 4  # over all joints in one pass of the solver, at most
ROUNDS = 4  # of writing the rows and solving them, at most
MISPLACED = 1e-5  # that rows may be off from where the bodies come to be [m], [rad]
TOLERATED = 1e-4  # that they may be off when the rounds are over, or else the part is solved as a blow [m], [rad]
MOST_LEAD = 1.0  # that a body may move in a substep and be foreseen at all [m], [rad]
SHRINKING = 0.5  # share of what they were off the round before, above which the rounds lead nowhere
LOST = 1e6  # sum of velocities that no solution has [m/s], [rad/s]
SETTLED = 1e-6  # rates below it are not worth another sweep, at rest [m/s], [rad/s]


@inner
def place_joint(moving, joint, rows, first):
    """Where everything stands now."""
    load_motion(moving, joint)
    place_frames(joint, 0.0)
    measure(joint, rows, first)
    turn_inertia(joint)  # impulses act before the bodies turn: with any other inertia they would change the spin


@inner
def note_rates(joint, rows, first, sign):
    """Adds the rows' rates, times a sign, to their leads."""
    for k in range(joint.locked):
        rows[first + k].lead += sign * row_rate(joint, rows[first + k])
    for k in range(AXIS, AXIS + joint.free):
        rows[first + k].lead += sign * row_rate(joint, rows[first + k])


@inner
def begin_rows(joint, rows, first, h):
    """Writes the rows as they will stand in the middle of a time, and how they differ from those at its end."""
    for k in range(JOINT_ROWS):
        rows[first + k].lead = 0.0
    if h > 0.0:
        place_frames(joint, h)
        write_rows(joint, rows, first)
        note_rates(joint, rows, first, 1.0)
    place_frames(joint, 0.5 * h)
    write_rows(joint, rows, first)
    if h > 0.0:
        note_rates(joint, rows, first, -1.0)
    prepare_masses(joint, rows, first)


@inner
def solve_joint(moving, joints, rows, j, h, biased):
    """One joint once; returns the largest rate that was left before."""
    joint = joints[j]
    if joint.direct != 0 and joint.free == 0:
        return 0.0
    if joint.kind == GEAR:
        return solve_gear(moving, joints, rows, joint, h, biased)
    first = JOINT_ROWS * j
    load_velocity(moving, joint)
    most = 0.0
    if joint.kind == MOTOR:
        solve_drive(joint, rows, first, h)
    elif joint.frequency > 0.0:
        solve_soft(joint, rows, first, h)
    elif joint.direct == 0:
        most = solve_locked(joint, rows, first, h, biased)
    if joint.free > 0:
        most = max(most, solve_free(joint, rows, first, h, biased))
    store_velocity(moving, joint)
    return most


@inner
def end_substep(moving, joint, rows, first):
    """Adds up what was applied, and keeps the rates that springs begin the next substep with."""
    load_velocity(moving, joint)
    for k in range(joint.locked):
        rows[first + k].start_rate = row_rate(joint, rows[first + k])
    for k in range(AXIS, AXIS + joint.free):
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
def sweep_count(joints, order, first, last):
    """How often joints are gone over at most: once where all of them are solved together."""
    for place in range(first, last):
        joint = joints[order[place]]
        if joint.direct == 0 or joint.free > 0:
            return SWEEPS
    return 1


@inner
def fastest(joints, order, first, last):
    """The largest velocity among jointed bodies, of which single precision keeps a ten-millionth."""
    most = 0.0
    for place in range(first, last):
        velocity = joints[order[place]].velocity
        for c in range(12):
            most = max(most, abs(velocity[c]))
    return most


@inner
def has_joints(system, g):
    """Whether there are joints in a group; `system` is a Joints or None. They are in the first groups, one for each strength."""
    if system is None or g >= system.groups.shape[0]:
        return False
    return system.groups[g].last > system.groups[g].first


@inner
def place_part(system, part, moving, h, biased):
    """Where everything stands now, and what it carries."""
    joints, rows, order = system.rows, system.solver_rows, system.order
    for place in range(part.first, part.last):
        j = order[place]
        if joints[j].kind != GEAR:
            place_joint(moving, joints[j], rows, JOINT_ROWS * j)
            if biased:
                joints[j].spring_start = joints[j].coordinate
    spread_loads(joints, order, part.first, part.last, system.loads, h)


@inner
def measure_gaps(joints, rows, order, part, moving):
    """What limits have left, after the bodies have moved."""
    for place in range(part.first, part.last):
        j = order[place]
        if joints[j].kind != GEAR and joints[j].free > 0:
            load_motion(moving, joints[j])
            place_frames(joints[j], 0.0)
            measure(joints[j], rows, JOINT_ROWS * j)


@inner
def lead_on(joints, order, part, moving, drives):
    """Where the bodies will be by their velocities as they are; returns by how much these have changed since last time."""
    most = 0.0
    for place in range(part.first, part.last):
        joint = joints[order[place]]
        if joint.kind != GEAR:
            most = max(most, load_path(moving, drives, joint))
    return most


@inner
def write_part(system, part, moving, h):
    """Rows and masses for where the bodies will be after a time, and the impulses so far along the new rows."""
    joints, rows, order = system.rows, system.solver_rows, system.order
    for place in range(part.first, part.last):
        j = order[place]
        if joints[j].kind != GEAR:
            begin_rows(joints[j], rows, JOINT_ROWS * j, h)
    push_again(joints, rows, order, part, moving)
    factor_joints(joints, rows, system.columns, part.first_column, part.last_column, system.blocks, system.updates)


@inner
def sweep_part(system, part, moving, h, biased):
    """Solves the joints as their rows are written, until they agree: forwards and backwards, so that a chain is no better
    from one end."""
    joints, rows, order = system.rows, system.solver_rows, system.order
    first, last = part.first, part.last
    columns = (system.columns, part.first_column, part.last_column)
    settled = SETTLED * (1.0 + 0.5 * fastest(joints, order, first, last))
    for sweep in range(sweep_count(joints, order, first, last)):
        most = 0.0
        for place in range(first, last):
            j = order[place] if sweep % 2 == 0 else order[first + last - 1 - place]
            most = max(most, solve_joint(moving, joints, rows, j, h, biased))
        # Last, so that what is locked is exact and what limits or drives it gives way.
        most = max(most, solve_direct(moving, joints, rows, *columns, system.blocks, h, biased, settled))
        if most <= settled:
            break


@inner
def mark_struck(joints, order, part, solver_bodies):
    """Has the integrator take nothing back from bodies that were struck at the beginning of the substep."""
    for place in range(part.first, part.last):
        joint = joints[order[place]]
        for side in range(2):
            if joint.mover[side] >= 0 and joint.inverse_mass[side] > 0.0:
                solver_bodies[joint.mover[side]].struck = 1.0


@inner
def end_blow(joints, order, part, moving, drives, constants):
    """Keeps bodies within the speeds that are allowed, as the step would end within them anyway.

    Where joints ask for what cannot be, and velocities come out that no solution has, they do nothing in this substep and
    forget what they did.
    """
    bodies, rest = moving
    total = 0.0
    for place in range(part.first, part.last):
        joint = joints[order[place]]
        for side in range(2):
            if joint.mover[side] >= 0:
                for c in range(6):
                    total += abs(bodies[joint.mover[side]].velocity[c])
    is_lost = not total < LOST  # nor is it a number
    for place in range(part.first, part.last):
        joint = joints[order[place]]
        if is_lost:
            forget_impulses(joint)
        for side in range(2):
            i = joint.mover[side]
            if i < 0 or joint.inverse_mass[side] == 0.0:
                continue
            if is_lost:
                for c in range(6):
                    bodies[i].velocity[c] = drives[i].start_velocity[c]
            is_cut = limit_pair(bodies[i].velocity, constants.max_linear_speed, constants.max_angular_speed) != 0
            if is_lost or is_cut:
                for c in range(6):
                    rest[i, c] = 0.0


@inner
def solve_part(system, part, moving, drives, h, biased, constants):
    """The joints of one part once in a substep."""
    joints, rows, order = system.rows, system.solver_rows, system.order
    if biased:
        place_part(system, part, moving, h, True)
        lead_on(joints, order, part, moving, drives)
        part.impulsive = 1 if h * fastest(joints, order, part.first, part.last) > MOST_LEAD else 0
    elif part.impulsive != 0:
        place_part(system, part, moving, h, False)
        mark_struck(joints, order, part, moving[0])
    else:
        measure_gaps(joints, rows, order, part, moving)
    before = MOST_LEAD
    for number in range(ROUNDS + 1):
        if biased or part.impulsive != 0:
            write_part(system, part, moving, 0.0 if part.impulsive != 0 else h)
        sweep_part(system, part, moving, h, biased)
        if not biased or part.impulsive != 0:
            break
        change = h * lead_on(joints, order, part, moving, drives)
        is_last = number == ROUNDS - 1
        if change < (TOLERATED if is_last else MISPLACED):
            break
        if is_last or change > max(SHRINKING * before, TOLERATED):
            part.impulsive = 1
        before = change
    if part.impulsive != 0:
        end_blow(joints, order, part, moving, drives, constants)


@inner
def solve_joints(system, g, solver_bodies, drives, h, biased, constants):
    """All joints of a strength once in a substep.

    With `biased` errors of position are taken out, which the pass after the bodies have moved takes out of the velocities
    again. The bodies must begin a substep with the impulses of the last one, as `integrate_velocities` lets them.
    """
    joints, rows = system.rows, system.solver_rows
    moving = (solver_bodies, system.rest)
    for number in range(system.groups[g].first, system.groups[g].last):
        part = system.parts[system.part_order[number]]
        solve_part(system, part, moving, drives, h, biased, constants)
        if biased:
            continue
        for place in range(part.first, part.last):
            j = system.order[place]
            if joints[j].kind != GEAR:
                end_substep(moving, joints[j], rows, JOINT_ROWS * j)


@inner
def warm_start_joints(system, g, solver_bodies):
    """Begins the step with the impulses of the last one."""
    for number in range(system.groups[g].first, system.groups[g].last):
        part = system.parts[system.part_order[number]]
        push_again(system.rows, system.solver_rows, system.order, part, (solver_bodies, system.rest))


@inner
def push_again(joints, rows, order, part, moving):
    """Applies the impulses of the last substep along the rows as they stand."""
    for place in range(part.first, part.last):
        j = order[place]
        joint = joints[j]
        if joint.kind != GEAR:
            load_velocity(moving, joint)
            push_all(joint, rows, JOINT_ROWS * j)
            store_velocity(moving, joint)


@kernel
def finish_joints(system, solver_bodies, all_constants, broken):
    """Forces and coordinates as the step ends, and the velocities of jointed bodies; joints whose force was too large break.

    Returns how many did; their rows are listed in `broken` (J,).
    """
    moving = (solver_bodies, system.rest)
    rate = 1.0 / all_constants[0].time
    count = 0
    for j in range(system.rows.shape[0]):
        joint = system.rows[j]
        if joint.live == 0 or joint.kind == GEAR:
            continue
        rows = system.solver_rows
        load_motion(moving, joint)
        for side in range(2):
            if joint.inverse_mass[side] > 0.0:
                for c in range(6):
                    system.bodies[joint.mover[side]].velocity[c] = joint.velocity[6 * side + c]
        place_frames(joint, 0.0)
        measure(joint, rows, JOINT_ROWS * j)
        write_free(joint, rows, JOINT_ROWS * j)
        joint.speed = row_rate(joint, rows[JOINT_ROWS * j + AXIS]) if has_coordinate(joint.kind) else 0.0
        p = joint.step_impulse
        joint.force = rate * math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
        joint.torque = rate * math.sqrt(p[3] * p[3] + p[4] * p[4] + p[5] * p[5])
        if joint.force > joint.break_force or joint.torque > joint.break_torque:
            joint.broken = 1
            broken[count] = j
            count += 1
    return count

"""Motion, exact where exactness is cheap.

A body that nothing holds flies on a parabola and turns as Euler's equations say: one exact move for the whole step, in float64.

What contacts hold moves in substeps, in float32, relative to where it was when the step began. A substep kicks the
velocities, lets contacts change them, moves the bodies with the new velocities and, at its end, takes half of the velocity's
change back from the displacement (`take_back`). That makes a constant force exact and everything smooth of second order. Where
a contact has only just begun to push nothing is taken back: its impulse belongs to the end of the substep, not to the whole
of it.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.batch import BODY_FLOATS, DRIVE_FLOATS
from elys.sim_node.physics.kernels.fields import field_at, fly_through_field
from elys.sim_node.physics.kernels.limits import LARGEST, limit_pair, measure_drive, measure_energy, note_limits
from elys.sim_node.physics.kernels.locks import (
    TRANSLATIONS,
    TURNS,
    applied,
    free_part,
    hold_axes,
    hold_solved,
    lock_inertia,
    turn_locked,
)
from elys.sim_node.physics.kernels.placement import write_world_inertia
from elys.sim_node.physics.kernels.rotation import multiplied, normalized, rotated, spun, spun_by_euler, turn_by
from elys.sim_node.physics.kernels.simd import load, splat, store
from elys.sim_node.physics.kernels.tables import DYNAMIC, JOINTED, SOLVER_DRIVE, float_place

SPINNING = 1e-6  # squared turn in a step [rad^2] above which a body's moments make a difference

FREE_AT = float_place(SOLVER_DRIVE, "free_velocity")
START_AT = float_place(SOLVER_DRIVE, "start_velocity")
KICK_AT = float_place(SOLVER_DRIVE, "kick")
KEEP_AT = float_place(SOLVER_DRIVE, "keep")


@inner
def damping_factor(rate, h):
    """exp(-rate h) to fifth order, never negative, however strong the damping."""
    if rate == 0.0:
        return 1.0
    x = rate * h
    return 1.0 / (1.0 + x * (1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0)))))


@inner
def begin_body(body, force, out, drive, h, constants):
    """What the solver needs to know of a body, for substeps of length h."""
    dynamic = body.motion == DYNAMIC
    if dynamic and body.locked != 0:
        hold_axes(body)
    for k in range(6):
        out.velocity[k] = body.velocity[k]
        out.displacement[k] = 0.0
        drive.free_velocity[k] = body.velocity[k]
        drive.start_velocity[k] = body.velocity[k]
        drive.impact_shift[k] = 0.0
    out.inverse_mass = body.inverse_mass
    out.struck = 0.0
    drive.free_velocity[6] = body.inverse_mass
    drive.free_velocity[7] = 0.0
    drive.gravity_scale = body.gravity_scale if dynamic else 0.0
    drive.locked = body.locked & TRANSLATIONS if dynamic else 0
    linear = damping_factor(body.linear_damping, h) if dynamic else 1.0
    angular = damping_factor(body.angular_damping, h) if dynamic else 1.0
    for k in range(8):
        drive.kick[k] = 0.0
        drive.keep[k] = linear if k < 3 else (angular if k < 6 else 1.0)
    if dynamic:
        gx, gy, gz = field_at(body, constants)
        drive.kick[0] = h * body.gravity_scale * gx
        drive.kick[1] = h * body.gravity_scale * gy
        drive.kick[2] = h * body.gravity_scale * gz
        write_world_inertia(body, drive.inverse_inertia)
        if body.locked != 0 or body.pushed != 0:
            lock_inertia(drive.inverse_inertia, body.locked)
            push_held(body, force, drive, h)
    else:
        for k in range(6):
            drive.inverse_inertia[k] = 0.0


@inner
def push_held(body, force, drive, h):
    """Adds forces from outside to what a substep does to a held body, and takes out its locked translations."""
    once = force.once
    lasting = force.lasting
    tx, ty, tz = once[3] + lasting[3], once[4] + lasting[4], once[5] + lasting[5]
    x, y, z = applied(drive.inverse_inertia, tx, ty, tz)
    for k in range(3):
        kick = drive.kick[k] + h * body.inverse_mass * (once[k] + lasting[k])
        drive.kick[k] = kick * free_part(body.locked, k)
        drive.kick[3 + k] = h * (x if k == 0 else (y if k == 1 else z))


@inner
def integrate_positions(held, first, last, solver, h):
    """Moves bodies by their velocities for one substep."""
    step = splat(h)
    for index in range(first, last):
        at = held[index] * BODY_FLOATS
        store(solver, at + 8, load(solver, at + 8) + load(solver, at) * step)


@inner
def begin_nobody(out, drive):
    """The row behind the last body stands for all that never moves; when bodies were removed it was somebody's."""
    out.inverse_mass = 0.0
    drive.gravity_scale = 0.0
    drive.locked = 0.0
    for k in range(6):
        out.velocity[k] = 0.0
        out.displacement[k] = 0.0
        drive.inverse_inertia[k] = 0.0


@inner
def take_back(held, first, last, solver_bodies, solver, drive, h):
    """Ends a substep: halves the displacement that its change of velocity has caused."""
    half = splat(0.5 * h)
    for index in range(first, last):
        i = held[index]
        if solver_bodies[i].struck > 0.0:
            solver_bodies[i].struck = 0.0
            continue
        at = i * BODY_FLOATS
        change = load(solver, at) - load(drive, i * DRIVE_FLOATS + START_AT)
        store(solver, at + 8, load(solver, at + 8) - half * change)


@inner
def integrate_velocities(held, first, last, solver, drive):
    """Begins a substep: gravity and damping; `solver` and `drive` are flat float32 views.

    What the contacts did in the last substep, which is the difference to `free_velocity`, is done again: that is warm
    starting, without visiting the contacts.
    """
    for index in range(first, last):
        at = held[index] * BODY_FLOATS
        to = held[index] * DRIVE_FLOATS
        v = load(solver, at)
        by_contacts = v - load(drive, to + FREE_AT)
        free = v * load(drive, to + KEEP_AT) + load(drive, to + KICK_AT)
        store(drive, to + START_AT, v)
        store(drive, to + FREE_AT, free)
        store(solver, at, free + by_contacts)


@inner
def turn_over(held, first, last, solver_bodies, solver, drive, h):
    """Ends a substep and begins the next: `take_back` and `integrate_velocities` in one visit to each body."""
    half = splat(0.5 * h)
    for index in range(first, last):
        i = held[index]
        at = i * BODY_FLOATS
        to = i * DRIVE_FLOATS
        if solver_bodies[i].struck > 0.0:
            solver_bodies[i].struck = 0.0
            v = load(solver, at)
        else:
            v = load(solver, at)
            store(solver, at + 8, load(solver, at + 8) - half * (v - load(drive, to + START_AT)))
        by_contacts = v - load(drive, to + FREE_AT)
        free = v * load(drive, to + KEEP_AT) + load(drive, to + KICK_AT)
        store(drive, to + START_AT, v)
        store(drive, to + FREE_AT, free)
        store(solver, at, free + by_contacts)


@inner
def is_finite(body):
    total = 0.0
    for k in range(3):
        total += abs(body.position[k])
    for k in range(4):
        total += abs(body.rotation[k])
    for k in range(6):
        total += abs(body.velocity[k])
    return total < LARGEST


@inner
def turn_body(body, vx, vy, vz):
    """Turns a body by a rotation vector in world axes."""
    if body.locked & TURNS == TURNS:
        return
    q = body.rotation
    dx, dy, dz, dw = turn_by(vx, vy, vz)
    x, y, z, w = multiplied(dx, dy, dz, dw, q[0], q[1], q[2], q[3])
    q[0], q[1], q[2], q[3] = normalized(x, y, z, w)


@inner
def principal_spin(body, x, y, z):
    """A world vector in the body's principal axes."""
    q = body.rotation
    return rotated(-q[0], -q[1], -q[2], q[3], x, y, z)


@inner
def turn_held(body, solved, constants):
    """Turns a body that was held, by what the solver found, and gives it the angular velocity it then has.

    Part of the solver's velocity turned the body; with that it has flown freely, as Euler's equations say. The rest came
    with the last impulses: its angular momentum stays as the body turns. Jointed bodies have
    flown so in every substep, and have their velocities by now.
    """
    d = solved.displacement
    v = body.velocity
    q = body.rotation
    inverse = body.inverse_inertia
    ix, iy, iz = inverse[0], inverse[1], inverse[2]
    vx, vy, vz = float(d[3]), float(d[4]), float(d[5])
    wx, wy, wz = float(solved.velocity[3]), float(solved.velocity[4]), float(solved.velocity[5])
    if body.held == JOINTED:
        turn_body(body, vx, vy, vz)
        return
    is_round = ix == iy and iy == iz and constants.gyroscopic == 0
    if ix * iy * iz == 0.0 or is_round or body.locked & TURNS:
        turn_body(body, vx, vy, vz)
        v[3], v[4], v[5] = wx, wy, wz
        return
    h = constants.time
    rate = 1.0 / h
    ox, oy, oz = vx * rate, vy * rate, vz * rate
    px, py, pz = principal_spin(body, wx - ox, wy - oy, wz - oz)
    lx, ly, lz = rotated(q[0], q[1], q[2], q[3], px / ix, py / iy, pz / iz)
    if vx * vx + vy * vy + vz * vz > SPINNING:
        q[0], q[1], q[2], q[3], ox, oy, oz = spun_by_euler(q[0], q[1], q[2], q[3], ox, oy, oz, ix, iy, iz, h)
    else:
        turn_body(body, vx, vy, vz)
    px, py, pz = principal_spin(body, lx, ly, lz)
    px, py, pz = rotated(q[0], q[1], q[2], q[3], px * ix, py * iy, pz * iz)
    v[3], v[4], v[5] = ox + px, oy + py, oz + pz


@inner
def move_held(body, solved, constants):
    """Takes over what the solver found in a step."""
    if body.locked != 0:
        hold_solved(body.locked, solved)
    for k in range(3):
        if body.held != JOINTED:
            body.velocity[k] = solved.velocity[k]
        body.position[k] += solved.displacement[k]
    turn_held(body, solved, constants)
    if body.locked != 0:
        hold_axes(body)


@inner
def fly(body, force, constants):
    """The whole step of a free body's centre of mass, without damping."""
    if constants.attractor_count > 0 and body.motion == DYNAMIC:
        fly_through_field(body, force, constants)
        return
    h = constants.time
    v = body.velocity
    scale = body.gravity_scale if body.motion == DYNAMIC else 0.0
    for k in range(3):
        change = h * scale * constants.gravity[k]
        if body.pushed != 0:
            change += h * body.inverse_mass * (force.once[k] + force.lasting[k])
        if body.locked >> k & 1:
            change = 0.0
        if change != 0.0:
            body.still_time = 0.0  # what floats at its turning point does not sleep there
        body.position[k] += h * (v[k] + 0.5 * change)
        v[k] += change


@inner
def twist_free(body, force, room, h):
    """Changes a body's spin by the torque from outside, for the time h; `room` (6,) is for its inertia."""
    write_world_inertia(body, room)
    lock_inertia(room, body.locked)
    once = force.once
    lasting = force.lasting
    x, y, z = applied(room, once[3] + lasting[3], once[4] + lasting[4], once[5] + lasting[5])
    v = body.velocity
    v[3] += h * x
    v[4] += h * y
    v[5] += h * z


@inner
def turn_free(body, room, h, keep, constants):
    """The whole step of a free body's turn; `keep` is what damping leaves of its spin in half of it."""
    v = body.velocity
    q = body.rotation
    for k in range(3, 6):
        v[k] *= keep
    if v[3] == 0.0 and v[4] == 0.0 and v[5] == 0.0:
        return
    dynamic = body.motion == DYNAMIC
    if dynamic and body.locked & TURNS:
        turn_locked(body, room, h)
    elif dynamic and constants.gyroscopic != 0:
        inverse = body.inverse_inertia
        turned = spun_by_euler(q[0], q[1], q[2], q[3], v[3], v[4], v[5], inverse[0], inverse[1], inverse[2], h)
        q[0], q[1], q[2], q[3], v[3], v[4], v[5] = turned
    else:
        inverse = body.inverse_inertia
        ix, iy, iz = (inverse[0], inverse[1], inverse[2]) if dynamic else (1.0, 1.0, 1.0)
        x, y, z, w, px, py, pz = spun(q[0], q[1], q[2], q[3], v[3], v[4], v[5], ix, iy, iz, h)
        q[0], q[1], q[2], q[3] = x, y, z, w
        v[3], v[4], v[5] = px, py, pz
    for k in range(3, 6):
        v[k] *= keep


@inner
def move_free(body, force, room, constants):
    """The whole step at once: a parabola, and a free body's turn. Damping and torque are taken in halves, before and after.

    Returns what was too fast to begin with, as bits: a spin without limits could not be integrated.
    """
    h = constants.time
    v = body.velocity
    dynamic = body.motion == DYNAMIC
    linear = damping_factor(body.linear_damping, 0.5 * h) if dynamic else 1.0
    angular = damping_factor(body.angular_damping, 0.5 * h) if dynamic else 1.0
    if dynamic and body.locked != 0:
        hold_axes(body)
    for k in range(3):
        v[k] *= linear
    fly(body, force, constants)
    for k in range(3):
        v[k] *= linear
    if dynamic and body.pushed != 0:
        twist_free(body, force, room, 0.5 * h)
    cut = limit_pair(v, constants.max_linear_speed, constants.max_angular_speed) if dynamic else 0
    turn_free(body, room, h, angular, constants)
    if dynamic and body.pushed != 0:
        twist_free(body, force, room, 0.5 * h)
    return cut


@inner
def release_force(body, force):
    """Ends what acted for this step only."""
    lasts = False
    for k in range(6):
        force.once[k] = 0.0
        lasts = lasts or force.lasting[k] != 0.0
    body.pushed = 1 if lasts else 0


@inner
def publish_pose(body, pose):
    """From centre of mass and principal axes to the entity's own position and rotation."""
    q = body.rotation
    axes = pose.axes
    center = pose.center
    x, y, z, w = q[0], q[1], q[2], q[3]
    if axes[3] != 1.0:
        x, y, z, w = multiplied(x, y, z, w, -axes[0], -axes[1], -axes[2], axes[3])
    p = pose.position
    p[0], p[1], p[2] = body.position[0], body.position[1], body.position[2]
    if center[0] != 0.0 or center[1] != 0.0 or center[2] != 0.0:
        cx, cy, cz = rotated(x, y, z, w, center[0], center[1], center[2])
        p[0] -= cx
        p[1] -= cy
        p[2] -= cz
    r = pose.rotation
    r[0], r[1], r[2], r[3] = x, y, z, w
    for k in range(3):
        pose.linear_velocity[k] = body.velocity[k]
        pose.angular_velocity[k] = body.velocity[k + 3]


@kernel
def finish_step(bodies, forces, awake, awake_count, poses, starts, solver_bodies, faulty, reports, room, all_constants):
    """Moves every awake body to where it is after the step and publishes the poses.

    Returns how many are not finite any more.

    Those are listed in `faulty` (N,) and keep their last published pose; those that had to be slowed down are listed at
    its end, backwards. `starts` (N,) gets where each was before, `reports` (1,) what came of the energy; `room` is (6,).
    """
    constants = all_constants[0]
    report = reports[0]
    fastest = constants.max_linear_speed
    quickest = constants.max_angular_speed
    report.fast_count = 0
    report.most_gained = -1
    report.kinetic_before = report.kinetic_after = report.gain = report.mass = report.driven = report.forced = 0.0
    faults = 0
    for index in range(awake_count):
        i = awake[index]
        body = bodies[i]
        for k in range(3):
            starts[i].position[k] = body.position[k]
        for k in range(4):
            starts[i].rotation[k] = body.rotation[k]
        v = body.velocity
        before = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
        dynamic = body.motion == DYNAMIC
        cut = 0
        if body.held != 0 and dynamic:
            cut = limit_pair(solver_bodies[i].displacement, constants.time * fastest, constants.time * quickest)
            move_held(body, solver_bodies[i], constants)
        else:
            cut = move_free(body, forces[i], room, constants)
        if not is_finite(body):
            faulty[faults] = i
            faults += 1
            continue
        if dynamic:
            if note_limits(body, cut | limit_pair(v, fastest, quickest)):
                report.fast_count += 1
                faulty[faulty.shape[0] - report.fast_count] = i
            if body.held != 0:  # what flies freely gains nothing but by what pulls it
                measure_energy(body, forces[i], i, before, constants.time, report)
        else:
            measure_drive(body, report)
        if body.pushed != 0:
            release_force(body, forces[i])
        publish_pose(body, poses[i])
    return faults


@kernel
def publish_poses(bodies, poses):
    """Publishes every body as it is now, after a change from outside."""
    for i in range(bodies.shape[0]):
        publish_pose(bodies[i], poses[i])

"""Motion between contacts, exact where exactness is cheap.

A substep kicks the velocities, lets contacts change them, moves the bodies with the new velocities and, at its end, takes
half of the velocity's change back from the displacement (`take_back`). That makes a constant force exact and everything
smooth of second order. Where a contact has only just begun to push nothing is taken back: its impulse belongs to the end
of the substep, not to the whole of it.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.rotation import multiplied, normalized, rotated, spun, turn_by
from elys.sim_node.physics.kernels.tables import DYNAMIC, STATIC

STILL = 1e-24  # squared turn [rad^2] below which an orientation is left alone
LARGEST = 1e38  # above it a number does not fit the 32 bits in which velocities are published, as if it were not finite


@inner
def damping_factor(rate, h):
    """exp(-rate h) to third order, never negative, however strong the damping."""
    if rate == 0.0:
        return 1.0
    x = rate * h
    return 1.0 / (1.0 + x * (1.0 + x * (0.5 + x / 6.0)))


@inner
def begin_step(bodies):
    for i in range(bodies.shape[0]):
        body = bodies[i]
        body.struck = 0
        for k in range(6):
            body.displacement[k] = 0.0
            body.impact_shift[k] = 0.0
            body.free_velocity[k] = body.velocity[k]


@inner
def integrate_velocities(bodies, constants):
    """Gravity and damping for one substep.

    What the contacts did in the last substep, which is the difference to `free_velocity`, is done again: that is warm
    starting, without visiting the contacts.
    """
    h = constants.substep
    gravity = constants.gravity
    for i in range(bodies.shape[0]):
        body = bodies[i]
        if body.motion != DYNAMIC:
            continue
        v = body.velocity
        free = body.free_velocity
        start = body.start_velocity
        linear = damping_factor(body.linear_damping, h)
        angular = damping_factor(body.angular_damping, h)
        scale = body.gravity_scale * h
        for k in range(3):
            by_contacts = v[k] - free[k]
            start[k] = v[k]
            free[k] = v[k] * linear + scale * gravity[k]
            v[k] = free[k] + by_contacts
        for k in range(3, 6):
            by_contacts = v[k] - free[k]
            start[k] = v[k]
            free[k] = v[k] * angular
            v[k] = free[k] + by_contacts


@inner
def turn_body(q, vx, vy, vz):
    """Turns an orientation by a rotation vector in world axes."""
    dx, dy, dz, dw = turn_by(vx, vy, vz)
    x, y, z, w = multiplied(dx, dy, dz, dw, q[0], q[1], q[2], q[3])
    q[0], q[1], q[2], q[3] = normalized(x, y, z, w)


@inner
def integrate_positions(bodies, constants):
    """Moves what moves by its velocity for one substep; a free body's spin changes as Euler's equations say."""
    h = constants.substep
    for i in range(bodies.shape[0]):
        body = bodies[i]
        if body.motion == STATIC:
            continue
        v = body.velocity
        d = body.displacement
        shift = body.impact_shift
        for k in range(6):
            d[k] += h * v[k] + shift[k]
        q = body.rotation
        if shift[3] * shift[3] + shift[4] * shift[4] + shift[5] * shift[5] > 0.0:
            turn_body(q, shift[3], shift[4], shift[5])
        for k in range(6):
            shift[k] = 0.0
        ox, oy, oz = v[3], v[4], v[5]
        if (ox * ox + oy * oy + oz * oz) * h * h < STILL:
            continue
        inverse = body.inverse_inertia
        x, y, z, w, px, py, pz = spun(q[0], q[1], q[2], q[3], ox, oy, oz, inverse[0], inverse[1], inverse[2], h)
        q[0], q[1], q[2], q[3] = x, y, z, w
        v[3], v[4], v[5] = px, py, pz
        for velocity in (body.free_velocity, body.start_velocity):
            velocity[3] += px - ox
            velocity[4] += py - oy
            velocity[5] += pz - oz


@inner
def turn_back(body, vx, vy, vz):
    """Turns a body by a rotation vector and changes its angular velocity so that its angular momentum stays."""
    q = body.rotation
    inverse = body.inverse_inertia
    v = body.velocity
    ix, iy, iz = inverse[0], inverse[1], inverse[2]
    if ix == iy and iy == iz:
        turn_body(q, vx, vy, vz)
        return
    x, y, z = rotated(-q[0], -q[1], -q[2], q[3], v[3], v[4], v[5])
    x, y, z = rotated(q[0], q[1], q[2], q[3], x / ix, y / iy, z / iz)
    turn_body(q, vx, vy, vz)
    x, y, z = rotated(-q[0], -q[1], -q[2], q[3], x, y, z)
    x, y, z = rotated(q[0], q[1], q[2], q[3], x * ix, y * iy, z * iz)
    free = body.free_velocity
    free[3] += x - v[3]
    free[4] += y - v[4]
    free[5] += z - v[5]
    v[3], v[4], v[5] = x, y, z


@inner
def take_back(bodies, constants):
    """Halves the displacement that this substep's change of velocity has caused."""
    half = 0.5 * constants.substep
    for i in range(bodies.shape[0]):
        body = bodies[i]
        if body.motion != DYNAMIC:
            continue
        if body.struck != 0:
            body.struck = 0
            continue
        v = body.velocity
        start = body.start_velocity
        d = body.displacement
        for k in range(3):
            d[k] -= half * (v[k] - start[k])
        x = -half * (v[3] - start[3])
        y = -half * (v[4] - start[4])
        z = -half * (v[5] - start[5])
        if x * x + y * y + z * z > STILL:
            d[3] += x
            d[4] += y
            d[5] += z
            turn_back(body, x, y, z)


@inner
def is_finite(body):
    total = 0.0
    for k in range(3):
        total += abs(body.position[k])
    for k in range(4):
        total += abs(body.rotation[k])
    for k in range(6):
        total += abs(body.velocity[k]) + abs(body.displacement[k])
    return total < LARGEST


@inner
def publish_pose(body, pose):
    """From centre of mass and principal axes to the entity's own position and rotation."""
    q = body.rotation
    axes = pose.axes
    center = pose.center
    x, y, z, w = q[0], q[1], q[2], q[3]
    if axes[3] != 1.0:
        x, y, z, w = multiplied(x, y, z, w, -axes[0], -axes[1], -axes[2], axes[3])
    cx, cy, cz = rotated(x, y, z, w, center[0], center[1], center[2])
    p = pose.position
    p[0], p[1], p[2] = body.position[0] - cx, body.position[1] - cy, body.position[2] - cz
    r = pose.rotation
    r[0], r[1], r[2], r[3] = x, y, z, w
    for k in range(3):
        pose.linear_velocity[k] = body.velocity[k]
        pose.angular_velocity[k] = body.velocity[k + 3]


@kernel
def finish_step(bodies, poses, faulty):
    """Adds the displacements to the positions and publishes the poses; returns how many bodies are not finite any more.

    Those are listed in `faulty` (N,) and keep their last published pose.
    """
    faults = 0
    for i in range(bodies.shape[0]):
        body = bodies[i]
        if body.motion == STATIC:
            # What is not finite times no inverse mass is not 0: one bad body must not spoil all that touch the ground.
            for k in range(6):
                body.velocity[k] = 0.0
            continue
        if not is_finite(body):
            faulty[faults] = i
            faults += 1
            continue
        for k in range(3):
            body.position[k] += body.displacement[k]
        publish_pose(body, poses[i])
    return faults


@kernel
def publish_poses(bodies, poses):
    """Publishes every body as it is now, after a change from outside."""
    for i in range(bodies.shape[0]):
        publish_pose(bodies[i], poses[i])

"""What carries characters and what they push: the ground's own motion, and the forces on loose bodies."""

from __future__ import annotations

from elys.sim_node.character.kernels.tables import FLOOR
from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.rotation import normalized, rotated, turn_by
from elys.sim_node.physics.kernels.tables import DYNAMIC, KINEMATIC, STATIC

BELOW = 0.3  # height of a normal from which on what is touched carries, and is not pushed aside


@inner
def moved_rigidly(body, dt, px, py, pz):
    """Where a point of a body is after dt, its velocity staying what it is."""
    v, c = body.velocity, body.position
    x, y, z, w = turn_by(v[3] * dt, v[4] * dt, v[5] * dt)
    ax, ay, az = rotated(x, y, z, w, px - c[0], py - c[1], pz - c[2])
    return c[0] + v[0] * dt + ax, c[1] + v[1] * dt + ay, c[2] + v[2] * dt + az


@inner
def foresee(body, collider, dt):
    """Puts a collider where its body will be after dt, its box around both places."""
    center = collider.center
    qx, qy, qz = center[0], center[1], center[2]
    x, y, z = moved_rigidly(body, dt, qx, qy, qz)
    center[0], center[1], center[2] = x, y, z
    v = body.velocity
    tx, ty, tz, tw = turn_by(v[3] * dt, v[4] * dt, v[5] * dt)
    for k in range(3):
        u = collider.axes
        ax, ay, az = rotated(tx, ty, tz, tw, u[3 * k], u[3 * k + 1], u[3 * k + 2])
        u[3 * k], u[3 * k + 1], u[3 * k + 2] = ax, ay, az
    turned = abs(v[3]) + abs(v[4]) + abs(v[5]) > 0.0
    room = collider.reach if turned else 0.0
    widen(collider.box, x - qx, y - qy, z - qz, room, x, y, z)


@inner
def widen(box, dx, dy, dz, reach, x, y, z):
    """Makes a box hold itself moved by a way and, where reach is above 0, a ball of it around the new centre (x, y, z)."""
    box[0], box[1], box[2] = box[0] + min(dx, 0.0), box[1] + min(dy, 0.0), box[2] + min(dz, 0.0)
    box[3], box[4], box[5] = box[3] + max(dx, 0.0), box[4] + max(dy, 0.0), box[5] + max(dz, 0.0)
    if reach > 0.0:
        box[0], box[1], box[2] = min(box[0], x - reach), min(box[1], y - reach), min(box[2], z - reach)
        box[3], box[4], box[5] = max(box[3], x + reach), max(box[4], y + reach), max(box[5], z + reach)


@inner
def carry_of(around, character, dt):
    """The way by which the ground takes a character along in dt, and the angle by which it turns it about y."""
    row = character.ground
    if row < 0:
        return 0.0, 0.0, 0.0, 0.0
    body = around.bodies[row]
    if body.motion == STATIC or around.is_character[row] != 0:
        return 0.0, 0.0, 0.0, 0.0
    p = character.position
    x, y, z = moved_rigidly(body, dt, p[0], p[1], p[2])
    return x - p[0], y - p[1], z - p[2], body.velocity[4] * dt


@inner
def add_push(around, count, body, fx, fy, fz, px, py, pz):
    """Notes a force on a body at a point, if there is room; how many there are."""
    if count >= around.pushes.shape[0]:
        return count
    push = around.pushes[count]
    push.body = body
    push.force[0], push.force[1], push.force[2] = fx, fy, fz
    push.point[0], push.point[1], push.point[2] = px, py, pz
    return count + 1


@inner
def push_aside(around, character, plane_count, wx, wz, dt, count):
    """Forces on the loose bodies that are in the way of a character that wants to go at (wx, wz) [m/s].

    No more than its strength, and no more than brings the body to that speed within dt; as near to the height of the body's
    centre of mass as the character reaches, so that it shoves rather than tips.
    """
    low = character.position[1]
    for i in range(plane_count):
        plane = around.planes[i]
        if plane.motion != DYNAMIC or (plane.slant == FLOOR or plane.normal[1] > BELOW):
            continue
        n, u, by = plane.normal, plane.velocity, character.carried
        along = -(n[0] * wx + n[2] * wz)
        missing = along + n[0] * (u[0] - by[0]) + n[1] * (u[1] - by[1]) + n[2] * (u[2] - by[2])
        if along <= 0.0 or missing <= 0.0:
            continue
        force = min(character.push_force, around.mass[plane.body] * missing / dt)
        p = plane.point
        y = min(max(around.bodies[plane.body].position[1], low), low + character.stature)
        count = add_push(around, count, plane.body, -force * n[0], -force * n[1], -force * n[2], p[0], y, p[2])
    return count


@inner
def weigh_down(around, character, point, count):
    """The weight of a character on the loose body that it stands on."""
    row = character.ground
    if row < 0 or around.bodies[row].motion != DYNAMIC:
        return count
    weight = character.mass * character.gravity
    return add_push(around, count, row, 0.0, -weight, 0.0, point[0], point[1], point[2])


@inner
def is_moving_by_itself(body):
    v = body.velocity
    return body.motion == KINEMATIC and (
        v[0] != 0.0 or v[1] != 0.0 or v[2] != 0.0 or v[3] != 0.0 or v[4] != 0.0 or v[5] != 0.0
    )


@inner
def facing(yaw):
    """The quaternion of a turn about y."""
    x, y, z, w = turn_by(0.0, yaw, 0.0)
    return normalized(x, y, z, w)

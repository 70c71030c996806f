"""Ground and steps: standing up, climbing what is low enough, staying on the ground where it falls away."""

from __future__ import annotations

import math

from elys.sim_node.character.kernels.around import load_probe
from elys.sim_node.character.kernels.sweeping import find_ground, half_skinned, skinned, spread_probe, sweep
from elys.sim_node.character.kernels.tables import FLOOR, SKIN, STEEP, WALK
from elys.sim_node.compilation import inner

LEAST_WAY = 0.02  # how far forward a step is looked for at least [m]
SHORT = 1e-6  # a way shorter than wished by less is not blocked [m]
CLOSE = 0.002  # ground that who falls has reached [m]
RESTING = 1e-6  # who leaves the floor no faster stays on it [m/s]
ROUNDING = 1e-6  # by which a step may be higher than allowed [m]


@inner
def stand_up(around, near_count, character):
    """Crouches, or stands up where there is room above."""
    low = min(max(character.crouch_height, 2.0 * character.radius), character.height)
    if character.wish_crouch != 0 and character.mode == WALK:
        if character.stature > low:
            character.stature = low
            load_probe(around.geometry, character.radius, low)
        return
    missing = character.height - character.stature
    if missing <= 0.0:
        character.stature = character.height
        load_probe(around.geometry, character.radius, character.height)
        return
    p = character.position
    spread_probe(around, half_skinned(character.radius))
    y = p[1] + 0.5 * character.stature
    free = sweep(around, near_count, -1, p[0], y, p[2], 0.0, 1.0, 0.0, missing + SKIN, around.hits[0])
    if free >= missing + 0.5 * SKIN:
        character.stature = character.height
    load_probe(around.geometry, character.radius, character.stature)


@inner
def climb_step(around, near_count, character, x, low, z, dx, dz):
    """Where the way (dx, dz) from (x, z) was blocked: up, forward and down again, if something that carries is there.

    It may not be higher above the feet, as they were at `low`, than the character's step. Whether it has climbed.
    """
    way = math.sqrt(dx * dx + dz * dz)
    if way < SHORT or character.step_height <= 0.0:
        return False
    ux, uz = dx / way, dz / way
    p = character.position
    left = way - ((p[0] - x) * ux + (p[2] - z) * uz)
    if left < SHORT:
        return False
    middle = 0.5 * character.stature
    spread_probe(around, half_skinned(character.radius))
    room = character.step_height + SKIN
    up = sweep(around, near_count, -1, p[0], p[1] + middle, p[2], 0.0, 1.0, 0.0, room, around.hits[0])
    up = min(up, room) - (0.5 * SKIN if around.hits[0].collider >= 0 else 0.0)
    if up <= 0.0:
        return False
    forward = max(left, LEAST_WAY)
    y = p[1] + up + middle
    gone = sweep(around, near_count, -1, p[0], y, p[2], ux, 0.0, uz, forward, around.hits[0])
    if around.hits[0].collider >= 0:
        gone -= 0.5 * SKIN
    if gone < SHORT:
        return False
    nx, nz = p[0] + gone * ux, p[2] + gone * uz
    spread_probe(around, skinned(character.radius))
    found = find_ground(around, near_count, nx, y, nz, character.least_up, up + SKIN, around.hits[1], around.hits[2])
    if not found or around.hits[1].point[1] - (low - SKIN) > character.step_height + ROUNDING:
        return False
    height = p[1] + up - around.hits[1].distance
    if height <= p[1] + SHORT:
        return False
    p[0], p[1], p[2] = nx, height, nz
    return True


@inner
def settle(around, near_count, character, was_grounded, plane_count):
    """Finds the ground. Who stood stays on it where it falls away by no more than a step; who falls lands on what is close."""
    p, v, n = character.position, character.velocity, character.normal
    n[0] = n[1] = n[2] = 0.0
    if not was_grounded and leaves_floor(around, character, plane_count):
        character.grounded = 0
        character.ground = -1
        return
    down = character.step_height if was_grounded else CLOSE
    spread_probe(around, skinned(character.radius))
    hit, steep = around.hits[1], around.hits[2]
    y = p[1] + SKIN + 0.5 * character.stature
    if find_ground(around, near_count, p[0], y, p[2], character.least_up, SKIN + down, hit, steep):
        p[1] = p[1] + SKIN - hit.distance
        stand_on(around, character, hit, was_grounded)
        return
    if was_grounded:
        v[0], v[1], v[2] = v[0] + character.carried[0], v[1] + character.carried[1], v[2] + character.carried[2]
        character.air_time = 0.0
        character.has_jumped = 0
    character.grounded = 0
    character.ground = -1
    character.carried[0] = character.carried[1] = character.carried[2] = 0.0
    for i in range(plane_count):
        plane = around.planes[i]
        if plane.slant == STEEP:
            n[0], n[1], n[2] = plane.normal[0], plane.normal[1], plane.normal[2]


@inner
def leaves_floor(around, character, plane_count):
    """Whether who is in the air moves away from the floor that it touches; without any, whether it rises."""
    v = character.velocity
    touches = False
    for i in range(plane_count):
        plane = around.planes[i]
        if plane.slant != FLOOR:
            continue
        n, u = plane.normal, plane.velocity
        if n[0] * (v[0] - u[0]) + n[1] * (v[1] - u[1]) + n[2] * (v[2] - u[2]) <= RESTING:
            return False
        touches = True
    return touches or v[1] > 0.0


@inner
def stand_on(around, character, hit, was_grounded):
    """Notes the ground; who has landed gives up its fall, and what the ground moves at."""
    n, v, u = character.normal, character.velocity, character.carried
    m = hit.normal
    if m[1] >= character.least_up:
        n[0], n[1], n[2] = m[0], m[1], m[2]
    else:  # the edge of something level
        n[0], n[1], n[2] = 0.0, 1.0, 0.0
    row = around.colliders[hit.collider].body
    if not was_grounded or row != character.ground:
        body = around.bodies[row]
        w = body.velocity
        x, y, z = 0.0, 0.0, 0.0
        if around.is_character[row] == 0:
            rx, rz = hit.point[0] - body.position[0], hit.point[2] - body.position[2]
            ry = hit.point[1] - body.position[1]
            x, y, z = w[0] + w[4] * rz - w[5] * ry, w[1] + w[5] * rx - w[3] * rz, w[2] + w[3] * ry - w[4] * rx
        v[0], v[2] = v[0] + u[0] - x, v[2] + u[2] - z
        u[0], u[1], u[2] = x, y, z
        if not was_grounded:
            v[1] = 0.0
    character.ground = row
    character.grounded = 1
    character.air_time = 0.0
    character.has_jumped = 0

"""A character's tick: what it wants becomes a velocity, the velocity a way, the way is gone as far as its surroundings allow."""

from __future__ import annotations

import math

from elys.sim_node.character.kernels.around import gather, length_of, load_probe
from elys.sim_node.character.kernels.carrying import carry_of, push_aside, weigh_down
from elys.sim_node.character.kernels.sliding import clip_velocity, slide
from elys.sim_node.character.kernels.steps import climb_step, settle, stand_up
from elys.sim_node.character.kernels.tables import FLY, SKIN, SWIM, WALK
from elys.sim_node.compilation import inner

TINY = 1e-12


@inner
def toward(vx, vy, vz, wx, wy, wz, most):
    """A velocity, changed towards a wanted one by `most` at the most."""
    dx, dy, dz = wx - vx, wy - vy, wz - vz
    length = length_of(dx, dy, dz)
    if length <= most:
        return wx, wy, wz
    share = most / length
    return vx + share * dx, vy + share * dy, vz + share * dz


@inner
def launch_speed(height, gravity, dt):
    """The speed to jump with [m/s]: the highest of the places that a character has at the ends of ticks is `height` exactly.

    At the end of tick n the height is v n dt - g (n dt)^2 / 2. The highest tick is the least n with n (n + 1) >= 2 h / (g dt^2),
    and v follows from it. The difference to sqrt(2 g h) is of the second order in dt.
    """
    if not (height > 0.0 and gravity > TINY):
        return 0.0
    wanted = 2.0 * height / (gravity * dt * dt)
    n = max(math.floor(math.sqrt(wanted)) - 1.0, 1.0)
    while n * (n + 1.0) < wanted:
        n += 1.0
    return height / (n * dt) + 0.5 * gravity * n * dt


@inner
def wanted_speed(character):
    """How fast it wants to go along its wish [m/s]."""
    if character.mode == SWIM:
        return character.swim_speed
    if character.mode == FLY:
        return character.fly_speed
    if character.stature < character.height:
        return character.crouch_speed
    return character.run_speed if character.wish_run != 0 else character.walk_speed


@inner
def note_wishes(character, dt):
    """Counts how long ago it stood and jump was pressed."""
    if character.wish_jump != 0 and character.jump_held == 0:
        character.jump_time = 0.0
    else:
        character.jump_time += dt
    character.jump_held = character.wish_jump
    if character.grounded == 0:
        character.air_time += dt


@inner
def jumps_now(character):
    """Whether it leaves the ground: jump was pressed a moment ago, and it stands, or did until a moment ago."""
    if character.mode != WALK or character.jump_time > character.jump_buffer + TINY:
        return False
    if character.grounded != 0:
        return True
    return character.has_jumped == 0 and character.air_time <= character.coyote_time + TINY


@inner
def leave_ground(character):
    """What carried it has given it its velocity."""
    if character.grounded != 0:
        v, u = character.velocity, character.carried
        v[0], v[1], v[2] = v[0] + u[0], v[1] + u[1], v[2] + u[2]
    character.grounded = 0
    character.ground = -1
    character.carried[0] = character.carried[1] = character.carried[2] = 0.0


@inner
def level_wish(character):
    """The wished velocity along the level (x, z) [m/s], its length at most the wanted speed."""
    w = character.wish
    length = math.sqrt(w[0] * w[0] + w[2] * w[2])
    speed = wanted_speed(character) / max(length, 1.0)
    return w[0] * speed, w[2] * speed


@inner
def walk_on_ground(character, wx, wz, dt):
    """Velocity along the ground: as fast along a slope as on the level, towards where the wish points seen from above."""
    v, n = character.velocity, character.normal
    across = math.sqrt(v[0] * v[0] + v[2] * v[2])
    share = length_of(v[0], v[1], v[2]) / across if across > TINY else 0.0
    rate = character.acceleration if wx * wx + wz * wz > TINY else character.braking
    x, _, z = toward(v[0] * share, 0.0, v[2] * share, wx, 0.0, wz, rate * dt)
    y = -(n[0] * x + n[2] * z) / n[1]
    length = length_of(x, y, z)
    share = math.sqrt(x * x + z * z) / length if length > TINY else 0.0
    v[0], v[1], v[2] = x * share, y * share, z * share


@inner
def fall(character, wx, wz, dt):
    """Velocity in the air at the tick's end, from half-way through it; the wish steers a little, but up no steep slope."""
    v, n = character.velocity, character.normal
    across = math.sqrt(n[0] * n[0] + n[2] * n[2])
    if across > TINY:  # something too steep to stand on is touched
        into = min((n[0] * wx + n[2] * wz) / across, 0.0) / across
        wx, wz = wx - into * n[0], wz - into * n[2]
    if wx * wx + wz * wz > TINY:
        v[0], _, v[2] = toward(v[0], 0.0, v[2], wx, 0.0, wz, character.air_control * character.acceleration * dt)
    v[1] = max(v[1] - character.gravity * dt, -character.fall_speed)


@inner
def float_along(character, dt):
    """Velocity of who swims or flies: where the wish points, jump upwards, crouch downwards."""
    v, w = character.velocity, character.wish
    y = w[1] + float(character.wish_jump) - float(character.wish_crouch)
    speed = wanted_speed(character) / max(length_of(w[0], y, w[2]), 1.0)
    wx, wy, wz = w[0] * speed, y * speed, w[2] * speed
    rate = character.acceleration if wx * wx + wy * wy + wz * wz > TINY else character.braking
    v[0], v[1], v[2] = toward(v[0], v[1], v[2], wx, wy, wz, rate * dt)


@inner
def ride(around, near_count, character, dt, jumps):
    """Goes and turns with what it stands on; who jumps off takes the velocity of that along instead."""
    dx, dy, dz, turn = carry_of(around, character, dt)
    u = character.carried
    u[0], u[1], u[2] = dx / dt, dy / dt, dz / dt
    if jumps or (dx == 0.0 and dy == 0.0 and dz == 0.0 and turn == 0.0):
        return
    character.yaw += turn
    slide(around, near_count, character, dx, dy, dz, False, character.ground)


@inner
def way_of(character, before, dt):
    """The way of a tick: of a fall exactly, by the velocities at both ends."""
    v = character.velocity
    y = 0.5 * (before + v[1]) if character.grounded == 0 and character.mode == WALK else v[1]
    return v[0] * dt, y * dt, v[2] * dt


@inner
def walk(around, character, dt, pushes):
    """One tick of a character, in place. Returns how many pushes there are."""
    note_wishes(character, dt)
    reach = length_of(character.velocity[0], character.velocity[1], character.velocity[2]) * dt
    reach += length_of(character.carried[0], character.carried[1], character.carried[2]) * dt
    reach += (character.acceleration + character.braking + character.gravity) * dt * dt + character.step_height
    reach += launch_speed(character.jump_height, character.gravity, dt) * dt + character.height + 8.0 * SKIN
    near_count = gather(around, character.collider, reach)
    load_probe(around.geometry, character.radius, character.stature)
    stand_up(around, near_count, character)
    if character.mode != WALK:
        leave_ground(character)
        return drift(around, near_count, character, dt, pushes)
    jumps = jumps_now(character)
    if character.grounded != 0:
        ride(around, near_count, character, dt, jumps)
    wx, wz = level_wish(character)
    before = character.velocity[1]
    if jumps:
        was_free = character.grounded == 0
        leave_ground(character)
        lifted = 0.0 if was_free else character.velocity[1] - before
        character.velocity[1] = lifted + launch_speed(character.jump_height, character.gravity, dt)
        before = character.velocity[1]
        character.has_jumped = 1
        character.jump_time = 1e9
        character.normal[0] = character.normal[1] = character.normal[2] = 0.0
    if character.grounded != 0:
        walk_on_ground(character, wx, wz, dt)
    else:
        fall(character, wx, wz, dt)
    dx, dy, dz = way_of(character, before, dt)
    p = character.position
    x, z = p[0], p[2]
    low = p[1]
    was_grounded = character.grounded != 0
    count, met = slide(around, near_count, character, dx, dy, dz, was_grounded, -1)
    character.blocked = 1 if met else 0
    pushes = push_aside(around, character, count, wx, wz, dt, pushes)
    v = character.velocity
    vx, vy, vz = v[0], v[1], v[2]
    clip_velocity(around.planes, count, v, character.carried)
    if was_grounded and climb_step(around, near_count, character, x, low, z, dx, dz):
        v[0], v[1], v[2] = vx, vy, vz  # the step has taken nothing
    settle(around, near_count, character, was_grounded, count)
    if character.grounded != 0:
        pushes = weigh_down(around, character, around.hits[1].point, pushes)
    return pushes


@inner
def drift(around, near_count, character, dt, pushes):
    """The tick of who swims or flies."""
    float_along(character, dt)
    dx, dy, dz = way_of(character, 0.0, dt)
    wx, wz = character.velocity[0], character.velocity[2]
    count, met = slide(around, near_count, character, dx, dy, dz, False, -1)
    character.blocked = 1 if met else 0
    pushes = push_aside(around, character, count, wx, wz, dt, pushes)
    clip_velocity(around.planes, count, character.velocity, character.carried)
    character.normal[0] = character.normal[1] = character.normal[2] = 0.0
    character.has_jumped = 1  # who is put to walk in the air falls
    return pushes

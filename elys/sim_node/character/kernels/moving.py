"""What Python calls: the world as it will be at the tick's end, and all characters moved in it, one after another."""

from __future__ import annotations

import math

from elys.sim_node.character.kernels.carrying import facing, foresee, is_moving_by_itself
from elys.sim_node.character.kernels.walking import launch_speed, walk
from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.rotation import turn_by
from elys.sim_node.physics.kernels.tables import PLANE

HALF_DEGREE = math.pi / 360.0


@kernel
def foresee_bodies(bodies, colliders, is_character, characters, dt, moved):
    """Puts the colliders of kinematic bodies where they will be after dt, and makes room in the boxes of characters.

    A box is made to hold all the places in which a character may be at the tick's end, so that others find it in the query tree
    when it has moved. Writes the rows of what was changed into `moved` (C,) and returns how many there are.
    """
    count = 0
    for c in range(colliders.shape[0]):
        collider = colliders[c]
        body = bodies[collider.body]
        if is_character[collider.body] != 0 or collider.kind == PLANE or not is_moving_by_itself(body):
            continue
        foresee(body, collider, dt)
        moved[count] = c
        count += 1
    for i in range(characters.shape[0]):
        character = characters[i]
        box = colliders[character.collider].box
        v, u = character.velocity, character.carried
        reach = (abs(v[0]) + abs(v[1]) + abs(v[2]) + abs(u[0]) + abs(u[1]) + abs(u[2])) * dt
        reach += (character.acceleration + character.braking + character.gravity) * dt * dt
        reach += launch_speed(character.jump_height, character.gravity, dt) * dt
        reach += 2.0 * character.step_height + character.height
        for k in range(3):
            box[k] -= reach
            box[3 + k] += reach
        moved[count] = character.collider
        count += 1
    return count


@kernel
def move_characters(around, characters, dt):
    """Moves characters (N,) by one tick, each seeing where those before it have gone. Returns how many pushes there are.

    Writes their new state in place and what they do to loose bodies into `around.pushes`.
    """
    pushes = 0
    for i in range(characters.shape[0]):
        character = characters[i]
        _, _, _, w = turn_by(4.0 * HALF_DEGREE * character.slope_limit, 0.0, 0.0)
        character.least_up = w - 1e-9  # a slope of exactly the limit can be stood on
        pushes = walk(around, character, dt, pushes)
        x, y, z, w = facing(character.yaw)
        q = character.rotation
        q[0], q[1], q[2], q[3] = x, y, z, w
        place_capsule(around.colliders[character.collider], character)
    return pushes


@inner
def place_capsule(collider, character):
    """Puts a capsule where its character now is, for those that come after."""
    p = character.position
    center = collider.center
    center[0], center[1], center[2] = p[0], p[1] + 0.5 * character.stature, p[2]
    collider.half_extents[1] = max(0.5 * character.stature - character.radius, 1e-4)

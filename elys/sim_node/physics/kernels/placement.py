"""From body poses to where every shape is: world axes, centres, boxes, and the inertia as seen in world axes."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.rotation import multiplied, rotated
from elys.sim_node.physics.kernels.tables import CAPSULE, CYLINDER, DYNAMIC, PLANE, SPHERE, STATIC


@inner
def write_axes(axes, x, y, z, w):
    """The three axes of the frame that a quaternion describes, one after another."""
    axes[0] = 1.0 - 2.0 * (y * y + z * z)
    axes[1] = 2.0 * (x * y + w * z)
    axes[2] = 2.0 * (x * z - w * y)
    axes[3] = 2.0 * (x * y - w * z)
    axes[4] = 1.0 - 2.0 * (x * x + z * z)
    axes[5] = 2.0 * (y * z + w * x)
    axes[6] = 2.0 * (x * z + w * y)
    axes[7] = 2.0 * (y * z - w * x)
    axes[8] = 1.0 - 2.0 * (x * x + y * y)


@kernel
def place_inertia(bodies, axes):
    """Writes the world inverse inertia of every dynamic body: R diag(1/I) R^T. `axes` (9,) is room to work in."""
    for i in range(bodies.shape[0]):
        body = bodies[i]
        if body.motion != DYNAMIC:
            continue
        q = body.rotation
        write_axes(axes, q[0], q[1], q[2], q[3])
        inverse = body.inverse_inertia
        out = body.world_inverse_inertia
        for k in range(6):
            out[k] = 0.0
        for k in range(3):
            u = inverse[k]
            x = axes[3 * k]
            y = axes[3 * k + 1]
            z = axes[3 * k + 2]
            out[0] += u * x * x
            out[1] += u * y * y
            out[2] += u * z * z
            out[3] += u * x * y
            out[4] += u * x * z
            out[5] += u * y * z


@inner
def axis_reach(collider, k):
    """How far a shape reaches along a world axis, from its centre."""
    axes = collider.axes
    half = collider.half_extents
    if collider.kind == CAPSULE:
        return abs(axes[3 + k]) * half[1] + half[0]
    if collider.kind == CYLINDER:
        return abs(axes[3 + k]) * half[1] + math.sqrt(max(1.0 - axes[3 + k] * axes[3 + k], 0.0)) * half[0]
    return abs(axes[k]) * half[0] + abs(axes[3 + k]) * half[1] + abs(axes[6 + k]) * half[2]


@kernel
def place_colliders(bodies, colliders):
    """Writes centre, axes and tight box of every collider from its body's pose."""
    for c in range(colliders.shape[0]):
        collider = colliders[c]
        body = bodies[collider.body]
        q = body.rotation
        x, y, z, w = q[0], q[1], q[2], q[3]
        local = collider.local_position
        px, py, pz = rotated(x, y, z, w, local[0], local[1], local[2])
        px += body.position[0]
        py += body.position[1]
        pz += body.position[2]
        center = collider.center
        center[0], center[1], center[2] = px, py, pz
        half = collider.half_extents
        box = collider.box
        if collider.kind == SPHERE:
            for k in range(3):
                box[k] = center[k] - half[k]
                box[3 + k] = center[k] + half[k]
            continue
        if collider.kind == PLANE:
            for k in range(3):
                box[k] = center[k] - half[k]
                box[3 + k] = center[k] + half[k]
        turn = collider.local_rotation
        x, y, z, w = multiplied(x, y, z, w, turn[0], turn[1], turn[2], turn[3])
        axes = collider.axes
        write_axes(axes, x, y, z, w)
        if collider.kind == PLANE:
            continue
        for k in range(3):
            reach = axis_reach(collider, k)
            box[k] = center[k] - reach
            box[3 + k] = center[k] + reach


@inner
def turning_travel(body, collider, h):
    """How far the farthest point of a collider can go by its body's turning within the time h [m]."""
    v = body.velocity
    spin = math.sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5])
    squared = 0.0
    for k in range(3):
        away = collider.center[k] - body.position[k]
        squared += away * away
    return min(spin * h, 2.0) * (math.sqrt(squared) + collider.reach)


@inner
def surface_travel(body, collider, h):
    """How far the farthest point of a collider can go within the time h, by moving and by turning [m]."""
    v = body.velocity
    speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return speed * h + turning_travel(body, collider, h)


@kernel
def fatten_boxes(bodies, colliders, all_constants):
    """Gives a new fat box to every collider that may leave its old one in this step; returns how many.

    Together two boxes hold the gap that `pair_margin` looks across, all around and not only ahead: what is found must not
    depend on how the world is turned. What is added beyond that lets a box last: a little, and two more steps ahead.
    """
    constants = all_constants[0]
    h = constants.substep * constants.substeps
    moved = 0
    for c in range(colliders.shape[0]):
        collider = colliders[c]
        body = bodies[collider.body]
        around = constants.margin
        ahead = 0.0
        if body.motion != STATIC:
            around += min(surface_travel(body, collider, h), collider.reach)
            ahead = 2.0 * h
        box = collider.box
        fat = collider.fat_box
        inside = True
        for k in range(3):
            inside = inside and box[k] - around >= fat[k] and box[3 + k] + around <= fat[3 + k]
        if inside:
            collider.moved = 0
            continue
        around += constants.fattening
        for k in range(3):
            way = body.velocity[k] * ahead
            fat[k] = box[k] - around + min(way, 0.0)
            fat[3 + k] = box[3 + k] + around + max(way, 0.0)
        collider.moved = 1
        moved += 1
    return moved

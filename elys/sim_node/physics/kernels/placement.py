"""From body poses to where every shape is: world axes, centres, boxes, and the inertia as seen in world axes."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.midphase import has_parts
from elys.sim_node.physics.kernels.rotation import multiplied, rotated
from elys.sim_node.physics.kernels.tables import (
    CAPSULE,
    CYLINDER,
    HULL,
    IN_PARTS,
    MESH,
    PLANE,
    SOLID,
    SPHERE,
    STATIC,
    TRIGGER,
)


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


LASTING = 4.0  # steps of straight flight that a fat box holds


@inner
def write_world_inertia(body, out):
    """The inverse inertia in world axes, R diag(1/I) R^T, as xx yy zz xy xz yz."""
    q = body.rotation
    x, y, z, w = q[0], q[1], q[2], q[3]
    a, b, c = body.inverse_inertia[0], body.inverse_inertia[1], body.inverse_inertia[2]
    r0, r1, r2 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
    r3, r4, r5 = 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)
    r6, r7, r8 = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
    out[0] = a * r0 * r0 + b * r3 * r3 + c * r6 * r6
    out[1] = a * r1 * r1 + b * r4 * r4 + c * r7 * r7
    out[2] = a * r2 * r2 + b * r5 * r5 + c * r8 * r8
    out[3] = a * r0 * r1 + b * r3 * r4 + c * r6 * r7
    out[4] = a * r0 * r2 + b * r3 * r5 + c * r6 * r8
    out[5] = a * r1 * r2 + b * r4 * r5 + c * r7 * r8


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


@inner
def place_collider(body, collider):
    """Writes centre and axes of a collider from its body's pose."""
    q = body.rotation
    x, y, z, w = q[0], q[1], q[2], q[3]
    local = collider.local_position
    px, py, pz = rotated(x, y, z, w, local[0], local[1], local[2])
    center = collider.center
    center[0], center[1], center[2] = px + body.position[0], py + body.position[1], pz + body.position[2]
    if collider.kind != SPHERE:
        turn = collider.local_rotation
        x, y, z, w = multiplied(x, y, z, w, turn[0], turn[1], turn[2], turn[3])
        write_axes(collider.axes, x, y, z, w)


@inner
def bound_hull(collider, header, points, box):
    """The smallest box around a hull's corners: around one that is nearly round, a third of what its turned box takes."""
    u = collider.axes
    first = header.first_point
    for k in range(3):
        x, y, z = u[k], u[3 + k], u[6 + k]
        low = high = points[first, 0] * x + points[first, 1] * y + points[first, 2] * z
        for i in range(first + 1, first + header.point_count):
            along = points[i, 0] * x + points[i, 1] * y + points[i, 2] * z
            low = min(low, along)
            high = max(high, along)
        box[k] = collider.center[k] + low
        box[3 + k] = collider.center[k] + high


@kernel
def place_colliders(bodies, colliders, listed, count, geometry):
    """Writes centre, axes and tight box of the first `count` listed colliders from their bodies' poses."""
    for index in range(count):
        collider = colliders[listed[index]]
        place_collider(bodies[collider.body], collider)
        center = collider.center
        box = collider.box
        if collider.kind == HULL:
            bound_hull(collider, geometry.headers[collider.geometry], geometry.points, box)
            continue
        for k in range(3):
            is_same_all_around = collider.kind == SPHERE or collider.kind == PLANE
            reach = collider.half_extents[k] if is_same_all_around else axis_reach(collider, k)
            box[k] = center[k] - reach
            box[3 + k] = center[k] + reach


@inner
def lever(collider, body):
    """How far from its body's centre the farthest point of a collider is that is elsewhere when it turns [m]: a ball's middle."""
    squared = 0.0
    for k in range(3):
        away = collider.center[k] - body.position[k]
        squared += away * away
    return math.sqrt(squared) + (0.0 if collider.kind == SPHERE else collider.reach)


@inner
def turning_travel(body, collider, h):
    """How far the farthest point of a collider can go by its body's turning within the time h [m]."""
    v = body.velocity
    squared_spin = v[3] * v[3] + v[4] * v[4] + v[5] * v[5]
    if squared_spin == 0.0:
        return 0.0
    return min(math.sqrt(squared_spin) * h, 2.0) * lever(collider, body)


@inner
def thinness(collider):
    """How far something may move past the surface of a collider before its middle lies behind it [m]."""
    if collider.kind >= MESH:
        return 0.0
    half = collider.half_extents
    return min(half[0], half[1], half[2])


@inner
def follow_collider(proxy, body, collider):
    """Writes what says how near a collider comes to others in this step."""
    for k in range(6):
        proxy.box[k] = collider.box[k]
    proxy.turning = collider.turning
    for k in range(3):
        proxy.velocity[k] = body.velocity[k]


@inner
def renew_proxy(proxy, body, collider):
    """Writes what decides which pairs a collider has."""
    proxy.body = collider.body
    proxy.layer = collider.layer
    proxy.mask = collider.mask
    proxy.kind = collider.kind
    proxy.trigger = collider.trigger
    proxy.motion = body.motion
    proxy.reach = collider.reach
    proxy.thinness = thinness(collider)
    proxy.special = (TRIGGER if collider.trigger != SOLID else 0) | (IN_PARTS if has_parts(collider) else 0)


@kernel
def fatten_boxes(bodies, colliders, proxies, listed, count, moved, all_constants):
    """Gives a new fat box to every listed collider that may leave its old one in this step.

    Writes those into `moved`; returns how many they are.

    Together two boxes hold the gap that `pair_margin` looks across, all around and not only ahead: what is found must not
    depend on how the world is turned. What is added beyond that lets a box last: a little, and some more steps ahead.
    """
    constants = all_constants[0]
    h = constants.time
    moved_count = 0
    for index in range(count):
        collider = colliders[listed[index]]
        body = bodies[collider.body]
        around = constants.margin
        ahead = 0.0
        collider.turning = 0.0
        if body.motion != STATIC:
            v = body.velocity
            collider.turning = turning_travel(body, collider, h)
            way = h * math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + collider.turning
            around += min(way, collider.reach)
            ahead = LASTING * h
        box = collider.box
        proxy = proxies[listed[index]]
        follow_collider(proxy, body, collider)
        fat = proxy.fat_box
        fits = True
        for k in range(3):
            low = box[k] - around - fat[k]
            high = fat[3 + k] - box[3 + k] - around
            # One that was made for a faster body is given up too: it would keep pairs that never meet.
            most = around + 3.0 * constants.fattening + 2.0 * abs(body.velocity[k]) * ahead
            fits = fits and 0.0 <= low <= most and 0.0 <= high <= most
        if fits:
            continue
        around += constants.fattening
        for k in range(3):
            way = body.velocity[k] * ahead
            fat[k] = box[k] - around + min(way, 0.0)
            fat[3 + k] = box[3 + k] + around + max(way, 0.0)
        renew_proxy(proxy, body, collider)
        moved[moved_count] = listed[index]
        moved_count += 1
    return moved_count

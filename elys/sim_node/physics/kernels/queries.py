"""Rays against boxes and spheres."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.tables import BOX
from elys.sim_node.physics.kernels.tree import FAR, LEAF

MISS = -1.0


@inner
def slab(origin, inverse, low, high):
    """Where a line enters and leaves the space between two parallel planes.

    A line within a plane gives 0 times infinity, which is no number, and then both answers let it pass.
    """
    t0 = (low - origin) * inverse
    t1 = (high - origin) * inverse
    if t0 > t1:
        t0, t1 = t1, t0
    return (t0 if t0 == t0 else -FAR), (t1 if t1 == t1 else FAR)


@inner
def entry_of(box, ox, oy, oz, ix, iy, iz, limit):
    """Where a ray enters an axis-aligned box, FAR when it does not before the limit. Takes the inverse direction."""
    x0, x1 = slab(ox, ix, box[0], box[3])
    y0, y1 = slab(oy, iy, box[1], box[4])
    z0, z1 = slab(oz, iz, box[2], box[5])
    enter = max(x0, y0, z0, 0.0)
    return enter if enter <= min(x1, y1, z1, limit) else FAR


@inner
def ray_sphere(sphere, ox, oy, oz, dx, dy, dz):
    """Distance along a unit ray, and the normal; MISS as the distance when it passes by."""
    center = sphere.center
    px, py, pz = ox - center[0], oy - center[1], oz - center[2]
    radius = sphere.half_extents[0]
    b = px * dx + py * dy + pz * dz
    outside = px * px + py * py + pz * pz - radius * radius
    if outside <= 0.0:
        return 0.0, -dx, -dy, -dz
    # Distance of the centre from the line, taken from its foot: exact also for small spheres far away.
    fx, fy, fz = px - b * dx, py - b * dy, pz - b * dz
    squared = radius * radius - (fx * fx + fy * fy + fz * fz)
    if b >= 0.0 or squared < 0.0:
        return MISS, 0.0, 0.0, 0.0
    t = -b - math.sqrt(squared)
    scale = 1.0 / radius
    return t, (px + t * dx) * scale, (py + t * dy) * scale, (pz + t * dz) * scale


@inner
def ray_box(box, ox, oy, oz, dx, dy, dz):
    """Distance along a unit ray, and the normal; MISS as the distance when it passes by."""
    center = box.center
    axes = box.axes
    px, py, pz = ox - center[0], oy - center[1], oz - center[2]
    enter = -FAR
    leave = FAR
    nx = ny = nz = 0.0
    for k in range(3):
        ax, ay, az = axes[3 * k], axes[3 * k + 1], axes[3 * k + 2]
        origin = px * ax + py * ay + pz * az
        along = dx * ax + dy * ay + dz * az
        half = box.half_extents[k]
        t0, t1 = slab(origin, 1.0 / along, -half, half)
        if along == 0.0 and abs(origin) > half:
            return MISS, 0.0, 0.0, 0.0
        if t0 > enter:
            enter = t0
            sign = -1.0 if along > 0.0 else 1.0
            nx, ny, nz = sign * ax, sign * ay, sign * az
        leave = min(leave, t1)
    if enter > leave or leave < 0.0:
        return MISS, 0.0, 0.0, 0.0
    if enter <= 0.0:
        return 0.0, -dx, -dy, -dz
    return enter, nx, ny, nz


@kernel
def cast_rays(colliders, leaves, nodes, stack, entries, origins, directions, limits, hit, distance, normal):
    """The first collider that each ray meets.

    Parameters: rays (R, 3) with unit directions and the farthest distance (R,) of each; `stack` and `entries` are room for
    the walk down the tree. Writes per ray the collider, or -1, the distance [m] and the surface normal. A ray that begins
    inside a shape hits it at once, against its direction.
    """
    leaf_count = nodes.shape[0] // 2
    n = colliders.shape[0]
    for r in range(origins.shape[0]):
        ox, oy, oz = origins[r, 0], origins[r, 1], origins[r, 2]
        dx, dy, dz = directions[r, 0], directions[r, 1], directions[r, 2]
        ix, iy, iz = 1.0 / dx, 1.0 / dy, 1.0 / dz
        limit = limits[r]
        hit[r] = -1
        stack[0] = 1
        entries[0] = 0.0
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            if entries[top] > limit:
                continue
            if node < leaf_count:
                # The nearer child goes on top: what it hits spares the other.
                first = entry_of(nodes[2 * node], ox, oy, oz, ix, iy, iz, limit)
                second = entry_of(nodes[2 * node + 1], ox, oy, oz, ix, iy, iz, limit)
                near = 2 * node if first <= second else 2 * node + 1
                if max(first, second) < FAR:
                    stack[top], entries[top] = 4 * node + 1 - near, max(first, second)
                    top += 1
                if min(first, second) < FAR:
                    stack[top], entries[top] = near, min(first, second)
                    top += 1
                continue
            start = (node - leaf_count) * LEAF
            for place in range(start, min(n, start + LEAF)):
                c = leaves[place].order
                collider = colliders[c]
                if collider.kind == BOX:
                    t, nx, ny, nz = ray_box(collider, ox, oy, oz, dx, dy, dz)
                else:
                    t, nx, ny, nz = ray_sphere(collider, ox, oy, oz, dx, dy, dz)
                if t == MISS or t > limit or (t == limit and hit[r] >= 0 and hit[r] < c):
                    continue
                limit = t
                hit[r] = c
                distance[r] = t
                normal[r, 0], normal[r, 1], normal[r, 2] = nx, ny, nz

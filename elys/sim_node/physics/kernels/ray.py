"""Rays against one shape each, in closed form and float64.

Each function takes a collider, the ray's origin and its unit direction, and returns the distance and the surface normal. The
distance is MISS when the ray passes by. A ray that begins inside meets the shape at 0, with a normal against the ray.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.tables import BOX
from elys.sim_node.physics.kernels.tree import FAR

MISS = -1.0


@inner
def ray_sphere(sphere, ox, oy, oz, dx, dy, dz):
    center = sphere.center
    px, py, pz = ox - center[0], oy - center[1], oz - center[2]
    radius = sphere.half_extents[0]
    t = along_ball(px, py, pz, dx, dy, dz, radius)
    if t <= 0.0:
        return t, -dx, -dy, -dz
    scale = 1.0 / radius
    return t, (px + t * dx) * scale, (py + t * dy) * scale, (pz + t * dz) * scale


@inner
def along_ball(px, py, pz, dx, dy, dz, radius):
    """Distance along a unit ray from p to a ball around 0; 0 from inside, MISS when it passes by."""
    if px * px + py * py + pz * pz <= radius * radius:
        return 0.0
    # Distance of the centre from the line, taken from its foot: exact also for small spheres far away.
    b = px * dx + py * dy + pz * dz
    fx, fy, fz = px - b * dx, py - b * dy, pz - b * dz
    squared = radius * radius - (fx * fx + fy * fy + fz * fz)
    if b >= 0.0 or squared < 0.0:
        return MISS
    return max(-b - math.sqrt(squared), 0.0)


@inner
def slab(origin, along, half):
    """Where a line enters and leaves the space |x| <= half; never, as (FAR, -FAR), for one that runs beside it."""
    if along == 0.0:
        return (-FAR, FAR) if abs(origin) <= half else (FAR, -FAR)
    inverse = 1.0 / along
    reach = abs(half * inverse)
    middle = -origin * inverse
    return middle - reach, middle + reach


@inner
def ray_box(box, ox, oy, oz, dx, dy, dz):
    center = box.center
    a = box.axes
    half = box.half_extents
    px, py, pz = ox - center[0], oy - center[1], oz - center[2]
    vx = dx * a[0] + dy * a[1] + dz * a[2]
    vy = dx * a[3] + dy * a[4] + dz * a[5]
    vz = dx * a[6] + dy * a[7] + dz * a[8]
    x0, x1 = slab(px * a[0] + py * a[1] + pz * a[2], vx, half[0])
    y0, y1 = slab(px * a[3] + py * a[4] + pz * a[5], vy, half[1])
    z0, z1 = slab(px * a[6] + py * a[7] + pz * a[8], vz, half[2])
    enter = max(x0, y0, z0)
    leave = min(x1, y1, z1)
    if enter > leave or leave < 0.0:
        return MISS, 0.0, 0.0, 0.0
    if enter <= 0.0:
        return 0.0, -dx, -dy, -dz
    if enter == x0:
        k, along = 0, vx
    elif enter == y0:
        k, along = 3, vy
    else:
        k, along = 6, vz
    sign = -1.0 if along > 0.0 else 1.0
    return enter, sign * a[k], sign * a[k + 1], sign * a[k + 2]


@inner
def ray_shape(collider, ox, oy, oz, dx, dy, dz):
    """A ray against a shape of any kind."""
    if collider.kind == BOX:
        return ray_box(collider, ox, oy, oz, dx, dy, dz)
    return ray_sphere(collider, ox, oy, oz, dx, dy, dz)

"""The point of a shape that is closest to a given one, in closed form; for hulls by the general distance.

Each function takes a collider and a point and returns the distance, the closest point and the surface normal there. A point
inside is its own closest point, at distance 0 with no normal.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.gjk import FAR, core_distance
from elys.sim_node.physics.kernels.ray import into_axes, out_of_axes
from elys.sim_node.physics.kernels.support import load_convex
from elys.sim_node.physics.kernels.tables import BOX, CAPSULE, CYLINDER, PLANE, SPHERE


@inner
def core_point(kind, half, x, y, z):
    """The point of a core that is closest to (x, y, z), all in the shape's own axes."""
    if kind == BOX:
        return min(max(x, -half[0]), half[0]), min(max(y, -half[1]), half[1]), min(max(z, -half[2]), half[2])
    if kind == CAPSULE:
        return 0.0, min(max(y, -half[1]), half[1]), 0.0
    if kind == CYLINDER:
        squared = x * x + z * z
        scale = 1.0
        if squared > half[0] * half[0]:
            scale = half[0] / math.sqrt(squared)
        return scale * x, min(max(y, -half[1]), half[1]), scale * z
    return 0.0, 0.0, 0.0


@inner
def point_to_round_core(collider, radius, x, y, z):
    """A box, cylinder, or the ball or capsule of a radius, by the closest point of its core."""
    center = collider.center
    wx, wy, wz = x - center[0], y - center[1], z - center[2]
    if collider.kind == SPHERE:  # has no axes
        ax, ay, az = wx, wy, wz
    else:
        lx, ly, lz = into_axes(collider.axes, wx, wy, wz)
        cx, cy, cz = core_point(collider.kind, collider.half_extents, lx, ly, lz)
        ax, ay, az = out_of_axes(collider.axes, lx - cx, ly - cy, lz - cz)
    squared = ax * ax + ay * ay + az * az
    if squared <= radius * radius:
        return 0.0, x, y, z, 0.0, 0.0, 0.0
    length = math.sqrt(squared)
    nx, ny, nz = ax / length, ay / length, az / length
    gap = length - radius
    return gap, x - gap * nx, y - gap * ny, z - gap * nz, nx, ny, nz


@inner
def point_to_core(shape, geometry, x, y, z):
    """A point and the core of a hull or triangle, both relative to the same place: distance, closest point, normal."""
    point = geometry.convex[0]
    point.kind = SPHERE
    point.scale = 1.0
    point.center[0], point.center[1], point.center[2] = x, y, z
    simplex = geometry.simplex[0]
    distance = core_distance(point, shape, geometry.points, FAR, simplex)
    if distance <= 0.0:
        return 0.0, x, y, z, 0.0, 0.0, 0.0
    b = simplex.on_b
    n = simplex.direction
    return distance, b[0], b[1], b[2], -n[0], -n[1], -n[2]


@inner
def point_to_solid(collider, geometry, x, y, z):
    """A point and anything that has an inside: all but meshes and height fields."""
    kind = collider.kind
    if kind in (SPHERE, CAPSULE):
        return point_to_round_core(collider, collider.half_extents[0], x, y, z)
    if kind in (BOX, CYLINDER):
        return point_to_round_core(collider, 0.0, x, y, z)
    center = collider.center
    if kind == PLANE:
        nx, ny, nz = collider.axes[3], collider.axes[4], collider.axes[5]
        height = (x - center[0]) * nx + (y - center[1]) * ny + (z - center[2]) * nz
        if height <= 0.0:
            return 0.0, x, y, z, 0.0, 0.0, 0.0
        return height, x - height * nx, y - height * ny, z - height * nz, nx, ny, nz
    shape = geometry.convex[1]
    load_convex(shape, collider, geometry.headers, center[0], center[1], center[2])
    d, px, py, pz, nx, ny, nz = point_to_core(shape, geometry, x - center[0], y - center[1], z - center[2])
    return d, px + center[0], py + center[1], pz + center[2], nx, ny, nz

"""Moving shapes against shapes that stand still.

The gap between two convex shapes, one of which moves along a line, is a convex function of the way: Newton's method, begun
before the first touch, never goes past it, and each of its steps is one of conservative advancement (Mirtich 1996; van den
Bergen, "Ray casting against general convex objects", 2004). Balls against balls, capsules and boxes need no general distance.

A cast returns the distance, or MISS, and writes to `touch` where the surfaces meet and the normal of the still shape.
"""

from __future__ import annotations

import math

import numpy as np

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.gjk import FAR, core_distance
from elys.sim_node.physics.kernels.ray import MISS, PARALLEL, into_axes, out_of_axes, ray_capsule, ray_sphere, slab
from elys.sim_node.physics.kernels.support import load_convex, support
from elys.sim_node.physics.kernels.tables import BOX, CAPSULE, PLANE, SPHERE

TOUCH = np.dtype([("point", "f8", 3), ("normal", "f8", 3)], align=True)

ROUNDS = 64  # a grazing touch halves the gap with each; others take a few
CLOSE = 1e-7  # of the shapes' extent: as near as the direction of the gap is sure, from where the last steps are taken
KEPT = 1e-3  # of a gap is kept by each step: there is always one from which the last step was seen well
TOUCHING = 2e-8  # of the shapes' extent: no gap any more


@inner
def write_touch(touch, px, py, pz, nx, ny, nz):
    touch.point[0], touch.point[1], touch.point[2] = px, py, pz
    touch.normal[0], touch.normal[1], touch.normal[2] = nx, ny, nz


@inner
def cast_ball_at_box(box, radius, ox, oy, oz, dx, dy, dz):
    """A ball against a box: distance and normal."""
    center = box.center
    half = box.half_extents
    px, py, pz = into_axes(box.axes, ox - center[0], oy - center[1], oz - center[2])
    vx, vy, vz = into_axes(box.axes, dx, dy, dz)
    x0, x1 = slab(px, vx, half[0] + radius)
    y0, y1 = slab(py, vy, half[1] + radius)
    z0, z1 = slab(pz, vz, half[2] + radius)
    t = max(x0, y0, z0, 0.0)
    if t > min(x1, y1, z1):
        return MISS, 0.0, 0.0, 0.0
    # Touching is as near as coordinates of this size can tell.
    near = 1e-15 * (radius + half[0] + half[1] + half[2] + abs(px) + abs(py) + abs(pz))
    ex = ey = ez = 0.0
    for _ in range(ROUNDS):
        x, y, z = px + t * vx, py + t * vy, pz + t * vz
        ex, ey, ez = (
            x - min(max(x, -half[0]), half[0]),
            y - min(max(y, -half[1]), half[1]),
            z - min(max(z, -half[2]), half[2]),
        )
        distance = math.sqrt(ex * ex + ey * ey + ez * ez)
        if distance - radius <= near:
            break
        approach = -(ex * vx + ey * vy + ez * vz) / distance
        if approach <= 0.0:
            return MISS, 0.0, 0.0, 0.0
        t += (distance - radius) / approach
    length = math.sqrt(ex * ex + ey * ey + ez * ez)
    if t == 0.0 or length == 0.0:
        return t, -dx, -dy, -dz
    nx, ny, nz = out_of_axes(box.axes, ex / length, ey / length, ez / length)
    return t, nx, ny, nz


@inner
def cast_ball(collider, radius, ox, oy, oz, dx, dy, dz, touch):
    """A ball against a ball, capsule or box."""
    if collider.kind == SPHERE:
        t, nx, ny, nz = ray_sphere(collider, ox, oy, oz, dx, dy, dz, radius)
    elif collider.kind == CAPSULE:
        t, nx, ny, nz = ray_capsule(collider, ox, oy, oz, dx, dy, dz, radius)
    else:
        t, nx, ny, nz = cast_ball_at_box(collider, radius, ox, oy, oz, dx, dy, dz)
    back = radius if t > 0.0 else 0.0
    write_touch(touch, ox + t * dx - back * nx, oy + t * dy - back * ny, oz + t * dz - back * nz, nx, ny, nz)
    return t


@inner
def cast_convex(probe, shape, points, simplex, extent, ox, oy, oz, dx, dy, dz, limit, touch):
    """Any convex shape against any other. Places are relative to the still shape's centre; `extent` is the size of both."""
    radius = probe.radius + shape.radius
    close = CLOSE * extent
    touching = TOUCHING * extent
    t = left = 0.0
    center = probe.center
    for step in range(ROUNDS):
        center[0], center[1], center[2] = ox + t * dx, oy + t * dy, oz + t * dz
        gap = core_distance(probe, shape, points, FAR, simplex) - radius
        if step == 0 and gap <= 0.0:
            write_touch(touch, ox, oy, oz, -dx, -dy, -dz)
            return 0.0
        if step > 0 and gap <= touching:
            # Of shapes that lie almost flat on each other the distance vanishes too early: the last one seen knows better.
            t += left
            break
        n = simplex.direction
        approach = n[0] * dx + n[1] * dy + n[2] * dz
        if approach <= 0.0:
            return MISS
        b = simplex.on_b
        r = shape.radius
        write_touch(touch, b[0] - r * n[0], b[1] - r * n[1], b[2] - r * n[2], -n[0], -n[1], -n[2])
        keep = max(close, KEPT * gap) if gap > 2.0 * close else 0.0
        t += (gap - keep) / approach
        left = keep / approach
        if t > limit:
            return MISS
    return t if t <= limit else MISS


@inner
def height_over(plane, probe, points, ox, oy, oz):
    """How far the lowest point of a probe is above a plane, the probe's centre at o; and that point."""
    nx, ny, nz = plane.axes[3], plane.axes[4], plane.axes[5]
    probe.center[0], probe.center[1], probe.center[2] = ox, oy, oz
    x, y, z = support(probe, points, -nx, -ny, -nz)
    x, y, z = x - probe.radius * nx, y - probe.radius * ny, z - probe.radius * nz
    center = plane.center
    return (x - center[0]) * nx + (y - center[1]) * ny + (z - center[2]) * nz, x, y, z


@inner
def cast_at_plane(plane, probe, points, ox, oy, oz, dx, dy, dz, touch):
    """Any convex shape against a half-space."""
    nx, ny, nz = plane.axes[3], plane.axes[4], plane.axes[5]
    height, x, y, z = height_over(plane, probe, points, ox, oy, oz)
    if height <= 0.0:
        write_touch(touch, ox, oy, oz, -dx, -dy, -dz)
        return 0.0
    along = dx * nx + dy * ny + dz * nz
    if along > -PARALLEL:
        return MISS
    t = -height / along
    write_touch(touch, x + t * dx, y + t * dy, z + t * dz, nx, ny, nz)
    return t


@inner
def cast_solid(probe, reach, collider, geometry, ox, oy, oz, dx, dy, dz, limit, touch):
    """A probe against anything that has an inside; the probe's centre begins at o, its box reaches `reach` in all."""
    kind = collider.kind
    if probe.kind == SPHERE and kind in (SPHERE, CAPSULE, BOX):
        return cast_ball(collider, probe.radius, ox, oy, oz, dx, dy, dz, touch)
    points = geometry.points
    if kind == PLANE:
        return cast_at_plane(collider, probe, points, ox, oy, oz, dx, dy, dz, touch)
    center = collider.center
    shape = geometry.convex[1]
    load_convex(shape, collider, geometry.headers, center[0], center[1], center[2])
    x, y, z = ox - center[0], oy - center[1], oz - center[2]
    simplex = geometry.simplex[0]
    t = cast_convex(probe, shape, points, simplex, reach + collider.reach, x, y, z, dx, dy, dz, limit, touch)
    point = touch.point
    point[0], point[1], point[2] = point[0] + center[0], point[1] + center[1], point[2] + center[2]
    return t

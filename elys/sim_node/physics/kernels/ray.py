"""Rays against one shape each, in closed form and float64.

Each function takes a collider, the ray's origin and its unit direction, and returns the distance and the surface normal. The
distance is MISS when the ray passes by. A ray that begins inside meets the shape at 0, with a normal against the ray.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.tables import BOX, CAPSULE, CYLINDER, PLANE, SPHERE
from elys.sim_node.physics.kernels.tree import FAR

MISS = -1.0
PARALLEL = 1e-200  # a direction's share along an axis that leads nowhere, and whose inverse is too large a number


@inner
def into_axes(axes, x, y, z):
    """A vector in a shape's own axes."""
    return (
        x * axes[0] + y * axes[1] + z * axes[2],
        x * axes[3] + y * axes[4] + z * axes[5],
        x * axes[6] + y * axes[7] + z * axes[8],
    )


@inner
def out_of_axes(axes, x, y, z):
    """A vector of a shape's own axes in world space."""
    return (
        x * axes[0] + y * axes[3] + z * axes[6],
        x * axes[1] + y * axes[4] + z * axes[7],
        x * axes[2] + y * axes[5] + z * axes[8],
    )


@inner
def ray_sphere(sphere, ox, oy, oz, dx, dy, dz, more):
    """A ball whose radius is larger by `more`."""
    center = sphere.center
    px, py, pz = ox - center[0], oy - center[1], oz - center[2]
    radius = sphere.half_extents[0] + more
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
    if abs(along) < PARALLEL:
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
    px, py, pz = into_axes(a, ox - center[0], oy - center[1], oz - center[2])
    vx, vy, vz = into_axes(a, dx, dy, dz)
    x0, x1 = slab(px, vx, half[0])
    y0, y1 = slab(py, vy, half[1])
    z0, z1 = slab(pz, vz, half[2])
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
def along_tube(px, pz, vx, vz, radius):
    """Where a line is within `radius` of the y axis: from, to; (FAR, -FAR) when nowhere."""
    squared = vx * vx + vz * vz
    if squared < PARALLEL:
        return (-FAR, FAR) if px * px + pz * pz <= radius * radius else (FAR, -FAR)
    # Taken from the foot of the axis on the line, as for balls.
    t = -(px * vx + pz * vz) / squared
    fx, fz = px + t * vx, pz + t * vz
    inside = radius * radius - (fx * fx + fz * fz)
    if inside < 0.0:
        return FAR, -FAR
    half = math.sqrt(inside / squared)
    return t - half, t + half


@inner
def along_capsule(px, py, pz, vx, vy, vz, radius, half):
    """Distance along a unit ray in a capsule's own axes; 0 from inside, MISS when it passes by."""
    below = py - min(max(py, -half), half)
    if px * px + below * below + pz * pz <= radius * radius:
        return 0.0
    enter, leave = along_tube(px, pz, vx, vz, radius)
    if enter > leave or leave < 0.0:
        return MISS
    y = py + max(enter, 0.0) * vy
    if abs(y) <= half:
        return enter
    # Into the tube beyond an end: only the ball there can be met first.
    return along_ball(px, py - math.copysign(half, y), pz, vx, vy, vz, radius)


@inner
def ray_capsule(capsule, ox, oy, oz, dx, dy, dz, more):
    """A capsule whose radius is larger by `more`; the normal is that of the capsule."""
    center = capsule.center
    px, py, pz = into_axes(capsule.axes, ox - center[0], oy - center[1], oz - center[2])
    vx, vy, vz = into_axes(capsule.axes, dx, dy, dz)
    radius = capsule.half_extents[0] + more
    half = capsule.half_extents[1]
    t = along_capsule(px, py, pz, vx, vy, vz, radius, half)
    if t <= 0.0:
        return t, -dx, -dy, -dz
    y = py + t * vy
    scale = 1.0 / radius
    x, y, z = (px + t * vx) * scale, (y - min(max(y, -half), half)) * scale, (pz + t * vz) * scale
    nx, ny, nz = out_of_axes(capsule.axes, x, y, z)
    return t, nx, ny, nz


@inner
def ray_cylinder(cylinder, ox, oy, oz, dx, dy, dz):
    center = cylinder.center
    px, py, pz = into_axes(cylinder.axes, ox - center[0], oy - center[1], oz - center[2])
    vx, vy, vz = into_axes(cylinder.axes, dx, dy, dz)
    radius = cylinder.half_extents[0]
    side, side_end = along_tube(px, pz, vx, vz, radius)
    cap, cap_end = slab(py, vy, cylinder.half_extents[1])
    enter = max(side, cap)
    if enter > min(side_end, cap_end) or min(side_end, cap_end) < 0.0:
        return MISS, 0.0, 0.0, 0.0
    if enter <= 0.0:
        return 0.0, -dx, -dy, -dz
    if cap >= side:
        nx, ny, nz = out_of_axes(cylinder.axes, 0.0, -math.copysign(1.0, vy), 0.0)
        return enter, nx, ny, nz
    scale = 1.0 / radius
    nx, ny, nz = out_of_axes(cylinder.axes, (px + enter * vx) * scale, 0.0, (pz + enter * vz) * scale)
    return enter, nx, ny, nz


@inner
def ray_plane(plane, ox, oy, oz, dx, dy, dz):
    """The half-space below a plane through the centre, whose normal is the second axis."""
    center = plane.center
    nx, ny, nz = plane.axes[3], plane.axes[4], plane.axes[5]
    height = (ox - center[0]) * nx + (oy - center[1]) * ny + (oz - center[2]) * nz
    if height <= 0.0:
        return 0.0, -dx, -dy, -dz
    along = dx * nx + dy * ny + dz * nz
    if along > -PARALLEL:
        return MISS, 0.0, 0.0, 0.0
    return -height / along, nx, ny, nz


@inner
def ray_hull(hull, geometry, ox, oy, oz, dx, dy, dz):
    """A hull is what lies behind all its faces (Cyrus and Beck 1978)."""
    center = hull.center
    px, py, pz = into_axes(hull.axes, ox - center[0], oy - center[1], oz - center[2])
    vx, vy, vz = into_axes(hull.axes, dx, dy, dz)
    header = geometry.headers[hull.geometry]
    points = geometry.points
    enter = -FAR
    leave = FAR
    at = -1
    for f in range(header.first_face, header.first_face + header.face_count):
        face = geometry.faces[f]
        n = face.normal
        k = face.first_corner
        height = n[0] * (px - points[k, 0]) + n[1] * (py - points[k, 1]) + n[2] * (pz - points[k, 2])
        along = n[0] * vx + n[1] * vy + n[2] * vz
        if abs(along) < PARALLEL:
            if height > 0.0:
                return MISS, 0.0, 0.0, 0.0
        elif along < 0.0:
            if -height / along > enter:
                enter, at = -height / along, f
        else:
            leave = min(leave, -height / along)
    if enter > leave or leave < 0.0:
        return MISS, 0.0, 0.0, 0.0
    if enter <= 0.0:
        return 0.0, -dx, -dy, -dz
    n = geometry.faces[at].normal
    nx, ny, nz = out_of_axes(hull.axes, n[0], n[1], n[2])
    return enter, nx, ny, nz


@inner
def ray_solid(collider, geometry, ox, oy, oz, dx, dy, dz):
    """A ray against anything that has an inside: all but meshes and height fields."""
    kind = collider.kind
    if kind == BOX:
        return ray_box(collider, ox, oy, oz, dx, dy, dz)
    if kind == SPHERE:
        return ray_sphere(collider, ox, oy, oz, dx, dy, dz, 0.0)
    if kind == CAPSULE:
        return ray_capsule(collider, ox, oy, oz, dx, dy, dz, 0.0)
    if kind == CYLINDER:
        return ray_cylinder(collider, ox, oy, oz, dx, dy, dz)
    if kind == PLANE:
        return ray_plane(collider, ox, oy, oz, dx, dy, dz)
    return ray_hull(collider, geometry, ox, oy, oz, dx, dy, dz)

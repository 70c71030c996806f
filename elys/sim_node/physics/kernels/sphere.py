"""Spheres against spheres and boxes: one point each."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner


@inner
def write_point(found, nx, ny, nz, x, y, z, gap):
    normal = found.normal
    point = found.point
    normal[0], normal[1], normal[2] = nx, ny, nz
    point[0], point[1], point[2] = x, y, z
    found.separation[0] = gap
    found.feature[0] = 1
    return 1


@inner
def sphere_sphere(a, b, margin, found):
    """Contact point of two spheres no farther apart than the margin; returns how many (0 or 1)."""
    p = a.center
    q = b.center
    dx, dy, dz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    radius = a.half_extents[0]
    gap = distance - radius - b.half_extents[0]
    if gap > margin:
        return 0
    if distance > 0.0:
        nx, ny, nz = dx / distance, dy / distance, dz / distance
    else:
        nx, ny, nz = 0.0, 1.0, 0.0  # one inside the other, centre on centre: any direction is as good
    out = radius + 0.5 * gap
    return write_point(found, nx, ny, nz, p[0] + nx * out, p[1] + ny * out, p[2] + nz * out, gap)


@inner
def box_sphere(a, b, margin, found):
    """Contact point of box a and sphere b no farther apart than the margin; returns how many (0 or 1)."""
    p = a.center
    q = b.center
    u = a.axes
    dx, dy, dz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    x = dx * u[0] + dy * u[1] + dz * u[2]
    y = dx * u[3] + dy * u[4] + dz * u[5]
    z = dx * u[6] + dy * u[7] + dz * u[8]
    hx, hy, hz = a.half_extents[0], a.half_extents[1], a.half_extents[2]
    radius = b.half_extents[0]
    lx = x - min(max(x, -hx), hx)
    ly = y - min(max(y, -hy), hy)
    lz = z - min(max(z, -hz), hz)
    squared = lx * lx + ly * ly + lz * lz
    reach = radius + margin
    if squared > reach * reach:
        return 0
    if squared > 0.0:
        distance = math.sqrt(squared)
        lx /= distance
        ly /= distance
        lz /= distance
        gap = distance - radius
    else:  # the centre is inside: out through the nearest face
        gx, gy, gz = abs(x) - hx, abs(y) - hy, abs(z) - hz
        if gx >= gy and gx >= gz:
            lx, ly, lz, gap = math.copysign(1.0, x), 0.0, 0.0, gx - radius
        elif gy >= gz:
            lx, ly, lz, gap = 0.0, math.copysign(1.0, y), 0.0, gy - radius
        else:
            lx, ly, lz, gap = 0.0, 0.0, math.copysign(1.0, z), gz - radius
    nx = lx * u[0] + ly * u[3] + lz * u[6]
    ny = lx * u[1] + ly * u[4] + lz * u[7]
    nz = lx * u[2] + ly * u[5] + lz * u[8]
    out = radius + 0.5 * gap
    return write_point(found, nx, ny, nz, q[0] - nx * out, q[1] - ny * out, q[2] - nz * out, gap)

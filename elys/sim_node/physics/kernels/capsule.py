"""Capsules against spheres and capsules: closest points of a segment and a point, and of two segments.

Closest points of segments after Ericson, "Real-Time Collision Detection" (2005), 5.1.9.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.sphere import write_point

PARALLEL = 1e-3  # squared sine of the angle below which capsules that lie side by side get two points


@inner
def ball_ball(px, py, pz, radius_p, qx, qy, qz, radius_q, nx, ny, nz, margin, found):
    """Contact point of two balls; (nx, ny, nz) is the normal where their centres are in one place."""
    dx, dy, dz = qx - px, qy - py, qz - pz
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    gap = distance - radius_p - radius_q
    if gap > margin:
        return 0
    if distance > 0.0:
        nx, ny, nz = dx / distance, dy / distance, dz / distance
    out = radius_p + 0.5 * gap
    return write_point(found, nx, ny, nz, px + out * nx, py + out * ny, pz + out * nz, gap)


@inner
def sphere_capsule(a, b, margin, found):
    """Contact point of sphere a and capsule b no farther apart than the margin; returns how many (0 or 1)."""
    p = a.center
    q = b.center
    v = b.axes
    half = b.half_extents[1]
    t = (p[0] - q[0]) * v[3] + (p[1] - q[1]) * v[4] + (p[2] - q[2]) * v[5]
    t = min(max(t, -half), half)
    qx, qy, qz = q[0] + t * v[3], q[1] + t * v[4], q[2] + t * v[5]
    return ball_ball(
        p[0], p[1], p[2], a.half_extents[0], qx, qy, qz, b.half_extents[0], v[0], v[1], v[2], margin, found
    )


@inner
def side_by_side(a, b, cosine, along, across, margin, found):
    """Two points where nearly parallel capsules lie along each other, 0 where they do not.

    `along` and `across` are the offsets of b's centre along the axes of a and of b.
    """
    u = a.axes
    v = b.axes
    half_a, half_b = a.half_extents[1], b.half_extents[1]
    shadow = abs(cosine) * half_b
    low = max(-half_a, along - shadow)
    high = min(half_a, along + shadow)
    if high - low <= 1e-3 * (half_a + half_b):
        return 0
    p = a.center
    q = b.center
    count = 0
    for end in range(2):
        s = low if end == 0 else high
        t = min(max(cosine * s - across, -half_b), half_b)
        dx = q[0] + t * v[3] - p[0] - s * u[3]
        dy = q[1] + t * v[4] - p[1] - s * u[4]
        dz = q[2] + t * v[5] - p[2] - s * u[5]
        # The normal is that of the first point: across both axes to second order.
        if count == 0:
            distance = math.sqrt(dx * dx + dy * dy + dz * dz)
            if distance == 0.0:
                return 0
            nx, ny, nz = dx / distance, dy / distance, dz / distance
        gap = dx * nx + dy * ny + dz * nz - a.half_extents[0] - b.half_extents[0]
        if gap > margin:
            continue
        out = a.half_extents[0] + 0.5 * gap
        point = found.point
        point[3 * count] = p[0] + s * u[3] + out * nx
        point[3 * count + 1] = p[1] + s * u[4] + out * ny
        point[3 * count + 2] = p[2] + s * u[5] + out * nz
        found.separation[count] = gap
        found.feature[count] = 2 + end
        normal = found.normal
        normal[0], normal[1], normal[2] = nx, ny, nz
        count += 1
    return count


@inner
def capsule_capsule(a, b, margin, found):
    """Contact points of two capsules no farther apart than the margin; two where they lie side by side."""
    p = a.center
    q = b.center
    u = a.axes
    v = b.axes
    half_a, half_b = a.half_extents[1], b.half_extents[1]
    dx, dy, dz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    cosine = u[3] * v[3] + u[4] * v[4] + u[5] * v[5]
    along = dx * u[3] + dy * u[4] + dz * u[5]
    across = dx * v[3] + dy * v[4] + dz * v[5]
    reach = a.half_extents[0] + b.half_extents[0] + margin
    far = half_a + half_b + reach
    if dx * dx + dy * dy + dz * dz > far * far:
        return 0
    squared_sine = 1.0 - cosine * cosine
    if squared_sine < PARALLEL:
        count = side_by_side(a, b, cosine, along, across, margin, found)
        if count > 0:
            return count
    s = 0.0
    if squared_sine > 1e-12:
        s = min(max((along - cosine * across) / squared_sine, -half_a), half_a)
    t = min(max(cosine * s - across, -half_b), half_b)
    s = min(max(along + cosine * t, -half_a), half_a)
    nx, ny, nz = u[4] * v[5] - u[5] * v[4], u[5] * v[3] - u[3] * v[5], u[3] * v[4] - u[4] * v[3]
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length > 1e-6:
        nx, ny, nz = nx / length, ny / length, nz / length
    else:
        nx, ny, nz = u[0], u[1], u[2]
    px, py, pz = p[0] + s * u[3], p[1] + s * u[4], p[2] + s * u[5]
    qx, qy, qz = q[0] + t * v[3], q[1] + t * v[4], q[2] + t * v[5]
    return ball_ball(px, py, pz, a.half_extents[0], qx, qy, qz, b.half_extents[0], nx, ny, nz, margin, found)

"""Support mapping: the point of a convex shape that lies farthest in a direction, for every kind of core.

The general algorithms (distance, depth, casts) know shapes by this alone. Balls and capsules are points and segments here;
their radius is added by who asks.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.tables import BOX, CAPSULE, CYLINDER, HULL, ROUNDED, TRIANGLE


@inner
def farthest_corner(shape, points, dx, dy, dz):
    """Support of a hull: a scan over its vertices, which beats climbing along edges up to a hundred of them."""
    axes = shape.axes
    lx = dx * axes[0] + dy * axes[1] + dz * axes[2]
    ly = dx * axes[3] + dy * axes[4] + dz * axes[5]
    lz = dx * axes[6] + dy * axes[7] + dz * axes[8]
    best = -math.inf
    at = shape.first_point
    for i in range(shape.first_point, shape.first_point + shape.point_count):
        along = points[i, 0] * lx + points[i, 1] * ly + points[i, 2] * lz
        if along > best:
            best, at = along, i
    x, y, z = points[at, 0], points[at, 1], points[at, 2]
    return (
        x * axes[0] + y * axes[3] + z * axes[6],
        x * axes[1] + y * axes[4] + z * axes[7],
        x * axes[2] + y * axes[5] + z * axes[8],
    )


@inner
def farthest_on_cylinder(shape, dx, dy, dz):
    """Support of a cylinder: on the rim of a cap, or the middle of the cap where its whole face is as far."""
    axes = shape.axes
    ax, ay, az = axes[3], axes[4], axes[5]
    along = dx * ax + dy * ay + dz * az
    half = math.copysign(shape.half_extents[1], along)
    rx, ry, rz = dx - along * ax, dy - along * ay, dz - along * az
    squared = rx * rx + ry * ry + rz * rz
    out = 0.0
    if squared > 1e-24 * along * along:
        out = shape.half_extents[0] / math.sqrt(squared)
    return half * ax + out * rx, half * ay + out * ry, half * az + out * rz


@inner
def support(shape, points, dx, dy, dz):
    """The point of a shape's core that lies farthest in a direction of any length."""
    x = y = z = 0.0
    kind = shape.kind
    axes = shape.axes
    half = shape.half_extents
    if kind == BOX:
        for k in range(3):
            ax, ay, az = axes[3 * k], axes[3 * k + 1], axes[3 * k + 2]
            reach = math.copysign(half[k], dx * ax + dy * ay + dz * az)
            x += reach * ax
            y += reach * ay
            z += reach * az
    elif kind == HULL:
        x, y, z = farthest_corner(shape, points, dx, dy, dz)
    elif kind == CAPSULE:
        reach = math.copysign(half[1], dx * axes[3] + dy * axes[4] + dz * axes[5])
        x, y, z = reach * axes[3], reach * axes[4], reach * axes[5]
    elif kind == CYLINDER:
        x, y, z = farthest_on_cylinder(shape, dx, dy, dz)
    elif kind == TRIANGLE:
        corners = shape.corners
        best = -math.inf
        for k in range(3):
            along = corners[3 * k] * dx + corners[3 * k + 1] * dy + corners[3 * k + 2] * dz
            if along > best:
                best = along
                x, y, z = corners[3 * k], corners[3 * k + 1], corners[3 * k + 2]
    center = shape.center
    scale = shape.scale
    return center[0] + scale * x, center[1] + scale * y, center[2] + scale * z


@inner
def gap_along(a, b, points, nx, ny, nz):
    """Gap between two cores as seen along a unit vector from a to b: negative for overlap."""
    px, py, pz = support(a, points, nx, ny, nz)
    qx, qy, qz = support(b, points, -nx, -ny, -nz)
    return (qx - px) * nx + (qy - py) * ny + (qz - pz) * nz


@inner
def face_count(shape):
    """How many flat faces a core has."""
    kind = shape.kind
    if kind == BOX:
        return 6
    if kind == HULL:
        return shape.face_count
    if kind == CYLINDER:
        return 2
    return 1 if kind == TRIANGLE else 0


@inner
def face_normal(shape, faces, k):
    """Outward unit normal of face k of a core."""
    axes = shape.axes
    kind = shape.kind
    if kind == HULL:
        n = faces[shape.first_face + k].normal
        return (
            n[0] * axes[0] + n[1] * axes[3] + n[2] * axes[6],
            n[0] * axes[1] + n[1] * axes[4] + n[2] * axes[7],
            n[0] * axes[2] + n[1] * axes[5] + n[2] * axes[8],
        )
    sign = 1.0 - 2.0 * (k & 1)
    at = 3 * (k >> 1) if kind == BOX else 3
    return sign * axes[at], sign * axes[at + 1], sign * axes[at + 2]


@inner
def load_convex(shape, collider, headers, ox, oy, oz):
    """Writes a box, ball, capsule, cylinder or hull as the general algorithms see it, its place relative to (ox, oy, oz)."""
    center = shape.center
    place = collider.center
    center[0], center[1], center[2] = place[0] - ox, place[1] - oy, place[2] - oz
    for k in range(9):
        shape.axes[k] = collider.axes[k]
    for k in range(3):
        shape.half_extents[k] = collider.half_extents[k]
    kind = collider.kind
    shape.kind = kind
    shape.scale = 1.0
    shape.radius = 0.0
    if kind in ROUNDED:
        shape.radius = collider.half_extents[0]
    if kind == HULL:
        header = headers[collider.geometry]
        shape.first_point = header.first_point
        shape.point_count = header.point_count
        shape.first_face = header.first_face
        shape.face_count = header.face_count


@inner
def load_triangle(shape, collider, header, faces, points, part, ox, oy, oz):
    """Writes one triangle of a mesh as a convex shape, its place relative to (ox, oy, oz)."""
    u = collider.axes
    face = faces[header.first_face + part]
    first = face.first_corner
    corners = shape.corners
    cx = cy = cz = 0.0
    for k in range(3):
        x, y, z = points[first + k, 0], points[first + k, 1], points[first + k, 2]
        corners[3 * k] = x * u[0] + y * u[3] + z * u[6]
        corners[3 * k + 1] = x * u[1] + y * u[4] + z * u[7]
        corners[3 * k + 2] = x * u[2] + y * u[5] + z * u[8]
        cx += corners[3 * k] / 3.0
        cy += corners[3 * k + 1] / 3.0
        cz += corners[3 * k + 2] / 3.0
    for k in range(3):
        corners[3 * k] -= cx
        corners[3 * k + 1] -= cy
        corners[3 * k + 2] -= cz
    place = collider.center
    center = shape.center
    center[0], center[1], center[2] = place[0] - ox + cx, place[1] - oy + cy, place[2] - oz + cz
    n = face.normal
    axes = shape.axes
    axes[3] = n[0] * u[0] + n[1] * u[3] + n[2] * u[6]
    axes[4] = n[0] * u[1] + n[1] * u[4] + n[2] * u[7]
    axes[5] = n[0] * u[2] + n[1] * u[5] + n[2] * u[8]
    shape.kind = TRIANGLE
    shape.scale = 1.0
    shape.radius = 0.0
    shape.active = face.active

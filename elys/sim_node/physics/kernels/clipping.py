"""Contact points of two shapes once the normal is known: the face of one, cut to the sides of the face of the other.

Faces here are faces, segments or points: a capsule or a lying cylinder meets others with a segment, a standing cylinder
with an octagon in its cap, turned so that the lowest point of the rim is a corner. The method is that of `box_box`, for any
number of corners.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.box_box import chosen_corners
from elys.sim_node.physics.kernels.rotation import cross
from elys.sim_node.physics.kernels.support import face_count, face_normal
from elys.sim_node.physics.kernels.tables import BOX, CAPSULE, CORNERS, CYLINDER, HULL, TRIANGLE

DIAGONAL = math.sqrt(0.5)
LEVEL = 0.02  # a cap that leans less shows a fixed octagon, so that its corners keep their names
PARALLEL = 0.01  # squared sine of the angle between segments that touch along their length


@inner
def put(corners, k, x, y, z):
    corners[3 * k], corners[3 * k + 1], corners[3 * k + 2] = x, y, z


@inner
def facing(shape, faces, nx, ny, nz):
    """Which flat face of a core looks most in a direction, and the cosine; (-1, -1) for a core without faces."""
    best = -1.0
    at = -1
    for k in range(face_count(shape)):
        mx, my, mz = face_normal(shape, faces, k)
        cosine = mx * nx + my * ny + mz * nz
        if cosine > best:
            best, at = cosine, k
    return at, best


@inner
def box_face(shape, k, corners):
    """The four corners of face k, counter-clockwise as seen from outside."""
    axes = shape.axes
    half = shape.half_extents
    e = k >> 1
    f = e + 1 if e < 2 else 0
    g = 3 - e - f
    out = half[e]
    across = half[g]
    if k & 1:
        out, across = -out, -across
    center = shape.center
    for corner in range(4):
        u = half[f] if corner == 0 or corner == 3 else -half[f]
        v = across if corner < 2 else -across
        put(
            corners,
            corner,
            center[0] + out * axes[3 * e] + u * axes[3 * f] + v * axes[3 * g],
            center[1] + out * axes[3 * e + 1] + u * axes[3 * f + 1] + v * axes[3 * g + 1],
            center[2] + out * axes[3 * e + 2] + u * axes[3 * f + 2] + v * axes[3 * g + 2],
        )


@inner
def hull_face(shape, faces, points, k, corners):
    axes = shape.axes
    center = shape.center
    face = faces[shape.first_face + k]
    count = min(face.corner_count, CORNERS)
    for corner in range(count):
        at = face.first_corner + corner * face.corner_count // count
        x, y, z = points[at, 0], points[at, 1], points[at, 2]
        put(
            corners,
            corner,
            center[0] + x * axes[0] + y * axes[3] + z * axes[6],
            center[1] + x * axes[1] + y * axes[4] + z * axes[7],
            center[2] + x * axes[2] + y * axes[5] + z * axes[8],
        )
    return count


@inner
def cylinder_face(shape, nx, ny, nz, corners):
    """Eight corners in the cap that looks in a direction, or the two ends of the side's line that does."""
    axes = shape.axes
    center = shape.center
    ax, ay, az = axes[3], axes[4], axes[5]
    radius, half = shape.half_extents[0], shape.half_extents[1]
    along = nx * ax + ny * ay + nz * az
    rx, ry, rz = nx - along * ax, ny - along * ay, nz - along * az
    lean = math.sqrt(rx * rx + ry * ry + rz * rz)
    if lean > DIAGONAL:
        out = radius / lean
        x, y, z = center[0] + out * rx, center[1] + out * ry, center[2] + out * rz
        put(corners, 0, x + half * ax, y + half * ay, z + half * az)
        put(corners, 1, x - half * ax, y - half * ay, z - half * az)
        return 2
    if lean > LEVEL:
        rx, ry, rz = rx / lean, ry / lean, rz / lean
    else:
        rx, ry, rz = axes[0], axes[1], axes[2]
    half = math.copysign(half, along)
    x, y, z = center[0] + half * ax, center[1] + half * ay, center[2] + half * az
    sx, sy, sz = cross(ax, ay, az, rx, ry, rz)
    radius_s = math.copysign(radius, along)
    for corner in range(8):
        c = (1.0, DIAGONAL, 0.0, -DIAGONAL, -1.0, -DIAGONAL, 0.0, DIAGONAL)[corner] * radius
        s = (0.0, DIAGONAL, 1.0, DIAGONAL, 0.0, -DIAGONAL, -1.0, -DIAGONAL)[corner] * radius_s
        put(corners, corner, x + c * rx + s * sx, y + c * ry + s * sy, z + c * rz + s * sz)
    return 8


@inner
def load_face(shape, faces, points, nx, ny, nz, corners):
    """The face, segment or point of a core that looks in a direction; returns how many corners, and which face it is."""
    kind = shape.kind
    center = shape.center
    if kind == BOX:
        k, _ = facing(shape, faces, nx, ny, nz)
        box_face(shape, k, corners)
        return 4, k
    if kind == HULL:
        k, _ = facing(shape, faces, nx, ny, nz)
        return hull_face(shape, faces, points, k, corners), k
    if kind == CYLINDER:
        count = cylinder_face(shape, nx, ny, nz, corners)
        return count, count
    if kind == TRIANGLE:
        for k in range(9):
            corners[k] = center[k % 3] + shape.corners[k]
        return 3, 0
    if kind == CAPSULE:
        half = shape.half_extents[1]
        axes = shape.axes
        x, y, z = half * axes[3], half * axes[4], half * axes[5]
        put(corners, 0, center[0] + x, center[1] + y, center[2] + z)
        put(corners, 1, center[0] - x, center[1] - y, center[2] - z)
        return 2, 0
    put(corners, 0, center[0], center[1], center[2])
    return 1, 0


@inner
def copy_corner(found, source, target):
    outline = found.outline
    sides = found.sides
    for k in range(3):
        outline[3 * target + k] = outline[3 * source + k]
    for k in range(2):
        sides[2 * target + k] = sides[2 * source + k]


@inner
def clip_line(found, source, target, count, nu, nv, limit, side):
    """Cuts an outline at the line nu u + nv v = limit; the two halves of `found.outline` take turns.

    A corner is known by the side that leads to it and the one that leaves it: below CORNERS those of the incident face,
    from there on the cutting ones. Two corners are a segment, which is not closed.
    """
    outline = found.outline
    sides = found.sides
    first = 2 * CORNERS * source
    to = 2 * CORNERS * target
    end = to + 2 * CORNERS - 1
    a = first + count - 1
    begin = 0
    da = nu * outline[3 * a] + nv * outline[3 * a + 1] - limit
    if count <= 2:
        a = first
        begin = 1
        da = nu * outline[3 * a] + nv * outline[3 * a + 1] - limit
        if da <= 0.0:
            copy_corner(found, a, to)
            to += 1
    for k in range(begin, count):
        b = first + k
        db = nu * outline[3 * b] + nv * outline[3 * b + 1] - limit
        if (da > 0.0) != (db > 0.0) and to < end:
            t = da / (da - db)
            for d in range(3):
                outline[3 * to + d] = outline[3 * a + d] + t * (outline[3 * b + d] - outline[3 * a + d])
            if da <= 0.0:
                sides[2 * to], sides[2 * to + 1] = sides[2 * a + 1], side
            else:
                sides[2 * to], sides[2 * to + 1] = side, sides[2 * b]
            to += 1
        if db <= 0.0 and to < end:
            copy_corner(found, b, to)
            to += 1
        a = b
        da = db
    return to - 2 * CORNERS * target


@inner
def clip_to_sides(found, count, sides_count, ux, uy, uz, vx, vy, vz):
    """Cuts the outline to the reference face, or to the two ends of a reference segment; returns count and which half."""
    corners = found.reference
    at = 0
    for side in range(sides_count):
        p = 3 * side
        q = 3 * (side + 1 if side + 1 < sides_count else 0)
        x, y, z = corners[p] - corners[0], corners[p + 1] - corners[1], corners[p + 2] - corners[2]
        pu, pv = x * ux + y * uy + z * uz, x * vx + y * vy + z * vz
        x, y, z = corners[q] - corners[p], corners[q + 1] - corners[p + 1], corners[q + 2] - corners[p + 2]
        eu, ev = x * ux + y * uy + z * uz, x * vx + y * vy + z * vz
        nu, nv = (-eu, -ev) if sides_count == 2 else (ev, -eu)
        limit = nu * pu + nv * pv
        outside = False
        first = 2 * CORNERS * at
        for k in range(first, first + count):
            outside = outside or nu * found.outline[3 * k] + nv * found.outline[3 * k + 1] > limit
        if outside:
            count = clip_line(found, at, 1 - at, count, nu, nv, limit, CORNERS + side)
            at = 1 - at
    return count, at


@inner
def tangents(nx, ny, nz):
    """Two unit vectors with which a unit normal makes a right-handed frame (Duff et al. 2017)."""
    sign = math.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return 1.0 + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny


@inner
def outline_of(found, count, nx, ny, nz, ux, uy, uz, vx, vy, vz):
    """Writes the incident corners as u, v and height over the reference's first corner."""
    corners = found.incident
    base = found.reference
    outline = found.outline
    for k in range(count):
        x, y, z = corners[3 * k] - base[0], corners[3 * k + 1] - base[1], corners[3 * k + 2] - base[2]
        outline[3 * k] = x * ux + y * uy + z * uz
        outline[3 * k + 1] = x * vx + y * vy + z * vz
        outline[3 * k + 2] = x * nx + y * ny + z * nz
        found.sides[2 * k] = k - 1 if k > 0 else count - 1
        found.sides[2 * k + 1] = k


@inner
def write_corners(found, first, count, code, radius_r, radius_i, margin, sign, nx, ny, nz, ux, uy, uz, vx, vy, vz):
    """Keeps the corners near the reference, at most four, and writes them as contact points; returns how many.

    (nx, ny, nz) looks out of the reference; `sign` is -1 where that is from b to a.
    """
    outline = found.outline
    base = found.reference
    near = first
    for k in range(first, first + count):
        if outline[3 * k + 2] - radius_r - radius_i <= margin:
            copy_corner(found, k, near)
            near += 1
    count, c0, c1, c2, c3 = chosen_corners(outline, 3 * first, near - first)
    for e in range(count):
        k = first + (c0 if e == 0 else (c1 if e == 1 else (c2 if e == 2 else c3)))
        u, v, height = outline[3 * k], outline[3 * k + 1], outline[3 * k + 2]
        gap = height - radius_r - radius_i
        middle = radius_r + 0.5 * gap
        put(
            found.point,
            e,
            base[0] + u * ux + v * vx + middle * nx,
            base[1] + u * uy + v * vy + middle * ny,
            base[2] + u * uz + v * vz + middle * nz,
        )
        found.separation[e] = gap
        found.feature[e] = code | found.sides[2 * k] | (found.sides[2 * k + 1] << 6)
    normal = found.normal
    normal[0], normal[1], normal[2] = sign * nx, sign * ny, sign * nz
    return count


@inner
def meet_flat(reference, other, faces, points, nx, ny, nz, sign, margin, found):
    """Contact points of a core and the flat face of a reference whose unit normal is given; returns how many."""
    sides, face = load_face(reference, faces, points, nx, ny, nz, found.reference)
    count, incident = load_face(other, faces, points, -nx, -ny, -nz, found.incident)
    ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
    outline_of(found, count, nx, ny, nz, ux, uy, uz, vx, vy, vz)
    at = 0
    if sides > 2:
        count, at = clip_to_sides(found, count, sides, ux, uy, uz, vx, vy, vz)
    code = ((face & 0xFF) << 12) | ((incident & 0xFF) << 20) | (0x10000000 if sign < 0.0 else 0)
    first = 2 * CORNERS * at
    radius_r, radius_i = reference.radius, other.radius
    frame = (nx, ny, nz, ux, uy, uz, vx, vy, vz)
    return write_corners(found, first, count, code, radius_r, radius_i, margin, sign, *frame)


@inner
def meet_segments(a, b, faces, points, nx, ny, nz, margin, found):
    """Contact points of two cores that touch with nearly parallel segments; -1 when they do not."""
    first, _ = load_face(a, faces, points, nx, ny, nz, found.reference)
    if first != 2:
        return -1
    second, _ = load_face(b, faces, points, -nx, -ny, -nz, found.incident)
    if second != 2:
        return -1
    p = found.reference
    q = found.incident
    px, py, pz = p[3] - p[0], p[4] - p[1], p[5] - p[2]
    qx, qy, qz = q[3] - q[0], q[4] - q[1], q[5] - q[2]
    cx, cy, cz = cross(px, py, pz, qx, qy, qz)
    lengths = (px * px + py * py + pz * pz) * (qx * qx + qy * qy + qz * qz)
    if cx * cx + cy * cy + cz * cz > PARALLEL * lengths or lengths == 0.0:
        return -1
    ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
    outline_of(found, 2, nx, ny, nz, ux, uy, uz, vx, vy, vz)
    count, at = clip_to_sides(found, 2, 2, ux, uy, uz, vx, vy, vz)
    # Heights over the reference segment, which may lean a little.
    pu, pv = px * ux + py * uy + pz * uz, px * vx + py * vy + pz * vz
    slope = (px * nx + py * ny + pz * nz) / (pu * pu + pv * pv)
    outline = found.outline
    first = 2 * CORNERS * at
    for k in range(first, first + count):
        outline[3 * k + 2] -= slope * (outline[3 * k] * pu + outline[3 * k + 1] * pv)
    frame = (nx, ny, nz, ux, uy, uz, vx, vy, vz)
    return write_corners(found, first, count, 0x20000000, a.radius, b.radius, margin, 1.0, *frame)

"""Boxes against boxes: the axis of least overlap, then the points where the two faces or edges meet.

Separating axes after Gottschalk, Lin and Manocha (1996); clipping of the incident face against the sides of the reference
face after Sutherland and Hodgman; the choice of axis and of points after Gregorius, "Robust Contact Creation" (GDC 2015).
Scalars throughout: small arrays inside would make it ten times slower.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.rotation import cross

APART = -1
EDGES = 6  # axes 0 to 2 are faces of a, 3 to 5 of b, 6 + 3 i + j the product of edge i of a and edge j of b
FAR = 1e300
ROUNDING = 1e-12  # keeps nearly parallel edges from passing for a separating axis
CORNER = 7  # a mask that changes no corner's number: what cannot be negative needs no test for an index from the end
PARALLEL = 1e-4  # squared sine of the angle below which two edges are parallel


@inner
def dot(ax, ay, az, bx, by, bz):
    return ax * bx + ay * by + az * bz


@inner
def edge_gap(distance, radius, cosine):
    """Gap along the product of two edges whose axes enclose an angle of that cosine."""
    squared_sine = 1.0 - cosine * cosine
    if squared_sine < PARALLEL:
        return -FAR
    return (abs(distance) - radius) / math.sqrt(squared_sine)


@inner
def least_overlap(a, b, margin):
    """The axis along which two boxes overlap least (or are farthest apart), and the gap along it.

    Returns (APART, 0) as soon as an axis shows a gap above the margin. A face of a is preferred to one of b and a face to
    an edge unless the other is clearly better: otherwise a resting box would change its mind from step to step.

    Long, because a loop over the fifteen axes would need the numbers in memory instead of in registers.
    """
    p = a.center
    q = b.center
    u = a.axes
    v = b.axes
    tx, ty, tz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    half = a.half_extents
    a0, a1, a2 = half[0], half[1], half[2]
    half = b.half_extents
    b0, b1, b2 = half[0], half[1], half[2]
    slack = 0.01 * min(a0, a1, a2, b0, b1, b2)

    c00 = dot(u[0], u[1], u[2], v[0], v[1], v[2])
    c01 = dot(u[0], u[1], u[2], v[3], v[4], v[5])
    c02 = dot(u[0], u[1], u[2], v[6], v[7], v[8])
    q00, q01, q02 = abs(c00) + ROUNDING, abs(c01) + ROUNDING, abs(c02) + ROUNDING
    t0 = dot(tx, ty, tz, u[0], u[1], u[2])
    best = abs(t0) - (a0 + b0 * q00 + b1 * q01 + b2 * q02)
    axis = 0
    if best > margin:
        return APART, 0.0
    c10 = dot(u[3], u[4], u[5], v[0], v[1], v[2])
    c11 = dot(u[3], u[4], u[5], v[3], v[4], v[5])
    c12 = dot(u[3], u[4], u[5], v[6], v[7], v[8])
    q10, q11, q12 = abs(c10) + ROUNDING, abs(c11) + ROUNDING, abs(c12) + ROUNDING
    t1 = dot(tx, ty, tz, u[3], u[4], u[5])
    gap = abs(t1) - (a1 + b0 * q10 + b1 * q11 + b2 * q12)
    if gap > best:
        best, axis = gap, 1
    c20 = dot(u[6], u[7], u[8], v[0], v[1], v[2])
    c21 = dot(u[6], u[7], u[8], v[3], v[4], v[5])
    c22 = dot(u[6], u[7], u[8], v[6], v[7], v[8])
    q20, q21, q22 = abs(c20) + ROUNDING, abs(c21) + ROUNDING, abs(c22) + ROUNDING
    t2 = dot(tx, ty, tz, u[6], u[7], u[8])
    gap = abs(t2) - (a2 + b0 * q20 + b1 * q21 + b2 * q22)
    if gap > best:
        best, axis = gap, 2
    if best > margin:
        return APART, 0.0

    best_b = abs(dot(tx, ty, tz, v[0], v[1], v[2])) - (b0 + a0 * q00 + a1 * q10 + a2 * q20)
    axis_b = 3
    gap = abs(dot(tx, ty, tz, v[3], v[4], v[5])) - (b1 + a0 * q01 + a1 * q11 + a2 * q21)
    if gap > best_b:
        best_b, axis_b = gap, 4
    gap = abs(dot(tx, ty, tz, v[6], v[7], v[8])) - (b2 + a0 * q02 + a1 * q12 + a2 * q22)
    if gap > best_b:
        best_b, axis_b = gap, 5
    if best_b > margin:
        return APART, 0.0
    if best_b > best + 0.1 * slack:
        best, axis = best_b, axis_b

    best_edge = edge_gap(t2 * c10 - t1 * c20, a1 * q20 + a2 * q10 + b1 * q02 + b2 * q01, c00)
    edge = EDGES
    gap = edge_gap(t2 * c11 - t1 * c21, a1 * q21 + a2 * q11 + b0 * q02 + b2 * q00, c01)
    if gap > best_edge:
        best_edge, edge = gap, EDGES + 1
    gap = edge_gap(t2 * c12 - t1 * c22, a1 * q22 + a2 * q12 + b0 * q01 + b1 * q00, c02)
    if gap > best_edge:
        best_edge, edge = gap, EDGES + 2
    gap = edge_gap(t0 * c20 - t2 * c00, a0 * q20 + a2 * q00 + b1 * q12 + b2 * q11, c10)
    if gap > best_edge:
        best_edge, edge = gap, EDGES + 3
    gap = edge_gap(t0 * c21 - t2 * c01, a0 * q21 + a2 * q01 + b0 * q12 + b2 * q10, c11)
    if gap > best_edge:
        best_edge, edge = gap, EDGES + 4
    gap = edge_gap(t0 * c22 - t2 * c02, a0 * q22 + a2 * q02 + b0 * q11 + b1 * q10, c12)
    if gap > best_edge:
        best_edge, edge = gap, EDGES + 5
    gap = edge_gap(t1 * c00 - t0 * c10, a0 * q10 + a1 * q00 + b1 * q22 + b2 * q21, c20)
    if gap > best_edge:
        best_edge, edge = gap, EDGES + 6
    gap = edge_gap(t1 * c01 - t0 * c11, a0 * q11 + a1 * q01 + b0 * q22 + b2 * q20, c21)
    if gap > best_edge:
        best_edge, edge = gap, EDGES + 7
    gap = edge_gap(t1 * c02 - t0 * c12, a0 * q12 + a1 * q02 + b0 * q21 + b1 * q20, c22)
    if gap > best_edge:
        best_edge, edge = gap, EDGES + 8
    if best_edge > margin:
        return APART, 0.0
    if best_edge > best + slack:
        return edge, best_edge
    return axis, best


@inner
def support_edge(box, along, nx, ny, nz):
    """Middle of the edge along an axis that lies farthest in a direction, and which of the four it is."""
    center = box.center
    axes = box.axes
    x, y, z = center[0], center[1], center[2]
    which = 0
    for k in range(3):
        if k == along:
            continue
        ax, ay, az = axes[3 * k], axes[3 * k + 1], axes[3 * k + 2]
        half = box.half_extents[k]
        if dot(ax, ay, az, nx, ny, nz) < 0.0:
            half = -half
        else:
            which |= 1 << k
        x += half * ax
        y += half * ay
        z += half * az
    return x, y, z, which


@inner
def meet_edges(a, b, axis, gap, found):
    """The one point where two crossing edges come closest."""
    along_a = (axis - EDGES) // 3
    along_b = axis - EDGES - 3 * along_a
    u = a.axes
    v = b.axes
    ux, uy, uz = u[3 * along_a], u[3 * along_a + 1], u[3 * along_a + 2]
    vx, vy, vz = v[3 * along_b], v[3 * along_b + 1], v[3 * along_b + 2]
    nx, ny, nz = cross(ux, uy, uz, vx, vy, vz)
    p = a.center
    q = b.center
    scale = 1.0 / math.sqrt(dot(nx, ny, nz, nx, ny, nz))
    if dot(nx, ny, nz, q[0] - p[0], q[1] - p[1], q[2] - p[2]) < 0.0:
        scale = -scale
    nx *= scale
    ny *= scale
    nz *= scale
    px, py, pz, which_a = support_edge(a, along_a, nx, ny, nz)
    qx, qy, qz, which_b = support_edge(b, along_b, -nx, -ny, -nz)
    # Closest points of the lines p + s u and q + t v.
    dx = qx - px
    dy = qy - py
    dz = qz - pz
    uv = dot(ux, uy, uz, vx, vy, vz)
    du = dot(dx, dy, dz, ux, uy, uz)
    dv = dot(dx, dy, dz, vx, vy, vz)
    inverse = 1.0 / (1.0 - uv * uv)
    s = (du - uv * dv) * inverse
    t = (uv * du - dv) * inverse
    normal = found.normal
    normal[0], normal[1], normal[2] = nx, ny, nz
    point = found.point
    point[0] = 0.5 * (px + s * ux + qx + t * vx)
    point[1] = 0.5 * (py + s * uy + qy + t * vy)
    point[2] = 0.5 * (pz + s * uz + qz + t * vz)
    found.separation[0] = gap
    found.feature[0] = 0x40000000 | (axis << 6) | (which_a << 3) | which_b
    return 1


@inner
def clip_side(found, source, target, count, component, sign, limit, side):
    """Cuts a polygon at one side of the reference face; the two halves of `found.polygon` take turns.

    A corner is known by the edge that leads to it and the edge that leaves it: 0 to 3 are edges of the incident face, 4 to
    7 the sides that cut.
    """
    polygon = found.polygon
    edges = found.edges
    written = 0
    component &= 1
    source &= 1
    target &= 1
    a = (count - 1) & CORNER
    da = sign * polygon[24 * source + 3 * a + component] - limit
    for corner in range(count):
        b = corner & CORNER
        from_a = 24 * source + 3 * a
        from_b = 24 * source + 3 * b
        db = sign * polygon[from_b + component] - limit
        if (da > 0.0) != (db > 0.0):
            t = da / (da - db)
            to = 24 * target + 3 * (written & CORNER)
            for k in range(3):
                polygon[to + k] = polygon[from_a + k] + t * (polygon[from_b + k] - polygon[from_a + k])
            place = 16 * target + 2 * (written & CORNER)
            if da <= 0.0:
                edges[place] = edges[16 * source + 2 * a + 1]
                edges[place + 1] = side
            else:
                edges[place] = side
                edges[place + 1] = edges[16 * source + 2 * b]
            written += 1
        if db <= 0.0:
            to = 24 * target + 3 * (written & CORNER)
            for k in range(3):
                polygon[to + k] = polygon[from_b + k]
            place = 16 * target + 2 * (written & CORNER)
            edges[place] = edges[16 * source + 2 * b]
            edges[place + 1] = edges[16 * source + 2 * b + 1]
            written += 1
        a = b
        da = db
    return written


@inner
def chosen_corners(polygon, first, count):
    """At most four corners that span the polygon: the deepest, the farthest from it, and the extremes on either side."""
    if count <= 4:
        return count, 0, 1, 2, 3
    c0 = 0
    best = FAR
    for k in range(count):
        if polygon[first + 3 * k + 2] < best:
            best, c0 = polygon[first + 3 * k + 2], k
    x = polygon[first + 3 * c0]
    y = polygon[first + 3 * c0 + 1]
    c1 = c0
    best = -1.0
    for k in range(count):
        dx = polygon[first + 3 * k] - x
        dy = polygon[first + 3 * k + 1] - y
        if dx * dx + dy * dy > best:
            best, c1 = dx * dx + dy * dy, k
    ex = polygon[first + 3 * c1] - x
    ey = polygon[first + 3 * c1 + 1] - y
    c2 = c3 = -1
    most = least = 0.0
    for k in range(count):
        area = ex * (polygon[first + 3 * k + 1] - y) - ey * (polygon[first + 3 * k] - x)
        if area > most:
            most, c2 = area, k
        if area < least:
            least, c3 = area, k
    if c2 < 0 and c3 < 0:
        return 2, c0, c1, 0, 0
    if c2 < 0:
        return 3, c0, c1, c3, 0
    if c3 < 0:
        return 3, c0, c1, c2, 0
    return 4, c0, c1, c2, c3


@inner
def meet_faces(colliders, i, j, axis, margin, found):
    """Clips the face of one box that looks most against the reference face of the other; up to four points.

    Long, because the frame of the reference face is needed from the first line to the last.
    """
    flipped = axis >= 3
    reference, other, k = (colliders[j], colliders[i], axis - 3) if flipped else (colliders[i], colliders[j], axis)
    k &= 3
    u = reference.axes
    w = other.axes
    p = reference.center
    q = other.center
    k1 = k + 1 if k < 2 else 0
    k2 = (3 - k - k1) & 3
    tx, ty, tz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    nx, ny, nz = u[3 * k], u[3 * k + 1], u[3 * k + 2]
    face = 2 * k
    if dot(nx, ny, nz, tx, ty, tz) < 0.0:
        nx, ny, nz = -nx, -ny, -nz
        face += 1
    ux, uy, uz = u[3 * k1], u[3 * k1 + 1], u[3 * k1 + 2]
    vx, vy, vz = u[3 * k2], u[3 * k2 + 1], u[3 * k2 + 2]
    half = reference.half_extents
    hn, hu, hv = half[k], half[k1], half[k2]
    half = other.half_extents

    m = 0
    toward = 0.0
    for e in range(3):
        d = dot(nx, ny, nz, w[3 * e], w[3 * e + 1], w[3 * e + 2])
        if abs(d) > abs(toward):
            toward, m = d, e
    m &= 3
    m1 = m + 1 if m < 2 else 0
    m2 = (3 - m - m1) & 3
    reach = half[m]
    incident = 2 * m
    if toward > 0.0:
        reach = -reach
        incident += 1
    ex, ey, ez = half[m1] * w[3 * m1], half[m1] * w[3 * m1 + 1], half[m1] * w[3 * m1 + 2]
    fx, fy, fz = half[m2] * w[3 * m2], half[m2] * w[3 * m2 + 1], half[m2] * w[3 * m2 + 2]
    tx += reach * w[3 * m]
    ty += reach * w[3 * m + 1]
    tz += reach * w[3 * m + 2]
    cu, cv, cn = dot(tx, ty, tz, ux, uy, uz), dot(tx, ty, tz, vx, vy, vz), dot(tx, ty, tz, nx, ny, nz) - hn
    eu, ev, en = dot(ex, ey, ez, ux, uy, uz), dot(ex, ey, ez, vx, vy, vz), dot(ex, ey, ez, nx, ny, nz)
    fu, fv, fn = dot(fx, fy, fz, ux, uy, uz), dot(fx, fy, fz, vx, vy, vz), dot(fx, fy, fz, nx, ny, nz)
    polygon = found.polygon
    edges = found.edges
    for corner in range(4):
        along_e = 1.0 if corner == 0 or corner == 3 else -1.0
        along_f = 1.0 if corner < 2 else -1.0
        polygon[3 * corner] = cu + along_e * eu + along_f * fu
        polygon[3 * corner + 1] = cv + along_e * ev + along_f * fv
        polygon[3 * corner + 2] = cn + along_e * en + along_f * fn
        edges[2 * corner] = (corner + 3) & 3
        edges[2 * corner + 1] = corner
    count = 4
    at = 0
    for side in range(4):
        component = side >> 1
        sign = 1.0 - 2.0 * (side & 1)
        middle, reach, limit = (cu, abs(eu) + abs(fu), hu) if component == 0 else (cv, abs(ev) + abs(fv), hv)
        if sign * middle + reach > limit:
            count = clip_side(found, at, 1 - at, count, component, sign, limit, 4 + side)
            at = 1 - at

    point = found.point
    normal = found.normal
    first = 24 * (at & 1)
    corner = 16 * (at & 1)
    near = 0
    for each in range(count):
        e = each & CORNER
        if polygon[first + 3 * e + 2] <= margin:
            to = near & CORNER
            for s in range(3):
                polygon[first + 3 * to + s] = polygon[first + 3 * e + s]
            edges[corner + 2 * to] = edges[corner + 2 * e]
            edges[corner + 2 * to + 1] = edges[corner + 2 * e + 1]
            near += 1
    count, c0, c1, c2, c3 = chosen_corners(polygon, first, near)
    code = (face << 6) | (incident << 9) | ((1 << 13) if flipped else 0)
    for each in range(count):
        e = each & 3
        s = (c0 if e == 0 else (c1 if e == 1 else (c2 if e == 2 else c3))) & CORNER
        pu, pv, gap = polygon[first + 3 * s], polygon[first + 3 * s + 1], polygon[first + 3 * s + 2]
        height = hn + 0.5 * gap
        point[3 * e] = p[0] + ux * pu + vx * pv + nx * height
        point[3 * e + 1] = p[1] + uy * pu + vy * pv + ny * height
        point[3 * e + 2] = p[2] + uz * pu + vz * pv + nz * height
        found.separation[e] = gap
        found.feature[e] = code | edges[corner + 2 * s] | (edges[corner + 2 * s + 1] << 3)
    sign = -1.0 if flipped else 1.0
    normal[0], normal[1], normal[2] = sign * nx, sign * ny, sign * nz
    return count


@inner
def box_box(colliders, i, j, margin, found):
    """Contact points of two boxes no farther apart than the margin; returns how many."""
    axis, gap = least_overlap(colliders[i], colliders[j], margin)
    if axis == APART:
        return 0
    if axis >= EDGES:
        return meet_edges(colliders[i], colliders[j], axis, gap, found)
    return meet_faces(colliders, i, j, axis, margin, found)

"""Distance between convex cores (Gilbert, Johnson and Keerthi 1988), and how deep they overlap.

Distance: the point of a minus b that is closest to the origin, approached by simplices of support points; closest points
within a simplex after Ericson, "Real-Time Collision Detection" (2005), 5.1. Exact for round cores as well as for flat ones.

Depth: where cores overlap, b is moved along a direction until a small gap opens, and the distance there gives a better
direction. The overlap as seen along it is never larger than before: with n the old direction, s the way moved, d the gap
opened, and n', d' what the distance finds, d' >= d, so that s (n . n') - d' <= s - d. For an overlap much smaller than the
shapes one or two rounds reach the minimum, and no polytope needs to be grown.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.rotation import cross
from elys.sim_node.physics.kernels.support import face_count, face_normal, gap_along, support

FAR = 1e300
ROUNDS = 20  # support points tried at most; flat cores need less than ten, rims against rims would go on for long
TOUCHING = 1e-8  # cores closer than this, measured by their extent, count as overlapping
CONVERGED = 1e-10  # how much closer the next support point could bring us, as a share of the squared distance
ROUNDING = 1e-14  # the same as a share of the extent: no support point is known better
SHRUNK = 0.8  # cores that still overlap when they are so much smaller overlap deeply


@inner
def weights_on_segment(w, i, j):
    """Weight of vertex j at the point of the segment closest to the origin."""
    dx, dy, dz = w[j] - w[i], w[j + 1] - w[i + 1], w[j + 2] - w[i + 2]
    squared = dx * dx + dy * dy + dz * dz
    if squared <= 0.0:
        return 0.0
    t = -(w[i] * dx + w[i + 1] * dy + w[i + 2] * dz) / squared
    return min(max(t, 0.0), 1.0)


@inner
def weights_on_triangle(w, i, j, k):
    """Weights of three vertices at the point of the triangle closest to the origin."""
    bx, by, bz = w[j] - w[i], w[j + 1] - w[i + 1], w[j + 2] - w[i + 2]
    cx, cy, cz = w[k] - w[i], w[k + 1] - w[i + 1], w[k + 2] - w[i + 2]
    d1 = -(bx * w[i] + by * w[i + 1] + bz * w[i + 2])
    d2 = -(cx * w[i] + cy * w[i + 1] + cz * w[i + 2])
    if d1 <= 0.0 and d2 <= 0.0:
        return 1.0, 0.0, 0.0
    d3 = -(bx * w[j] + by * w[j + 1] + bz * w[j + 2])
    d4 = -(cx * w[j] + cy * w[j + 1] + cz * w[j + 2])
    if d3 >= 0.0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    d5 = -(bx * w[k] + by * w[k + 1] + bz * w[k + 2])
    d6 = -(cx * w[k] + cy * w[k + 1] + cz * w[k + 2])
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    # Areas from cross products: differences of products of dots would lose half the digits in slivers.
    nx, ny, nz = cross(bx, by, bz, cx, cy, cz)
    px, py, pz = cross(w[i], w[i + 1], w[i + 2], w[j], w[j + 1], w[j + 2])
    c = nx * px + ny * py + nz * pz
    if c <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        t = d1 / (d1 - d3) if d1 > d3 else 0.0
        return 1.0 - t, t, 0.0
    px, py, pz = cross(w[k], w[k + 1], w[k + 2], w[i], w[i + 1], w[i + 2])
    b = nx * px + ny * py + nz * pz
    if b <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6) if d2 > d6 else 0.0
        return 1.0 - t, 0.0, t
    px, py, pz = cross(w[j], w[j + 1], w[j + 2], w[k], w[k + 1], w[k + 2])
    a = nx * px + ny * py + nz * pz
    if a <= 0.0 and d4 >= d3 and d5 >= d6:
        t = (d4 - d3) / (d4 - d3 + d5 - d6) if d4 - d3 + d5 - d6 > 0.0 else 0.0
        return 0.0, 1.0 - t, t
    total = a + b + c
    if total <= 0.0:
        return 1.0, 0.0, 0.0
    return a / total, b / total, c / total


@inner
def squared_norm_at(w, i, j, k, s, t, u):
    x = s * w[i] + t * w[j] + u * w[k]
    y = s * w[i + 1] + t * w[j + 1] + u * w[k + 1]
    z = s * w[i + 2] + t * w[j + 2] + u * w[k + 2]
    return x * x + y * y + z * z


@inner
def hides_origin(w, i, j, k, opposite):
    """Whether a face of a tetrahedron has the origin on its outer side, or the tetrahedron is flat."""
    bx, by, bz = w[j] - w[i], w[j + 1] - w[i + 1], w[j + 2] - w[i + 2]
    cx, cy, cz = w[k] - w[i], w[k + 1] - w[i + 1], w[k + 2] - w[i + 2]
    nx, ny, nz = cross(bx, by, bz, cx, cy, cz)
    origin = -(nx * w[i] + ny * w[i + 1] + nz * w[i + 2])
    inside = nx * (w[opposite] - w[i]) + ny * (w[opposite + 1] - w[i + 1]) + nz * (w[opposite + 2] - w[i + 2])
    return origin * inside <= 0.0


@inner
def closest_face(simplex, only_hiding):
    """Weights at the point closest to the origin on those faces of a tetrahedron that hide it, or on all; its squared norm.

    FAR when no face hides the origin. The fourth face is the simplex of before, and the last vertex lies beyond it.
    """
    w = simplex.vertex
    weight = simplex.weight
    best = FAR
    for side in range(3):
        i, j, opposite = side, (side + 1) % 3, (side + 2) % 3
        if only_hiding and not hides_origin(w, 3 * i, 3 * j, 9, 3 * opposite):
            continue
        s, t, u = weights_on_triangle(w, 3 * i, 3 * j, 9)
        squared = squared_norm_at(w, 3 * i, 3 * j, 9, s, t, u)
        if squared < best:
            best = squared
            weight[i], weight[j], weight[opposite], weight[3] = s, t, 0.0, u
    return best


@inner
def reduce_simplex(simplex, apart):
    """Keeps the vertices that hold the point closest to the origin, with their weights; False when it holds the origin.

    `apart` says that this is known to be impossible.
    """
    w = simplex.vertex
    weight = simplex.weight
    count = simplex.count
    for k in range(4):
        weight[k] = 0.0
    if count == 1:
        weight[0] = 1.0
    elif count == 2:
        weight[1] = weights_on_segment(w, 0, 3)
        weight[0] = 1.0 - weight[1]
    elif count == 3:
        weight[0], weight[1], weight[2] = weights_on_triangle(w, 0, 3, 6)
    else:
        best = closest_face(simplex, True)
        if best == FAR and apart:
            # Rounding makes a flat tetrahedron seem to hold what is known to be outside.
            best = closest_face(simplex, False)
        if best == FAR:
            return False
    from_a = simplex.from_a
    kept = 0
    for k in range(count):
        if weight[k] > 0.0:
            weight[kept] = weight[k]
            for d in range(3):
                w[3 * kept + d] = w[3 * k + d]
                from_a[3 * kept + d] = from_a[3 * k + d]
            kept += 1
    simplex.count = kept
    return True


@inner
def holds_vertex(simplex, x, y, z):
    w = simplex.vertex
    held = False
    for k in range(simplex.count):
        held = held or (w[3 * k] == x and w[3 * k + 1] == y and w[3 * k + 2] == z)
    return held


@inner
def closest_now(simplex):
    """The point of a minus b that the weights give, and the point of a that it comes from."""
    w = simplex.vertex
    p = simplex.from_a
    vx = vy = vz = px = py = pz = 0.0
    for k in range(simplex.count):
        weight = simplex.weight[k]
        vx += weight * w[3 * k]
        vy += weight * w[3 * k + 1]
        vz += weight * w[3 * k + 2]
        px += weight * p[3 * k]
        py += weight * p[3 * k + 1]
        pz += weight * p[3 * k + 2]
    return vx, vy, vz, px, py, pz


@inner
def core_distance(a, b, points, limit, simplex):
    """Distance between two cores [m], 0 where they overlap, FAR as soon as it is known to be above the limit.

    With a distance between, `simplex` gets the unit vector from a to b and the closest points of both.
    """
    p = a.center
    q = b.center
    return distance_from(a, b, points, q[0] - p[0], q[1] - p[1], q[2] - p[2], limit, simplex)


@inner
def distance_from(a, b, points, dx, dy, dz, limit, simplex):
    """The same, looking first along a direction from a to b that is thought to be near."""
    vx, vy, vz = -dx, -dy, -dz
    if vx == 0.0 and vy == 0.0 and vz == 0.0:
        vx = 1.0
    squared = FAR
    extent = 0.0
    simplex.count = 0
    for _ in range(ROUNDS):
        px, py, pz = support(a, points, -vx, -vy, -vz)
        qx, qy, qz = support(b, points, vx, vy, vz)
        wx, wy, wz = px - qx, py - qy, pz - qz
        along = vx * wx + vy * wy + vz * wz
        length = vx * vx + vy * vy + vz * vz
        if along > 0.0 and along * along > limit * limit * length:
            return FAR
        if squared < FAR and squared - along <= CONVERGED * squared + ROUNDING * math.sqrt(squared * extent):
            break
        if holds_vertex(simplex, wx, wy, wz):
            break
        extent = max(extent, wx * wx + wy * wy + wz * wz)
        n = simplex.count
        w = simplex.vertex
        w[3 * n], w[3 * n + 1], w[3 * n + 2] = wx, wy, wz
        p = simplex.from_a
        p[3 * n], p[3 * n + 1], p[3 * n + 2] = px, py, pz
        simplex.count = n + 1
        # The plane through the new vertex, at right angles to the direction, has both cores on its sides.
        apart = along > 0.0 and along * along > TOUCHING * TOUCHING * extent * length
        if not reduce_simplex(simplex, apart):
            return 0.0
        nx, ny, nz, px, py, pz = closest_now(simplex)
        shorter = nx * nx + ny * ny + nz * nz
        if shorter <= TOUCHING * TOUCHING * extent:
            return 0.0
        if shorter >= squared:
            break
        vx, vy, vz, squared = nx, ny, nz, shorter
        on_a = simplex.on_a
        on_a[0], on_a[1], on_a[2] = px, py, pz
    distance = math.sqrt(squared)
    on_a = simplex.on_a
    on_b = simplex.on_b
    on_b[0], on_b[1], on_b[2] = on_a[0] - vx, on_a[1] - vy, on_a[2] - vz
    direction = simplex.direction
    direction[0], direction[1], direction[2] = -vx / distance, -vy / distance, -vz / distance
    return distance


@inner
def best_face_direction(a, b, faces, points):
    """The face normal, as a direction from a to b, along which two cores overlap least; and the gap along it."""
    best = -FAR
    bx, by, bz = 0.0, 1.0, 0.0
    for side in range(2):
        shape = b if side else a
        sign = -1.0 if side else 1.0
        for k in range(face_count(shape)):
            nx, ny, nz = face_normal(shape, faces, k)
            nx, ny, nz = sign * nx, sign * ny, sign * nz
            gap = gap_along(a, b, points, nx, ny, nz)
            if gap > best:
                best, bx, by, bz = gap, nx, ny, nz
    return best, bx, by, bz


@inner
def first_direction(a, b, faces, points, simplex):
    """A direction from a to b along which overlapping cores may part, and the gap along it."""
    a.scale = b.scale = SHRUNK
    distance = core_distance(a, b, points, FAR, simplex)
    a.scale = b.scale = 1.0
    dx, dy, dz = b.center[0] - a.center[0], b.center[1] - a.center[1], b.center[2] - a.center[2]
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    if distance > 0.0:
        n = simplex.direction
        nx, ny, nz = n[0], n[1], n[2]
        return gap_along(a, b, points, nx, ny, nz), nx, ny, nz
    best, nx, ny, nz = best_face_direction(a, b, faces, points)
    if length > 0.0:
        dx, dy, dz = dx / length, dy / length, dz / length
        gap = gap_along(a, b, points, dx, dy, dz)
        if gap > best:
            return gap, dx, dy, dz
    return best, nx, ny, nz


@inner
def write_support_points(a, b, points, nx, ny, nz, simplex):
    px, py, pz = support(a, points, nx, ny, nz)
    qx, qy, qz = support(b, points, -nx, -ny, -nz)
    simplex.on_a[0], simplex.on_a[1], simplex.on_a[2] = px, py, pz
    simplex.on_b[0], simplex.on_b[1], simplex.on_b[2] = qx, qy, qz


@inner
def core_overlap(a, b, gap, nx, ny, nz, opening, points, simplex):
    """The least overlap of two cores near a direction, as a negative gap; from a gap seen along a unit direction.

    `opening` is how far apart b is moved to look for a better direction: small against the shapes, large against rounding.
    `simplex` gets the direction and the points where the surfaces meet along it.
    """
    center = b.center
    x, y, z = center[0], center[1], center[2]
    for _ in range(4):
        way = opening - gap
        center[0], center[1], center[2] = x + way * nx, y + way * ny, z + way * nz
        distance = distance_from(a, b, points, nx, ny, nz, FAR, simplex)
        center[0], center[1], center[2] = x, y, z
        if distance <= 0.0:
            write_support_points(a, b, points, nx, ny, nz, simplex)
            break
        on_b = simplex.on_b  # goes back with b
        on_b[0], on_b[1], on_b[2] = on_b[0] - way * nx, on_b[1] - way * ny, on_b[2] - way * nz
        n = simplex.direction
        # By support points, and not by the distance, which at a rim may not have converged: a depth is never too small.
        better = gap_along(a, b, points, n[0], n[1], n[2])
        if better <= gap + 1e-4 * opening:
            break
        gap, nx, ny, nz = better, n[0], n[1], n[2]
    n = simplex.direction
    n[0], n[1], n[2] = nx, ny, nz
    return gap

"""Convex shapes of any kind against each other: distance or depth by `gjk`, contact points by `clipping`.

A face is preferred to a direction between edges or corners unless that is clearly better: otherwise a resting shape would
change its mind from step to step, and a lying cylinder would feel the last digits of an iteration.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.clipping import facing, meet_flat, meet_segments
from elys.sim_node.physics.kernels.gjk import FAR, core_distance, core_overlap, distance_from, first_direction
from elys.sim_node.physics.kernels.ray import into_axes
from elys.sim_node.physics.kernels.support import face_normal, gap_along, load_convex, load_triangle
from elys.sim_node.physics.kernels.tables import HEIGHT_FIELD

OPENING = 1e-3  # how far cores are parted to find their depth, as a share of the smaller one
PREFERENCE = 5e-3  # how much worse a face may be than another direction, as a share of the smaller shape
SLIGHT = 0.1  # overlap that is followed from the normal of before, as a share of the smaller shape
SNAP = 1e-6  # 1 - cosine up to which a direction between rounded shapes passes for a face's
ONE_POINT = 0x40000000
BEYOND = 1e-8  # squared sine above which something lies on the core's side of a plane, and not in it
WITHIN = 1e-6  # by which the cosine to the middle of a corner's normals may be less than theirs
ON_SIDE = 1e-6  # weight of a corner below which a point of a triangle lies on the side opposite to it


@inner
def smallest_half(a, b):
    p = a.half_extents
    q = b.half_extents
    return min(p[0], p[1], p[2], q[0], q[1], q[2])


@inner
def one_point(a, b, gap, simplex, found):
    """Contact in the single pair of closest points."""
    n = simplex.direction
    for k in range(3):
        surface_a = simplex.on_a[k] + a.radius * n[k]
        surface_b = simplex.on_b[k] - b.radius * n[k]
        found.point[k] = 0.5 * (surface_a + surface_b)
        found.normal[k] = n[k]
    found.separation[0] = gap - a.radius - b.radius
    found.feature[0] = ONE_POINT
    return 1


@inner
def flat_direction(a, b, gap, faces, points, simplex):
    """Whether a face of a (1) or of b (2) may stand for the direction found, or none (0); and its normal."""
    n = simplex.direction
    slack = PREFERENCE * smallest_half(a, b)
    # Of rounded shapes the direction turns gradually at an edge, and a face must not be extended over it.
    gradual = gap > 0.0 and a.radius + b.radius > 0.0
    k, cosine = facing(a, faces, n[0], n[1], n[2])
    best = -FAR
    side = 0
    bx = by = bz = 0.0
    if k >= 0 and (not gradual or 1.0 - cosine < SNAP):
        bx, by, bz = face_normal(a, faces, k)
        best = gap_along(a, b, points, bx, by, bz)
        if gradual or best >= gap - slack:
            side = 1
        else:
            best = -FAR
    k, cosine = facing(b, faces, -n[0], -n[1], -n[2])
    if k >= 0 and (not gradual or 1.0 - cosine < SNAP):
        mx, my, mz = face_normal(b, faces, k)
        other = gap_along(a, b, points, -mx, -my, -mz)
        if (gradual or other >= gap - slack) and other > best + 0.1 * slack:
            bx, by, bz = mx, my, mz
            side = 2
    return side, bx, by, bz


@inner
def meet_along(a, b, gap, faces, points, margin, simplex, found):
    """Contact points of two cores with `gap` along `simplex.direction`."""
    side, mx, my, mz = flat_direction(a, b, gap, faces, points, simplex)
    count = 0
    if side == 1:
        count = meet_flat(a, b, faces, points, mx, my, mz, 1.0, margin, found)
    elif side == 2:
        count = meet_flat(b, a, faces, points, mx, my, mz, -1.0, margin, found)
    else:
        n = simplex.direction
        count = meet_segments(a, b, faces, points, n[0], n[1], n[2], margin, found)
    if count <= 0:
        return one_point(a, b, gap, simplex, found)
    return count


@inner
def core_gap(a, b, faces, points, reach, hint, simplex):
    """Signed distance of two cores [m], its direction in `simplex`; FAR beyond the reach.

    A slight overlap along the normal of the step before needs no search for where to begin.
    """
    nx, ny, nz = hint[0], hint[1], hint[2]
    smallest = smallest_half(a, b)
    if nx != 0.0 or ny != 0.0 or nz != 0.0:
        gap = gap_along(a, b, points, nx, ny, nz)
        if -SLIGHT * smallest < gap < 0.0:
            gap = core_overlap(a, b, gap, nx, ny, nz, OPENING * smallest, points, simplex)
            if gap <= 0.0:
                return gap
    else:
        nx, ny, nz = b.center[0] - a.center[0], b.center[1] - a.center[1], b.center[2] - a.center[2]
    gap = distance_from(a, b, points, nx, ny, nz, reach, simplex)
    if gap == 0.0:
        gap, nx, ny, nz = first_direction(a, b, faces, points, simplex)
        gap = core_overlap(a, b, gap, nx, ny, nz, OPENING * smallest, points, simplex)
    return gap


@inner
def convex_convex(first, second, margin, found, geometry):
    """Contact points of two convex colliders, from the first to the second, relative to the centre of the first."""
    a = geometry.convex[0]
    b = geometry.convex[1]
    simplex = geometry.simplex[0]
    origin = first.center
    load_convex(a, first, geometry.headers, origin[0], origin[1], origin[2])
    load_convex(b, second, geometry.headers, origin[0], origin[1], origin[2])
    reach = margin + a.radius + b.radius
    gap = core_gap(a, b, geometry.faces, geometry.points, reach, found.hint, simplex)
    if gap > reach:
        return 0
    return meet_along(a, b, gap, geometry.faces, geometry.points, margin, simplex, found)


@inner
def plane_convex(plane, second, margin, found, geometry):
    """Contact points of a half-space and a convex collider, from the plane, relative to the collider's centre."""
    a = geometry.convex[0]
    b = geometry.convex[1]
    origin = second.center
    load_convex(a, plane, geometry.headers, origin[0], origin[1], origin[2])
    load_convex(b, second, geometry.headers, origin[0], origin[1], origin[2])
    n = plane.axes
    a.radius = 0.0
    a.kind = -1  # met as a single point, whose plane has no sides
    # The point of the plane under the shape: the plane's own may lie far off.
    height = a.center[0] * n[3] + a.center[1] * n[4] + a.center[2] * n[5]
    for k in range(3):
        a.center[k] = height * n[3 + k]
    faces = geometry.faces
    return meet_flat(a, b, faces, geometry.points, n[3], n[4], n[5], 1.0, margin, found)


@inner
def lies_on(triangle, simplex):
    """Bits of the sides of a triangle that the closest point lies on: bit k for the side from corner k to the next."""
    c = triangle.corners
    p = simplex.on_a
    n = triangle.axes
    bits = 0
    for k in range(3):
        i = 3 * k
        j = 3 * ((k + 1) % 3)
        o = 3 * ((k + 2) % 3)
        # Distance from the side within the plane, by the side's inward normal n x e.
        ex, ey, ez = c[j] - c[i], c[j + 1] - c[i + 1], c[j + 2] - c[i + 2]
        x, y, z = n[4] * ez - n[5] * ey, n[5] * ex - n[3] * ez, n[3] * ey - n[4] * ex
        height = (c[o] - c[i]) * x + (c[o + 1] - c[i + 1]) * y + (c[o + 2] - c[i + 2]) * z
        px = p[0] - triangle.center[0] - c[i]
        py = p[1] - triangle.center[1] - c[i + 1]
        pz = p[2] - triangle.center[2] - c[i + 2]
        if px * x + py * y + pz * z <= ON_SIDE * height:
            bits |= 1 << k
    return bits


@inner
def lies_nearer_beside(mesh, face, points, sides, origin, simplex):
    """Whether the surface comes nearer to the core beside the closest point of a triangle, which lies on these sides of it.

    On one side it does if the third corner of the triangle beyond it lies, from there, on the core's side of a plane across the
    way to the core. At a corner the way to the core must lie among the normals of the triangles around it. What rolls towards
    an edge or corner is held by the triangle that it is on: from afar it would be a step.
    """
    d = simplex.direction
    dx, dy, dz = into_axes(mesh.axes, d[0], d[1], d[2])
    first = face.first_corner
    if sides == 3 or sides == 6 or sides == 5:
        k = 1 if sides == 3 else (2 if sides == 6 else 0)
        at = first + 6 + k
        return points[at, 0] * dx + points[at, 1] * dy + points[at, 2] * dz < points[first + 9, k] - WITHIN
    x, y, z = origin[0] - mesh.center[0], origin[1] - mesh.center[1], origin[2] - mesh.center[2]
    p = simplex.on_a
    px, py, pz = into_axes(mesh.axes, p[0] + x, p[1] + y, p[2] + z)
    for k in range(3):
        if sides == 1 << k and face.active >> (3 + k) & 1:
            at = first + 3 + k
            ax, ay, az = points[at, 0] - px, points[at, 1] - py, points[at, 2] - pz
            along = ax * dx + ay * dy + az * dz
            return along > 0.0 and along * along > BEYOND * (ax * ax + ay * ay + az * az)
    return False


@inner
def triangle_gap(a, b, mesh, face, points, reach, origin, simplex):
    """Signed distance from a one-sided triangle to a core, FAR where it does not count; `flat` when its face decides.

    What is behind a triangle does not touch it, but a thick one (of a height field, with ground below) pushes out whatever
    is there. A side that leads on flatly or into a valley has no normals but the face's: what slides over it must not
    catch (the neighbour holds it there).
    """
    thick = mesh.kind == HEIGHT_FIELD
    n = a.axes
    nx, ny, nz = n[3], n[4], n[5]
    center = b.center
    behind = 0.0
    for k in range(3):
        behind -= (center[k] - a.center[k]) * n[3 + k]
    if behind > 0.0 and not thick:
        return FAR, False
    gap = gap_along(a, b, points, nx, ny, nz)
    if gap > reach:
        return FAR, False
    distance = core_distance(a, b, points, reach, simplex)
    if distance > reach:
        return FAR, False
    if distance > 0.0:
        d = simplex.direction
        cosine = d[0] * nx + d[1] * ny + d[2] * nz
        if 1.0 - cosine < SNAP:
            return gap, True
        sides = lies_on(a, simplex)
        if sides & a.active == 0:
            return gap, True
        if cosine <= 0.0 or lies_nearer_beside(mesh, face, points, sides, origin, simplex):
            return FAR, False
        return distance, False
    better = core_overlap(a, b, gap, nx, ny, nz, OPENING * smallest_half(b, b), points, simplex)
    d = simplex.direction
    cosine = d[0] * nx + d[1] * ny + d[2] * nz
    if cosine <= 0.0 or 1.0 - cosine < SNAP or lies_on(a, simplex) & a.active == 0:
        return gap, True
    return better, False


@inner
def triangle_convex(mesh, part, second, margin, found, geometry):
    """Contact points of one triangle and a convex collider, from the triangle, relative to the collider's centre."""
    a = geometry.convex[0]
    b = geometry.convex[1]
    simplex = geometry.simplex[0]
    faces = geometry.faces
    points = geometry.points
    origin = second.center
    header = geometry.headers[mesh.geometry]
    load_triangle(a, mesh, header, faces, points, part, origin[0], origin[1], origin[2])
    load_convex(b, second, geometry.headers, origin[0], origin[1], origin[2])
    for k in range(3):
        a.half_extents[k] = FAR
    reach = margin + b.radius
    face = faces[header.first_face + part]
    gap, flat = triangle_gap(a, b, mesh, face, points, reach, origin, simplex)
    if gap > reach:
        return 0
    if flat:
        n = a.axes
        return meet_flat(a, b, faces, points, n[3], n[4], n[5], 1.0, margin, found)
    return meet_along(a, b, gap, faces, points, margin, simplex, found)

"""Questions about meshes and height fields: surfaces of triangles that have no inside and are met from both sides.

A walk down the tree over a mesh's triangles uses the room on the stack above what waits there already.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.cast import cast_convex
from elys.sim_node.physics.kernels.closest import point_to_core
from elys.sim_node.physics.kernels.gjk import FAR, core_distance
from elys.sim_node.physics.kernels.midphase import next_part
from elys.sim_node.physics.kernels.ray import MISS, into_axes, out_of_axes, slab
from elys.sim_node.physics.kernels.rotation import cross
from elys.sim_node.physics.kernels.support import load_triangle


@inner
def next_part_on_line(mesh, geometry, stack, bottom, top, px, py, pz, vx, vy, vz, reach, limit):
    """The first triangle of the next leaf whose box, larger by `reach`, a ray in the mesh's axes enters before the limit.

    The walk is in stack[bottom:top]. Returns that triangle, or -1, and the new top.
    """
    header = geometry.headers[mesh.geometry]
    while top > bottom:
        top -= 1
        node = stack[top]
        box = geometry.nodes[header.first_node + node]
        if box[0] > box[3]:
            continue  # a leaf without triangles
        x0, x1 = slab(px - 0.5 * (box[0] + box[3]), vx, 0.5 * (box[3] - box[0]) + reach)
        y0, y1 = slab(py - 0.5 * (box[1] + box[4]), vy, 0.5 * (box[4] - box[1]) + reach)
        z0, z1 = slab(pz - 0.5 * (box[2] + box[5]), vz, 0.5 * (box[5] - box[2]) + reach)
        enter = max(x0, y0, z0, 0.0)
        if enter > limit or enter > min(x1, y1, z1):
            continue
        if node >= header.leaf_count:
            return 2 * (node - header.leaf_count), top
        stack[top] = 2 * node + 1
        stack[top + 1] = 2 * node
        top += 2
    return -1, top


@inner
def ray_triangle(points, k, normal, px, py, pz, vx, vy, vz):
    """Distance along a ray to the triangle of points k, k + 1, k + 2, from either side; MISS when it passes by.

    Which side of each edge the ray passes is the sign of a product that the neighbour across the edge computes from the same
    numbers with the sign turned: no ray slips through between two triangles.
    """
    ax, ay, az = points[k, 0] - px, points[k, 1] - py, points[k, 2] - pz
    bx, by, bz = points[k + 1, 0] - px, points[k + 1, 1] - py, points[k + 1, 2] - pz
    cx, cy, cz = points[k + 2, 0] - px, points[k + 2, 1] - py, points[k + 2, 2] - pz
    x, y, z = cross(ax, ay, az, bx, by, bz)
    first = vx * x + vy * y + vz * z
    x, y, z = cross(bx, by, bz, cx, cy, cz)
    second = vx * x + vy * y + vz * z
    x, y, z = cross(cx, cy, cz, ax, ay, az)
    third = vx * x + vy * y + vz * z
    if min(first, second, third) < 0.0 and max(first, second, third) > 0.0:
        return MISS
    along = normal[0] * vx + normal[1] * vy + normal[2] * vz
    if along == 0.0 or first + second + third == 0.0:
        return MISS
    t = (normal[0] * ax + normal[1] * ay + normal[2] * az) / along
    return t if t >= 0.0 else MISS


@inner
def ray_mesh(mesh, geometry, stack, bottom, ox, oy, oz, dx, dy, dz, limit):
    """A ray against a mesh: distance, or MISS, and the normal on the ray's side."""
    center = mesh.center
    px, py, pz = into_axes(mesh.axes, ox - center[0], oy - center[1], oz - center[2])
    vx, vy, vz = into_axes(mesh.axes, dx, dy, dz)
    header = geometry.headers[mesh.geometry]
    best = MISS
    at = -1
    # What rounding moves a point by on its way into the mesh's axes.
    around = 1e-14 * (abs(px) + abs(py) + abs(pz) + mesh.reach)
    stack[bottom] = 1
    top = bottom + 1
    while True:
        part, top = next_part_on_line(mesh, geometry, stack, bottom, top, px, py, pz, vx, vy, vz, around, limit)
        if part < 0:
            break
        for p in range(part, min(part + 2, header.face_count)):
            face = geometry.faces[header.first_face + p]
            t = ray_triangle(geometry.points, face.first_corner, face.normal, px, py, pz, vx, vy, vz)
            if t == MISS or t > limit or (at >= 0 and t == limit and p > at):
                continue
            best = limit = t
            at = p
    if at < 0:
        return MISS, 0.0, 0.0, 0.0
    n = geometry.faces[header.first_face + at].normal
    sign = -1.0 if n[0] * vx + n[1] * vy + n[2] * vz > 0.0 else 1.0
    nx, ny, nz = out_of_axes(mesh.axes, sign * n[0], sign * n[1], sign * n[2])
    return best, nx, ny, nz


@inner
def cast_at_mesh(probe, reach, mesh, geometry, stack, bottom, ox, oy, oz, dx, dy, dz, limit, touch):
    """Any convex shape against a mesh, triangle by triangle."""
    center = mesh.center
    x, y, z = ox - center[0], oy - center[1], oz - center[2]
    px, py, pz = into_axes(mesh.axes, x, y, z)
    vx, vy, vz = into_axes(mesh.axes, dx, dy, dz)
    header = geometry.headers[mesh.geometry]
    shape = geometry.convex[1]
    simplex = geometry.simplex[0]
    best = MISS
    qx = qy = qz = nx = ny = nz = 0.0
    stack[bottom] = 1
    top = bottom + 1
    while True:
        part, top = next_part_on_line(mesh, geometry, stack, bottom, top, px, py, pz, vx, vy, vz, reach, limit)
        if part < 0:
            break
        for p in range(part, min(part + 2, header.face_count)):
            load_triangle(shape, mesh, header, geometry.faces, geometry.points, p, center[0], center[1], center[2])
            # The extent of what touches, not of the whole mesh: it says how close is close.
            extent = reach + abs(shape.corners[0]) + abs(shape.corners[1]) + abs(shape.corners[2])
            t = cast_convex(probe, shape, geometry.points, simplex, extent, x, y, z, dx, dy, dz, limit, touch)
            if t == MISS or (best != MISS and t >= best):
                continue
            best = limit = t
            qx, qy, qz = touch.point[0] + center[0], touch.point[1] + center[1], touch.point[2] + center[2]
            nx, ny, nz = touch.normal[0], touch.normal[1], touch.normal[2]
    touch.point[0], touch.point[1], touch.point[2] = qx, qy, qz
    touch.normal[0], touch.normal[1], touch.normal[2] = nx, ny, nz
    return best


@inner
def point_to_mesh(mesh, geometry, stack, bottom, x, y, z, limit):
    """The closest point of a mesh not farther than the limit, as `point_to_solid` has it; the distance is FAR for none."""
    center = mesh.center
    px, py, pz = x - center[0], y - center[1], z - center[2]
    lx, ly, lz = into_axes(mesh.axes, px, py, pz)
    header = geometry.headers[mesh.geometry]
    shape = geometry.convex[1]
    best = FAR
    bx = by = bz = nx = ny = nz = 0.0
    stack[bottom] = 1
    top = bottom + 1
    while True:
        # The box looked into shrinks with what was found.
        r = limit * (1.0 + 1e-12) + 1e-14 * (abs(lx) + abs(ly) + abs(lz))
        box = (lx - r, lx + r, ly - r, ly + r, lz - r, lz + r)
        part, top = next_part(mesh, box[0], box[1], box[2], box[3], box[4], box[5], geometry, stack, bottom, top)
        if part < 0:
            break
        for p in range(part, min(part + 2, header.face_count)):
            load_triangle(shape, mesh, header, geometry.faces, geometry.points, p, center[0], center[1], center[2])
            d, cx, cy, cz, ux, uy, uz = point_to_core(shape, geometry, px, py, pz)
            if d > limit or d >= best:
                continue
            best = limit = d
            bx, by, bz, nx, ny, nz = cx + center[0], cy + center[1], cz + center[2], ux, uy, uz
    return best, bx, by, bz, nx, ny, nz


@inner
def overlaps_mesh(probe, reach, mesh, geometry, stack, bottom, x, y, z):
    """Whether a probe with its centre at (x, y, z) shares a point with a triangle of a mesh."""
    center = mesh.center
    px, py, pz = x - center[0], y - center[1], z - center[2]
    lx, ly, lz = into_axes(mesh.axes, px, py, pz)
    header = geometry.headers[mesh.geometry]
    shape = geometry.convex[1]
    probe.center[0], probe.center[1], probe.center[2] = px, py, pz
    stack[bottom] = 1
    top = bottom + 1
    while True:
        part, top = next_part(
            mesh, lx - reach, lx + reach, ly - reach, ly + reach, lz - reach, lz + reach, geometry, stack, bottom, top
        )
        if part < 0:
            return False
        for p in range(part, min(part + 2, header.face_count)):
            load_triangle(shape, mesh, header, geometry.faces, geometry.points, p, center[0], center[1], center[2])
            if core_distance(probe, shape, geometry.points, FAR, geometry.simplex[0]) <= probe.radius:
                return True

"""Sweeps of a capsule through what is near it, and the search for ground below.

A sweep passes over what the capsule overlaps as it begins: the planes that it touches there hold it back already.
"""

from __future__ import annotations

import math

from elys.sim_node.character.kernels.tables import SKIN, STEEPEST_PERCH
from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.cast import cast_at_plane, cast_convex
from elys.sim_node.physics.kernels.midphase import has_parts
from elys.sim_node.physics.kernels.ray import MISS, into_axes, ray_solid
from elys.sim_node.physics.kernels.support import load_convex, load_triangle
from elys.sim_node.physics.kernels.surface import next_part_on_line, ray_mesh
from elys.sim_node.physics.kernels.tables import PLANE

FAR = 1e30
LEVEL = 1e-3  # two grounds whose heights differ by less are met together [m]
AHEAD = 0.01  # how far behind an edge its surface is looked at [m]


@inner
def write_hit(hit, c, t, px, py, pz, nx, ny, nz):
    hit.collider = c
    hit.distance = t
    hit.point[0], hit.point[1], hit.point[2] = px, py, pz
    hit.normal[0], hit.normal[1], hit.normal[2] = nx, ny, nz


@inner
def sweep_mesh(around, c, x, y, z, dx, dy, dz, limit):
    """The probe against the triangles of a mesh: distance, MISS if there is none; `touch` says where."""
    geometry, stack = around.geometry, around.stack
    mesh = around.colliders[c]
    center = mesh.center
    probe = geometry.convex[0]
    reach = probe.radius + probe.half_extents[1]
    ox, oy, oz = x - center[0], y - center[1], z - center[2]
    px, py, pz = into_axes(mesh.axes, ox, oy, oz)
    vx, vy, vz = into_axes(mesh.axes, dx, dy, dz)
    header = geometry.headers[mesh.geometry]
    shape = geometry.convex[1]
    touch = around.touch[0]
    best = MISS
    qx = qy = qz = nx = ny = nz = 0.0
    stack[0] = 1
    top = 1
    while True:
        part, top = next_part_on_line(mesh, geometry, stack, 0, top, px, py, pz, vx, vy, vz, reach, limit)
        if part < 0:
            break
        for p in range(part, min(part + 2, header.face_count)):
            load_triangle(shape, mesh, header, geometry.faces, geometry.points, p, center[0], center[1], center[2])
            extent = reach + abs(shape.corners[0]) + abs(shape.corners[1]) + abs(shape.corners[2])
            t = cast_convex(
                probe, shape, geometry.points, geometry.simplex[0], extent, ox, oy, oz, dx, dy, dz, limit, touch
            )
            if t == MISS or t <= 0.0 or (best != MISS and t >= best):
                continue
            best = limit = t
            qx, qy, qz = touch.point[0] + center[0], touch.point[1] + center[1], touch.point[2] + center[2]
            nx, ny, nz = touch.normal[0], touch.normal[1], touch.normal[2]
    touch.point[0], touch.point[1], touch.point[2] = qx, qy, qz
    touch.normal[0], touch.normal[1], touch.normal[2] = nx, ny, nz
    return best


@inner
def sweep_collider(around, c, x, y, z, dx, dy, dz, limit):
    """The probe, its centre at (x, y, z), along a unit vector against collider row c: distance up to the limit, or MISS."""
    geometry = around.geometry
    collider = around.colliders[c]
    probe = geometry.convex[0]
    touch = around.touch[0]
    if has_parts(collider):
        return sweep_mesh(around, c, x, y, z, dx, dy, dz, limit)
    if collider.kind == PLANE:
        t = cast_at_plane(collider, probe, geometry.points, x, y, z, dx, dy, dz, touch)
        return t if 0.0 < t <= limit else MISS
    # By boxes first: the way's against the collider's.
    box = collider.box
    across = probe.radius
    along = across + probe.half_extents[1]
    ex, ey, ez = limit * dx, limit * dy, limit * dz
    if box[0] > x + max(ex, 0.0) + across or box[3] < x + min(ex, 0.0) - across:
        return MISS
    if box[2] > z + max(ez, 0.0) + across or box[5] < z + min(ez, 0.0) - across:
        return MISS
    if box[1] > y + max(ey, 0.0) + along or box[4] < y + min(ey, 0.0) - along:
        return MISS
    center = collider.center
    shape = geometry.convex[1]
    load_convex(shape, collider, geometry.headers, center[0], center[1], center[2])
    ox, oy, oz = x - center[0], y - center[1], z - center[2]
    extent = probe.radius + probe.half_extents[1] + collider.reach
    t = cast_convex(probe, shape, geometry.points, geometry.simplex[0], extent, ox, oy, oz, dx, dy, dz, limit, touch)
    if t <= 0.0:
        return MISS
    point = touch.point
    point[0], point[1], point[2] = point[0] + center[0], point[1] + center[1], point[2] + center[2]
    return t


@inner
def sweep(around, near_count, passed_over, x, y, z, dx, dy, dz, limit, hit):
    """How far the probe gets along a unit vector, up to the limit; `hit` is what stops it. Body row `passed_over` does not."""
    hit.collider = -1
    for i in range(near_count):
        c = around.near[i]
        if around.colliders[c].body == passed_over:
            continue
        t = sweep_collider(around, c, x, y, z, dx, dy, dz, limit)
        if t == MISS or (t == limit and hit.collider >= 0):
            continue
        limit = t
        p, n = around.touch[0].point, around.touch[0].normal
        write_hit(hit, c, t, p[0], p[1], p[2], n[0], n[1], n[2])
    return limit


@inner
def is_edge_of_level(around, c, px, py, pz, nx, ny, nz, least_up):
    """Whether a point where a capsule touches collider c is the edge of something that can be stood on; and its height.

    A ray goes down a little behind the edge: what it meets is the surface that the edge belongs to.
    """
    if ny < STEEPEST_PERCH:
        return False
    across = math.sqrt(nx * nx + nz * nz)
    if across <= 0.0:
        return True
    x, y, z = px - AHEAD * nx / across, py + 2.0 * AHEAD, pz - AHEAD * nz / across
    collider = around.colliders[c]
    limit = 4.0 * AHEAD
    if has_parts(collider):
        t, _, up, _ = ray_mesh(collider, around.geometry, around.stack, 0, x, y, z, 0.0, -1.0, 0.0, limit)
    else:
        t, _, up, _ = ray_solid(collider, around.geometry, x, y, z, 0.0, -1.0, 0.0)
    return 0.0 < t <= limit and up >= least_up


@inner
def find_ground(around, near_count, x, y, z, least_up, limit, hit, steep):
    """The ground that the probe meets straight below within the limit; whether there is any that can be stood on.

    `hit` is that ground, and where none is met at all keeps collider -1; `steep` is what is met first and cannot be stood on.
    """
    hit.collider = steep.collider = -1
    best, first = limit, limit
    for i in range(near_count):
        c = around.near[i]
        t = sweep_collider(around, c, x, y, z, 0.0, -1.0, 0.0, min(limit, first + LEVEL))
        if t == MISS:
            continue
        p, n = around.touch[0].point, around.touch[0].normal
        px, py, pz, nx, ny, nz = p[0], p[1], p[2], n[0], n[1], n[2]
        if ny >= least_up or is_edge_of_level(around, c, px, py, pz, nx, ny, nz, least_up):
            if hit.collider < 0 or t < best:
                best = t
                write_hit(hit, c, t, px, py, pz, nx, ny, nz)
        elif steep.collider < 0 or t < first:
            write_hit(steep, c, t, px, py, pz, nx, ny, nz)
        first = min(first, t)
    # Of several the highest carries; what is higher than the ground and cannot be stood on has been met before it.
    return hit.collider >= 0 and hit.distance <= first + LEVEL


@inner
def spread_probe(around, radius):
    """Makes the probe's coat that thick: a skin thicker than the character, or half of one."""
    around.geometry.convex[0].radius = radius


@inner
def skinned(radius):
    return radius + SKIN


@inner
def half_skinned(radius):
    return radius + 0.5 * SKIN

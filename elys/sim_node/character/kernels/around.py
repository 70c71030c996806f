"""What is around a capsule: the colliders near it, how far each is away, and the planes that it touches.

All are sorted by row, so that nothing depends on how the query tree came to be.
"""

from __future__ import annotations

import math

from elys.sim_node.character.kernels.tables import FLOOR, MOST_PLANES, NEAR, SKIN, STEEP, WALL
from elys.sim_node.compilation import inner
from elys.sim_node.physics.kernels.cast import height_over
from elys.sim_node.physics.kernels.gjk import FAR, core_distance, core_overlap, first_direction
from elys.sim_node.physics.kernels.midphase import has_parts, next_part
from elys.sim_node.physics.kernels.ray import into_axes
from elys.sim_node.physics.kernels.rotation import cross
from elys.sim_node.physics.kernels.support import load_convex, load_triangle
from elys.sim_node.physics.kernels.tables import CAPSULE, DYNAMIC, KINEMATIC, PLANE, SOLID

ALIKE = 0.9999  # cosine between two normals that are one plane


@inner
def load_probe(geometry, radius, stature):
    """The capsule of a character, upright; its radius is that of the core's coat."""
    probe = geometry.convex[0]
    for k in range(9):
        probe.axes[k] = 1.0 if k % 4 == 0 else 0.0
    probe.half_extents[0] = radius
    probe.half_extents[1] = max(0.5 * stature - radius, 1e-4)
    probe.half_extents[2] = radius
    probe.kind = CAPSULE
    probe.scale = 1.0
    probe.radius = radius


@inner
def gather(around, own, reach):
    """Lists the solid colliders whose boxes are within `reach` of the capsule in collider row `own`, ascending; how many."""
    colliders, nodes, stack, near = around.colliders, around.nodes, around.stack, around.near
    mine = colliders[own]
    x, y, z = mine.center[0], mine.center[1], mine.center[2]
    across = mine.half_extents[0] + reach
    along = mine.half_extents[0] + mine.half_extents[1] + reach
    count = 0
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        box = nodes[node].box
        for side in range(2):
            base = 6 * side
            if box[base] > x + across or box[base + 1] > y + along or box[base + 2] > z + across:
                continue
            if box[base + 3] < x - across or box[base + 4] < y - along or box[base + 5] < z - across:
                continue
            child = nodes[node].child[side]
            if child >= 0:
                stack[top] = child
                top += 1
                continue
            c = -1 - child
            other = colliders[c]
            if other.body == mine.body or other.trigger != SOLID:
                continue
            if other.layer & mine.mask == 0 or mine.layer & other.mask == 0:
                continue
            place = count
            while place > 0 and near[place - 1] > c:
                near[place] = near[place - 1]
                place -= 1
            near[place] = c
            count += 1
    return count


@inner
def gap_between(probe, shape, geometry):
    """Gap between two loaded shapes, negative for overlap. `simplex` has the direction to the shape and its nearest point."""
    simplex = geometry.simplex[0]
    points = geometry.points
    distance = core_distance(probe, shape, points, FAR, simplex)
    if distance <= 0.0:
        gap, nx, ny, nz = first_direction(probe, shape, geometry.faces, points, simplex)
        distance = core_overlap(probe, shape, gap, nx, ny, nz, 0.05, points, simplex)
    return distance - probe.radius - shape.radius


@inner
def surface_velocity(around, collider, px, py, pz):
    """Of a collider's body at a point in world space. Characters count as standing still: they give way by themselves."""
    body = around.bodies[collider.body]
    if around.is_character[collider.body] != 0 or (body.motion != KINEMATIC and body.motion != DYNAMIC):
        return 0.0, 0.0, 0.0
    v = body.velocity
    x, y, z = cross(v[3], v[4], v[5], px - body.position[0], py - body.position[1], pz - body.position[2])
    return v[0] + x, v[1] + y, v[2] + z


@inner
def note_plane(around, c, count, least_up, gap, px, py, pz, nx, ny, nz):
    """Adds a plane of collider row c to those that are touched, or makes an equal one narrower; how many there are."""
    planes = around.planes
    collider = around.colliders[c]
    body = around.bodies[collider.body]
    is_loose = body.motion == DYNAMIC
    beyond = gap - SKIN
    if is_loose:  # what leans against a character does not drive it off by its skin
        beyond = gap if gap < 0.0 else max(beyond, 0.0)
    ux, uy, uz = surface_velocity(around, collider, px, py, pz)
    place = count
    for i in range(count):
        plane = planes[i]
        n = plane.normal
        if plane.body == collider.body and n[0] * nx + n[1] * ny + n[2] * nz > ALIKE:
            if plane.gap <= beyond:
                return count
            place = i
            break
    if place >= MOST_PLANES:
        return count
    plane = planes[place]
    plane.normal[0], plane.normal[1], plane.normal[2] = nx, ny, nz
    plane.point[0], plane.point[1], plane.point[2] = px, py, pz
    plane.velocity[0], plane.velocity[1], plane.velocity[2] = ux, uy, uz
    plane.gap = beyond
    plane.push = 0.0
    plane.body = collider.body
    plane.motion = body.motion
    plane.slant = FLOOR if ny >= least_up else (STEEP if ny > 0.0 else WALL)
    return max(count, place + 1)


@inner
def touch_shape(around, c, shape, count, least_up, room, cx, cy, cz):
    """Notes the plane between the probe and a loaded shape whose places are from (cx, cy, cz), if they touch."""
    geometry = around.geometry
    probe = geometry.convex[0]
    gap = gap_between(probe, shape, geometry)
    if gap > room:
        return count
    n = geometry.simplex[0].direction
    b = geometry.simplex[0].on_b
    r = shape.radius
    px, py, pz = b[0] - r * n[0] + cx, b[1] - r * n[1] + cy, b[2] - r * n[2] + cz
    return note_plane(around, c, count, least_up, gap, px, py, pz, -n[0], -n[1], -n[2])


@inner
def touch_mesh(around, c, count, least_up, room, x, y, z):
    """The same for the triangles of a mesh or height field around a probe at (x, y, z)."""
    geometry, stack = around.geometry, around.stack
    mesh = around.colliders[c]
    center = mesh.center
    probe = geometry.convex[0]
    px, py, pz = x - center[0], y - center[1], z - center[2]
    probe.center[0], probe.center[1], probe.center[2] = px, py, pz
    lx, ly, lz = into_axes(mesh.axes, px, py, pz)
    reach = probe.radius + probe.half_extents[1] + room
    header = geometry.headers[mesh.geometry]
    shape = geometry.convex[1]
    stack[0] = 1
    top = 1
    while True:
        part, top = next_part(
            mesh, lx - reach, lx + reach, ly - reach, ly + reach, lz - reach, lz + reach, geometry, stack, 0, top
        )
        if part < 0:
            return count
        for p in range(part, min(part + 2, header.face_count)):
            load_triangle(shape, mesh, header, geometry.faces, geometry.points, p, center[0], center[1], center[2])
            count = touch_shape(around, c, shape, count, least_up, room, center[0], center[1], center[2])


@inner
def touched_planes(around, near_count, least_up, x, y, z):
    """Finds the planes that the probe touches with its centre at (x, y, z); how many."""
    geometry = around.geometry
    probe = geometry.convex[0]
    room = SKIN + NEAR
    across = probe.radius + room
    along = across + probe.half_extents[1]
    count = 0
    for i in range(near_count):
        c = around.near[i]
        collider = around.colliders[c]
        box = collider.box
        if box[0] > x + across or box[3] < x - across or box[2] > z + across or box[5] < z - across:
            continue
        if box[1] > y + along or box[4] < y - along:
            continue
        if has_parts(collider):
            count = touch_mesh(around, c, count, least_up, room, x, y, z)
            continue
        center = collider.center
        if collider.kind == PLANE:
            height, px, py, pz = height_over(collider, probe, geometry.points, x, y, z)
            if height <= room:
                u = collider.axes
                count = note_plane(around, c, count, least_up, height, px, py, pz, u[3], u[4], u[5])
            continue
        shape = geometry.convex[1]
        load_convex(shape, collider, geometry.headers, center[0], center[1], center[2])
        probe.center[0], probe.center[1], probe.center[2] = x - center[0], y - center[1], z - center[2]
        count = touch_shape(around, c, shape, count, least_up, room, center[0], center[1], center[2])
    return count


@inner
def length_of(x, y, z):
    return math.sqrt(x * x + y * y + z * z)

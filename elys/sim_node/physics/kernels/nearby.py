"""Batches of questions about a place: which shapes overlap another one there, and what is closest to a point."""

from __future__ import annotations

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.cast import height_over
from elys.sim_node.physics.kernels.closest import point_to_solid
from elys.sim_node.physics.kernels.gjk import FAR, core_distance
from elys.sim_node.physics.kernels.midphase import has_parts
from elys.sim_node.physics.kernels.query_tree import NOTHING
from elys.sim_node.physics.kernels.support import load_convex
from elys.sim_node.physics.kernels.surface import overlaps_mesh, point_to_mesh
from elys.sim_node.physics.kernels.tables import PLANE, SPHERE


@inner
def squared_distance(box, base, x, y, z):
    """From a point to a child's box, 0 inside."""
    dx = max(box[base] - x, x - box[base + 3], 0.0)
    dy = max(box[base + 1] - y, y - box[base + 4], 0.0)
    dz = max(box[base + 2] - z, z - box[base + 5], 0.0)
    return dx * dx + dy * dy + dz * dz


@inner
def overlaps(probe, reach, collider, geometry, stack, bottom, x, y, z):
    """Whether a probe with its centre at (x, y, z) shares a point with a collider of any kind."""
    if has_parts(collider):
        return overlaps_mesh(probe, reach, collider, geometry, stack, bottom, x, y, z)
    if probe.kind == SPHERE:
        return point_to_solid(collider, geometry, x, y, z)[0] <= probe.radius
    if collider.kind == PLANE:
        return height_over(collider, probe, geometry.points, x, y, z)[0] <= 0.0
    center = collider.center
    shape = geometry.convex[1]
    load_convex(shape, collider, geometry.headers, center[0], center[1], center[2])
    probe.center[0], probe.center[1], probe.center[2] = x - center[0], y - center[1], z - center[2]
    return core_distance(probe, shape, geometry.points, FAR, geometry.simplex[0]) <= probe.radius + shape.radius


@kernel
def find_overlaps(colliders, geometry, nodes, chosen, own, stack, centers, probes, reaches, query, hit):
    """Which colliders share a point with shapes that stand at centers (R, 3).

    `probes` (R,) are the shapes, or one for all, and reaches (R, 3) or (1, 3) half the extents of their boxes. Writes query
    and collider in any order and returns how many there are, which may be more than the room for them.
    """
    found = 0
    for r in range(centers.shape[0]):
        x, y, z = centers[r, 0], centers[r, 1], centers[r, 2]
        p = r if probes.shape[0] > 1 else 0
        rx, ry, rz = reaches[p, 0], reaches[p, 1], reaches[p, 2]
        stack[0] = 0
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            box = nodes[node].box
            for side in range(2):
                base = 6 * side
                if box[base] > x + rx or box[base + 1] > y + ry or box[base + 2] > z + rz:
                    continue
                if box[base + 3] < x - rx or box[base + 4] < y - ry or box[base + 5] < z - rz:
                    continue
                child = nodes[node].child[side]
                if child >= 0:
                    stack[top] = child
                    top += 1
                    continue
                c = -1 - child
                collider = colliders[c]
                if chosen[c] == 0 or collider.body == own[r]:
                    continue
                if overlaps(probes[p], rx + ry + rz, collider, geometry, stack, top, x, y, z):
                    if found < hit.shape[0]:
                        query[found], hit[found] = r, c
                    found += 1
    return found


@kernel
def find_closest(
    colliders, geometry, nodes, chosen, own, stack, nearest, places, limits, hit, entity, distance, point, normal
):
    """The collider closest to each of the points `places` (R, 3), not farther than limits (R,).

    `stack` and `nearest` are room for the walk. Writes collider, its entity, distance
    [m], closest point and normal where there is one near enough.
    """
    for r in range(places.shape[0]):
        x, y, z = places[r, 0], places[r, 1], places[r, 2]
        limit = limits[r]
        stack[0] = 0
        nearest[0] = 0.0
        top = 1
        while top > 0:
            top -= 1
            # Rounding must not hide an equally far collider of a lower row.
            squared_limit = limit * limit * (1.0 + 1e-12)
            if nearest[top] > squared_limit:
                continue
            node = stack[top]
            if node < 0:
                c = -1 - node
                collider = colliders[c]
                if node == NOTHING or chosen[c] == 0 or collider.body == own[r]:
                    continue
                if has_parts(collider):
                    d, px, py, pz, nx, ny, nz = point_to_mesh(collider, geometry, stack, top, x, y, z, limit)
                else:
                    d, px, py, pz, nx, ny, nz = point_to_solid(collider, geometry, x, y, z)
                if d > limit or (d == limit and hit[r] >= 0 and hit[r] < c):
                    continue
                limit = d
                hit[r] = c
                entity[r] = collider.entity
                distance[r] = d
                point[r, 0], point[r, 1], point[r, 2] = px, py, pz
                normal[r, 0], normal[r, 1], normal[r, 2] = nx, ny, nz
                continue
            box = nodes[node].box
            first = squared_distance(box, 0, x, y, z)
            second = squared_distance(box, 6, x, y, z)
            side = 1 if first <= second else 0  # the nearer child goes on top
            for _ in range(2):
                squared = second if side == 1 else first
                if squared <= squared_limit:
                    stack[top] = nodes[node].child[side]
                    nearest[top] = squared
                    top += 1
                side = 1 - side

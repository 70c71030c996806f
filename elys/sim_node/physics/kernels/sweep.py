"""Continuous collision: what moved so far in a step that it may have passed through something is stopped where they met.

A body's path within the step is the straight line, and the shortest turn, from where it was to where the solver put it.
Along both paths of a pair the distance is divided by the fastest that it can shrink, and they go on by that
(conservative advancement, Mirtich 1996), until it is next to nothing. Both bodies stay where they met first, with their
velocities: the next step finds the contact and does the rest. What a stopped body does to the paths of others is found by
going over the pairs again.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.gjk import FAR, core_distance
from elys.sim_node.physics.kernels.integrator import publish_pose
from elys.sim_node.physics.kernels.midphase import has_parts
from elys.sim_node.physics.kernels.placement import lever, place_collider, thinness
from elys.sim_node.physics.kernels.rotation import multiplied, normalized
from elys.sim_node.physics.kernels.support import load_convex, load_triangle, support
from elys.sim_node.physics.kernels.tables import DYNAMIC, MESH, PLANE, STATIC

ADVANCES = 48  # steps along a path; few pairs need more than ten
ROUNDS = 4  # over all pairs: how far it is handed on that something was stopped


@inner
def body_on_path(body, start, t, out):
    """Where a body is at a fraction of its path, as a body of its own."""
    p = start.position
    q = start.rotation
    flip = 1.0
    if q[0] * body.rotation[0] + q[1] * body.rotation[1] + q[2] * body.rotation[2] + q[3] * body.rotation[3] < 0.0:
        flip = -1.0
    for k in range(3):
        out.position[k] = p[k] + t * (body.position[k] - p[k])
    x, y, z, w = (
        q[0] + t * (flip * body.rotation[0] - q[0]),
        q[1] + t * (flip * body.rotation[1] - q[1]),
        q[2] + t * (flip * body.rotation[2] - q[2]),
        q[3] + t * (flip * body.rotation[3] - q[3]),
    )
    out.rotation[0], out.rotation[1], out.rotation[2], out.rotation[3] = normalized(x, y, z, w)


@inner
def turned_on_path(body, start):
    """A bound of the angle by which a body turns on its path [rad]."""
    q = start.rotation
    r = body.rotation
    x, y, z, w = multiplied(r[0], r[1], r[2], r[3], -q[0], -q[1], -q[2], q[3])
    return math.pi * math.sqrt(x * x + y * y + z * z) if abs(w) < 1.0 else 0.0


@inner
def surface_distance(first, second, part, geometry):
    """Distance between two placed colliders [m], 0 where they overlap; a unit vector from first to second in the simplex."""
    a = geometry.convex[0]
    b = geometry.convex[1]
    simplex = geometry.simplex[0]
    points = geometry.points
    origin = second.center
    ox, oy, oz = origin[0], origin[1], origin[2]
    load_convex(b, second, geometry.headers, ox, oy, oz)
    if first.kind == PLANE:
        n = first.axes
        px, py, pz = support(b, points, -n[3], -n[4], -n[5])
        center = first.center
        height = (px + ox - center[0]) * n[3] + (py + oy - center[1]) * n[4] + (pz + oz - center[2]) * n[5]
        simplex.direction[0], simplex.direction[1], simplex.direction[2] = n[3], n[4], n[5]
        return max(height - b.radius, 0.0)
    if has_parts(first):
        load_triangle(a, first, geometry.headers[first.geometry], geometry.faces, points, part, ox, oy, oz)
        height = 0.0
        for k in range(3):
            height -= a.center[k] * a.axes[3 + k]
        if height <= 0.0 and first.kind == MESH:  # behind it, where nothing touches it
            return FAR
    else:
        load_convex(a, first, geometry.headers, ox, oy, oz)
    return max(core_distance(a, b, points, FAR, simplex) - a.radius - b.radius, 0.0)


@inner
def time_of_impact(pair, colliders, bodies, starts, fractions, places, shapes, geometry, near):
    """The fraction of the step at which a pair comes as close as `near`; 2 when it does not, or began closer."""
    flipped = colliders[pair.b].kind == PLANE or has_parts(colliders[pair.b])
    rows = (pair.b, pair.a) if flipped else (pair.a, pair.b)
    closing_turn = 0.0
    for side in range(2):
        collider = colliders[rows[side]]
        body = bodies[collider.body]
        shapes[side] = collider
        closing_turn += turned_on_path(body, starts[collider.body]) * lever(collider, starts[collider.body])
    first = bodies[colliders[rows[0]].body]
    second = bodies[colliders[rows[1]].body]
    start_a = starts[colliders[rows[0]].body]
    start_b = starts[colliders[rows[1]].body]
    frac_a = fractions[colliders[rows[0]].body]
    frac_b = fractions[colliders[rows[1]].body]
    t = 0.0
    for advance in range(ADVANCES):
        body_on_path(first, start_a, min(t, frac_a), places[0])
        body_on_path(second, start_b, min(t, frac_b), places[1])
        place_collider(places[0], shapes[0])
        place_collider(places[1], shapes[1])
        distance = surface_distance(shapes[0], shapes[1], pair.part, geometry)
        if distance <= near:
            return t if advance > 0 else 2.0
        n = geometry.simplex[0].direction
        closing = closing_turn
        for k in range(3):
            way_a = first.position[k] - start_a.position[k] if t < frac_a else 0.0
            way_b = second.position[k] - start_b.position[k] if t < frac_b else 0.0
            closing += (way_a - way_b) * n[k]
        if closing <= 0.0:
            return 2.0
        # Up to half of what must remain, so that the last advance ends.
        t += (distance - 0.5 * near) / closing
        if t >= 1.0:
            return 2.0
    return t


@inner
def ends_above(pair, colliders, bodies, starts, fractions, places, shapes, geometry):
    """Whether the middle of what met a triangle is in front of its face, by half its thickness, where its path ends.

    Then it was not gone through, and the solver has held it: so a ball rolls from one triangle of a road onto the next.
    """
    if not (has_parts(colliders[pair.a]) or has_parts(colliders[pair.b])):
        return False
    rows = (pair.b, pair.a) if has_parts(colliders[pair.b]) else (pair.a, pair.b)
    for side in range(2):
        collider = colliders[rows[side]]
        shapes[side] = collider
        body_on_path(bodies[collider.body], starts[collider.body], fractions[collider.body], places[side])
        place_collider(places[side], shapes[side])
    a = geometry.convex[0]
    b = geometry.convex[1]
    mesh = shapes[0]
    center = shapes[1].center
    x, y, z = center[0], center[1], center[2]
    load_triangle(a, mesh, geometry.headers[mesh.geometry], geometry.faces, geometry.points, pair.part, x, y, z)
    load_convex(b, shapes[1], geometry.headers, x, y, z)
    n = a.axes
    px, py, pz = support(b, geometry.points, -n[3], -n[4], -n[5])
    height = -b.radius
    height += (px - a.center[0]) * n[3] + (py - a.center[1]) * n[4] + (pz - a.center[2]) * n[5]
    return height > -0.5 * thinness(shapes[1])


@kernel
def stop_at_impacts(
    bodies, colliders, pairs, fast, fast_count, starts, fractions, poses, places, shapes, geometry, all_constants
):
    """Takes bodies back to where they first met something on the way; returns how many.

    Parameters: fast lists the pairs that may have missed each other, starts (N,) holds where bodies were when the step
    began; fractions (N,) is room, as are places and shapes of two rows.
    """
    near = 0.1 * all_constants[0].margin
    for f in range(fast_count):
        pair = pairs[fast[f]]
        for side in range(2):
            i = colliders[pair.a if side == 0 else pair.b].body
            fractions[i] = 1.0
            if bodies[i].motion == STATIC or bodies[i].asleep != 0:
                for k in range(3):
                    starts[i].position[k] = bodies[i].position[k]
                for k in range(4):
                    starts[i].rotation[k] = bodies[i].rotation[k]
    for _ in range(ROUNDS):
        quiet = True
        for f in range(fast_count):
            pair = pairs[fast[f]]
            a = colliders[pair.a].body
            b = colliders[pair.b].body
            t = time_of_impact(pair, colliders, bodies, starts, fractions, places, shapes, geometry, near)
            if t < 1.0 and ends_above(pair, colliders, bodies, starts, fractions, places, shapes, geometry):
                continue
            if bodies[a].motion == DYNAMIC and t < fractions[a]:
                fractions[a] = t
                quiet = False
            if bodies[b].motion == DYNAMIC and t < fractions[b]:
                fractions[b] = t
                quiet = False
        if quiet:
            break
    stopped = 0
    for f in range(fast_count):
        for side in range(2):
            i = colliders[pairs[fast[f]].a if side == 0 else pairs[fast[f]].b].body
            if fractions[i] < 1.0 and bodies[i].motion != STATIC:
                body_on_path(bodies[i], starts[i], fractions[i], places[0])
                for k in range(3):
                    bodies[i].position[k] = places[0].position[k]
                for k in range(4):
                    bodies[i].rotation[k] = places[0].rotation[k]
                publish_pose(bodies[i], poses[i])
                fractions[i] = 1.0
                stopped += 1
    return stopped

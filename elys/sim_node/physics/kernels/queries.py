"""Batches of questions about where shapes are, each answered by a walk down the query tree.

What is found does not depend on the tree: boxes are looked at with room for float32's rounding, shapes in float64, and of
equally far ones the lower row is first.
"""

from __future__ import annotations

import numpy as np

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.cast import cast_solid
from elys.sim_node.physics.kernels.midphase import has_parts
from elys.sim_node.physics.kernels.query_tree import ROUND_OUT
from elys.sim_node.physics.kernels.ray import MISS, ray_solid
from elys.sim_node.physics.kernels.surface import cast_at_mesh, ray_mesh

# Three roundings on the way to either side of a comparison, each of 2^-24.
_SLACK = np.float32(1.0 + 2.0**-20)
_ZERO = np.float32(0.0)
_NEVER = np.float32(3e38)
_STEEPEST = 1e18  # inverse of a direction's coordinate of 0


@inner
def near_and_far(origin, along, reach):
    """One coordinate of a ray as boxes see it: origins that make it enter too early and leave too late by what float32
    rounds and by `reach`, the inverse direction, and where the nearer side is in a box."""
    around = abs(origin) * ROUND_OUT + reach + 1e-30
    if along >= 0.0:
        inverse = min(1.0 / along, _STEEPEST)
        return np.float32(origin + around), np.float32(origin - around), np.float32(inverse), 0
    inverse = max(1.0 / along, -_STEEPEST)
    return np.float32(origin - around), np.float32(origin + around), np.float32(inverse), 3


@inner
def line_of(ox, oy, oz, dx, dy, dz, rx, ry, rz):
    """A ray as boxes see it, which are larger by `r` on every side."""
    nx, fx, ix, kx = near_and_far(ox, dx, rx)
    ny, fy, iy, ky = near_and_far(oy, dy, ry)
    nz, fz, iz, kz = near_and_far(oz, dz, rz)
    return nx, ny, nz, fx, fy, fz, ix, iy, iz, kx, ky, kz


@inner
def enter_box(box, base, line, limit):
    """Where a line enters a child's box, at the latest; _NEVER when it does not before the limit."""
    nx, ny, nz, fx, fy, fz, ix, iy, iz, kx, ky, kz = line
    enter = (box[base + kx] - nx) * ix
    y = (box[base + 1 + ky] - ny) * iy
    z = (box[base + 2 + kz] - nz) * iz
    enter = y if y > enter else enter
    enter = z if z > enter else enter
    enter = enter if enter > _ZERO else _ZERO
    leave = (box[base + 3 - kx] - fx) * ix
    y = (box[base + 4 - ky] - fy) * iy
    z = (box[base + 5 - kz] - fz) * iz
    leave = y if y < leave else leave
    leave = z if z < leave else leave
    leave = limit if limit < leave else leave
    return enter if enter <= leave * _SLACK else _NEVER


@inner
def single(limit):
    """A limit in float32, not below what it is."""
    return np.float32(min(limit * (1.0 + ROUND_OUT), 1e38))


@inner
def next_on_line(nodes, stack, entries, top, line, limit):
    """The next collider whose box a line enters before the limit, or -1, and how many nodes wait on the stack then."""
    while top > 0:
        top -= 1
        if entries[top] > limit:
            continue
        node = stack[top]
        while node >= 0:
            box = nodes[node].box
            first = enter_box(box, 0, line, limit)
            second = enter_box(box, 6, line, limit)
            side = 0 if first <= second else 1
            near, far = (first, second) if first <= second else (second, first)
            if near == _NEVER:
                break
            child = nodes[node].child
            if far < _NEVER:
                # The nearer child is gone into at once: what it hits spares the other.
                stack[top], entries[top] = child[1 - side], far
                top += 1
            node = child[side]
        if node < 0:
            return -1 - node, top
    return -1, 0


@kernel
def cast_rays(
    colliders,
    geometry,
    nodes,
    chosen,
    own,
    stack,
    entries,
    origins,
    directions,
    limits,
    every,
    query,
    hit,
    entity,
    distance,
    point,
    normal,
):
    """What rays meet: the first collider of each ray, or every one.

    Parameters: `nodes` of the query tree, `chosen` (C,) uint8 which colliders count, `own` (R,) a body whose colliders do
    not count for a ray, or -1; rays (R, 3) with unit directions and the farthest distance (R,) of each; `stack` and
    `entries` are room for the walk. Results by hit: its query (the ray), collider and its entity, distance [m], point [m] and
    surface normal. Without `every` there is one row for each ray, which is left alone where it meets nothing. With it they
    come in any order; returns how many there are, which may be more than the room for them: then the caller makes room and
    calls again.
    """
    found = 0
    for r in range(origins.shape[0]):
        ox, oy, oz = origins[r, 0], origins[r, 1], origins[r, 2]
        dx, dy, dz = directions[r, 0], directions[r, 1], directions[r, 2]
        line = line_of(ox, oy, oz, dx, dy, dz, 0.0, 0.0, 0.0)
        limit = limits[r]
        rough = single(limit)
        best = -1
        stack[0] = 0
        entries[0] = _ZERO
        top = 1
        while True:
            c, top = next_on_line(nodes, stack, entries, top, line, rough)
            if c < 0:
                break
            collider = colliders[c]
            if chosen[c] == 0 or collider.body == own[r]:
                continue
            if has_parts(collider):
                t, ux, uy, uz = ray_mesh(collider, geometry, stack, top, ox, oy, oz, dx, dy, dz, limit)
            else:
                t, ux, uy, uz = ray_solid(collider, geometry, ox, oy, oz, dx, dy, dz)
            if t == MISS or t > limit or (t == limit and best >= 0 and best < c):
                continue
            place = found if every else r
            found += 1
            if not every:
                limit = t
                rough = single(t)
                best = c
            if place < hit.shape[0]:
                query[place], hit[place], entity[place], distance[place] = r, c, collider.entity, t
                point[place, 0], point[place, 1], point[place, 2] = ox + t * dx, oy + t * dy, oz + t * dz
                normal[place, 0], normal[place, 1], normal[place, 2] = ux, uy, uz
    return found


@kernel
def cast_shapes(
    colliders,
    geometry,
    nodes,
    chosen,
    own,
    stack,
    entries,
    origins,
    directions,
    limits,
    probes,
    reaches,
    touches,
    every,
    query,
    hit,
    entity,
    distance,
    point,
    normal,
):
    """What moving shapes meet, as `cast_rays` has it, with the points of touch.

    `probes` (R,) are the shapes, or one for all, and reaches (R, 3) or (1, 3) half the extents of their boxes; `touches` is
    a row to work in.
    """
    touch = touches[0]
    found = 0
    for r in range(origins.shape[0]):
        ox, oy, oz = origins[r, 0], origins[r, 1], origins[r, 2]
        dx, dy, dz = directions[r, 0], directions[r, 1], directions[r, 2]
        p = r if probes.shape[0] > 1 else 0
        probe = probes[p]
        rx, ry, rz = reaches[p, 0], reaches[p, 1], reaches[p, 2]
        line = line_of(ox, oy, oz, dx, dy, dz, rx, ry, rz)
        limit = limits[r]
        rough = single(limit)
        best = -1
        stack[0] = 0
        entries[0] = _ZERO
        top = 1
        while True:
            c, top = next_on_line(nodes, stack, entries, top, line, rough)
            if c < 0:
                break
            collider = colliders[c]
            if chosen[c] == 0 or collider.body == own[r]:
                continue
            reach = rx + ry + rz
            if has_parts(collider):
                t = cast_at_mesh(probe, reach, collider, geometry, stack, top, ox, oy, oz, dx, dy, dz, limit, touch)
            else:
                t = cast_solid(probe, reach, collider, geometry, ox, oy, oz, dx, dy, dz, limit, touch)
            if t == MISS or t > limit or (t == limit and best >= 0 and best < c):
                continue
            place = found if every else r
            found += 1
            if not every:
                limit = t
                rough = single(t)
                best = c
            if place < hit.shape[0]:
                query[place], hit[place], entity[place], distance[place] = r, c, collider.entity, t
                for k in range(3):
                    point[place, k] = touch.point[k]
                    normal[place, k] = touch.normal[k]
    return found

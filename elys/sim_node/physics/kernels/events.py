"""What begins and what ends: contacts, and visits to triggers.

Each pair remembers in `touched` whether it touched when the last step ended. A step compares, and tells what is new. Pairs
that sleep are not looked at, so what they remember stays: sleeping ends nothing. The pairs of a collider with the parts of
a mesh stand together and are one contact, whichever part keeps it.
"""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.midphase import has_parts
from elys.sim_node.physics.kernels.parts import run_end
from elys.sim_node.physics.kernels.placement import place_collider, thinness
from elys.sim_node.physics.kernels.sleeping import AWAKE
from elys.sim_node.physics.kernels.sweep import surface_distance, time_of_impact
from elys.sim_node.physics.kernels.tables import DYNAMIC, MESH, PLANE, STATIC

# A resting gap is 0 give or take rounding, and rounding must not end a contact [m].
PARTED = 1e-6
NEAR = 1e-4  # how close to a trigger counts as a visit on the way through [m]


@inner
def touches(manifold, gap):
    """Whether any point of a manifold is closer than a gap after the step, or has carried an impulse in it."""
    real = False
    for k in range(manifold.point_count):
        real = real or manifold.separation[k] <= gap or manifold.step_impulse[k] > 0.0
    return real


@inner
def name_pair(out, colliders, bodies, a, b):
    """Writes the entities of two collider rows and of their bodies."""
    out.a = colliders[a].entity
    out.b = colliders[b].entity
    out.body_a = bodies[colliders[a].body].entity
    out.body_b = bodies[colliders[b].body].entity


@inner
def describe_contact(out, pairs, slots, begin, end, manifolds, first, second):
    """Writes the deepest point of the pairs in slots[begin:end], its normal, and the impulse of all; returns slot and point.

    The point lies in the middle between the surfaces, as the bodies stand.
    """
    out.impulse = 0.0
    out.depth = -math.inf
    slot = slots[begin]
    deepest = 0
    for q in range(begin, end):
        manifold = manifolds[slots[q]]
        for k in range(manifold.point_count):
            out.impulse += manifold.step_impulse[k]
            if -manifold.separation[k] > out.depth:
                out.depth = -manifold.separation[k]
                slot, deepest = slots[q], k
    manifold = manifolds[slot]
    for d in range(3):
        on_a = first.position[d] + manifold.anchors[6 * deepest + d]
        on_b = second.position[d] + manifold.anchors[6 * deepest + 3 + d]
        out.normal[d] = manifold.normal[d]
        out.point[d] = 0.5 * (on_a + on_b)
    return slot, deepest


@inner
def speed_of(body, d, rx, ry, rz):
    """Component d of the velocity of a body at a place r from its centre of mass."""
    v = body.velocity
    if d == 0:
        return v[0] + v[4] * rz - v[5] * ry
    if d == 1:
        return v[1] + v[5] * rx - v[3] * rz
    return v[2] + v[3] * ry - v[4] * rx


@inner
def touch_speed(first, second, manifold, k, gravity):
    """How fast point k of a manifold closes as it first touches: u at a gap s, sqrt(u^2 + 2 a s) after it [m/s].

    Bodies are as they were when the step began.
    """
    r = manifold.anchors
    at = 6 * k
    closing = gap = acceleration = 0.0
    weight_a = first.gravity_scale if first.motion == DYNAMIC else 0.0
    weight_b = second.gravity_scale if second.motion == DYNAMIC else 0.0
    for d in range(3):
        n = manifold.normal[d]
        of_a = speed_of(first, d, r[at], r[at + 1], r[at + 2])
        of_b = speed_of(second, d, r[at + 3], r[at + 4], r[at + 5])
        closing += n * (of_a - of_b)
        gap += n * (second.position[d] + r[at + 3 + d] - first.position[d] - r[at + d])
        acceleration += n * gravity[d] * (weight_a - weight_b)
    if gap <= 0.0:
        return max(closing, 0.0)
    return math.sqrt(max(closing * closing + 2.0 * acceleration * gap, 0.0))


@inner
def begin_contact(out, bodies, colliders, pairs, watched, begin, end, manifolds, solver_bodies, gravity):
    """Describes a contact that has begun in a step that is solved and not yet finished: bodies stand where it began."""
    pair = pairs[watched[begin]]
    i = colliders[pair.a].body
    j = colliders[pair.b].body
    slot, k = describe_contact(out, pairs, watched, begin, end, manifolds, bodies[i], bodies[j])
    out.speed = touch_speed(bodies[i], bodies[j], manifolds[slot], k, gravity)
    for d in range(3):
        moved = solver_bodies[i].displacement[d] if bodies[i].held != 0 else 0.0
        moved += solver_bodies[j].displacement[d] if bodies[j].held != 0 else 0.0
        out.point[d] += 0.5 * moved
    name_pair(out, colliders, bodies, pair.a, pair.b)


@kernel
def track_contacts(
    bodies, colliders, pairs, watched, watched_count, manifolds, solver_bodies, begun, ended, all_constants
):
    """Finds the contacts that a solved step has begun and ended, before it moves the bodies; returns how many of each.

    Parameters: watched (P,) int32 lists the slots of pairs that touch or did, sorted; begun (P,) TOUCH and ended (P,) MEETING
    take what is found.
    """
    gravity = all_constants[0].gravity
    begun_count = 0
    ended_count = 0
    begin = 0
    while begin < watched_count:
        end = run_end(pairs, watched, begin, watched_count)
        was = False
        for q in range(begin, end):
            was = was or pairs[watched[q]].touched != 0
        now = False
        for q in range(begin, end):
            real = touches(manifolds[watched[q]], PARTED if was else 0.0)
            pairs[watched[q]].touched = 1 if real else 0
            now = now or real
        if now and not was:
            out = begun[begun_count]
            begin_contact(out, bodies, colliders, pairs, watched, begin, end, manifolds, solver_bodies, gravity)
            begun_count += 1
        elif was and not now:
            name_pair(ended[ended_count], colliders, bodies, pairs[watched[begin]].a, pairs[watched[begin]].b)
            ended_count += 1
        begin = end
    return begun_count, ended_count


@kernel
def describe_contacts(bodies, colliders, pairs, slots, count, manifolds, out):
    """Describes the contacts of the first `count` of slots, sorted; returns how many they are, one for each two colliders."""
    found = 0
    begin = 0
    while begin < count:
        end = run_end(pairs, slots, begin, count)
        pair = pairs[slots[begin]]
        first = bodies[colliders[pair.a].body]
        second = bodies[colliders[pair.b].body]
        describe_contact(out[found], pairs, slots, begin, end, manifolds, first, second)
        name_pair(out[found], colliders, bodies, pair.a, pair.b)
        out[found].speed = 0.0
        found += 1
        begin = end
    return found


@inner
def overlap(bodies, colliders, pair, shapes, geometry):
    """Whether two colliders overlap as their bodies stand now, which may be elsewhere than where colliders were placed."""
    flipped = colliders[pair.b].kind == PLANE or has_parts(colliders[pair.b])
    shapes[0] = colliders[pair.b if flipped else pair.a]
    shapes[1] = colliders[pair.a if flipped else pair.b]
    place_collider(bodies[shapes[0].body], shapes[0])
    place_collider(bodies[shapes[1].body], shapes[1])
    if shapes[0].kind < MESH:
        squared = 0.0
        for k in range(3):
            away = shapes[1].center[k] - shapes[0].center[k]
            squared += away * away
        reach = shapes[0].reach + shapes[1].reach
        if squared > reach * reach:
            return False
    return surface_distance(shapes[0], shapes[1], pair.part, geometry) <= 0.0


@inner
def name_visit(out, colliders, bodies, pair):
    """Writes a trigger as a, and what is in it as b."""
    if colliders[pair.a].trigger != 0:
        name_pair(out, colliders, bodies, pair.a, pair.b)
    else:
        name_pair(out, colliders, bodies, pair.b, pair.a)


@inner
def stay_put(bodies, colliders, pair, starts, fractions):
    """Says of the bodies of a pair that they go their whole way, and of one that does not move that it was where it is."""
    for side in range(2):
        i = colliders[pair.a if side == 0 else pair.b].body
        fractions[i] = 1.0
        if bodies[i].motion == STATIC or bodies[i].asleep != AWAKE:
            for k in range(3):
                starts[i].position[k] = bodies[i].position[k]
            for k in range(4):
                starts[i].rotation[k] = bodies[i].rotation[k]


@inner
def passes(bodies, colliders, pair, starts, fractions, places, shapes, geometry):
    """Whether two colliders that are apart met on the way of the step: they moved farther than they are thick."""
    stay_put(bodies, colliders, pair, starts, fractions)
    a = colliders[pair.a]
    b = colliders[pair.b]
    squared = 0.0
    for k in range(3):
        way = bodies[b.body].position[k] - starts[b.body].position[k]
        way -= bodies[a.body].position[k] - starts[a.body].position[k]
        squared += way * way
    thin = thinness(a) + thinness(b)
    if squared <= thin * thin:
        return False
    return time_of_impact(pair, colliders, bodies, starts, fractions, places, shapes, geometry, NEAR) <= 1.0


@kernel
def track_triggers(
    bodies,
    colliders,
    pairs,
    watched,
    watched_count,
    starts,
    fractions,
    places,
    shapes,
    geometry,
    entered,
    exited,
):
    """Finds what has entered and left triggers now that bodies have moved; returns how many of each.

    What went through one within the step has done both. Parameters: watched (P,) int32 lists the slots of awake pairs with a
    trigger, sorted; starts (N,) holds where bodies were when the step began; fractions (N,) is room, as are places and shapes
    of two rows; entered and exited (P,) MEETING take what is found.
    """
    entered_count = 0
    exited_count = 0
    begin = 0
    while begin < watched_count:
        end = run_end(pairs, watched, begin, watched_count)
        was = False
        now = False
        for q in range(begin, end):
            pair = pairs[watched[q]]
            was = was or pair.touched != 0
            inside = overlap(bodies, colliders, pair, shapes, geometry)
            pair.touched = 1 if inside else 0
            now = now or inside
        through = False
        if not was and not now:
            for q in range(begin, end):
                through = through or passes(
                    bodies, colliders, pairs[watched[q]], starts, fractions, places, shapes, geometry
                )
        if (now and not was) or through:
            name_visit(entered[entered_count], colliders, bodies, pairs[watched[begin]])
            entered_count += 1
        if (was and not now) or through:
            name_visit(exited[exited_count], colliders, bodies, pairs[watched[begin]])
            exited_count += 1
        begin = end
    return entered_count, exited_count

"""Where colliders touch: one function for each pair of shapes, chosen here."""

from __future__ import annotations

import math

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.box_box import box_box
from elys.sim_node.physics.kernels.capsule import capsule_capsule, sphere_capsule
from elys.sim_node.physics.kernels.convex import convex_convex, plane_convex, triangle_convex
from elys.sim_node.physics.kernels.manifold import follow_motion, forget_contact, write_manifold
from elys.sim_node.physics.kernels.midphase import has_parts
from elys.sim_node.physics.kernels.parts import choose_hosts, gather, hosted_by, run_end, take_cluster
from elys.sim_node.physics.kernels.prefetching import prefetch
from elys.sim_node.physics.kernels.sleeping import AWAKE, WAKING, disturbs
from elys.sim_node.physics.kernels.sphere import box_sphere, sphere_sphere
from elys.sim_node.physics.kernels.tables import BOX, CAPSULE, CYLINDER, DYNAMIC, PLANE, SPHERE, TRIGGER

AHEAD = 4  # so many pairs ahead memory is asked for
SETTLED = -1.0
HARDLY = 1e-3  # turn after which the contact of something round is looked for anew [rad]


@inner
def pair_margin(a, b, constants):
    """Gap up to which two colliders, given by their proxies, may touch within this step.

    What approaches fast is looked for from farther away, so that it is stopped at the surface and not inside; but never
    from farther than the smaller shape is large: that would make it hit things that it passes by. Second comes whether one
    may even be through the other by then.
    """
    squared = 0.0
    for k in range(3):
        relative = b.velocity[k] - a.velocity[k]
        squared += relative * relative
    way = constants.time * math.sqrt(squared) + a.turning + b.turning
    if not way >= 0.0:  # a velocity that is no number must not end the contacts of whoever it touches
        way = 0.0
    return constants.margin + min(way, a.reach, b.reach), way > a.thinness + b.thinness


@inner
def boxes_apart(a, b, margin):
    """Whether the smallest boxes of two colliders are farther apart than the margin: most pairs are, and need no more."""
    apart = False
    for k in range(3):
        apart = apart or a[k] - margin > b[3 + k] or b[k] - margin > a[3 + k]
    return apart


@inner
def move_points(found, count, origin, flipped):
    """Brings points that are relative to an origin into world space, and turns the normal round where asked."""
    point = found.point
    for k in range(count):
        point[3 * k] += origin[0]
        point[3 * k + 1] += origin[1]
        point[3 * k + 2] += origin[2]
    if flipped:
        turn_round(found.normal)
    return count


@inner
def turn_round(vector):
    vector[0], vector[1], vector[2] = -vector[0], -vector[1], -vector[2]


@inner
def set_hint(found, manifold):
    """Offers the manifold's normal, if it has contact, as the direction to look in."""
    hint = found.hint
    scale = 0.0
    if manifold.point_count > 0:
        n = manifold.normal
        scale = 1.0 / math.sqrt(float(n[0]) * n[0] + float(n[1]) * n[1] + float(n[2]) * n[2])
    for k in range(3):
        hint[k] = scale * manifold.normal[k]


@inner
def collide(colliders, a, b, part, margin, found, geometry):
    """Contact points of colliders a and b, one of them no box or ball, no farther apart than the margin; returns how many.

    `found` gets the normal from a to b and up to four points, in the middle between the surfaces, with their separations
    and features. `part` is the triangle where one of the two is a mesh or a height field.
    """
    first = colliders[a]
    second = colliders[b]
    # By kind, so that half the pairs need no function.
    flipped = first.kind > second.kind
    if flipped:
        first = colliders[b]
        second = colliders[a]
    kind = second.kind
    if kind == CAPSULE and first.kind == SPHERE:
        count = sphere_capsule(first, second, margin, found)
    elif kind == CAPSULE and first.kind == CAPSULE:
        count = capsule_capsule(first, second, margin, found)
    elif kind == PLANE:
        count = plane_convex(second, first, margin, found, geometry)
        return move_points(found, count, first.center, not flipped)
    elif has_parts(second):
        count = triangle_convex(second, part, first, margin, found, geometry)
        return move_points(found, count, first.center, not flipped)
    else:
        if flipped:
            turn_round(found.hint)
        count = convex_convex(first, second, margin, found, geometry)
        return move_points(found, count, first.center, flipped)
    if flipped:
        turn_round(found.normal)
    return count


@inner
def must_refresh(first, second, a, b, manifold, margin, constants):
    """Whether a manifold does not describe any more how two bodies meet. Writes how they have moved since it was made.

    The point of contact of what is round wanders as it turns, so that hardly any turn is too much; balls are met so
    quickly that theirs is always made anew.
    """
    if a.kind == SPHERE or b.kind == SPHERE or not follow_motion(first, second, manifold, margin, constants):
        return True
    turned = 0.0
    if is_round(a):
        turned = turned_by(manifold.turn_a)
    if is_round(b):
        turned = max(turned, turned_by(manifold.turn_b))
    return turned > HARDLY * HARDLY


@inner
def is_round(collider):
    return collider.kind == CAPSULE or collider.kind == CYLINDER


@inner
def turned_by(turn):
    return turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]


@inner
def update_parts(first, second, colliders, pairs, active, begin, end, manifolds, found, geometry, margin, constants):
    """Brings the manifolds of a collider with the parts of a mesh up to date; whether any has got or lost points."""
    row_a = pairs[active[begin]].a
    row_b = pairs[active[begin]].b
    a = colliders[row_a]
    b = colliders[row_b]
    is_stale = False
    for q in range(begin, end):
        is_stale = must_refresh(first, second, a, b, manifolds[active[q]], margin, constants) or is_stale
    if not is_stale:
        return False
    clusters = geometry.clusters
    cluster_count = 0
    for q in range(begin, end):
        count = collide(colliders, row_a, row_b, pairs[active[q]].part, margin, found, geometry)
        if count > 0:
            cluster_count = gather(clusters, cluster_count, found, count, q, margin)
    choose_hosts(clusters, cluster_count, active, begin, end, manifolds)
    is_changed = False
    for q in range(begin, end):
        manifold = manifolds[active[q]]
        before = manifold.point_count
        at = hosted_by(clusters, cluster_count, q)
        count = take_cluster(clusters[at], found) if at >= 0 else 0
        write_manifold(first, second, a, b, manifold, found, count, margin, constants)
        is_changed = is_changed or count != before
    return is_changed


@inner
def is_held(body):
    """Whether contacts have an effect on a body now."""
    return body.motion == DYNAMIC and body.asleep == AWAKE


@inner
def wake_touched(first, second):
    """Marks the one of two touching bodies that the other wakes; whether there is one."""
    if disturbs(first, second):
        second.asleep = WAKING
        return True
    if disturbs(second, first):
        first.asleep = WAKING
        return True
    return False


@inner
def look_at_pairs(proxies, pairs, active, active_count, manifolds, constants, near, margins, fast, triggers):
    """Sorts out the active pairs: which are near each other, which so fast that they may miss each other, which triggers'.

    Returns how many of each stand in `near`, `fast` and `triggers`, and whether any manifold lost its points: of colliders far
    from each other it is emptied here. `margins` gets the gap up to which those near may touch, SETTLED where nothing is left to
    do: a pair that touched in the last step is listed all the same.
    """
    near_count = 0
    fast_count = 0
    trigger_count = 0
    is_changed = False
    for p in range(active_count):
        slot = active[p]
        pair = pairs[slot]
        a = proxies[pair.a]
        b = proxies[pair.b]
        special = a.special | b.special
        if special & TRIGGER:
            triggers[trigger_count] = slot
            trigger_count += 1
            continue
        margin, is_fast = pair_margin(a, b, constants)
        if is_fast:
            fast[fast_count] = slot
            fast_count += 1
        if special == 0 and boxes_apart(a.box, b.box, margin):
            if pair.blank == 0:
                manifold = manifolds[slot]
                is_changed = is_changed or manifold.point_count > 0
                forget_contact(manifold)
                manifold.margin = -1.0
                pair.blank = 1
            if pair.touched == 0:
                continue
            margin = SETTLED
        near[near_count] = slot
        margins[near_count] = margin
        near_count += 1
    return near_count, fast_count, trigger_count, is_changed


@inner
def prefetch_pair(bodies, colliders, pairs, manifolds, slot):
    pair = pairs[slot]
    prefetch(manifolds, slot)
    prefetch(colliders, pair.b)
    prefetch(bodies, colliders[pair.b].body)


@inner
def box_or_sphere(colliders, a, b, margin, found):
    """`collide` for boxes and balls."""
    first = colliders[a]
    second = colliders[b]
    if first.kind == BOX and second.kind == BOX:
        return box_box(colliders, a, b, margin, found)
    if first.kind == BOX:
        return box_sphere(first, second, margin, found)
    if second.kind == SPHERE:
        return sphere_sphere(first, second, margin, found)
    count = box_sphere(second, first, margin, found)
    turn_round(found.normal)
    return count


@kernel
def update_simple_manifolds(
    bodies,
    colliders,
    proxies,
    pairs,
    active,
    active_count,
    near,
    margins,
    manifolds,
    all_found,
    all_constants,
    touching,
    fast,
    watched,
    triggers,
):
    """`update_manifolds` for worlds of boxes and balls alone: it is compiled three times as fast."""
    constants = all_constants[0]
    found = all_found[0]
    near_count, fast_count, trigger_count, is_changed = look_at_pairs(
        proxies, pairs, active, active_count, manifolds, constants, near, margins, fast, triggers
    )
    touching_count = 0
    watched_count = 0
    is_woken = False
    for p in range(near_count):
        if p + AHEAD < near_count:
            prefetch_pair(bodies, colliders, pairs, manifolds, near[p + AHEAD])
        slot = near[p]
        margin = margins[p]
        pair = pairs[slot]
        a = colliders[pair.a]
        b = colliders[pair.b]
        first = bodies[a.body]
        second = bodies[b.body]
        manifold = manifolds[slot]
        before = manifold.point_count
        if margin >= 0.0 and must_refresh(first, second, a, b, manifold, margin, constants):
            count = box_or_sphere(colliders, pair.a, pair.b, margin, found)
            write_manifold(first, second, a, b, manifold, found, count, margin, constants)
            pair.blank = 0
        is_changed = is_changed or manifold.point_count != before
        is_acting = False
        if manifold.point_count > 0:
            is_woken = wake_touched(first, second) or is_woken
            is_acting = is_held(first) or is_held(second)
        if is_acting:
            touching[touching_count] = slot
            touching_count += 1
        if is_acting or pair.touched != 0:
            watched[watched_count] = slot
            watched_count += 1
    return touching_count, is_changed, fast_count, is_woken, watched_count, trigger_count


@kernel
def update_manifolds(
    bodies,
    colliders,
    proxies,
    pairs,
    active,
    active_count,
    near,
    margins,
    manifolds,
    all_found,
    geometry,
    all_constants,
    touching,
    fast,
    watched,
    triggers,
):
    """Brings the manifold of every active pair up to date; returns how many have contact, their slots listed in `touching`.

    Second comes whether any manifold has got or lost points, third how many pairs are so fast that they may miss each other
    within the step: those are listed in `fast`. Fourth comes whether anything asleep was touched and marked to be woken,
    then how many pairs touch or did in the last step, listed in `watched`, and how many have a trigger, which are listed in
    `triggers` and nowhere else: they push nothing and wake nobody. `near` and `margins` are room for all active pairs.
    """
    constants = all_constants[0]
    found = all_found[0]
    near_count, fast_count, trigger_count, is_changed = look_at_pairs(
        proxies, pairs, active, active_count, manifolds, constants, near, margins, fast, triggers
    )
    touching_count = 0
    watched_count = 0
    is_woken = False
    parts_end = 0
    for p in range(near_count):
        if p + AHEAD < near_count:
            prefetch_pair(bodies, colliders, pairs, manifolds, near[p + AHEAD])
        slot = near[p]
        margin = margins[p]
        pair = pairs[slot]
        a = colliders[pair.a]
        b = colliders[pair.b]
        first = bodies[a.body]
        second = bodies[b.body]
        manifold = manifolds[slot]
        before = manifold.point_count
        if has_parts(a) or has_parts(b):
            if p >= parts_end:
                parts_end = run_end(pairs, near, p, near_count)
                part_changed = update_parts(
                    first, second, colliders, pairs, near, p, parts_end, manifolds, found, geometry, margin, constants
                )
                is_changed = is_changed or part_changed
        elif margin >= 0.0 and must_refresh(first, second, a, b, manifold, margin, constants):
            if a.kind <= SPHERE and b.kind <= SPHERE:
                count = box_or_sphere(colliders, pair.a, pair.b, margin, found)
            else:  # geometry is many values to hand over: only where it is needed
                set_hint(found, manifold)
                count = collide(colliders, pair.a, pair.b, pair.part, margin, found, geometry)
            write_manifold(first, second, a, b, manifold, found, count, margin, constants)
            pair.blank = 0
        is_changed = is_changed or manifold.point_count != before
        is_acting = False
        if manifold.point_count > 0:
            is_woken = wake_touched(first, second) or is_woken
            is_acting = is_held(first) or is_held(second)
        if is_acting:
            touching[touching_count] = slot
            touching_count += 1
        if is_acting or pair.touched != 0:
            watched[watched_count] = slot
            watched_count += 1
    return touching_count, is_changed, fast_count, is_woken, watched_count, trigger_count

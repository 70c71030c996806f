"""Pairs kept from step to step, and changed only where something moved.

A pair stands in a slot of its own, with its manifold. Those that a step has to look at, where at least one body is awake, are
listed in `active`, sorted by (a, b, part). What sleeps is in no list: no step walks over its pairs.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.broadphase import comes_before
from elys.sim_node.physics.kernels.tables import DYNAMIC, KINEMATIC, POINTS


@inner
def sort_slots(pairs, slots, count, room):
    """Sorts slots by their pairs: merge sort from below, in `room` as long as `slots`."""
    width = 1
    while width < count:
        for start in range(0, count, 2 * width):
            middle = min(start + width, count)
            end = min(start + 2 * width, count)
            left = start
            right = middle
            for place in range(start, end):
                takes_left = right >= end or (
                    left < middle and not comes_before(pairs[slots[right]], pairs[slots[left]])
                )
                if takes_left:
                    room[place] = slots[left]
                    left += 1
                else:
                    room[place] = slots[right]
                    right += 1
        for place in range(count):
            slots[place] = room[place]
        width *= 2


@inner
def clear_manifold(manifold):
    manifold.point_count = 0
    manifold.margin = -1.0
    manifold.load = 0.0
    manifold.impulse_time = 0.0
    manifold.twist_impulse = 0.0
    for k in range(3):
        manifold.friction_impulse[k] = 0.0
        manifold.rolling_impulse[k] = 0.0
    for k in range(POINTS):
        manifold.normal_impulse[k] = 0.0
        manifold.step_impulse[k] = 0.0


@inner
def are_neighbours(p, q):
    """Whether two pairs are of the same colliders, one of them a mesh."""
    return p.a == q.a and p.b == q.b


@inner
def heir_of(pairs, active, p, active_count, kept):
    """The place in `active` of a neighbour in the run of a pair that ends, -1 when it is the last of its run."""
    if p + 1 < active_count and are_neighbours(pairs[active[p + 1]], pairs[active[p]]):
        return p + 1
    if kept > 0 and are_neighbours(pairs[active[kept - 1]], pairs[active[p]]):
        return kept - 1
    return -1


@inner
def pass_on(pairs, manifolds, active, p, heir):
    """Before a pair with a part of a mesh ends, a neighbour in its run takes over the contact that it keeps for them.

    The two exchange their slots, and with them their manifolds. What has its own takes over that they touched.
    """
    slot = active[p]
    other = active[heir]
    if manifolds[slot].point_count > 0 and manifolds[other].point_count == 0:
        part = pairs[slot].part
        pairs[slot].part = pairs[other].part
        pairs[other].part = part
        active[heir] = slot
        active[p] = other
    if pairs[active[p]].touched != 0:
        pairs[active[p]].touched = 0
        pairs[active[heir]].touched = 1


@kernel
def compare_pairs(
    found,
    found_count,
    moved,
    moved_count,
    is_moved,
    pairs,
    manifolds,
    active,
    active_count,
    sleeping,
    sleeping_count,
    entries,
    free,
    free_count,
):
    """Ends the active pairs of moved colliders that were not found again, and picks out those found that are new.

    Returns how many active pairs are kept, and how many are new: those come to stand first in `found`, each with the place
    in `active` before which it belongs in `entries`. `sleeping` lists pairs with nobody awake, sorted, where such may have
    been found; `free[: free_count[0]]` are the unused slots, and `is_moved` is zero afterwards.
    """
    kept = 0
    new_count = 0
    f = 0
    s = 0
    for p in range(active_count + 1):
        while f < found_count and (p == active_count or comes_before(found[f], pairs[active[p]])):
            while s < sleeping_count and comes_before(pairs[sleeping[s]], found[f]):
                s += 1
            if s == sleeping_count or comes_before(found[f], pairs[sleeping[s]]):
                found[new_count] = found[f]
                entries[new_count] = kept
                new_count += 1
            f += 1
        if p == active_count:
            break
        slot = active[p]
        pair = pairs[slot]
        if f < found_count and not comes_before(pair, found[f]):
            f += 1
        elif is_moved[pair.a] | is_moved[pair.b]:
            heir = heir_of(pairs, active, p, active_count, kept)
            if heir >= 0:
                pass_on(pairs, manifolds, active, p, heir)
                slot = active[p]
            if pairs[slot].touched == 0:  # else it stays until this step has told of its end
                pairs[slot].a = -1
                free[free_count[0]] = slot
                free_count[0] += 1
                continue
        active[kept] = slot
        kept += 1
    for m in range(moved_count):
        is_moved[moved[m]] = 0
    return kept, new_count


@kernel
def enter_pairs(new, new_count, entries, pairs, manifolds, active, active_count, free, free_count):
    """Enters the first `new_count` pairs into unused slots and, where `entries` says, between the active ones."""
    last = active_count
    for q in range(new_count - 1, -1, -1):
        free_count[0] -= 1
        slot = free[free_count[0]]
        pairs[slot] = new[q]
        clear_manifold(manifolds[slot])
        for p in range(last - 1, entries[q] - 1, -1):
            active[p + q + 1] = active[p]
        last = entries[q]
        active[last + q] = slot


@inner
def is_active(bodies, colliders, pair):
    """Whether a step has to look at a pair: something in it is awake and may come to push or be pushed."""
    for side in range(2):
        body = bodies[colliders[pair.a if side == 0 else pair.b].body]
        if body.motion == KINEMATIC or (body.motion == DYNAMIC and body.asleep == 0):
            return True
    return False


@kernel
def list_pairs(bodies, colliders, pairs, wanted, listed, room):
    """Lists the slots of all pairs that a step has to look at, or with `wanted` False of the others, sorted; returns how many."""
    count = 0
    for slot in range(1, pairs.shape[0]):
        if pairs[slot].a >= 0 and is_active(bodies, colliders, pairs[slot]) == wanted:
            listed[count] = slot
            count += 1
    sort_slots(pairs, listed, count, room)
    return count

"""Which colliders may touch: pairs of overlapping fat boxes, kept from step to step and changed only where something moved.

Those that a step has to look at, where at least one body is awake, stand in `active`, sorted by (a, b, part), whatever the
tree and the table look like: the order of impulses must not depend on them.
"""

from __future__ import annotations

import numpy as np

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.midphase import has_parts, local_interval, meets_part, next_part, still_near
from elys.sim_node.physics.kernels.pair_table import EMPTY, find_pair, insert_pair, remove_pair
from elys.sim_node.physics.kernels.simd import LANES, lowest_bit
from elys.sim_node.physics.kernels.tables import DYNAMIC, KINEMATIC, MESH, NOTICES_ALL, POINTS, SOLID, STATIC
from elys.sim_node.physics.kernels.tree import LEAF
from elys.sim_node.physics.kernels.wide_tree import BLOCK, MOST_LEVELS, overlapping_lanes, splat_box


@inner
def boxes_overlap(a, b):
    return (a[0] <= b[3]) & (b[0] <= a[3]) & (a[1] <= b[4]) & (b[1] <= a[4]) & (a[2] <= b[5]) & (b[2] <= a[5])


@inner
def notices(bodies, trigger, other):
    """Whether a trigger is told of another collider: a solid one that moves, and if so chosen what it comes upon itself."""
    if trigger.trigger == SOLID or other.trigger != SOLID:
        return False
    if trigger.kind >= MESH and other.kind >= MESH:  # nothing says where two of these overlap
        return False
    if bodies[other.body].motion != STATIC:
        return True
    return trigger.trigger == NOTICES_ALL and bodies[trigger.body].motion != STATIC


@inner
def may_collide(bodies, a, b):
    """Whether two colliders are worth a pair: of two bodies, at least one of which can be pushed, in layers that meet.

    Or one is a trigger that notices the other.
    """
    if a.body == b.body:
        return False
    if (a.layer & b.mask) == 0 or (b.layer & a.mask) == 0:
        return False
    if a.trigger != SOLID or b.trigger != SOLID:
        return notices(bodies, a, b) or notices(bodies, b, a)
    return bodies[a.body].motion == DYNAMIC or bodies[b.body].motion == DYNAMIC


@inner
def is_unpaired(unpaired, first, second):
    """Whether two bodies are held by a joint that lets them not collide: a search in sorted keys."""
    if unpaired.shape[0] == 0:
        return False
    key = (np.int64(min(first, second)) << 32) + max(first, second)
    low = 0
    high = unpaired.shape[0]
    while low < high:
        middle = (low + high) // 2
        if unpaired[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low < unpaired.shape[0] and unpaired[low] == key


@inner
def add_new(pairs, table, a, b, part, new, found):
    """Notes a pair unless it is known; returns how many are noted now."""
    if find_pair(pairs, table, a, b, part) != EMPTY:
        return found
    if found < new.shape[0]:
        new[found].a = a
        new[found].b = b
        new[found].part = part
    return found + 1


@inner
def add_parts(colliders, mesh_row, other_row, pairs, table, new, found, geometry, stack, bottom):
    """Notes the pairs of a collider with the triangles near it; returns how many pairs are noted now."""
    mesh = colliders[mesh_row]
    box = colliders[other_row].fat_box
    a = min(mesh_row, other_row)
    b = max(mesh_row, other_row)
    x0, x1 = local_interval(mesh, box, 0)
    y0, y1 = local_interval(mesh, box, 1)
    z0, z1 = local_interval(mesh, box, 2)
    stack[bottom] = 1
    top = bottom + 1
    count = geometry.headers[mesh.geometry].face_count
    while True:
        first, top = next_part(mesh, x0, x1, y0, y1, z0, z1, geometry, stack, bottom, top)
        if first < 0:
            return found
        for part in range(first, min(count, first + LEAF)):
            if meets_part(mesh, part, box, geometry):
                found = add_new(pairs, table, a, b, part, new, found)


@inner
def meet(bodies, colliders, i, j, geometry, pairs, table, unpaired, new, found, stack, top):
    """Notes the pairs of two colliders whose boxes may overlap, the first of which moved; returns how many there are now."""
    collider = colliders[i]
    other = colliders[j]
    if j == i or (j < i and other.moved != 0):  # two that moved are found from the smaller one
        return found
    if not boxes_overlap(other.fat_box, collider.fat_box) or not may_collide(bodies, collider, other):
        return found
    if is_unpaired(unpaired, collider.body, other.body):
        return found
    if has_parts(other):
        return add_parts(colliders, j, i, pairs, table, new, found, geometry, stack, top)
    if has_parts(collider):
        return add_parts(colliders, i, j, pairs, table, new, found, geometry, stack, top)
    if still_near(collider, other, 0, geometry):
        return add_new(pairs, table, min(i, j), max(i, j), 0, new, found)
    return found


@kernel
def find_new_pairs(
    bodies, colliders, moved, moved_count, leaves, blocks, levels, level_count, geometry, pairs, table, unpaired, new, stack
):
    """Writes the pairs that moved colliders have gained, in any order; returns how many there are.

    When there are more than `new` can take the rest is only counted: the caller makes room and calls again. `leaves`,
    `blocks` and `levels` are the wide tree over all fat boxes, `unpaired` the sorted keys of bodies that do not collide.
    """
    found = 0
    for m in range(moved_count):
        i = moved[m]
        collider = colliders[i]
        low_x, low_y, low_z, high_x, high_y, high_z = splat_box(collider.fat_box)
        # On the stack: a block's place in its level, and the level.
        stack[0] = level_count - 1
        top = 1
        while top > 0:
            top -= 1
            level = stack[top] % MOST_LEVELS
            block = stack[top] // MOST_LEVELS
            at = (levels[level] + block) * BLOCK
            bits = overlapping_lanes(blocks, at, low_x, low_y, low_z, high_x, high_y, high_z)
            while bits != 0:
                child = block * LANES + lowest_bit(bits)
                bits &= bits - 1
                if level > 0:
                    stack[top] = child * MOST_LEVELS + level - 1
                    top += 1
                else:
                    j = leaves[child].order
                    found = meet(bodies, colliders, i, j, geometry, pairs, table, unpaired, new, found, stack, top)
    return found


@inner
def comes_before(p, q):
    """Whether a pair stands before another: by a, then b, then part."""
    if p.a != q.a:
        return p.a < q.a
    if p.b != q.b:
        return p.b < q.b
    return p.part < q.part


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
def pass_on(pairs, manifolds, table, active, p, heir):
    """Before a pair with a part of a mesh ends, a neighbour in its run takes over the contact that it keeps for them.

    The two exchange their slots, and with them their manifolds. What has its own takes over that they touched.
    """
    slot = active[p]
    other = active[heir]
    if manifolds[slot].point_count > 0 and manifolds[other].point_count == 0:
        remove_pair(pairs, table, slot)
        remove_pair(pairs, table, other)
        part = pairs[slot].part
        pairs[slot].part = pairs[other].part
        pairs[other].part = part
        insert_pair(pairs, table, slot)
        insert_pair(pairs, table, other)
        active[heir] = slot
        active[p] = other
    if pairs[active[p]].touched != 0:
        pairs[active[p]].touched = 0
        pairs[active[heir]].touched = 1


@kernel
def change_pairs(
    colliders,
    moved,
    moved_count,
    geometry,
    pairs,
    manifolds,
    table,
    active,
    active_count,
    new,
    new_count,
    slots,
    room,
    free,
    free_count,
):
    """Ends the active pairs that parted and enters the new ones; returns how many are active now.

    Parameters: `active`, `slots` and `room` have room for all of them, free[:free_count[0]] are the unused slots. Whatever
    moved is awake, so all of its pairs are active.
    """
    kept = 0
    for p in range(active_count):
        slot = active[p]
        pair = pairs[slot]
        a = colliders[pair.a]
        b = colliders[pair.b]
        if (a.moved != 0 or b.moved != 0) and not still_near(a, b, pair.part, geometry):
            heir = heir_of(pairs, active, p, active_count, kept)
            if heir >= 0:
                pass_on(pairs, manifolds, table, active, p, heir)
                slot = active[p]
            if pairs[slot].touched == 0:  # else it stays until this step has told of its end
                remove_pair(pairs, table, slot)
                pairs[slot].a = -1
                free[free_count[0]] = slot
                free_count[0] += 1
                continue
        active[kept] = slot
        kept += 1
    for q in range(new_count):
        free_count[0] -= 1
        slot = free[free_count[0]]
        pairs[slot] = new[q]
        clear_manifold(manifolds[slot])
        insert_pair(pairs, table, slot)
        slots[q] = slot
    sort_slots(pairs, slots, new_count, room)
    p = kept - 1
    q = new_count - 1
    for place in range(kept + new_count - 1, -1, -1):
        if q < 0:
            break
        if p >= 0 and comes_before(pairs[slots[q]], pairs[active[p]]):
            active[place] = active[p]
            p -= 1
        else:
            active[place] = slots[q]
            q -= 1
    for m in range(moved_count):
        colliders[moved[m]].moved = 0
    return kept + new_count


@inner
def is_active(bodies, colliders, pair):
    """Whether a step has to look at a pair: something in it is awake and may come to push or be pushed."""
    for side in range(2):
        body = bodies[colliders[pair.a if side == 0 else pair.b].body]
        if body.motion == KINEMATIC or (body.motion == DYNAMIC and body.asleep == 0):
            return True
    return False


@kernel
def list_active_pairs(bodies, colliders, pairs, active, room):
    """Lists the slots of all pairs that a step has to look at, sorted; returns how many."""
    count = 0
    for slot in range(1, pairs.shape[0]):
        if pairs[slot].a >= 0 and is_active(bodies, colliders, pairs[slot]):
            active[count] = slot
            count += 1
    sort_slots(pairs, active, count, room)
    return count

"""Which colliders may touch: pairs of overlapping fat boxes, kept from step to step and changed only where something moved.

Pairs stay sorted by (a, b), whatever the tree looks like: the order of impulses must not depend on it.
"""

from __future__ import annotations

import numpy as np

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.tables import DYNAMIC, POINTS
from elys.sim_node.physics.kernels.tree import LEAF


@inner
def boxes_overlap(a, b):
    return (a[0] <= b[3]) & (b[0] <= a[3]) & (a[1] <= b[4]) & (b[1] <= a[4]) & (a[2] <= b[5]) & (b[2] <= a[5])


@kernel
def index_pairs(pairs, pair_count, row_start):
    """Writes where the pairs of each collider begin; row_start is (C + 1,)."""
    p = 0
    for a in range(row_start.shape[0]):
        while p < pair_count and pairs[p].a < a:
            p += 1
        row_start[a] = p


@inner
def is_known(pairs, row_start, a, b):
    """Whether (a, b) is a pair already: a scan over the few pairs of a."""
    p = row_start[a]
    while p < row_start[a + 1] and pairs[p].b != b:
        p += 1
    return p < row_start[a + 1]


@inner
def may_collide(bodies, first, second):
    """Whether two bodies are worth a pair: two different ones, at least one of which can be pushed."""
    if first == second:
        return False
    return bodies[first].motion == DYNAMIC or bodies[second].motion == DYNAMIC


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


@kernel
def find_new_pairs(bodies, colliders, leaves, nodes, pairs, row_start, unpaired, new, stack):
    """Writes the pairs that moved colliders have gained, in any order; returns how many there are.

    When there are more than `new` can take the rest is only counted: the caller makes room and calls again.
    """
    leaf_count = nodes.shape[0] // 2
    n = colliders.shape[0]
    found = 0
    for i in range(n):
        collider = colliders[i]
        if collider.moved == 0:
            continue
        box = collider.fat_box
        stack[0] = 1
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            if not boxes_overlap(nodes[node], box):
                continue
            if node < leaf_count:
                stack[top] = 2 * node
                stack[top + 1] = 2 * node + 1
                top += 2
                continue
            first = (node - leaf_count) * LEAF
            for place in range(first, min(n, first + LEAF)):
                j = leaves[place].order
                other = colliders[j]
                if j == i or (j < i and other.moved != 0):  # two that moved are found from the smaller one
                    continue
                if not boxes_overlap(other.fat_box, box) or not may_collide(bodies, collider.body, other.body):
                    continue
                a = min(i, j)
                b = max(i, j)
                if is_known(pairs, row_start, a, b) or is_unpaired(unpaired, collider.body, other.body):
                    continue
                if found < new.shape[0]:
                    new[found].a = a
                    new[found].b = b
                found += 1
    return found


@inner
def sort_pairs(pairs, count, sorted_pairs, starts):
    """Sorts pairs by (a, b) into `sorted_pairs`: counting by a, then insertion within each a."""
    starts[:] = 0
    for p in range(count):
        starts[pairs[p].a + 1] += 1
        sorted_pairs[p].a = -1
    for i in range(starts.shape[0] - 1):
        starts[i + 1] += starts[i]
    for p in range(count):
        a = pairs[p].a
        b = pairs[p].b
        place = starts[a]
        starts[a] = place + 1
        while place > 0 and sorted_pairs[place - 1].a == a and sorted_pairs[place - 1].b > b:
            sorted_pairs[place].b = sorted_pairs[place - 1].b
            sorted_pairs[place].a = a
            place -= 1
        sorted_pairs[place].a = a
        sorted_pairs[place].b = b


@kernel
def merge_pairs(colliders, pairs, pair_count, new, new_count, sorted_new, starts, free, free_count):
    """Drops the pairs that parted and adds the new ones in their places; returns the pair count.

    `pairs` has room for the new ones and `free` for every slot; free[:free_count[0]] are the unused slots. A new pair's slot
    is -1 until `give_slots`.
    """
    kept = 0
    for p in range(pair_count):
        pair = pairs[p]
        a = colliders[pair.a]
        b = colliders[pair.b]
        if (a.moved != 0 or b.moved != 0) and not boxes_overlap(a.fat_box, b.fat_box):
            free[free_count[0]] = pair.slot
            free_count[0] += 1
            continue
        pairs[kept] = pair
        kept += 1
    sort_pairs(new, new_count, sorted_new, starts)
    total = kept + new_count
    p = kept - 1
    q = new_count - 1
    for place in range(total - 1, -1, -1):
        if q < 0:
            break
        added = sorted_new[q]
        if p >= 0 and (pairs[p].a > added.a or (pairs[p].a == added.a and pairs[p].b > added.b)):
            pairs[place] = pairs[p]
            p -= 1
        else:
            pairs[place].a = added.a
            pairs[place].b = added.b
            pairs[place].slot = -1
            q -= 1
    return total


@kernel
def give_slots(pairs, pair_count, manifolds, points, free, free_count):
    """Gives an empty manifold to every pair that has none."""
    for p in range(pair_count):
        if pairs[p].slot >= 0:
            continue
        free_count[0] -= 1
        slot = free[free_count[0]]
        pairs[p].slot = slot
        manifold = manifolds[slot]
        manifold.point_count = 0
        manifold.margin = -1.0
        manifold.twist_impulse = 0.0
        for k in range(3):
            manifold.friction_impulse[k] = 0.0
        for k in range(slot * POINTS, slot * POINTS + POINTS):
            points[k].normal_impulse = 0.0
            points[k].step_impulse = 0.0

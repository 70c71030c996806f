"""Which colliders may touch: pairs of overlapping fat boxes, kept from step to step and changed only where something moved.

Pairs stay sorted by (a, b), whatever the tree looks like: the order of impulses must not depend on it.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.midphase import has_parts, local_interval, meets_part, next_part, still_near
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
def is_known(pairs, row_start, a, b, part):
    """Whether (a, b, part) is a pair already: a bisection of the pairs of a, of which a floor has thousands."""
    low = row_start[a]
    high = row_start[a + 1]
    while low < high:
        middle = (low + high) // 2
        pair = pairs[middle]
        if pair.b < b or (pair.b == b and pair.part < part):
            low = middle + 1
        else:
            high = middle
    return low < row_start[a + 1] and pairs[low].b == b and pairs[low].part == part


@inner
def may_collide(bodies, a, b):
    """Whether two colliders are worth a pair: of two bodies, at least one of which can be pushed, in layers that meet."""
    if a.body == b.body:
        return False
    if (a.layer & b.mask) == 0 or (b.layer & a.mask) == 0:
        return False
    return bodies[a.body].motion == DYNAMIC or bodies[b.body].motion == DYNAMIC


@inner
def add_new(pairs, row_start, a, b, part, new, found):
    """Notes a pair unless it is known; returns how many are noted now."""
    if is_known(pairs, row_start, a, b, part):
        return found
    if found < new.shape[0]:
        new[found].a = a
        new[found].b = b
        new[found].part = part
    return found + 1


@inner
def add_parts(colliders, mesh_row, other_row, pairs, row_start, new, found, geometry, stack, bottom):
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
                found = add_new(pairs, row_start, a, b, part, new, found)


@kernel
def find_new_pairs(bodies, colliders, leaves, nodes, geometry, pairs, row_start, new, stack):
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
                if not boxes_overlap(other.fat_box, box) or not may_collide(bodies, collider, other):
                    continue
                if has_parts(other):
                    found = add_parts(colliders, j, i, pairs, row_start, new, found, geometry, stack, top)
                elif has_parts(collider):
                    found = add_parts(colliders, i, j, pairs, row_start, new, found, geometry, stack, top)
                elif still_near(collider, other, 0, geometry):
                    found = add_new(pairs, row_start, min(i, j), max(i, j), 0, new, found)
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
def sort_pairs(pairs, count, sorted_pairs, starts):
    """Sorts pairs by (a, b, part) into `sorted_pairs`: counting by a, then insertion within each a."""
    starts[:] = 0
    for p in range(count):
        starts[pairs[p].a + 1] += 1
        sorted_pairs[p].a = -1  # not filled yet: nothing comes before it
    for i in range(starts.shape[0] - 1):
        starts[i + 1] += starts[i]
    for p in range(count):
        a = pairs[p].a
        place = starts[a]
        starts[a] = place + 1
        while place > 0 and sorted_pairs[place - 1].a == a and comes_before(pairs[p], sorted_pairs[place - 1]):
            sorted_pairs[place] = sorted_pairs[place - 1]
            place -= 1
        sorted_pairs[place] = pairs[p]


@kernel
def merge_pairs(colliders, geometry, pairs, pair_count, new, new_count, sorted_new, starts, free, free_count):
    """Drops the pairs that parted and adds the new ones in their places; returns the pair count.

    `pairs` has room for the new ones and `free` for every slot; free[:free_count[0]] are the unused slots. A new pair's slot
    is -1 until `give_slots`.
    """
    kept = 0
    for p in range(pair_count):
        pair = pairs[p]
        a = colliders[pair.a]
        b = colliders[pair.b]
        if (a.moved != 0 or b.moved != 0) and not still_near(a, b, pair.part, geometry):
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
        if p >= 0 and comes_before(added, pairs[p]):
            pairs[place] = pairs[p]
            p -= 1
        else:
            pairs[place] = added
            pairs[place].slot = -1
            q -= 1
    return total


@kernel
def give_slots(pairs, pair_count, manifolds, free, free_count):
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
        manifold.load = 0.0
        manifold.impulse_time = 0.0
        manifold.twist_impulse = 0.0
        for k in range(3):
            manifold.friction_impulse[k] = 0.0
        for k in range(POINTS):
            manifold.normal_impulse[k] = 0.0
            manifold.step_impulse[k] = 0.0

"""Which colliders may touch: those whose fat boxes overlap. They are looked for where a box is new, with eight boxes at once.

What is found is sorted by (a, b, part), whatever the tree looks like: the order of impulses must not depend on it.
"""

from __future__ import annotations

import numpy as np

from elys.sim_node.compilation import inlined, inner, kernel
from elys.sim_node.physics.kernels.midphase import (
    box_over_plane,
    has_parts,
    local_interval,
    meets_part,
    next_part,
)
from elys.sim_node.physics.kernels.simd import LANES, lowest_bit
from elys.sim_node.physics.kernels.tables import DYNAMIC, MESH, NOTICES_ALL, PLANE, SOLID, STATIC
from elys.sim_node.physics.kernels.tree import LEAF
from elys.sim_node.physics.kernels.wide_tree import (
    BLOCK,
    bound_lanes,
    first_level,
    list_near_leaves,
    load_lane,
    overlapping_lanes,
)

DIGIT = 11  # bits that one pass of a radix sort looks at, at most
ALL = (1 << LANES) - 1
SHORT = 24  # so few pairs are sorted by insertion


@inner
def boxes_overlap(a, b):
    return (a[0] <= b[3]) & (b[0] <= a[3]) & (a[1] <= b[4]) & (b[1] <= a[4]) & (a[2] <= b[5]) & (b[2] <= a[5])


@inner
def notices(trigger, other):
    """Whether a trigger is told of another collider: a solid one that moves, and if so chosen what it comes upon itself."""
    if trigger.trigger == SOLID or other.trigger != SOLID:
        return False
    if trigger.kind >= MESH and other.kind >= MESH:  # nothing says where two of these overlap
        return False
    if other.motion != STATIC:
        return True
    return trigger.trigger == NOTICES_ALL and trigger.motion != STATIC


@inner
def may_collide(a, b):
    """Whether two colliders are worth a pair: of two bodies, at least one of which can be pushed, in layers that meet.

    Or one is a trigger that notices the other.
    """
    if a.body == b.body:
        return False
    if (a.layer & b.mask) == 0 or (b.layer & a.mask) == 0:
        return False
    if a.trigger != SOLID or b.trigger != SOLID:
        return notices(a, b) or notices(b, a)
    return a.motion == DYNAMIC or b.motion == DYNAMIC


@inner
def is_unpaired(unpaired, first, second):
    """Whether two bodies are held by a joint that lets them not collide: a search in sorted keys."""
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


@inlined
def add_pair(found, count, a, b, part):
    """Notes a pair where there is room for it; returns how many there are now."""
    if count < found.shape[0]:
        pair = found[count]
        pair.a = a
        pair.b = b
        pair.part = part
        pair.touched = 0
        pair.blank = 1
    return count + 1


@inner
def add_parts(colliders, mesh_row, other_row, box, found, count, geometry, stack):
    """Notes the pairs of a collider, in its fat box, with the triangles near it, ascending; returns how many there are now."""
    mesh = colliders[mesh_row]
    a = min(mesh_row, other_row)
    b = max(mesh_row, other_row)
    x0, x1 = local_interval(mesh, box, 0)
    y0, y1 = local_interval(mesh, box, 1)
    z0, z1 = local_interval(mesh, box, 2)
    stack[0] = 1
    top = 1
    face_count = geometry.headers[mesh.geometry].face_count
    while True:
        first, top = next_part(mesh, x0, x1, y0, y1, z0, z1, geometry, stack, 0, top)
        if first < 0:
            return count
        for part in range(first, min(face_count, first + LEAF)):
            if meets_part(mesh, part, box, geometry):
                count = add_pair(found, count, a, b, part)


@inner
def add_special(colliders, proxies, i, j, found, count, geometry, stack):
    """Notes the pairs of two colliders one of which is a plane or has parts; returns how many there are now."""
    if proxies[i].kind == PLANE or proxies[j].kind == PLANE:
        plane, other = (i, j) if proxies[i].kind == PLANE else (j, i)
        if box_over_plane(colliders[plane], proxies[other].fat_box) > 0.0:
            return count
        return add_pair(found, count, min(i, j), max(i, j), 0)
    mesh, other = (i, j) if has_parts(proxies[i]) else (j, i)
    return add_parts(colliders, mesh, other, proxies[other].fat_box, found, count, geometry, stack)


@inlined
def are_pair(first, second, unpaired):
    """Whether two colliders whose boxes may overlap are a pair, or have pairs with each other's parts."""
    if not boxes_overlap(first.fat_box, second.fat_box) or not may_collide(first, second):
        return False
    return unpaired.shape[0] == 0 or not is_unpaired(unpaired, first.body, second.body)


@inner
def comes_before(p, q):
    """Whether a pair stands before another: by a, then b, then part."""
    if p.a != q.a:
        return p.a < q.a
    if p.b != q.b:
        return p.b < q.b
    return p.part < q.part


@inner
def sort_short(found, count):
    """Sorts a few pairs by insertion."""
    for end in range(1, count):
        pair = found[end]
        a, b, part = pair.a, pair.b, pair.part
        place = end
        while place > 0 and (
            found[place - 1].a > a
            or (
                found[place - 1].a == a
                and (found[place - 1].b > b or (found[place - 1].b == b and found[place - 1].part > part))
            )
        ):
            found[place] = found[place - 1]
            place -= 1
        found[place].a = a
        found[place].b = b
        found[place].part = part


@inner
def radix_pass(source, target, count, histogram, by_a, shift, width):
    """One pass of a stable sort of pairs, by some bits of their first or second collider."""
    mask = (1 << width) - 1
    histogram[: mask + 2] = 0
    for i in range(count):
        row = source[i].a if by_a else source[i].b
        histogram[((row >> shift) & mask) + 1] += 1
    for digit in range(mask):
        histogram[digit + 1] += histogram[digit]
    for i in range(count):
        row = source[i].a if by_a else source[i].b
        digit = (row >> shift) & mask
        place = histogram[digit]
        histogram[digit] = place + 1
        target[place] = source[i]


@inner
def sort_pairs(found, count, room, histogram, collider_count):
    """Sorts pairs by their colliders; parts of a mesh stay in the order in which they were found, which ascends."""
    if count <= SHORT:
        sort_short(found, count)
        return
    bits = 1
    while (1 << bits) < collider_count:
        bits += 1
    passes = (bits + DIGIT - 1) // DIGIT
    width = (bits + passes - 1) // passes
    source, target = found, room
    for p in range(2 * passes):  # an even number: what is sorted is in `found` at the end
        radix_pass(source, target, count, histogram, p >= passes, (p % passes) * width, width)
        source, target = target, source


@kernel
def find_pairs(
    colliders,
    proxies,
    moved,
    moved_count,
    is_moved,
    leaves,
    places,
    blocks,
    levels,
    level_count,
    moved_lanes,
    near,
    stack,
    geometry,
    unpaired,
    found,
    room,
    histogram,
):
    """Writes all pairs of moved colliders, sorted; returns how many there are.

    When there are more than `found` can take the rest is only counted: the caller makes room and calls again. `leaves`,
    `places`, `blocks` and `levels` are the wide tree over all fat boxes, `unpaired` the sorted keys of bodies that do not
    collide. `is_moved` (C,) is set for moved colliders; `moved_lanes`, a byte for each block of boxes, is zero before and after.

    What moved in one block of eight walks the tree together, and a pair that moved on both sides is found from the side that
    comes first in the tree.
    """
    for m in range(moved_count):
        is_moved[moved[m]] = 1
        place = places[moved[m]]
        moved_lanes[place // LANES] |= 1 << (place % LANES)
    top_level = first_level(levels, level_count)
    count = 0
    for m in range(moved_count):
        block = places[moved[m]] // LANES
        waiting = np.int64(moved_lanes[block])
        if 1 << (places[moved[m]] % LANES) != waiting & -waiting:  # the whole block is done once
            continue
        at = block * BLOCK
        low_x, low_y, low_z, high_x, high_y, high_z = bound_lanes(blocks, at, waiting)
        near_count = list_near_leaves(
            blocks, levels, top_level, low_x, low_y, low_z, high_x, high_y, high_z, stack, near
        )
        kept = 0
        for n in range(near_count):  # not those of which all have moved: they have found what is here
            near[kept] = near[n]
            kept += int((near[n] >= block) | (moved_lanes[near[n]] != ALL))
        done = np.int64(0)
        while waiting != 0:
            lane = lowest_bit(waiting)
            waiting &= waiting - 1
            done |= 1 << lane
            i = leaves[block * LANES + lane].order
            low_x, low_y, low_z, high_x, high_y, high_z = load_lane(blocks, at, lane)
            for n in range(kept):
                other = near[n]
                bits = overlapping_lanes(blocks, other * BLOCK, low_x, low_y, low_z, high_x, high_y, high_z)
                if other < block:
                    bits &= ~np.int64(moved_lanes[other])
                elif other == block:
                    bits &= ~done
                while bits != 0:
                    j = leaves[other * LANES + lowest_bit(bits)].order
                    bits &= bits - 1
                    first = proxies[i]
                    second = proxies[j]
                    if not are_pair(first, second, unpaired):
                        continue
                    # Geometry is many values to hand over: only where it is needed.
                    if first.kind >= MESH or second.kind >= MESH:
                        count = add_special(colliders, proxies, i, j, found, count, geometry, stack)
                    else:
                        count = add_pair(found, count, min(i, j), max(i, j), 0)
    for m in range(moved_count):
        moved_lanes[places[moved[m]] // LANES] = 0
    if count <= found.shape[0]:
        sort_pairs(found, count, room, histogram, colliders.shape[0])
    return count

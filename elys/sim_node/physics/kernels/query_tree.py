"""The tree that queries walk down: a binary tree over the colliders' boxes, built by the surface area heuristic.

A node is one cache line: the boxes of its two children and what they are. So a walk reads a line for two boxes, and a box is
looked at before the shape in it. Boxes are float32, rounded outward: half the memory, and nothing is lost by it, since what
the boxes let through is decided by the exact shapes. Children stand behind their parents; `refit` runs backwards.

MacDonald and Booth, "Heuristics for ray tracing using space subdivision" (1990); Wald, "On fast construction of SAH-based
bounding volume hierarchies" (2007) for the bins.
"""

from __future__ import annotations

import numpy as np

from elys.sim_node.compilation import inner, kernel

QUERY_NODE = np.dtype(
    [
        ("box", "f4", 12),  # of the first child, then of the second: lower corner, upper corner [m]
        ("child", "i4", 2),  # a node, -1 - c for collider c, or NOTHING
        ("first", "i4"),  # where the node's colliders begin in the order, while it is built
        ("count", "i4"),
    ],
    align=True,
)

BINS = 12
ROUND_OUT = 2.0**-22  # more than float32 rounds
NOTHING = -(2**31)
TINY = 1e-30  # middles closer together are not parted
FARTHEST = 1e30  # boxes end here, and so does float32 arithmetic with them


@inner
def write_child_box(box, base, low_x, low_y, low_z, high_x, high_y, high_z):
    """A box in float64 rounded outward to float32."""
    box[base] = max(low_x - abs(low_x) * ROUND_OUT - 1e-37, -FARTHEST)
    box[base + 1] = max(low_y - abs(low_y) * ROUND_OUT - 1e-37, -FARTHEST)
    box[base + 2] = max(low_z - abs(low_z) * ROUND_OUT - 1e-37, -FARTHEST)
    box[base + 3] = min(high_x + abs(high_x) * ROUND_OUT + 1e-37, FARTHEST)
    box[base + 4] = min(high_y + abs(high_y) * ROUND_OUT + 1e-37, FARTHEST)
    box[base + 5] = min(high_z + abs(high_z) * ROUND_OUT + 1e-37, FARTHEST)


@inner
def middle_of(boxes, i, k):
    """Twice the middle of box i along axis k, finite for boxes without end."""
    return max(boxes[i, k], -FARTHEST) + min(boxes[i, 3 + k], FARTHEST)


@inner
def half_area(bin_, low, high):
    """Half the surface of a box that is kept as bin_[low:low + 3] and bin_[high:high + 3]."""
    x = min(bin_[high] - bin_[low], FARTHEST)
    y = min(bin_[high + 1] - bin_[low + 1], FARTHEST)
    z = min(bin_[high + 2] - bin_[low + 2], FARTHEST)
    return x * y + y * z + z * x


@inner
def fill_bins(boxes, order, first, count, axis, low, scale, bins):
    """Puts the boxes of a range into bins along an axis: bins[b] is lower corner, upper corner, count."""
    for b in range(BINS):
        for k in range(3):
            bins[b, k] = FARTHEST
            bins[b, 3 + k] = -FARTHEST
        bins[b, 6] = 0.0
    for place in range(first, first + count):
        i = order[place]
        b = min(int((middle_of(boxes, i, axis) - low) * scale), BINS - 1)
        for k in range(3):
            bins[b, k] = min(bins[b, k], boxes[i, k])
            bins[b, 3 + k] = max(bins[b, 3 + k], boxes[i, 3 + k])
        bins[b, 6] += 1.0


@inner
def best_cut(bins, sweep):
    """The cheapest cut between bins as (cost, last bin of the first half); the cost is area times count, summed."""
    # Row BINS holds the box that grows; sweep[b] is what the bins behind b cost.
    grown = bins[BINS]
    for direction in range(2):
        for k in range(3):
            grown[k] = FARTHEST
            grown[3 + k] = -FARTHEST
        grown[6] = 0.0
        best = np.inf
        cut = -1
        for step in range(BINS - 1):
            b = step if direction == 1 else BINS - 1 - step
            for k in range(3):
                grown[k] = min(grown[k], bins[b, k])
                grown[3 + k] = max(grown[3 + k], bins[b, 3 + k])
            grown[6] += bins[b, 6]
            cost = half_area(grown, 0, 3) * grown[6] if grown[6] > 0.0 else 0.0
            if direction == 0:
                sweep[b - 1] = cost if grown[6] > 0.0 else np.inf
            elif grown[6] > 0.0 and cost + sweep[b] < best:
                best = cost + sweep[b]
                cut = b
    return best, cut


@inner
def split(boxes, order, first, count, bins, sweep):
    """Arranges a range of the order into two halves; returns how many are in the first."""
    best = np.inf
    best_axis = 0
    best_low = best_scale = 0.0
    best_bin = -1
    for axis in range(3):
        low = np.inf
        high = -np.inf
        for place in range(first, first + count):
            middle = middle_of(boxes, order[place], axis)
            low = min(low, middle)
            high = max(high, middle)
        if not high - low > TINY:
            continue
        scale = BINS / (high - low)
        fill_bins(boxes, order, first, count, axis, low, scale, bins)
        cost, cut = best_cut(bins, sweep)
        if cost < best:
            best, best_axis, best_low, best_scale, best_bin = cost, axis, low, scale, cut
    if best_bin < 0:
        return count // 2
    front = first
    for place in range(first, first + count):
        i = order[place]
        if min(int((middle_of(boxes, i, best_axis) - best_low) * best_scale), BINS - 1) <= best_bin:
            order[place] = order[front]
            order[front] = i
            front += 1
    return front - first


@inner
def add_child(nodes, node, side, order, first, count, node_count):
    """Names what a half becomes: a collider, or a node to be split later. Returns how many nodes there are then."""
    if count <= 1:
        nodes[node].child[side] = -1 - order[first] if count == 1 else NOTHING
        return node_count
    nodes[node].child[side] = node_count
    nodes[node_count].first = first
    nodes[node_count].count = count
    return node_count + 1


@kernel
def build_query_tree(boxes, nodes, order, bins, sweep):
    """Builds the tree over boxes (C, 6), C at least 1, and returns its cost, see `refit_query_tree`.

    `nodes` are C - 1 rows, at least one; `order` (C,), `bins` (BINS + 1, 7) and `sweep` (BINS,) are room to work in.
    """
    count = boxes.shape[0]
    for i in range(count):
        order[i] = i
    nodes[0].first = 0
    nodes[0].count = count
    node_count = 1
    node = 0
    while node < node_count:
        first = nodes[node].first
        total = nodes[node].count
        left = 1 if total <= 2 else split(boxes, order, first, total, bins, sweep)
        node_count = add_child(nodes, node, 0, order, first, left, node_count)
        node_count = add_child(nodes, node, 1, order, first + left, total - left, node_count)
        node += 1
    return refit(boxes, nodes)


@inner
def refit(boxes, nodes):
    cost = 0.0
    for node in range(nodes.shape[0] - 1, -1, -1):
        box = nodes[node].box
        for side in range(2):
            child = nodes[node].child[side]
            base = 6 * side
            if child == NOTHING:
                write_child_box(box, base, FARTHEST, FARTHEST, FARTHEST, -FARTHEST, -FARTHEST, -FARTHEST)
                continue
            if child < 0:
                b = boxes[-1 - child]
                write_child_box(box, base, b[0], b[1], b[2], b[3], b[4], b[5])
            else:
                below = nodes[child].box
                for k in range(3):
                    box[base + k] = min(below[k], below[6 + k])
                    box[base + 3 + k] = max(below[3 + k], below[9 + k])
            x = float(box[base + 3]) - float(box[base])
            y = float(box[base + 4]) - float(box[base + 1])
            z = float(box[base + 5]) - float(box[base + 2])
            area = x * y + y * z + z * x
            if area < FARTHEST:  # boxes without end stay what they are
                cost += area
    return cost


@kernel
def refit_query_tree(boxes, nodes):
    """Follows boxes (C, 6) that moved, the tree staying as it is. Returns its cost: half the surface of all its boxes [m^2].

    A random line meets a box in proportion to its surface: what the cost has grown by is what walks have become slower.
    """
    return refit(boxes, nodes)

"""A bounding volume tree that is built in linear time: boxes in Morton order under an implicit complete binary tree.

Node 1 is the root, nodes 2 n and 2 n + 1 are below node n. The order along the Morton curve keeps neighbours together; the
tree over it needs no pointers. It is as good as the order, which is enough for boxes that move a little each step. Boxes
much larger than their neighbours widen only the nodes above them.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner, kernel

LEAF = 2  # boxes in a leaf
FAR = 1e300


@inner
def spread_bits(x):
    """Ten bits, two zeros between each."""
    x &= 0x3FF
    x = (x | (x << 16)) & 0x030000FF
    x = (x | (x << 8)) & 0x0300F00F
    x = (x | (x << 4)) & 0x030C30C3
    return (x | (x << 2)) & 0x09249249


@inner
def write_codes(boxes, leaves, corners):
    """Morton codes of the boxes' centres within the box of all centres. `corners` (6,) is room to work in."""
    for k in range(3):
        corners[k] = FAR
        corners[3 + k] = -FAR
    for i in range(boxes.shape[0]):
        for k in range(3):
            middle = boxes[i, k] + boxes[i, 3 + k]
            corners[k] = min(corners[k], middle)
            corners[3 + k] = max(corners[3 + k], middle)
    # One scale for all axes: cells are cubes, so that a flat world is not cut into thin slices.
    size = 1e-9
    for k in range(3):
        size = max(size, corners[3 + k] - corners[k])
    scale = 1023.0 / size
    for i in range(boxes.shape[0]):
        code = 0
        for k in range(3):
            cell = int((boxes[i, k] + boxes[i, 3 + k] - corners[k]) * scale)
            code |= spread_bits(cell) << k
        leaves[i].code = code
        leaves[i].order = i


@inner
def sort_pass(leaves, histogram, shift):
    """One pass of a stable radix sort by ten bits; the result is in other_code and other_order, and copied back."""
    histogram[:] = 0
    for i in range(leaves.shape[0]):
        histogram[((leaves[i].code >> shift) & 1023) + 1] += 1
    for digit in range(1024):
        histogram[digit + 1] += histogram[digit]
    for i in range(leaves.shape[0]):
        digit = (leaves[i].code >> shift) & 1023
        place = histogram[digit]
        histogram[digit] = place + 1
        leaves[place].other_code = leaves[i].code
        leaves[place].other_order = leaves[i].order
    for i in range(leaves.shape[0]):
        leaf = leaves[i]
        leaf.code = leaf.other_code
        leaf.order = leaf.other_order


@kernel
def build_tree(boxes, leaves, nodes, histogram, corners, sort):
    """Builds the tree over boxes (C, 6); without `sort` the last order is kept and only the nodes (2 L, 6) are made anew."""
    if sort:
        write_codes(boxes, leaves, corners)
        for shift in range(0, 30, 10):
            sort_pass(leaves, histogram, shift)
    leaf_count = nodes.shape[0] // 2
    n = boxes.shape[0]
    for leaf in range(leaf_count):
        node = leaf_count + leaf
        for k in range(3):
            low = FAR
            high = -FAR
            for place in range(leaf * LEAF, min(n, leaf * LEAF + LEAF)):
                i = leaves[place].order
                low = min(low, boxes[i, k])
                high = max(high, boxes[i, 3 + k])
            nodes[node, k] = low
            nodes[node, 3 + k] = high
    for node in range(leaf_count - 1, 0, -1):
        for k in range(3):
            nodes[node, k] = min(nodes[2 * node, k], nodes[2 * node + 1, k])
            nodes[node, 3 + k] = max(nodes[2 * node, 3 + k], nodes[2 * node + 1, 3 + k])

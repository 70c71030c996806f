"""A bounding volume tree with eight children a node: eight boxes are tested at once.

Boxes stand in Morton order, eight to a block, and the blocks of each level are the children of the next: an implicit
complete tree, level after level in one array, with four levels for thousands of boxes. A block is 48 float32: the lowest x
of eight boxes, the lowest y, z, then the highest. Rounding to float32 only makes boxes larger; what is found is tested
exactly by who asks.
"""

from __future__ import annotations

import numpy as np

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.simd import LANES, bits_of, load, lowest_bit, splat
from elys.sim_node.physics.kernels.tree import sort_pass, write_codes

BLOCK = 48
MOST_LEVELS = 12
FEW_BLOCKS = 16

_ROUNDING = 2.0**-22  # more than float32 may be off
_SMALLEST = 1e-37
_NEVER = np.float32(np.inf)


@inner
def rounded_down(x):
    return np.float32(x - abs(x) * _ROUNDING - _SMALLEST)


@inner
def rounded_up(x):
    return np.float32(x + abs(x) * _ROUNDING + _SMALLEST)


@inner
def write_box(blocks, at, lane, box):
    """Writes a box as one lane of the block that begins at a place."""
    for k in range(3):
        blocks[at + LANES * k + lane] = rounded_down(box[k])
        blocks[at + LANES * (3 + k) + lane] = rounded_up(box[3 + k])


@inner
def clear_lane(blocks, at, lane):
    for k in range(3):
        blocks[at + LANES * k + lane] = _NEVER
        blocks[at + LANES * (3 + k) + lane] = -_NEVER


@inner
def write_bounds(blocks, child_at, at, lane):
    """Writes what holds a whole block as one lane of the block above it."""
    for k in range(3):
        low = _NEVER
        high = -_NEVER
        for child in range(LANES):
            low = min(low, blocks[child_at + LANES * k + child])
            high = max(high, blocks[child_at + LANES * (3 + k) + child])
        blocks[at + LANES * k + lane] = low
        blocks[at + LANES * (3 + k) + lane] = high


@kernel
def build_wide_tree(boxes, leaves, places, blocks, levels, level_count, histogram, corners, sort):
    """Builds the tree over boxes (C, 6); without `sort` the last order is kept and only the blocks are made anew.

    Parameters: places (C,) gets where each box stands in the order; levels (L + 1,) says at which block each level begins,
    the boxes' own first, and where the last one ends.
    """
    n = boxes.shape[0]
    if sort:
        write_codes(boxes, leaves, corners)
        for shift in range(0, 30, 10):
            sort_pass(leaves, histogram, shift)
        for place in range(n):
            places[leaves[place].order] = place
    for place in range(levels[1] * LANES):
        at = place // LANES * BLOCK
        if place < n:
            write_box(blocks, at, place % LANES, boxes[leaves[place].order])
        else:
            clear_lane(blocks, at, place % LANES)
    for level in range(1, level_count):
        below = levels[level] - levels[level - 1]
        for child in range((levels[level + 1] - levels[level]) * LANES):
            at = (levels[level] + child // LANES) * BLOCK
            if child < below:
                write_bounds(blocks, (levels[level - 1] + child) * BLOCK, at, child % LANES)
            else:
                clear_lane(blocks, at, child % LANES)


@kernel
def refit_wide_tree(boxes, moved, moved_count, places, blocks, levels, level_count):
    """Makes the blocks above a few moved boxes hold them again: what does not move costs nothing."""
    for m in range(moved_count):
        place = places[moved[m]]
        write_box(blocks, place // LANES * BLOCK, place % LANES, boxes[moved[m]])
        for level in range(1, level_count):
            place //= LANES
            child_at = (levels[level - 1] + place) * BLOCK
            write_bounds(blocks, child_at, (levels[level] + place // LANES) * BLOCK, place % LANES)


@inner
def overlapping_lanes(blocks, at, low_x, low_y, low_z, high_x, high_y, high_z):
    """A bit for each box of a block that overlaps a box given by six vectors."""
    x = (load(blocks, at) <= high_x) & (load(blocks, at + 24) >= low_x)
    y = (load(blocks, at + 8) <= high_y) & (load(blocks, at + 32) >= low_y)
    z = (load(blocks, at + 16) <= high_z) & (load(blocks, at + 40) >= low_z)
    return bits_of(x & y & z)


@inner
def load_lane(blocks, at, lane):
    """The box in one lane of a block, as the six vectors that others are tested with."""
    return (
        splat(blocks[at + lane]),
        splat(blocks[at + 8 + lane]),
        splat(blocks[at + 16 + lane]),
        splat(blocks[at + 24 + lane]),
        splat(blocks[at + 32 + lane]),
        splat(blocks[at + 40 + lane]),
    )


@inner
def bound_lanes(blocks, at, bits):
    """The six vectors of what holds the boxes of a block that have a bit."""
    lane = lowest_bit(bits)
    low_x, low_y, low_z = blocks[at + lane], blocks[at + 8 + lane], blocks[at + 16 + lane]
    high_x, high_y, high_z = blocks[at + 24 + lane], blocks[at + 32 + lane], blocks[at + 40 + lane]
    bits &= bits - 1
    while bits != 0:
        lane = lowest_bit(bits)
        bits &= bits - 1
        low_x, high_x = min(low_x, blocks[at + lane]), max(high_x, blocks[at + 24 + lane])
        low_y, high_y = min(low_y, blocks[at + 8 + lane]), max(high_y, blocks[at + 32 + lane])
        low_z, high_z = min(low_z, blocks[at + 16 + lane]), max(high_z, blocks[at + 40 + lane])
    return splat(low_x), splat(low_y), splat(low_z), splat(high_x), splat(high_y), splat(high_z)


@inner
def first_level(levels, level_count):
    """Where a walk begins: on a level of few blocks all are tested as fast as one walks down to them."""
    level = level_count - 1
    while level > 1 and levels[level] - levels[level - 1] <= FEW_BLOCKS:
        level -= 1
    return level


@inner
def list_near_leaves(blocks, levels, top_level, low_x, low_y, low_z, high_x, high_y, high_z, stack, near):
    """Lists the blocks of boxes that may overlap a box given by six vectors; returns how many they are."""
    if top_level == 0:
        near[0] = 0
        return 1
    # On the stack: a block's place in its level, and the level.
    top = 0
    for block in range(levels[top_level + 1] - levels[top_level]):
        stack[top] = block * MOST_LEVELS + top_level
        top += 1
    count = 0
    while top > 0:
        top -= 1
        level = stack[top] % MOST_LEVELS
        block = stack[top] // MOST_LEVELS
        at = (levels[level] + block) * BLOCK
        bits = overlapping_lanes(blocks, at, low_x, low_y, low_z, high_x, high_y, high_z)
        while bits != 0:
            child = block * LANES + lowest_bit(bits)
            bits &= bits - 1
            if level == 1:
                near[count] = child
                count += 1
            else:
                stack[top] = child * MOST_LEVELS + level - 1
                top += 1
    return count

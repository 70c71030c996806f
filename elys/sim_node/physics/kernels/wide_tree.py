"""A bounding volume tree with eight children a node: eight boxes are tested at once.

Boxes stand in Morton order, eight to a block, and the blocks of each level are the children of the next: an implicit
complete tree, level after level in one array, with four levels for thousands of boxes. A block is 48 float32: the lowest x
of eight boxes, the lowest y, z, then the highest. Rounding to float32 only makes boxes larger; what is found is tested
exactly by who asks.
"""

from __future__ import annotations

import numpy as np

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.simd import LANES, bits_of, load, splat
from elys.sim_node.physics.kernels.tree import sort_pass, write_codes

BLOCK = 48
MOST_LEVELS = 12

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
def splat_box(box):
    """The six vectors of a box."""
    return (
        splat(rounded_down(box[0])),
        splat(rounded_down(box[1])),
        splat(rounded_down(box[2])),
        splat(rounded_up(box[3])),
        splat(rounded_up(box[4])),
        splat(rounded_up(box[5])),
    )

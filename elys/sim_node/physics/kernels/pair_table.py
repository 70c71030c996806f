"""Pairs by their colliders: an open hash table from (a, b, part) to the pair's slot, where its manifold is.

What sleeps is found here and nowhere else: no step walks over its pairs.
"""

from __future__ import annotations

import numpy as np

from elys.sim_node.compilation import inner, kernel

EMPTY = 0  # slot 0 is nobody's


@inner
def place_of(a, b, part, mask):
    """Where the search for a pair begins; the multipliers are those of Teschner et al., "Optimized Spatial Hashing" (2003)."""
    return (np.int64(a) * 73856093 ^ np.int64(b) * 19349663 ^ np.int64(part) * 83492791) & mask


@inner
def find_pair(pairs, table, a, b, part):
    """The slot of a pair, EMPTY when it is not there."""
    mask = table.shape[0] - 1
    place = place_of(a, b, part, mask)
    while table[place] != EMPTY:
        pair = pairs[table[place]]
        if pair.a == a and pair.b == b and pair.part == part:
            return table[place]
        place = (place + 1) & mask
    return EMPTY


@inner
def insert_pair(pairs, table, slot):
    mask = table.shape[0] - 1
    pair = pairs[slot]
    place = place_of(pair.a, pair.b, pair.part, mask)
    while table[place] != EMPTY:
        place = (place + 1) & mask
    table[place] = slot


@inner
def remove_pair(pairs, table, slot):
    """Takes a pair out and moves up those behind it that would not be found over the gap."""
    mask = table.shape[0] - 1
    pair = pairs[slot]
    gap = place_of(pair.a, pair.b, pair.part, mask)
    while table[gap] != slot:
        gap = (gap + 1) & mask
    place = gap
    while True:
        place = (place + 1) & mask
        if table[place] == EMPTY:
            break
        other = pairs[table[place]]
        home = place_of(other.a, other.b, other.part, mask)
        if ((place - home) & mask) >= ((place - gap) & mask):
            table[gap] = table[place]
            gap = place
    table[gap] = EMPTY


@kernel
def fill_table(pairs, table):
    """Enters every living pair anew; one whose first collider is -1 is none."""
    table[:] = EMPTY
    for slot in range(1, pairs.shape[0]):
        if pairs[slot].a >= 0:
            insert_pair(pairs, table, slot)

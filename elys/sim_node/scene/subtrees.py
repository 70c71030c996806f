"""Several subtrees of the tree at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.sim_node.ecs.entities import Indices
from elys.sim_node.scene.hierarchy import GROUND, Hierarchy


class Subtrees(NamedTuple):
    """N subtrees, none of them below another."""

    tops: Indices  # [N] the place of each root
    starts: Indices  # [N] where each begins in `places`
    places: Indices  # [M] of all in them: one subtree after the other, parents before children, siblings in order

    @property
    def sizes(self) -> Indices:
        """[N] how many are in each."""
        return np.diff(self.starts, append=len(self.places))


def subtrees_at(hierarchy: Hierarchy, tops: Indices) -> Subtrees | None:
    """Those at [N] places; None where a place is named twice or stands below another."""
    order = hierarchy.order
    position = np.zeros(len(hierarchy.parent), np.intp)
    position[order] = np.arange(len(order))
    # In the order of the tree a subtree is one piece, and ends with the last child of the last child of ...
    last = tops
    while (below := hierarchy.last_child[last]).any():
        last = np.where(below == GROUND, last, below)
    first, end = position[tops], position[last] + 1
    ascending = np.argsort(first, kind="stable")
    if np.any(end[ascending[:-1]] > first[ascending[1:]]):
        return None
    sizes = end - first
    starts = np.cumsum(sizes) - sizes
    pieces = np.arange(int(sizes.sum())) + np.repeat(first - starts, sizes)
    return Subtrees(tops, starts, order[pieces].astype(np.intp))


def stand_apart(hierarchy: Hierarchy, places: Indices, targets: Indices) -> bool:
    """Whether [N] places are all different, and none is one of the [M] `targets`, above one of them, or above another."""
    chosen: NDArray[np.bool_] = np.zeros(len(hierarchy.parent), np.bool_)
    chosen[places] = True
    if np.count_nonzero(chosen) != len(places):
        return False
    above = np.concatenate([targets, hierarchy.parent[places]]).astype(np.intp)
    while len(above := above[above != GROUND]):
        if chosen[above].any():
            return False
        above = np.unique(hierarchy.parent[above]).astype(np.intp)
    return True

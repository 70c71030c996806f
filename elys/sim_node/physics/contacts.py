"""Pairs and their manifolds, and the room they need: everything grows by doubling and never inside a kernel."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.sim_node.physics.kernels.broadphase import find_new_pairs, give_slots, index_pairs, merge_pairs
from elys.sim_node.physics.kernels.tables import (
    FOUND,
    MANIFOLD,
    MANIFOLD_POINT,
    PAIR,
    POINTS,
    ROW,
    ROW_POINT,
    TREE_LEAF,
    grown,
)
from elys.sim_node.physics.kernels.tree import LEAF, build_tree
from elys.sim_node.physics.states import ContactPoints

Array = np.ndarray[Any, Any]

TREE_DEPTH = 64  # a depth-first walk never has more nodes waiting


class BoxTree:
    """A tree over the boxes of colliders, and the room to build it."""

    def __init__(self, count: int) -> None:
        leaf_count = 1
        while leaf_count * LEAF < count:
            leaf_count *= 2
        self.leaves = np.zeros(count, TREE_LEAF)
        self.nodes = np.zeros((2 * leaf_count, 6))
        self.stack = np.zeros(TREE_DEPTH, np.int32)
        self.entries = np.zeros(TREE_DEPTH)
        self._histogram = np.zeros(1025, np.int32)
        self._corners = np.zeros(6)
        self._moved = count  # since the boxes were sorted

    def build(self, boxes: Array, moved: int) -> None:
        """Follows boxes (C, 6) of which `moved` are new; they are sorted anew when as many moved as there are."""
        self._moved += moved
        sort = self._moved >= len(self.leaves)
        if sort:
            self._moved = 0
        build_tree(boxes, self.leaves, self.nodes, self._histogram, self._corners, sort)


class ContactStore:
    """Pairs sorted by collider rows, each with a manifold that keeps its slot as long as the pair lives."""

    def __init__(self) -> None:
        self.pair_count = 0
        self.touching_count = 0
        self.pairs = np.zeros(64, PAIR)
        self.touching = np.zeros(64, np.int32)
        self.manifolds = np.zeros(64, MANIFOLD)
        self.points = np.zeros(64 * POINTS, MANIFOLD_POINT)
        self.rows = np.zeros(64, ROW)
        self.row_points = np.zeros(64 * POINTS, ROW_POINT)
        self.found = np.zeros(1, FOUND)
        self.tree = BoxTree(0)
        self._free = np.arange(63, -1, -1, dtype=np.int32)
        self._free_count = np.array([64], np.int32)
        self._new = np.zeros(64, PAIR)
        self._sorted = np.zeros(64, PAIR)
        self._starts = np.zeros(1, np.int32)

    @property
    def live_pairs(self) -> Array:
        """(P,) pairs, a view."""
        return self.pairs[: self.pair_count]

    def set_collider_count(self, count: int) -> None:
        """Makes room for work on `count` colliders."""
        self.tree = BoxTree(count)
        self._starts = np.zeros(count + 1, np.int32)

    def follow_colliders(self, place: Array) -> None:
        """Colliders have moved to other rows, `place` (old C,) says where; -1 ends their pairs. The order stays."""
        pairs = self.live_pairs
        pairs["a"], pairs["b"] = place[pairs["a"]], place[pairs["b"]]
        self.drop((pairs["a"] < 0) | (pairs["b"] < 0))

    def drop(self, ended: Array) -> None:
        """Ends the pairs where `ended` (P,) is true."""
        slots = self.live_pairs["slot"][ended]
        count = int(self._free_count[0])
        self._free[count : count + len(slots)] = slots
        self._free_count[0] = count + len(slots)
        kept = self.live_pairs[~ended]
        self.pairs[: len(kept)] = kept
        self.pair_count = len(kept)
        self.touching_count = 0

    def update_pairs(self, bodies: Array, colliders: Array, unpaired: Array, moved: int) -> None:
        """Finds the pairs of colliders with new fat boxes, except of `unpaired` bodies, and ends those that parted."""
        tree = self.tree
        tree.build(colliders["fat_box"], moved)
        index_pairs(self.pairs, self.pair_count, self._starts)
        while True:
            args = (tree.leaves, tree.nodes, self.pairs, self._starts, unpaired, self._new, tree.stack)
            found = find_new_pairs(bodies, colliders, *args)
            if found <= len(self._new):
                break
            self._new = grown(self._new, max(2 * len(self._new), found))
            self._sorted = grown(self._sorted, len(self._new))
        self.make_room(self.pair_count + found)
        self.pair_count = merge_pairs(
            colliders,
            self.pairs,
            self.pair_count,
            self._new,
            found,
            self._sorted,
            self._starts,
            self._free,
            self._free_count,
        )
        give_slots(self.pairs, self.pair_count, self.manifolds, self.points, self._free, self._free_count)

    def make_room(self, pair_count: int) -> None:
        """Lets there be that many pairs."""
        old = len(self.pairs)
        if pair_count <= old:
            return
        count = max(2 * old, pair_count)
        self.pairs = grown(self.pairs, count)
        self.touching = grown(self.touching, count)
        self.manifolds = grown(self.manifolds, count)
        self.points = grown(self.points, count * POINTS)
        self._free = grown(self._free, count)
        free = int(self._free_count[0])
        self._free[free : free + count - old] = np.arange(count - 1, old - 1, -1)
        self._free_count[0] = free + count - old

    def make_rows(self, row_count: int) -> None:
        """Lets there be that many rows for the solver."""
        if row_count > len(self.rows):
            count = max(2 * len(self.rows), row_count)
            self.rows = np.zeros(count, ROW)
            self.row_points = np.zeros(count * POINTS, ROW_POINT)

    def contact_points(self, bodies: Array, colliders: Array) -> ContactPoints:
        """The points of the last step that touch or carried an impulse."""
        pairs = self.pairs[self.touching[: self.touching_count]]
        manifolds = self.manifolds[pairs["slot"]]
        pair = np.repeat(np.arange(len(pairs)), manifolds["point_count"])
        starts = np.cumsum(manifolds["point_count"]) - manifolds["point_count"]
        points = self.points[pairs["slot"][pair] * POINTS + np.arange(len(pair)) - starts[pair]]
        real = (points["separation"] <= 0.0) | (points["step_impulse"] > 0.0)
        pair, points = pair[real], points[real]
        halfway = 0.5 * points["made_separation"][:, None] * manifolds["normal"][pair]
        body_a = colliders["body"][pairs["a"][pair]]
        body_b = colliders["body"][pairs["b"][pair]]
        return ContactPoints(
            bodies["entity"][body_a],
            bodies["entity"][body_b],
            bodies["position"][body_a] + points["anchor_a"] + halfway,
            manifolds["normal"][pair],
            -points["separation"],
            points["step_impulse"],
        )

    def saved(self) -> dict[str, Array]:
        """Pairs with their manifolds, in the order of the pairs."""
        slots = self.live_pairs["slot"]
        places = (slots[:, None] * POINTS + np.arange(POINTS)).ravel()
        return {
            "pairs": self.live_pairs.copy(),
            "manifolds": self.manifolds[slots],
            "manifold_points": self.points[places],
            "touching": self.touching[: self.touching_count].copy(),
        }

    def load(self, saved: dict[str, Array], collider_count: int) -> None:
        """Takes back what `saved` gave."""
        self.__init__()  # type: ignore[misc]
        self.set_collider_count(collider_count)
        count = len(saved["pairs"])
        self.make_room(count)
        self.pairs[:count] = saved["pairs"]
        self.pairs["slot"][:count] = np.arange(count)
        self.manifolds[:count] = saved["manifolds"]
        self.points[: count * POINTS] = saved["manifold_points"]
        self._free[: len(self.pairs) - count] = np.arange(len(self.pairs) - 1, count - 1, -1)
        self._free_count[0] = len(self.pairs) - count
        self.pair_count = count
        self.touching_count = len(saved["touching"])
        self.touching[: self.touching_count] = saved["touching"]

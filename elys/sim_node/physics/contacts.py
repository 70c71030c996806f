"""Pairs and their manifolds, and the room they need: everything grows by doubling and never inside a kernel."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.sim_node.physics.kernels.broadphase import DIGIT, find_pairs
from elys.sim_node.physics.kernels.pair_list import compare_pairs, enter_pairs, list_pairs
from elys.sim_node.physics.kernels.simd import LANES
from elys.sim_node.physics.kernels.tables import FOUND, MANIFOLD, PAIR, POINTS, TREE_LEAF, Geometry, grown
from elys.sim_node.physics.kernels.wide_tree import BLOCK, MOST_LEVELS, build_wide_tree, refit_wide_tree
from elys.sim_node.physics.rows import picked_rows
from elys.sim_node.physics.states import ContactPoints

Array = np.ndarray[Any, Any]

WAITING = 512  # a depth-first walk never has more nodes waiting, one through a mesh below it included
FEW = 16  # a tree is made anew when more than one box in so many has moved

# A pair with the slot of its manifold, for those who look from outside.
LIVE_PAIR = np.dtype([("a", "i4"), ("b", "i4"), ("part", "i4"), ("slot", "i4")])


class BoxTree:
    """A wide tree over the fat boxes of colliders, and the room to build it."""

    def __init__(self, count: int) -> None:
        self.leaves = np.zeros(count, TREE_LEAF)
        self.levels = np.zeros(MOST_LEVELS + 1, np.int32)
        self.level_count = 0
        blocks = count
        while blocks > 1 or self.level_count == 0:
            blocks = -(-blocks // LANES)
            self.level_count += 1
            self.levels[self.level_count] = self.levels[self.level_count - 1] + blocks
        self.blocks = np.zeros(int(self.levels[self.level_count]) * BLOCK, np.float32)
        leaf_blocks = int(self.levels[1])
        self.stack = np.zeros(WAITING, np.int32)
        self.near = np.zeros(leaf_blocks, np.int32)
        self.moved_lanes = np.zeros(leaf_blocks, np.uint8)
        self.is_moved = np.zeros(count, np.uint8)
        self.places = np.zeros(count, np.int32)
        self._histogram = np.zeros(1025, np.int32)
        self._corners = np.zeros(6)
        self._moved = count  # since the boxes were sorted

    def follow(self, boxes: Array, moved: Array, moved_count: int) -> None:
        """Follows boxes (C, 6) of which the first listed in `moved` are new.

        They are sorted anew when as many have moved as there are; a few are followed without a look at the others.
        """
        self._moved += moved_count
        sort = self._moved >= len(self.leaves)
        tree = (self.places, self.blocks, self.levels, self.level_count)
        if not sort and moved_count * FEW < len(self.leaves):
            refit_wide_tree(boxes, moved, moved_count, *tree)
            return
        if sort:
            self._moved = 0
        build_wide_tree(boxes, self.leaves, *tree, self._histogram, self._corners, sort)


def _empty_pairs(count: int) -> Array:
    pairs = np.zeros(count, PAIR)
    pairs["a"] = -1
    return pairs


class ContactStore:
    """Pairs by slot, each with a manifold; those that are awake are listed in `active`, sorted by collider rows."""

    def __init__(self) -> None:
        self.active_count = 0
        self.touching_count = 0
        self.is_changed = True  # since contacts were last dealt out to the solver
        self.is_outdated = True  # `active`: something fell asleep, woke, came or went
        self.watched_count = 0
        self.trigger_count = 0
        self.pairs = _empty_pairs(64)
        self.manifolds = np.zeros(64, MANIFOLD)
        self.active = np.zeros(64, np.int32)
        self.touching = np.zeros(64, np.int32)
        self.fast = np.zeros(64, np.int32)
        self.watched = np.zeros(64, np.int32)  # what touches or did in the last step
        self.triggers = np.zeros(64, np.int32)
        self.found = np.zeros(1, FOUND)
        self.tree = BoxTree(0)
        self._free = np.arange(63, -1, -1, dtype=np.int32)  # slot 0 is nobody's: empty lanes of the solver point to it
        self._free_count = np.array([63], np.int32)
        self.room = np.zeros(64, np.int32)  # for work on all active pairs
        self.margins = np.zeros(64)
        self._sleeping = np.zeros(64, np.int32)
        self._sleeping_count = 0
        self._pairs_found = np.zeros(64, PAIR)
        self._pairs_room = np.zeros(64, PAIR)
        self._entries = np.zeros(64, np.int32)
        self._histogram = np.zeros((1 << DIGIT) + 1, np.int32)

    @property
    def flat_manifolds(self) -> Array:
        """The manifolds as float32, a view: what vectors are loaded from."""
        return self.manifolds.view(np.float32)

    @property
    def live_pairs(self) -> Array:
        """All pairs, awake or not, sorted (P,): a copy."""
        slots = np.flatnonzero(self.pairs["a"] >= 0)
        live = np.zeros(len(slots), LIVE_PAIR)
        for name in ("a", "b", "part"):
            live[name] = self.pairs[name][slots]
        live["slot"] = slots
        return live[np.lexsort((live["part"], live["b"], live["a"]))]

    @property
    def pair_count(self) -> int:
        """How many pairs there are, awake or not."""
        return len(self.pairs) - 1 - int(self._free_count[0])

    def set_collider_count(self, count: int) -> None:
        """Makes room for work on `count` colliders."""
        self.tree = BoxTree(count)

    def follow_colliders(self, place: Array) -> None:
        """Colliders have moved to other rows, `place` (old C,) says where; -1 ends their pairs."""
        live = self.pairs["a"] >= 0
        a, b = self.pairs["a"][live], self.pairs["b"][live]
        if not len(a):
            return
        self.pairs["a"][live], self.pairs["b"][live] = place[a], place[b]
        self.drop(np.flatnonzero(live)[(place[a] < 0) | (place[b] < 0)])

    def drop(self, slots: Array) -> None:
        """Ends the pairs in slots (M,)."""
        self.pairs["a"][slots] = -1
        count = int(self._free_count[0])
        self._free[count : count + len(slots)] = slots
        self._free_count[0] = count + len(slots)
        self.touching_count = self.watched_count = self.trigger_count = 0
        self.is_outdated = True

    def calm(self) -> None:
        """What is no number went with its pairs; nobody's manifold, which no pair clears, is emptied of it."""
        self.manifolds[0] = np.zeros((), MANIFOLD)

    def list_active(self, bodies: Array, colliders: Array) -> None:
        """Lists anew the pairs that a step has to look at."""
        self.active_count = list_pairs(bodies, colliders, self.pairs, True, self.active, self.room)
        self.is_outdated = False
        self.is_changed = True

    def list_sleeping(self, bodies: Array, colliders: Array, *, wanted: bool) -> None:
        """Lists the pairs with nobody awake, where they are wanted for the next `update_pairs`: else it finds none of them."""
        self._sleeping_count = 0
        if wanted:
            self._sleeping_count = list_pairs(bodies, colliders, self.pairs, False, self._sleeping, self.room)

    def update_pairs(
        self, colliders: Array, proxies: Array, geometry: Geometry, unpaired: Array, moved: Array, moved_count: int
    ) -> None:
        """Finds the pairs of colliders with new fat boxes, those listed first in `moved`, and ends those that parted.

        `unpaired` are the sorted keys of pairs of bodies that do not collide, see `JointTable`.
        """
        tree = self.tree
        tree.follow(proxies["fat_box"], moved, moved_count)
        movers = (moved, moved_count, tree.is_moved)
        walk = (tree.leaves, tree.places, tree.blocks, tree.levels, tree.level_count)
        room = (tree.moved_lanes, tree.near, tree.stack)
        while True:
            results = (self._pairs_found, self._pairs_room, self._histogram)
            found = find_pairs(colliders, proxies, *movers, *walk, *room, geometry, unpaired, *results)
            if found <= len(self._pairs_found):
                break
            self._pairs_found = np.zeros(2 * found, PAIR)
            self._pairs_room = np.zeros(2 * found, PAIR)
            self._entries = np.zeros(2 * found, np.int32)
        before = self.active_count
        kept, new = compare_pairs(
            self._pairs_found,
            found,
            *movers,
            self.pairs,
            self.manifolds,
            self.active,
            before,
            self._sleeping,
            self._sleeping_count,
            self._entries,
            self._free,
            self._free_count,
        )
        self.active_count = kept + new
        self.is_changed |= new > 0 or kept != before
        if new:
            self.make_room(self.pair_count + new)
            pairs = (self.pairs, self.manifolds, self.active, kept)
            enter_pairs(self._pairs_found, new, self._entries, *pairs, self._free, self._free_count)

    def make_room(self, pair_count: int) -> None:
        """Lets there be that many pairs."""
        old = len(self.pairs)
        if pair_count < old:
            return
        count = max(2 * old, pair_count + 1)
        more = _empty_pairs(count)
        more[:old] = self.pairs
        self.pairs = more
        self.manifolds = grown(self.manifolds, count)
        for name in ("active", "touching", "fast", "watched", "triggers", "_free", "_sleeping", "room", "margins"):
            setattr(self, name, grown(getattr(self, name), count))
        free = int(self._free_count[0])
        self._free[free : free + count - old] = np.arange(count - 1, old - 1, -1)
        self._free_count[0] = free + count - old

    def contact_points(self, bodies: Array, colliders: Array) -> ContactPoints:
        """The points that touch or carried an impulse in the last step, or in the last before their bodies fell asleep."""
        slots = self.live_pairs["slot"]
        slots = slots[self.manifolds["point_count"][slots] > 0]
        pairs, manifolds = self.pairs[slots], self.manifolds[slots]
        real = (manifolds["separation"] <= 0.0) | (manifolds["step_impulse"] > 0.0)
        real &= np.arange(POINTS) < manifolds["point_count"][:, None]
        pair, k = np.nonzero(real)
        normal = manifolds["normal"][pair].astype(np.float64)
        halfway = 0.5 * manifolds["made_separation"][pair, k, None] * normal
        anchor = manifolds["anchors"].reshape(-1, POINTS, 6)[pair, k, :3]
        body_a = colliders["body"][pairs["a"][pair]]
        body_b = colliders["body"][pairs["b"][pair]]
        return ContactPoints(
            bodies["entity"][body_a],
            bodies["entity"][body_b],
            bodies["position"][body_a] + anchor + halfway,
            normal,
            -manifolds["separation"][pair, k],
            manifolds["step_impulse"][pair, k],
        )

    def saved(self) -> dict[str, Array]:
        """Pairs with their manifolds, sorted, and which of them touch."""
        live = self.live_pairs
        place = np.zeros(len(self.pairs), np.int32)
        place[live["slot"]] = np.arange(1, len(live) + 1)
        return {
            "pairs": picked_rows(self.pairs, live["slot"]),
            "manifolds": picked_rows(self.manifolds, live["slot"]),
            "touching": place[self.touching[: self.touching_count]],
        }

    def load(self, saved: dict[str, Array], collider_count: int) -> None:
        """Takes back what `saved` gave."""
        self.__init__()  # type: ignore[misc]
        self.set_collider_count(collider_count)
        count = len(saved["pairs"])
        self.make_room(count)
        self.pairs[1 : count + 1] = saved["pairs"]
        self.manifolds[1 : count + 1] = saved["manifolds"]
        free = len(self.pairs) - 1 - count
        self._free[:free] = np.arange(len(self.pairs) - 1, count, -1)
        self._free_count[0] = free
        self.touching_count = len(saved["touching"])
        self.touching[: self.touching_count] = saved["touching"]

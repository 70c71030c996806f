"""The tree for queries, kept from question to question. It is not the one that finds pairs: asking changes no step."""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.sim_node.physics.kernels.placement import place_colliders
from elys.sim_node.physics.kernels.query_tree import BINS, QUERY_NODE, build_query_tree, refit_query_tree
from elys.sim_node.physics.kernels.tables import Geometry

Array = np.ndarray[Any, Any]

MESH_DEPTH = 64  # nodes that wait on a walk down a mesh's tree, which is complete
WORN_OUT = 1.25  # a tree whose boxes have grown by this since it was built is built anew


class QueryTree:
    """Follows the colliders of a world, when it is asked to."""

    def __init__(self) -> None:
        self.nodes = np.zeros(1, QUERY_NODE)
        self.stack = np.zeros(1, np.int32)
        self.entries = np.zeros(1, np.float32)
        self._collider_count = 0
        self._built_cost = 0.0
        self._is_current = False
        self._bins = np.zeros((BINS + 1, 7))
        self._sweep = np.zeros(BINS)

    def outdate(self) -> None:
        """Something moved, came or went."""
        self._is_current = False

    def follow(self, bodies: Array, colliders: Array, geometry: Geometry) -> None:
        """Brings colliders' places up to date, as the next step would, and the tree with them.

        Boxes that moved a little keep their tree; it is built anew when it has become a quarter worse.
        """
        if self._is_current:
            return
        self._is_current = True
        place_colliders(bodies, colliders, np.arange(len(colliders), dtype=np.int32), len(colliders), geometry)
        count = len(colliders)
        if count == 0:
            return
        boxes = colliders["box"]
        if count == self._collider_count and refit_query_tree(boxes, self.nodes) <= WORN_OUT * self._built_cost:
            return
        if count != self._collider_count:
            self.nodes = np.zeros(max(count - 1, 1), QUERY_NODE)
            self._collider_count = count
            # A walk never has more nodes waiting than there are, however deep the tree; the one over a mesh comes on top.
            self.stack = np.zeros(count + MESH_DEPTH, np.int32)
            self.entries = np.zeros(count + 1, np.float32)
        order = np.zeros(count, np.int32)
        self._built_cost = build_query_tree(boxes, self.nodes, order, self._bins, self._sweep)

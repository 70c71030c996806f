"""In which order the locked rows of joints are eliminated, and where the factors have blocks.

Least degree first: the joint with the fewest neighbours goes next, and its neighbours become neighbours of one another. The
leaves of a tree go first and nothing is added. Joints that would have too many neighbours, as in a net, are left to sweeps.
"""

from __future__ import annotations

import heapq
from typing import Any

import numpy as np

from elys.sim_node.physics.kernels.tables import JOINT_BLOCK, JOINT_COLUMN

Array = np.ndarray[Any, Any]

MOST_NEIGHBOURS = 12


class JointPlan:
    """Columns (C,) part by part in the order of elimination, their blocks (B,), and those that each elimination changes (U,)."""

    def __init__(self, part: Array, direct: Array, bodies: Array) -> None:
        """`part` (J,) is where each joint belongs to, `direct` (D,) are the joints to solve, `bodies` (D, 2) the body rows that
        these couple, -1 for what does not move."""
        self._key = _key(part, direct, bodies)
        order, later = eliminated(neighbours(direct, bodies))
        order.sort(key=part.__getitem__)  # within a part as they are
        place = {joint: number for number, joint in enumerate(order)}
        self.columns = np.zeros(len(order), JOINT_COLUMN)
        block_of: dict[tuple[int, int], int] = {}
        owners: list[int] = []
        lists = [sorted((other for other in later[joint] if other in place), key=place.__getitem__) for joint in order]
        for number, joint in enumerate(order):
            self.columns[number]["joint"] = joint
            self.columns[number]["first"] = len(owners)
            self.columns[number]["count"] = len(lists[number])
            for other in lists[number]:
                block_of[joint, other] = len(owners)
                owners.append(other)
        updates: list[int] = []
        for number, others in enumerate(lists):
            self.columns[number]["update"] = len(updates)
            for position, other in enumerate(others):
                # The one that is eliminated earlier owns the block; others are in the order of elimination.
                updates.extend(block_of[before, other] for before in others[:position])
        self.blocks = np.zeros(len(owners), JOINT_BLOCK)
        self.blocks["joint"] = owners
        self.updates = np.array(updates, np.int32)
        self.direct = np.zeros(len(part), np.uint8)
        self.direct[order] = 1

    def is_for(self, part: Array, direct: Array, bodies: Array) -> bool:
        """Whether it would be the same plan."""
        return self._key == _key(part, direct, bodies)


def _key(part: Array, direct: Array, bodies: Array) -> tuple[bytes, bytes, bytes]:
    return part.tobytes(), direct.tobytes(), bodies.tobytes()


def neighbours(joints: Array, bodies: Array) -> dict[int, set[int]]:
    """Which joints share a body with which."""
    on: dict[int, list[int]] = {}
    for joint, pair in zip(joints.tolist(), bodies.tolist(), strict=True):
        for body in set(pair) - {-1}:
            on.setdefault(body, []).append(joint)
    graph: dict[int, set[int]] = {joint: set() for joint in joints.tolist()}
    for group in on.values():
        if len(group) > 4 * MOST_NEIGHBOURS:  # a hub: its joints see one another in the sweeps
            continue
        for joint in group:
            graph[joint].update(group)
    for joint, others in graph.items():
        others.discard(joint)
    return graph


def eliminated(graph: dict[int, set[int]]) -> tuple[list[int], dict[int, set[int]]]:
    """Joints in the order of elimination, and for each those that come later and stand in its column."""
    queue = [(len(others), joint) for joint, others in graph.items()]
    heapq.heapify(queue)
    order: list[int] = []
    later: dict[int, set[int]] = {}
    gone: set[int] = set()
    while queue:
        degree, joint = heapq.heappop(queue)
        if joint in gone or degree != len(graph[joint]):
            continue
        gone.add(joint)
        others = graph.pop(joint)
        kept = degree <= MOST_NEIGHBOURS
        if kept:
            order.append(joint)
            later[joint] = others
        for other in others:
            graph[other].discard(joint)
            if kept:
                graph[other] |= others - {other}
            heapq.heappush(queue, (len(graph[other]), other))
    return order, later

"""The tree for queries holds every box once, in boxes that never cut anything off, whatever the boxes are like."""

from __future__ import annotations

import numpy as np
import pytest

from elys.sim_node.physics.kernels.query_tree import (
    BINS,
    NOTHING,
    QUERY_NODE,
    build_query_tree,
    refit_query_tree,
)
from elys.sim_node.physics.kernels.tables import COLLIDER

RNG = np.random.default_rng(2)
ONE = np.array([[0.1, 0.2, 0.3, 1.1, 1.2, 1.3]])


def around(centers, half=0.5):
    return np.concatenate([centers - half, centers + half], axis=1)


CROWDS = {
    "one": ONE,
    "two": np.repeat(ONE, 2, axis=0),
    "the same place a hundred times": np.repeat(ONE, 100, axis=0),
    "a crowd": around(RNG.normal(size=(500, 3)) * 20, RNG.uniform(0.1, 2, (500, 3))),
    "a flat grid": around(np.stack(np.meshgrid(np.arange(20.0), [0.0], np.arange(20.0)), -1).reshape(-1, 3)),
    "ever smaller steps": around(2.0 ** -np.arange(900.0)[:, None] * (1, 1, 1), 0.0),
    "sizes from a millimetre to a planet": around(RNG.normal(size=(200, 3)), 10.0 ** RNG.uniform(-3, 7, (200, 3))),
    "without end": np.concatenate([around(RNG.normal(size=(50, 3))), np.full((2, 6), 1e300) * (-1, -1, -1, 1, 1, 1)]),
    "far away": around(RNG.normal(size=(200, 3)) + 1e7),
}


def built(boxes):
    count = len(boxes)
    colliders = np.zeros(count, COLLIDER)
    colliders["box"] = boxes
    nodes = np.zeros(max(count - 1, 1), QUERY_NODE)
    room = (np.zeros(count, np.int32), np.zeros((BINS + 1, 7)), np.zeros(BINS))
    return nodes, build_query_tree(colliders["box"], nodes, *room), colliders


def colliders_below(nodes, boxes):
    """Each collider as often as it is met, with the check that every child's box holds what is below it."""
    found = []
    waiting = [(0, np.full(6, np.inf) * (-1, -1, -1, 1, 1, 1))]
    while waiting:
        node, outer = waiting.pop()
        for side in range(2):
            child = nodes["child"][node, side]
            box = nodes["box"][node, 6 * side : 6 * side + 6].astype(float)
            if child == NOTHING:
                assert (box[:3] > box[3:]).all()
                continue
            assert (outer[:3] <= box[:3]).all()
            assert (box[3:] <= outer[3:]).all()
            if child >= 0:
                waiting.append((child, box))
                continue
            inside = np.clip(boxes[-1 - child], -1e30, 1e30)
            assert (box[:3] <= inside[:3]).all()
            assert (box[3:] >= inside[3:]).all()
            found.append(-1 - child)
    return found


@pytest.mark.parametrize("name", CROWDS)
def test_every_box_is_in_the_tree_once_and_inside_its_nodes(name):
    boxes = CROWDS[name]
    nodes, _, _ = built(boxes)
    assert sorted(colliders_below(nodes, boxes)) == list(range(len(boxes)))


@pytest.mark.parametrize("name", CROWDS)
def test_a_refitted_tree_holds_boxes_that_moved(name):
    boxes = CROWDS[name]
    nodes, cost, colliders = built(boxes)
    assert refit_query_tree(colliders["box"], nodes) == cost
    moved = boxes + np.tile(RNG.normal(size=(len(boxes), 3)), 2)
    colliders["box"] = moved
    refit_query_tree(colliders["box"], nodes)
    assert sorted(colliders_below(nodes, moved)) == list(range(len(boxes)))


def test_a_tree_by_surface_area_is_better_than_one_in_a_line():
    centers = RNG.permutation(np.arange(256.0))[:, None] * (1, 0, 0)
    boxes = around(centers)
    nodes, cost, colliders = built(boxes)
    # Halving a row of 256 cubes again and again gives boxes of 2 * 128, 4 * 64, ... cubes: half surfaces of 1 + 2 n.
    levels = sum(2**k * (1 + 2 * 256 / 2**k) for k in range(1, 9))
    assert cost == pytest.approx(levels, rel=0.1)
    colliders["box"] = boxes[RNG.permutation(256)]
    assert refit_query_tree(colliders["box"], nodes) > 5 * cost

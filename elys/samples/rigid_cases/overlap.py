"""How deep bodies overlap, from their shapes and poses alone: no engine's contacts are asked.

The depth of a pair is the shortest way that parts it. Between boxes it is the least overlap over the 15 axes that can
separate them (Gottschalk et al. 1996, "OBBTree"), which for overlapping boxes is exact. Spheres and capsules are segments
with a radius: exact as long as the segment itself is outside the other shape.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from elys.common.math import quaternion
from elys.samples.rigid_cases.scene import BOX, DYNAMIC, SPHERE, Bodies

Array = np.ndarray[Any, Any]


def deepest_overlap(bodies: Bodies, position: Array, rotation: Array) -> float:
    """The deepest overlap [m] of any pair with a dynamic body, 0 if none touch; position (N, 3) [m], rotation (N, 4)."""
    a, b = _near_pairs(bodies, position, rotation)
    if len(a) == 0:
        return 0.0
    return max(0.0, float(pair_depths(bodies, position, rotation, a, b).max()))


def pair_depths(bodies: Bodies, position: Array, rotation: Array, a: Array, b: Array) -> Array:
    """Depths (M,) [m] of the pairs of rows a, b (M,); negative for a gap."""
    turns = quaternion.to_matrix(quaternion.normalize(np.asarray(rotation, np.float64)))
    depth = np.empty(len(a))
    box_a, box_b = bodies.shape[a] == BOX, bodies.shape[b] == BOX
    both, neither = box_a & box_b, ~box_a & ~box_b
    depth[both] = _box_box(bodies, position, turns, a[both], b[both])
    depth[neither] = _round_round(bodies, position, turns, a[neither], b[neither])
    mixed = ~both & ~neither
    box, other = np.where(box_a, a, b)[mixed], np.where(box_a, b, a)[mixed]
    depth[mixed] = _box_round(bodies, position, turns, box, other)
    return depth


def _box_box(bodies: Bodies, position: Array, turns: Array, a: Array, b: Array) -> Array:
    turn_a, turn_b = turns[a], turns[b]
    faces = np.concatenate([turn_a.transpose(0, 2, 1), turn_b.transpose(0, 2, 1)], axis=1)
    edges = np.cross(faces[:, :3, None, :], faces[:, None, 3:, :]).reshape(-1, 9, 3)
    length = np.linalg.norm(edges, axis=2, keepdims=True)
    axes = np.concatenate([faces, edges / np.maximum(length, 1e-12)], axis=1)
    reach = (abs(axes @ turn_a) * 0.5 * bodies.size[a, None]).sum(2)
    reach += (abs(axes @ turn_b) * 0.5 * bodies.size[b, None]).sum(2)
    apart = abs((axes * (position[b] - position[a])[:, None]).sum(2))
    overlap = reach - apart
    # Parallel edges span no axis of their own.
    overlap[:, 6:][length[:, :, 0] < 1e-6] = np.inf
    return np.asarray(overlap.min(1))


def _segments(bodies: Bodies, position: Array, turns: Array, rows: Array) -> tuple[Array, Array]:
    """Starts and spans of the segments within spheres (of no length) and capsules."""
    half = np.where(bodies.shape[rows] == SPHERE, 0.0, bodies.half_length[rows])
    along = turns[rows][:, :, 1] * half[:, None]
    return position[rows] - along, 2.0 * along


def _round_round(bodies: Bodies, position: Array, turns: Array, a: Array, b: Array) -> Array:
    """Ericson, "Real-Time Collision Detection", 5.1.9: the closest points of two segments."""
    start_a, span_a = _segments(bodies, position, turns, a)
    start_b, span_b = _segments(bodies, position, turns, b)
    away = start_a - start_b
    aa, bb, ab = (span_a**2).sum(1), (span_b**2).sum(1), (span_a * span_b).sum(1)
    da, db = (span_a * away).sum(1), (span_b * away).sum(1)
    determinant = aa * bb - ab * ab
    safe_a, safe_b = np.maximum(aa, 1e-300), np.maximum(bb, 1e-300)
    skew = determinant > 1e-12 * aa * bb
    s = np.where(skew, np.clip((ab * db - da * bb) / np.where(skew, determinant, 1.0), 0.0, 1.0), 0.0)
    t = np.where(bb > 0.0, np.clip((ab * s + db) / safe_b, 0.0, 1.0), 0.0)
    s = np.where(aa > 0.0, np.clip((ab * t - da) / safe_a, 0.0, 1.0), 0.0)
    distance = np.linalg.norm(away + span_a * s[:, None] - span_b * t[:, None], axis=1)
    return np.asarray(bodies.radius[a] + bodies.radius[b] - distance)


def _box_round(bodies: Bodies, position: Array, turns: Array, box: Array, other: Array) -> Array:
    """The signed distance from a box is convex, so its least value along a segment is found by ternary search."""
    start, span = _segments(bodies, position, turns, other)
    local_from_world = turns[box].transpose(0, 2, 1)
    start = (local_from_world @ (start - position[box])[:, :, None])[:, :, 0]
    span = (local_from_world @ span[:, :, None])[:, :, 0]
    half = 0.5 * bodies.size[box]
    low, high = np.zeros(len(box)), np.ones(len(box))
    for _ in range(80 if span.any() else 1):
        left, right = low + (high - low) / 3.0, high - (high - low) / 3.0
        nearer = _box_distance(half, start + span * left[:, None]) < _box_distance(half, start + span * right[:, None])
        low, high = np.where(nearer, low, left), np.where(nearer, right, high)
    return np.asarray(bodies.radius[other] - _box_distance(half, start + span * (0.5 * (low + high))[:, None]))


def _box_distance(half: Array, point: Array) -> Array:
    beyond = abs(point) - half
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return np.asarray(outside + np.minimum(beyond.max(1), 0.0))


def _near_pairs(bodies: Bodies, position: Array, rotation: Array) -> tuple[Array, Array]:
    """Rows of pairs whose bounds overlap, at least one of them dynamic."""
    low, high = _bounds(bodies, position, rotation)
    moving = np.flatnonzero(bodies.motion == DYNAMIC)
    a, b = _neighbours(low, high, moving)
    firsts, seconds = [a], [b]
    for still in np.flatnonzero(bodies.motion != DYNAMIC):  # floors and walls: a handful
        firsts.append(np.full(len(moving), still))
        seconds.append(moving)
    a, b = np.concatenate(firsts), np.concatenate(seconds)
    near = ((low[a] <= high[b]) & (low[b] <= high[a])).all(1)
    return a[near], b[near]


def _bounds(bodies: Bodies, position: Array, rotation: Array) -> tuple[Array, Array]:
    turns = quaternion.to_matrix(quaternion.normalize(np.asarray(rotation, np.float64)))
    boxes = (abs(turns) * 0.5 * bodies.size[:, None, :]).sum(2)
    half = np.where(bodies.shape == SPHERE, 0.0, bodies.half_length)
    rounds = abs(turns[:, :, 1]) * half[:, None] + bodies.radius[:, None]
    reach = np.where((bodies.shape == BOX)[:, None], boxes, rounds)
    return position - reach, position + reach


def _neighbours(low: Array, high: Array, rows: Array) -> tuple[Array, Array]:
    """Pairs of rows in the same cell or in two that touch; a cell is as wide as the widest bounds."""
    if len(rows) == 0:
        return rows, rows
    width = float((high[rows] - low[rows]).max())
    cell = np.floor((0.5 * (low[rows] + high[rows])) / width).astype(np.int64)
    cell -= cell.min(0) - 1
    span = cell.max(0) + 2
    key = (cell[:, 0] * span[1] + cell[:, 1]) * span[2] + cell[:, 2]
    order = np.argsort(key, kind="stable")
    key, rows = key[order], rows[order]
    place = np.arange(len(rows))
    firsts, seconds = [], []
    for step in range(14):  # the cell itself and the half of its 26 neighbours that come after it
        x, rest = divmod(step + 13, 9)
        offset = ((x - 1) * span[1] + rest // 3 - 1) * span[2] + rest % 3 - 1
        begin = place + 1 if step == 0 else np.searchsorted(key, key + offset, "left")
        count = np.maximum(np.searchsorted(key, key + offset, "right") - begin, 0)
        first = np.repeat(place, count)
        firsts.append(first)
        seconds.append(np.arange(len(first)) + np.repeat(begin - (np.cumsum(count) - count), count))
    return rows[np.concatenate(firsts)], rows[np.concatenate(seconds)]

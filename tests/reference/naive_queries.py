"""Queries by trying every shape, with no formula for rays or moving shapes.

All that is known of a shape is how far a point is from it. The gap between two convex shapes is a convex function of the way
that one of them moved: its minimum is found by ternary search, the first touch by bisection. Slow, and exact to 1e-9.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from tests.reference import naive_boxes

BOX, SPHERE, CAPSULE, CYLINDER = 0, 1, 2, 3
SEARCHES = 50


class Shapes(NamedTuple):
    """Standing shapes: kind (C,), center (C, 3), rotation of C, half extents (C, 3) as colliders keep them."""

    kind: np.ndarray
    center: np.ndarray
    rotation: Rotation
    half: np.ndarray


def point_distance(shapes: Shapes, points: np.ndarray) -> np.ndarray:
    """(C,) how far a point (3,), or one for each shape (C, 3), is outside; 0 inside."""
    x, y, z = shapes.rotation.apply(points - shapes.center, inverse=True).T
    hx, hy, hz = shapes.half.T
    beyond = np.maximum(abs(y) - hy, 0.0)
    by_kind = [
        np.sqrt(np.maximum(abs(x) - hx, 0.0) ** 2 + beyond**2 + np.maximum(abs(z) - hz, 0.0) ** 2),
        np.maximum(np.sqrt(x * x + y * y + z * z) - hx, 0.0),
        np.maximum(np.sqrt(x * x + beyond**2 + z * z) - hx, 0.0),
        np.sqrt(np.maximum(np.hypot(x, z) - hx, 0.0) ** 2 + beyond**2),
    ]
    return np.choose(shapes.kind, by_kind)


def smallest(function, low, high):
    """Where and how small convex functions (C,) get between low and high."""
    low, high = np.broadcast_arrays(np.asarray(low, float), np.asarray(high, float))
    for _ in range(SEARCHES):
        first, second = low + (high - low) / 3, high - (high - low) / 3
        left = function(first) <= function(second)
        low, high = np.where(left, low, first), np.where(left, second, high)
    where = 0.5 * (low + high)
    return where, function(where)


def first_touch(gap, count, farthest):
    """(C,) the first t from 0 to `farthest` with gap(t) <= 0, infinity for none; gap is convex and takes and gives (C,)."""
    start = np.zeros(count)
    at, least = smallest(gap, start, np.full(count, farthest))
    low, high = start, np.where(gap(start) <= 0, 0.0, at)
    for _ in range(60):
        middle = 0.5 * (low + high)
        touching = gap(middle) <= 0
        low, high = np.where(touching, low, middle), np.where(touching, middle, high)
    return np.where((least <= 0) | (gap(start) <= 0), high, np.inf)


def cast_sphere(shapes: Shapes, origin, direction, radius, farthest):
    """(C,) how far a ball goes before it touches each shape; a ray for a radius of 0."""
    tiny = 1e-12  # a point that only touches has a gap that rounding keeps above 0
    gap = lambda t: point_distance(shapes, origin + t[:, None] * direction) - radius - tiny  # noqa: E731
    return first_touch(gap, len(shapes.kind), farthest)


def cast_capsule(shapes: Shapes, origin, direction, radius, half_length, rotation: Rotation, farthest):
    """The same for a capsule along y: the least gap of the balls along its middle line."""
    axis = rotation.apply([0.0, 1.0, 0.0]) * np.asarray(half_length)[..., None]

    def gap(t):
        center = origin + t[:, None] * direction
        near = lambda s: point_distance(shapes, center + s[:, None] * axis)  # noqa: E731
        return smallest(near, np.full(len(t), -1.0), np.full(len(t), 1.0))[1] - radius - 1e-12

    return first_touch(gap, len(shapes.kind), farthest)


def cast_box(shapes: Shapes, origin, direction, half, rotation: Rotation, farthest):
    """The same for a box against boxes, by linear programs, and against balls and capsules, which move the other way."""
    found = np.full(len(shapes.kind), np.inf)
    for c in np.flatnonzero(shapes.kind == BOX):
        still = (shapes.center[c], shapes.rotation[c].as_quat(), shapes.half[c])
        time = naive_boxes.time_of_impact((origin, rotation.as_quat(), half), farthest * direction, still)
        found[c] = np.inf if time is None else time * farthest
    round_ones = np.flatnonzero(np.isin(shapes.kind, (SPHERE, CAPSULE)))
    if len(round_ones):
        count = len(round_ones)
        turn = Rotation.from_quat(np.tile(rotation.as_quat(), (count, 1)))
        box = Shapes(np.full(count, BOX), np.tile(origin, (count, 1)), turn, np.tile(half, (count, 1)))
        length = np.where(shapes.kind == CAPSULE, shapes.half[:, 1], 0.0)[round_ones]
        radius = shapes.half[round_ones, 0]
        way = (shapes.center[round_ones], -direction, radius, length, shapes.rotation[round_ones], farthest)
        found[round_ones] = cast_capsule(box, *way)
    return found

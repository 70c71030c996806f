"""Boxes along the axes, against all their corners and against marching along rays."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from elys.common.math import aabb, matrix, quaternion

COORDINATE = st.integers(-8, 8).map(lambda n: n / 2.0)
POINT = st.tuples(COORDINATE, COORDINATE, COORDINATE)


@given(POINT, POINT, POINT)
def test_a_turned_box_is_the_box_of_its_corners(a: tuple[float, ...], b: tuple[float, ...], angles: tuple) -> None:
    lower, upper = np.minimum(a, b), np.maximum(a, b)
    affine = matrix.compose_affine((1.0, -2.0, 3.0), quaternion.from_euler(angles), (1.0, -0.5, 2.0))
    corners = np.array(list(itertools.product(*zip(lower, upper, strict=True))))
    expected = aabb.bounds_of_points(matrix.transform_points(affine, corners))
    assert np.allclose(aabb.transform_bounds(affine, lower, upper), expected)


@given(POINT, POINT, POINT, POINT)
def test_overlap_is_having_a_point_in_common(a: tuple, b: tuple, c: tuple, d: tuple) -> None:
    low, high = np.minimum(a, b), np.maximum(a, b)
    other_low, other_high = np.minimum(c, d), np.maximum(c, d)
    common = np.maximum(low, other_low) <= np.minimum(high, other_high)
    assert bool(aabb.overlaps(low, high, other_low, other_high)) == bool(common.all())


@given(POINT, POINT, POINT, POINT.filter(any))
def test_a_ray_meets_the_box_where_its_first_point_inside_lies(
    a: tuple, b: tuple, origin: tuple, direction: tuple
) -> None:
    lower, upper = np.minimum(a, b), np.maximum(a, b)
    distance = float(aabb.ray_distance(origin, direction, lower, upper))
    # All candidates: the origin and where the ray crosses any face's plane.
    planes = [
        (edge - o) / d
        for edges in (lower, upper)
        for edge, o, d in zip(edges, origin, direction, strict=True)
        if d != 0
    ]
    steps = sorted(t for t in [0.0, *planes] if t >= 0)
    points = np.array(origin) + np.outer(steps, direction)
    inside = ((points >= lower - 1e-9) & (points <= upper + 1e-9)).all(axis=1)
    expected = steps[int(np.argmax(inside))] if inside.any() else np.inf
    assert np.isclose(distance, expected) or (np.isinf(distance) and np.isinf(expected))


def test_nothing_has_an_empty_box_that_adds_nothing() -> None:
    lower, upper = aabb.bounds_of_points(np.zeros((0, 3)))
    assert (lower == np.inf).all()
    assert (upper == -np.inf).all()
    joined = aabb.union_bounds([lower, (0.0, 1.0, 2.0)], [upper, (3.0, 4.0, 5.0)])
    assert np.array_equal(joined, ((0.0, 1.0, 2.0), (3.0, 4.0, 5.0)))


def test_many_rays_against_many_boxes_at_once() -> None:
    distances = aabb.ray_distance(
        np.zeros(3),
        (0.0, 0.0, -1.0),
        np.array([(-1, -1, -3), (-1, -1, 2), (-1, -1, -1)]),
        np.array([(1, 1, -2), (1, 1, 3), (1, 1, 1)]),
    )
    assert distances.tolist() == [2.0, np.inf, 0.0]

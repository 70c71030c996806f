"""Boxes along the axes, against all their corners."""

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


def test_nothing_has_an_empty_box_that_adds_nothing() -> None:
    lower, upper = aabb.bounds_of_points(np.zeros((0, 3)))
    assert (lower == np.inf).all()
    assert (upper == -np.inf).all()
    joined = aabb.union_bounds([lower, (0.0, 1.0, 2.0)], [upper, (3.0, 4.0, 5.0)])
    assert np.array_equal(joined, ((0.0, 1.0, 2.0), (3.0, 4.0, 5.0)))

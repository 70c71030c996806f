"""Meshes without repetitions draw the same triangles."""

from __future__ import annotations

import numpy as np

from elys.common.assets import primitive
from elys.render_node.welding import LARGEST, welded


def test_a_cube_has_eight_places_and_the_same_triangles() -> None:
    cube = primitive("box")
    found = welded(cube.positions, cube.indices)
    assert found is not None
    positions, indices = found
    assert len(positions) == 8 < len(cube.positions)
    assert positions.dtype == np.float32
    assert indices.dtype == np.uint32
    np.testing.assert_array_equal(positions[indices], cube.positions[cube.indices])


def test_places_stand_in_the_order_in_which_they_appear() -> None:
    random = np.random.default_rng(2)
    several = random.normal(size=(40, 3)).astype(np.float32)
    number = random.integers(0, 40, 300)
    indices = random.integers(0, 300, 900).astype(np.uint32)
    found = welded(several[number], indices)
    assert found is not None
    np.testing.assert_array_equal(found[0], several[list(dict.fromkeys(number.tolist()))])
    np.testing.assert_array_equal(found[0][found[1]], several[number][indices])


def test_what_has_few_repetitions_stays() -> None:
    random = np.random.default_rng(4)
    places = random.normal(size=(100, 3)).astype(np.float32)
    assert welded(places, np.arange(99, dtype=np.uint32)) is None
    assert welded(places[:0], np.zeros(0, np.uint32)) is None
    assert welded(np.zeros((LARGEST + 1, 3), np.float32), np.zeros(3, np.uint32)) is None


def test_zeros_of_both_signs_stay_apart() -> None:
    """Equal bits and not equal numbers are what makes drawing them the same."""
    places = np.array([(0.0, 0, 0), (-0.0, 0, 0)] * 5, np.float32)
    found = welded(places, np.arange(9, dtype=np.uint32))
    assert found is not None
    np.testing.assert_array_equal(np.signbit(found[0][:, 0]), [False, True])

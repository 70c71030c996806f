"""Angles without the C library, against the C library."""

from __future__ import annotations

import math

import numpy as np
import pytest

from elys.sim_node.physics.kernels.trigonometry import arc_tangent


def test_the_arc_tangent_is_that_of_the_c_library():
    rng = np.random.default_rng(1)
    angles = np.concatenate([rng.uniform(-math.pi, math.pi, 20000), np.linspace(-math.pi, math.pi, 2001)])
    length = 10.0 ** rng.uniform(-30, 30, len(angles))
    for y, x in zip(np.sin(angles) * length, np.cos(angles) * length, strict=True):
        assert arc_tangent(y, x) == pytest.approx(math.atan2(y, x), rel=0.0, abs=9e-16)


@pytest.mark.parametrize(
    ("y", "x"), [(0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 0.0), (1e-300, 1.0), (1.0, 1.0), (-1.0, -1.0)]
)
def test_the_arc_tangent_on_the_axes_and_diagonals(y, x):
    assert arc_tangent(y, x) == pytest.approx(math.atan2(y, x), rel=1e-15)


def test_small_angles_keep_all_their_digits():
    for angle in (1e-8, 1e-5, 1e-3, 0.1):
        assert arc_tangent(math.sin(angle), math.cos(angle)) == pytest.approx(angle, rel=4e-16)

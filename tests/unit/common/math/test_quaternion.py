"""Rotations, against scipy and PyGLM."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pyglm import glm
from scipy.spatial.transform import Rotation, Slerp

from elys.common.math import quaternion

COMPONENTS = st.floats(-1.0, 1.0, allow_nan=False, width=32)
QUATERNIONS = arrays(np.float64, (5, 4), elements=COMPONENTS).filter(lambda q: (np.linalg.norm(q, axis=1) > 0.1).all())
VECTORS = arrays(np.float64, (5, 3), elements=st.floats(-100.0, 100.0, allow_nan=False, width=32))


def same_rotation(a: np.ndarray, b: np.ndarray, tolerance: float = 1e-9) -> bool:
    """q and -q are one rotation."""
    return bool((np.minimum(np.abs(a - b).max(axis=-1), np.abs(a + b).max(axis=-1)) < tolerance).all())


@given(QUATERNIONS, QUATERNIONS, VECTORS)
def test_product_and_rotation_agree_with_scipy(a: np.ndarray, b: np.ndarray, v: np.ndarray) -> None:
    a, b = quaternion.normalize(a), quaternion.normalize(b)
    ours = quaternion.multiply(a, b)
    theirs = Rotation.from_quat(a) * Rotation.from_quat(b)
    assert same_rotation(ours, theirs.as_quat())
    assert np.allclose(quaternion.rotate(ours, v), theirs.apply(v), atol=1e-9)
    assert np.allclose(quaternion.rotate(quaternion.conjugate(ours), quaternion.rotate(ours, v)), v, atol=1e-9)


@given(QUATERNIONS)
def test_inverse_undoes_any_length(q: np.ndarray) -> None:
    assert np.allclose(quaternion.multiply(q, quaternion.inverse(q)), quaternion.IDENTITY, atol=1e-9)


@given(QUATERNIONS)
def test_matrix_and_back(q: np.ndarray) -> None:
    q = quaternion.normalize(q)
    matrix = quaternion.to_matrix(q)
    assert np.allclose(matrix, Rotation.from_quat(q).as_matrix(), atol=1e-12)
    back = quaternion.from_matrix(matrix)
    assert same_rotation(back, q)
    assert (back[:, 3] >= 0).all()


@given(VECTORS)
def test_euler_agrees_with_scipy_and_returns(angles: np.ndarray) -> None:
    ours = quaternion.from_euler(angles)
    assert same_rotation(ours, Rotation.from_euler("xyz", angles).as_quat())
    # Near the poles the angles may differ, the rotation may not by more than the poles' tolerance allows.
    assert same_rotation(quaternion.from_euler(quaternion.to_euler(ours)), ours, 1e-3)


@pytest.mark.parametrize("about_y", [np.pi / 2, -np.pi / 2])
@pytest.mark.parametrize("about_x", [-3.0, -1.0, 0.0, 0.7, 3.1])
def test_euler_at_the_poles(about_x: float, about_y: float) -> None:
    q = quaternion.from_euler((about_x, about_y, 0.4))
    angles = quaternion.to_euler(q)
    assert angles[2] == 0.0
    assert same_rotation(quaternion.from_euler(angles), q, 1e-6)


@given(QUATERNIONS, QUATERNIONS, st.floats(0.0, 1.0))
def test_slerp_agrees_with_scipy(a: np.ndarray, b: np.ndarray, fraction: float) -> None:
    a, b = quaternion.normalize(a), quaternion.normalize(b)
    ours = quaternion.slerp(a, b, np.full(5, fraction))
    for row in range(5):
        if abs(a[row] @ b[row]) < 1e-6:
            continue  # half a turn apart: both ways are the short one
        theirs = Slerp([0.0, 1.0], Rotation.from_quat([a[row], b[row]]))(fraction).as_quat()
        assert same_rotation(ours[row], theirs, 1e-6)


def test_nlerp_ends_where_it_should_and_takes_the_short_way() -> None:
    a = quaternion.from_axis_angle((0.0, 1.0, 0.0), 0.2)
    b = -quaternion.from_axis_angle((0.0, 1.0, 0.0), 0.6)
    assert same_rotation(quaternion.nlerp(a, b, 0.0), a)
    assert same_rotation(quaternion.nlerp(a, b, 1.0), b)
    assert same_rotation(quaternion.nlerp(a, b, 0.5), quaternion.from_axis_angle((0.0, 1.0, 0.0), 0.4))


def test_axis_angle_agrees_with_glm_and_needs_no_unit_axis() -> None:
    ours = quaternion.from_axis_angle((1.0, 2.0, -0.5), 1.3)
    theirs = glm.angleAxis(1.3, glm.normalize(glm.dvec3(1.0, 2.0, -0.5)))
    assert np.allclose(ours, (theirs.x, theirs.y, theirs.z, theirs.w), atol=1e-12)
    assert np.allclose(quaternion.from_axis_angle((0.0, 0.0, 0.0), 0.0), quaternion.IDENTITY)


def test_float32_stays_and_everything_else_is_float64() -> None:
    q = quaternion.normalize(np.ones((2, 4), dtype=np.float32))
    assert q.dtype == np.float32
    assert quaternion.rotate(q, np.ones((2, 3), dtype=np.float32)).dtype == np.float32
    assert quaternion.rotate(q, np.ones((2, 3))).dtype == np.float64
    assert quaternion.to_matrix([0, 0, 0, 1]).dtype == np.float64


def test_what_has_no_length_becomes_the_identity() -> None:
    assert (quaternion.normalize(np.zeros(4)) == quaternion.IDENTITY).all()

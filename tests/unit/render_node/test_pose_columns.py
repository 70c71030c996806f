"""Transforms as columns beside small matrices one by one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.render_node.pose_columns import FixedTransforms, matrices_of


def test_matrices_are_those_of_scipy() -> None:
    rotation = Rotation.random(50, random_state=3)
    found = matrices_of(rotation.as_quat().astype(np.float32))
    np.testing.assert_allclose(np.moveaxis(found, 2, 0), rotation.as_matrix(), atol=5e-7)


@pytest.mark.parametrize("kind", ["none", "scales", "turned", "offsets", "tiny and far"])
def test_products_are_those_of_matrices(kind: str) -> None:
    random = np.random.default_rng(6)
    inner = np.zeros((40, 3, 4))
    inner[:, :, :3] = np.eye(3)
    if kind == "scales":
        inner[:, :, :3] *= random.uniform(1e-6, 1e3, (40, 1, 3))
    elif kind == "turned":
        inner[:, :, :3] = Rotation.random(40, random_state=4).as_matrix() * random.uniform(0.1, 3.0, (40, 1, 3))
    elif kind == "offsets":
        inner[:, 1, 3] = random.normal(size=40)
    elif kind == "tiny and far":
        inner[:, :, :3] *= 1e-4
        inner[:, :, 3] = 1e6
    inner[:, :, :3] += 1e-17  # as inversions leave it
    outer = Rotation.random(40, random_state=5).as_matrix().astype(np.float32)
    transforms = FixedTransforms(inner)
    expected = outer.astype(np.float64) @ inner
    tolerance = 5e-7 * np.linalg.norm(inner, axis=1)[:, None, :]  # of each axis, and of the offset
    found = np.moveaxis(transforms.turned(np.moveaxis(outer, 0, 2)), 2, 0)
    assert (np.abs(found - expected) <= tolerance).all()
    chosen = np.array((3, 7, 21))
    some = np.moveaxis(transforms.turned(np.moveaxis(outer[chosen], 0, 2), chosen=chosen), 2, 0)
    np.testing.assert_array_equal(some, found[chosen])
    assert transforms.offsets_are_none == (kind not in ("offsets", "tiny and far"))

"""How bodies turn between frames, beside scipy's Slerp and beside rotations at an even speed."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from elys.render_node.rotation_path import rotations_between


def angles_between(ours: NDArray[np.floating], theirs: Rotation) -> NDArray[np.float64]:
    """[rad] by which rotations are apart."""
    return np.asarray((Rotation.from_quat(np.asarray(ours, np.float64)).inv() * theirs).magnitude())


@pytest.mark.parametrize("size", [1e-4, 0.05, 0.0999, 0.2, 1.5, 3.1])
@pytest.mark.parametrize("share", [0.0, 0.21, 0.5, 1.0])
def test_the_way_is_the_one_of_scipy(size: float, share: float) -> None:
    random = np.random.default_rng(7)
    start = Rotation.random(50, random_state=1)
    axes = random.normal(size=(50, 3))
    end = Rotation.from_rotvec(size * axes / np.linalg.norm(axes, axis=1, keepdims=True)) * start
    signs = random.choice((-1.0, 1.0), 50)[:, None]  # both quaternions of a rotation lead the same way
    ours = rotations_between(
        start.as_quat().astype(np.float32), (signs * end.as_quat()).astype(np.float32), np.full(50, share)
    )
    theirs = Rotation.concatenate(
        [Slerp([0, 1], Rotation.concatenate([a, b]))(share) for a, b in zip(start, end, strict=True)]
    )
    assert angles_between(ours, theirs).max() < 2e-5
    np.testing.assert_allclose(np.linalg.norm(ours, axis=1), 1.0, atol=1e-6)


@pytest.mark.parametrize("turns", [0.2, 0.49, 0.51, 0.9, 1.0, 1.3, 4.75])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 1.0, 1.4])
def test_who_spins_fast_goes_all_the_way_round(turns: float, share: float) -> None:
    random = np.random.default_rng(3)
    axes = random.normal(size=(40, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    start = Rotation.random(40, random_state=2)
    whole = 2.0 * np.pi * turns * axes
    end = Rotation.from_rotvec(whole) * start
    promised = whole * random.uniform(0.95, 1.05, (40, 1))  # speeds change on the way
    ours = rotations_between(
        start.as_quat().astype(np.float32),
        end.as_quat().astype(np.float32),
        np.full(40, share),
        turn=promised.astype(np.float32),
    )
    # A whole turn leaves no trace in the quaternions but the promise, whose length and axis are used as they are.
    tolerance = 2e-5 if turns != 1.0 else 2e-3
    assert angles_between(ours, Rotation.from_rotvec(share * whole) * start).max() < tolerance


def test_a_blow_does_not_send_a_body_round() -> None:
    """The speeds before and after cancel out: the short way is taken."""
    start = np.array([(0.0, 0.0, 0.0, 1.0)], np.float32)
    end = Rotation.from_rotvec([0.4, 0.0, 0.0]).as_quat()[None].astype(np.float32)
    ours = rotations_between(start, end, np.array([0.5]), turn=np.array([(0.0, 2.5, 0.0)], np.float32))
    assert angles_between(ours, Rotation.from_rotvec([[0.2, 0.0, 0.0]])).max() < 1e-6

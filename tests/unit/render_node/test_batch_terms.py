"""What is compiled into a batch's shaders is what some instance needs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.common.assets import AssetStore
from elys.common.components import Component, Light, Material, MeshRenderer, Transform
from elys.render_node.batch_terms import EVEN_SCALE, GLOWING, METALLIC, evenly_scaled
from elys.render_node.scene_reader import SceneEdits
from tests.reference.truth_scenes import staged

TURNED = (0.5, 0.5, -0.5, 0.5)


def terms_of(*things: tuple[Component, ...]) -> tuple[str, ...]:
    world = staged([*things, (Transform(), Light())], AssetStore())
    assert len(world.batches) == 1
    return world.batches[0].terms


def test_plain_things_need_nothing() -> None:
    assert terms_of((Transform(rotation=TURNED, scale=(2.0, 2.0, 2.0)), MeshRenderer())) == (EVEN_SCALE,)


def test_one_of_a_batch_is_enough() -> None:
    plain = (Transform(), MeshRenderer())
    assert METALLIC in terms_of(plain, (Transform(), MeshRenderer(), Material(metallic=0.1)))
    assert GLOWING in terms_of((Transform(), MeshRenderer(), Material(emissive=(0.0, 0.0, 0.1))), plain)
    assert EVEN_SCALE not in terms_of(plain, (Transform(scale=(1.0, 1.0, 1.01)), MeshRenderer()), plain)


def test_moving_by_hand_tells_anew() -> None:
    world = staged([(Transform(), MeshRenderer())], AssetStore())
    assert EVEN_SCALE in world.batches[0].terms
    stretched = staged([(Transform(scale=(1.0, 2.0, 1.0)), MeshRenderer())], AssetStore())
    world.set_scene(stretched._tables, SceneEdits(np.array([0])))
    assert EVEN_SCALE not in world.batches[0].terms


@pytest.mark.parametrize("mirrored", [False, True])
def test_even_scales_keep_the_directions_of_normals(mirrored: bool) -> None:
    """Beside the inverse transpose, which is what normals go by."""
    random = np.random.default_rng(5)
    sign = np.diag((-1.0, 1.0, 1.0)) if mirrored else np.eye(3)
    linear = Rotation.random(30, random_state=1).as_matrix() @ sign * random.uniform(0.01, 50.0, (30, 1, 1))
    assert evenly_scaled(linear).all()
    normals = random.normal(size=(30, 3, 1))
    exact = np.linalg.inv(linear).swapaxes(1, 2) @ normals
    taken = linear @ normals
    cosine = (exact * taken).sum(axis=1) / np.linalg.norm(exact, axis=1) / np.linalg.norm(taken, axis=1)
    np.testing.assert_allclose(cosine, 1.0, atol=1e-12)
    assert not evenly_scaled(linear @ np.diag((1.0, 1.0, 1.001))).any()
    sheared = np.eye(3)
    sheared[0, 1] = 0.001
    assert not evenly_scaled(linear @ sheared).any()

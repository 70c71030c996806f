"""Every real model there is opens, and what is known of some comes out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from elys.common.assets import AssetStore, decode_mesh, image_format, is_reference
from elys.common.assets.clip import decode_clips
from elys.common.assets.skin import decode_skin
from elys.common.components import component_from
from elys.common.scene import open_scene, scene_bounds

MODELS = (
    "AlphaBlendModeTest/AlphaBlendModeTest.glb",
    "AnimatedCube/03_animated_cube.gltf",
    "Box/Box.glb",
    "BoxInterleaved/BoxInterleaved.glb",
    "BoxSparse/box_sparse.glb",
    "BoxTextured/BoxTextured.glb",
    "BoxVertexColors/BoxVertexColors.glb",
    "CommonMaterials/04_common_materials.gltf",
    "CornellBox/CornellBox.glb",
    "EmissionStrength/14_emission_strength.gltf",
    "FlightHelmet/FlightHelmet.gltf",
    "Fox/Fox.glb",
    "GeometryCameraLight/geometry-camera-light.glb",
    "NodeHierarchy/02_node_hierarchy.gltf",
    "NormalTangentTest/NormalTangentTest.glb",
    "SimpleSkin/SimpleSkin.gltf",
    "SpotLightTest/spotLightTest.gltf",
    "TextureTransformTest/TextureTransformTest.gltf",
    "TextureWrapping/13_texture_wrapping.gltf",
)

IS_WHOLE = {
    "mesh": lambda data: decode_mesh(data).vertex_count > 0,
    "image": image_format,
    "clips": lambda data: len(decode_clips(data)) > 0,
    "skin": lambda data: len(decode_skin(data).joints) > 0,
}


def test_none_is_forgotten(shared_assets: Path) -> None:
    found = {str(p.relative_to(shared_assets)) for p in shared_assets.rglob("*") if p.suffix in (".gltf", ".glb")}
    assert found == set(MODELS)


@pytest.mark.parametrize("model", MODELS)
def test_a_real_model_opens_whole_and_framed(shared_assets: Path, model: str) -> None:
    assets = AssetStore()
    scene = open_scene(shared_assets / model, assets)
    assert scene.name == Path(model).stem
    present = [name for record in scene.records for name in record.components]
    assert {"Camera", "Light", "MeshRenderer", "Material"} <= set(present)
    for row, record in enumerate(scene.records):
        assert record.parent < row
        for name, values in record.components.items():
            component_from(name, values)
            for reference in filter(is_reference, (v.partition("?")[0] for v in values.values() if isinstance(v, str))):
                data = assets.get(reference)
                assert IS_WHOLE[assets.kind(reference)](data)
    lower, upper = scene_bounds(scene.records, assets)
    assert np.isfinite(lower).all()
    assert (upper >= lower).all()


def test_the_boxes_are_boxes(shared_assets: Path) -> None:
    for model in ("Box/Box.glb", "BoxInterleaved/BoxInterleaved.glb", "BoxTextured/BoxTextured.glb"):
        assets = AssetStore()
        lower, upper = scene_bounds(open_scene(shared_assets / model, assets).records, assets)
        assert np.allclose(lower, -0.5)
        assert np.allclose(upper, 0.5)


def test_the_helmet_has_its_parts_and_pictures(shared_assets: Path) -> None:
    assets = AssetStore()
    scene = open_scene(shared_assets / "FlightHelmet" / "FlightHelmet.gltf", assets)
    assert [r.name for r in scene.records] == [
        "FlightHelmet", "Hose_low", "RubberWood_low", "GlassPlastic_low", "MetalParts_low", "LeatherParts_low", "Lenses_low",
        "Sun", "Camera",
    ]  # fmt: skip
    kinds = [assets.kind(reference) for reference in assets.references()]
    assert (kinds.count("mesh"), kinds.count("image")) == (6, 15)
    lower, upper = scene_bounds(scene.records, assets)
    assert np.allclose(upper - lower, (0.3666, 0.7160, 0.3716), atol=0.001)

"""Real glTF models as they are drawn, each looked at once; `pytest tests/golden --draw-golden` draws them anew.

The models are no part of the project (see `shared_assets`); where they are not at hand these tests are skipped.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import pytest

from elys.common.assets import AssetStore
from elys.common.scene import open_scene
from elys.render_node.gpu import Context
from elys.render_node.offline import OfflineRenderer, load_picture, save_picture
from elys.verbs.footage import simulated

pytestmark = pytest.mark.gl

FOLDER: Final = Path(__file__).parent / "models"
SIZE: Final = (256, 192)
MEAN_TOLERANCE: Final = 1.0  # of 255, over all pixels and channels
FAR_OFF: Final = 16  # of 255, in any channel
FAR_OFF_SHARE: Final = 0.01  # of the pixels: edges move by a pixel between versions of Mesa
MODELS: Final = {  # by the time [s] at which they are drawn
    "AlphaBlendModeTest": 0.0,
    "AnimatedCube": 0.5,
    "Box": 0.0,
    "BoxInterleaved": 0.0,
    "BoxSparse": 0.0,
    "BoxTextured": 0.0,
    "BoxVertexColors": 0.0,
    "CommonMaterials": 0.0,
    "CornellBox": 0.0,
    "EmissionStrength": 0.0,
    "FlightHelmet": 0.0,
    "Fox": 0.5,
    "GeometryCameraLight": 0.0,
    "NodeHierarchy": 0.0,
    "NormalTangentTest": 0.0,
    "SimpleSkin": 1.0,
    "SpotLightTest": 0.0,
    "TextureTransformTest": 0.0,
    "TextureWrapping": 0.0,
}


@pytest.mark.parametrize("model", MODELS)
def test_models_look_as_they_did(
    model: str, context: Context, shared_assets: Path, request: pytest.FixtureRequest
) -> None:
    assets = AssetStore()
    time = MODELS[model]
    footage = simulated(open_scene(next((shared_assets / model).glob("*.gl*")), assets), assets, time)
    footage.mirror.latest_frame = next(footage.frames)
    with OfflineRenderer(footage.mirror, footage.fetch, width=SIZE[0], height=SIZE[1], context=context) as renderer:
        picture = renderer.picture()[..., :3]
    path = FOLDER / f"{model}.png"
    if request.config.getoption("--draw-golden"):
        FOLDER.mkdir(exist_ok=True)
        save_picture(path, picture)
    difference = np.abs(picture.astype(int) - load_picture(path).astype(int))
    far_off = float((difference.max(axis=-1) > FAR_OFF).mean())
    assert difference.mean() <= MEAN_TOLERANCE, f"{model} differs by {difference.mean():.2f} on average"
    assert far_off <= FAR_OFF_SHARE, f"{far_off:.2%} of the pixels of {model} are far off"


def test_no_model_is_left_out(shared_assets: Path) -> None:
    assert {path.parent.name for path in shared_assets.glob("*/*.gl*")} == set(MODELS)

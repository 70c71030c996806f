"""Light from a photographed sky on a model and on spheres; `pytest tests/golden --draw-golden` draws the pictures anew.

Model and sky are no part of the project (see `shared_assets`); where they are not at hand these tests are skipped.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from numpy.typing import NDArray

from elys.common.assets import AssetStore
from elys.common.math.matrix import look_rotation
from elys.common.scene import open_scene
from elys.render_node.gpu import Context
from elys.render_node.offline import OfflineRenderer, load_picture, save_picture
from elys.verbs.footage import simulated

pytestmark = pytest.mark.gl

FOLDER: Final = Path(__file__).parent / "models"
SIZE: Final = (320, 240)
MEAN_TOLERANCE: Final = 1.0  # of 255, over all pixels and channels
FAR_OFF: Final = 16  # of 255, in any channel
FAR_OFF_SHARE: Final = 0.01  # of the pixels: edges move by a pixel between versions of Mesa
STEPS: Final = 5  # of roughness

Entity = dict[str, Any]


def helmet(shared_assets: Path) -> list[Entity]:
    """FlightHelmet, which is 0.7 m high."""
    model = shared_assets / "FlightHelmet" / "FlightHelmet.gltf"
    return [{"name": "Helmet", "prefab": model.as_posix()}, eye((0.35, 0.45, 1.05), (0.0, 0.35, 0.0))]


def spheres(_: Path) -> list[Entity]:
    """Gold above, plastic below, from polished to rough."""
    made: list[Entity] = []
    for row, (metallic, color) in enumerate(((1.0, (1.0, 0.77, 0.34)), (0.0, (0.5, 0.05, 0.05)))):
        for column in range(STEPS):
            place = (1.1 * (column - (STEPS - 1) / 2), 0.6 - 1.2 * row, 0.0)
            surface = {"base_color": color, "metallic": metallic, "roughness": column / (STEPS - 1)}
            parts = {"Transform": {"position": place}, "MeshRenderer": {"mesh": "sphere"}, "Material": surface}
            made.append({"name": f"Sphere {row} {column}", "components": parts})
    return [*made, eye((0.0, 0.4, 6.5), (0.0, 0.0, 0.0))]


def eye(place: tuple[float, float, float], target: tuple[float, float, float]) -> Entity:
    """A camera that looks at a target."""
    rotation = look_rotation(np.subtract(target, place)).tolist()
    return {
        "name": "Eye",
        "components": {"Transform": {"position": place, "rotation": rotation}, "Camera": {"field_of_view": 0.7}},
    }


def drawn(
    entities: list[Entity], shared_assets: Path, context: Context, folder: Path, *, intensity: float = 1.0
) -> NDArray[np.uint8]:
    """Under the evening sky of Venice alone, without any lamp."""
    sky = {"kind": "image", "image": (shared_assets / "env_venice_256" / "venice_sunset_256.hdr").as_posix()}
    around = {"name": "Sky", "components": {"Transform": {}, "Environment": {**sky, "intensity": intensity}}}
    path = folder / "it.scene.json"
    path.write_text(json.dumps({"elys_scene": 1, "entities": [around, *entities]}))
    assets = AssetStore()
    footage = simulated(open_scene(path, assets), assets, 0.0)
    footage.mirror.latest_frame = next(footage.frames)
    with OfflineRenderer(footage.mirror, footage.fetch, width=SIZE[0], height=SIZE[1], context=context) as renderer:
        return renderer.picture()[..., :3]


def difference_from(golden: Path, picture: NDArray[np.uint8]) -> tuple[float, float]:
    """Mean difference of a channel, and the share of pixels that are far off."""
    difference = np.abs(picture.astype(int) - load_picture(golden).astype(int))
    return float(difference.mean()), float((difference.max(axis=-1) > FAR_OFF).mean())


@pytest.mark.parametrize(("name", "scene"), [("FlightHelmet_venice", helmet), ("spheres_venice", spheres)])
def test_things_under_a_photographed_sky_look_as_they_did(
    name: str, scene: Any, context: Context, shared_assets: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    picture = drawn(scene(shared_assets), shared_assets, context, tmp_path)
    path = FOLDER / f"{name}.png"
    if request.config.getoption("--draw-golden"):
        save_picture(path, picture)
    mean, far_off = difference_from(path, picture)
    assert mean <= MEAN_TOLERANCE, f"{name} differs by {mean:.2f} on average"
    assert far_off <= FAR_OFF_SHARE, f"{far_off:.2%} of the pixels of {name} are far off"


def test_other_light_would_be_noticed(context: Context, shared_assets: Path, tmp_path: Path) -> None:
    """The tolerance is not so wide that everything passes: a tenth less light is refused."""
    picture = drawn(spheres(shared_assets), shared_assets, context, tmp_path, intensity=0.9)
    assert difference_from(FOLDER / "spheres_venice.png", picture)[0] > MEAN_TOLERANCE

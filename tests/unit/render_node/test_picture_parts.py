"""Pictures that are drawn in parts against the same drawn at once: no seam, whatever looks at neighbouring pixels."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from elys.bus.messages.scene import SceneDelta, SettingsSet, Spawned
from elys.bus.mirror import SceneMirror
from elys.common.components import Camera, Component, Light, Material, MeshRenderer, Transform, values_of
from elys.common.math.matrix import look_rotation
from elys.common.scene import PictureSettings, SceneSettings
from elys.render_node.camera import View
from elys.render_node.offline import OfflineRenderer
from elys.render_node.passes.bloom import BLOOM_REACH
from elys.render_node.passes.finishing import FXAA_REACH
from elys.render_node.passes.occlusion import OCCLUSION_REACH
from elys.render_node.picture_parts import STEP, parts_of, reach_of
from tests.unit.render_node.test_picture_effects import AHEAD

SIZE = (563, 421)  # odd, so that halves do not come out even
EFFECTS: dict[str, tuple[PictureSettings, int]] = {
    "none": (PictureSettings(), 64),
    "bloom": (PictureSettings(bloom=0.4), 90),
    "ambient occlusion": (PictureSettings(ambient_occlusion=1.0, occlusion_radius=0.8), 396),
    "fxaa": (PictureSettings(fxaa=True), 90),
    "all": (PictureSettings(bloom=0.2, ambient_occlusion=1.0, fxaa=True, fog_density=0.02), 420),
}


def scene(picture: PictureSettings, *, ortho_height: float = 0.0) -> SceneMirror:
    """Blocks on a floor with lamps that are far brighter than white, all over the picture, under a sky and a sun."""
    rng = np.random.default_rng(5)
    grey = Material(base_color=(0.7, 0.7, 0.7), roughness=0.8)
    things: list[tuple[Component, ...]] = [
        (Transform(position=(0, -0.25, 0), scale=(30, 0.5, 30)), MeshRenderer(), grey)
    ]
    for x in range(-4, 5):
        for z in range(-4, 5):
            turn = tuple(look_rotation((float(rng.normal()), 0.0, float(rng.normal()))).tolist())
            scale = tuple(rng.uniform(0.4, 1.0, 3).tolist())
            glow = (30.0, 20.0, 5.0) if (x + 2 * z) % 5 == 0 else (0.0, 0.0, 0.0)
            surface = Material(base_color=tuple(rng.uniform(0.2, 0.9, 3).tolist()), emissive=glow, roughness=0.4)
            things.append(
                (Transform(position=(1.2 * x, 0.3, 1.2 * z), rotation=turn, scale=scale), MeshRenderer(), surface)
            )
    things.append((Transform(rotation=tuple(look_rotation((-0.5, -1.0, -0.4)).tolist())), Light(intensity=2.0)))
    projection: Any = "orthographic" if ortho_height else "perspective"
    camera = Camera(field_of_view=0.9, projection=projection, ortho_height=ortho_height or 10.0)
    things.append((Transform(position=(4, 5, 7), rotation=tuple(look_rotation((-4, -5, -7)).tolist())), camera))
    mirror = SceneMirror()
    spawned = tuple(
        Spawned(
            entity=number,
            name=str(number),
            parent=0,
            enabled=True,
            components={type(c).__name__: values_of(c) for c in parts},
        )
        for number, parts in enumerate(things, 1)
    )
    settings = SettingsSet(settings=msgspec.structs.replace(SceneSettings(), picture=picture))
    mirror.apply_delta(SceneDelta(epoch=0, sequence=0, tick=0, changes=(*spawned, settings)))
    return mirror


def drawn(context: Any, mirror: SceneMirror, **options: Any) -> tuple[np.ndarray, np.ndarray]:
    """Pixels and light."""
    with OfflineRenderer(mirror, width=SIZE[0], height=SIZE[1], context=context, **options) as renderer:
        return renderer.picture().astype(int), renderer.values().astype(float)


@pytest.mark.gl
@pytest.mark.parametrize("name", EFFECTS)
def test_parts_show_no_seam(context: Any, name: str) -> None:
    picture, edge = EFFECTS[name]
    mirror = scene(picture)
    assert len(parts_of(*SIZE, edge=edge, reach=reach_of(picture))) >= 6
    whole, whole_light = drawn(context, mirror)
    parts, parts_light = drawn(context, mirror, tile_edge=edge)
    # Matrices of parts are rounded differently: a sample here and there falls on the other side of an edge. One column or row
    # of a seam would be more than 0.1 % of the picture.
    assert (np.abs(whole - parts).max(axis=-1) > 1).mean() < 5e-4
    relative = np.abs(whole_light - parts_light).max(axis=-1) / np.maximum(whole_light.max(axis=-1), 0.05)
    assert (relative > 2e-2).mean() < 1e-3
    assert np.quantile(relative, 0.99) < 2e-3
    plain = drawn(context, scene(PictureSettings()))[0] if name != "none" else whole + 99
    assert np.abs(plain - whole).max() > 20  # the effect is there


@pytest.mark.gl
def test_a_seam_would_be_seen(context: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same comparison fails where parts have nothing in common."""
    mirror = scene(PictureSettings(ambient_occlusion=1.0, fxaa=True))
    whole, _ = drawn(context, mirror)
    monkeypatch.setattr("elys.render_node.offline.reach_of", lambda picture: 0)
    parts, _ = drawn(context, mirror, tile_edge=200)
    assert (np.abs(whole - parts).max(axis=-1) > 1).mean() > 2e-3


@pytest.mark.parametrize(
    ("length", "edge", "reach"), [(563, 90, 4), (1000, 300, 131), (4097, 4096, 0), (40, 64, 9), (64, 64, 6)]
)
def test_parts_keep_every_pixel_once_and_see_far_enough(length: int, edge: int, reach: int) -> None:
    kept = np.zeros((length, length + 1), int)
    parts = parts_of(length + 1, length, edge=edge, reach=reach)
    for (x, y, width, height), (kept_x, kept_y, kept_width, kept_height) in parts:
        kept[kept_y : kept_y + kept_height, kept_x : kept_x + kept_width] += 1
        assert 0 <= x <= max(kept_x - reach, 0) and 0 <= y <= max(kept_y - reach, 0)
        assert min(kept_x + kept_width + reach, length + 1) <= x + width <= length + 1
        assert min(kept_y + kept_height + reach, length) <= y + height <= length
        assert max(width, height) <= edge
        if len(parts) > 1:
            assert x % STEP == 0 and (length - y - height) % STEP == 0
    assert (kept == 1).all()
    assert len({part.drawn[2:] for part in parts}) == 1  # the card keeps memory of one size


def test_effects_reach_as_far_as_their_shaders_look() -> None:
    assert reach_of(PictureSettings()) == 0
    assert reach_of(PictureSettings(fxaa=True)) == FXAA_REACH
    assert reach_of(EFFECTS["all"][0]) == FXAA_REACH + BLOOM_REACH + OCCLUSION_REACH


@pytest.mark.parametrize("ortho_height", [0.0, 4.0])
def test_a_metre_is_as_many_pixels_high_in_a_part_as_in_the_whole(ortho_height: float) -> None:
    view = View.of(msgspec.structs.replace(AHEAD, rotation=(0.1, 0.2, 0.3, 0.9), ortho_height=ortho_height), 640, 480)
    expected = 480 / ortho_height if ortho_height else 480 / (2 * np.tan(AHEAD.field_of_view / 2))
    assert view.pixels_a_metre == pytest.approx(expected)
    assert view.of_region((33, 90, 200, 100)).pixels_a_metre == pytest.approx(expected)

"""What a scene's picture settings do to its light, against closed forms, and that what is off costs no pass."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

from elys.bus.messages.views import ViewCamera
from elys.common.components import Environment, Light, Material, MeshRenderer, Transform
from elys.common.math.matrix import look_rotation
from elys.common.scene import PictureSettings, SceneSettings, format_scene, parse_scene
from elys.common.scene_document import SceneDocument
from elys.render_node.camera import View
from elys.render_node.pass_plan import told_passes
from elys.render_node.picture_plan import plan_picture
from elys.render_node.quality import EXACT, FAST, FULL, Quality
from elys.render_node.renderer import Renderer

SIZE = 64
BLACK = SceneSettings(background=(0.0, 0.0, 0.0), ambient=(0.0, 0.0, 0.0))
AHEAD = ViewCamera(position=(0.0, 1.0, 0.0), rotation=(0.0, 0.0, 0.0, 1.0), field_of_view=0.6)


def settings(base: SceneSettings = BLACK, **picture: Any) -> SceneSettings:
    return msgspec.structs.replace(base, picture=PictureSettings(**picture))


def glowing_wall(stage: Any, distance: float, radiance: float) -> None:
    """A wall in front of AHEAD that does nothing but glow."""
    stage.add(
        Transform(position=(0.0, 1.0, -distance - 0.5), scale=(50.0, 50.0, 1.0)),
        MeshRenderer(cast_shadows=False),
        Material(base_color=(0.0, 0.0, 0.0), emissive=(radiance,) * 3),
    )


def shown(stage: Any, context: Any, quality: Quality, camera: ViewCamera = AHEAD) -> tuple[np.ndarray, np.ndarray]:
    """The picture and the light before it."""
    renderer, world = Renderer(context, quality=quality), stage.world()
    pixels = renderer.read_pixels(renderer.draw(world, camera, SIZE, SIZE))[..., :3]
    return pixels, renderer.read_light(SIZE, SIZE)[..., :3]


def test_settings_of_pictures_stand_in_scene_files() -> None:
    document = SceneDocument(settings=settings(SceneSettings(), exposure=-1.5, tone_mapping="agx", fog_density=0.02))
    text = format_scene(document)
    assert '"fog_density": 0.02' in text and "bloom" not in text
    assert parse_scene(text).settings == document.settings


def test_exposure_is_in_stops_and_as_a_camera_has_it() -> None:
    assert PictureSettings(exposure=2.0).exposure_factor == pytest.approx(4.0)
    # Full daylight of 100000 lx makes a white surface 31831 cd/m2, and what fills a sensor at EV 15 is 1.2 * 2^15 = 39322 cd/m2.
    assert PictureSettings(camera_ev=15.0).exposure_factor * 31831.0 == pytest.approx(0.8095, rel=1e-4)


@pytest.mark.gl
@pytest.mark.parametrize("quality", [FULL, FAST])
def test_exposure_doubles_what_the_screen_shows(stage, context, quality) -> None:
    glowing_wall(stage, 5.0, 0.1)
    stage.settings = settings(exposure=1.0, tone_mapping="none")
    pixels, _ = shown(stage, context, quality)
    expected = (1.055 * 0.2 ** (1 / 2.4) - 0.055) * 255
    assert abs(int(pixels[SIZE // 2, SIZE // 2, 0]) - expected) <= 1.0


@pytest.mark.gl
def test_agx_keeps_grey_grey_and_rolls_highlights_off(stage, context) -> None:
    """Middle grey stays near where it is; sixteen times white is white, and four times white is not yet."""
    values = []
    for radiance in (0.18, 1.0, 4.0, 16.0):
        stage.components.clear()
        stage.parents.clear()
        stage.enabled.clear()
        glowing_wall(stage, 5.0, radiance)
        stage.settings = settings(tone_mapping="agx")
        values.append(shown(stage, context, FULL)[0][SIZE // 2, SIZE // 2].astype(int))
    middle, one, four, sixteen = values
    assert np.ptp(middle) <= 2 and 105 <= middle[0] <= 135
    assert middle[0] < one[0] < four[0] < sixteen[0]
    assert four[0] < 250 <= sixteen[0]


def khronos_neutral(color: tuple[float, float, float]) -> list[float]:
    """The formula of the specification (KhronosGroup/ToneMapping, "PBR Neutral"), with its names."""
    f90, k_d = 0.04, 0.15
    k_s = 0.8 - f90
    x = min(color)
    f = x - x**2 / (4 * f90) if x <= 2 * f90 else f90
    c = [channel - f for channel in color]
    p = max(c)
    if p <= k_s:
        return c
    p_n = 1 - (1 - k_s) ** 2 / (p + 1 - 2 * k_s)
    g = 1 / (k_d * (p - p_n) + 1)
    return [channel * p_n / p * g + p_n * (1 - g) for channel in c]


def srgb(linear: float) -> float:
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055


def test_the_formula_of_neutral_keeps_what_its_specification_promises() -> None:
    """Base colours up to 0.8 come out as they are, less the 4 % that all surfaces mirror; highlights go to white."""
    assert khronos_neutral((0.54, 0.24, 0.14)) == pytest.approx([0.5, 0.2, 0.1])
    assert khronos_neutral((0.8, 0.8, 0.8)) == pytest.approx([0.76] * 3)
    bright = khronos_neutral((1000.0, 10.0, 10.0))
    assert max(bright) < 1.0 and min(bright) > 0.98


@pytest.mark.gl
@pytest.mark.parametrize("quality", [FULL, FAST], ids=["full", "fast"])
def test_neutral_is_the_formula_of_its_specification(stage, context, quality) -> None:
    """Dark colours, of which less is taken off; those around 0.8, where compression begins; highlights, which lose hue."""
    levels = (0.0, 0.02, 0.079, 0.081, 0.3, 0.759, 0.81, 1.0, 2.5, 12.0, 200.0)
    colors = [(a, b, 0.05) for a in levels for b in levels] + [(level,) * 3 for level in levels]
    columns, rows = 12, 11
    assert len(colors) == columns * rows
    stage.settings = settings(tone_mapping="neutral")
    for number, color in enumerate(colors):
        stage.add(
            Transform(position=(number % columns - 5.5, number // columns - 5.0, -20.0), scale=(1.0, 1.0, 1.0)),
            MeshRenderer(cast_shadows=False),
            Material(base_color=(0.0, 0.0, 0.0), emissive=color),
        )
    camera = ViewCamera(position=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0, 1.0), ortho_height=12.0)
    renderer, world = Renderer(context, quality=quality), stage.world()
    pixels = renderer.read_pixels(renderer.draw(world, camera, 12 * 8, 12 * 8))
    for number, color in enumerate(colors):
        x, y = number % columns - 5.5, number // columns - 5.0
        found = pixels[int(48 - y * 8), int(48 + x * 8), :3]
        expected = [srgb(max(channel, 0.0)) * 255 for channel in khronos_neutral(color)]
        # Half floats of full quality and the rounding to 255 steps.
        assert np.abs(found - np.array(expected)).max() <= 0.75, (color, found, expected)


@pytest.mark.gl
@pytest.mark.parametrize("falloff", [0.0, 0.3])
def test_fog_takes_light_as_its_integral_says(stage, context, falloff: float) -> None:
    """Beer's law over a density that falls with height, integrated in small steps along the way of light."""
    glowing_wall(stage, 20.0, 3.0)
    stage.settings = settings(fog_density=0.05, fog_falloff=falloff, fog_color=(0.1, 0.2, 0.4))
    _, light = shown(stage, context, EXACT)
    for row in (4, 31, 60):
        slope = np.tan(0.3) * (1 - (row + 0.5) / SIZE * 2)
        sideways = np.tan(0.3) * ((SIZE // 2 + 0.5) / SIZE * 2 - 1)
        way = np.array((sideways, slope, -1.0)) * 20.0
        heights = 1.0 + way[1] * (np.arange(2000) + 0.5) / 2000
        depth = (0.05 * np.exp(-falloff * heights)).mean() * np.linalg.norm(way)
        expected = 3.0 * np.exp(-depth) + np.array((0.1, 0.2, 0.4)) * (1 - np.exp(-depth))
        np.testing.assert_allclose(light[row, SIZE // 2], expected, rtol=1e-3)


@pytest.mark.gl
@pytest.mark.parametrize("quality", [FULL, FAST])
def test_bloom_spreads_light_and_makes_none(stage, context, quality) -> None:
    stage.add(
        Transform(position=(0.0, 1.0, -6.0), scale=(0.4, 0.4, 0.1)),
        MeshRenderer(cast_shadows=False),
        Material(base_color=(0.0, 0.0, 0.0), emissive=(20.0, 20.0, 20.0)),
    )
    stage.settings = settings(bloom=0.0)
    _, plain = shown(stage, context, FULL if quality is FULL else replace(FULL, samples=0))
    stage.settings = settings(bloom=0.3)
    _, bloomed = shown(stage, context, quality)
    beside = (SIZE // 2, SIZE // 2 + 12)
    assert plain[beside].max() == 0.0 and bloomed[beside].min() > 0.01
    assert bloomed[SIZE // 2, SIZE // 2, 0] < plain[SIZE // 2, SIZE // 2, 0]
    assert bloomed.sum() == pytest.approx(plain.sum(), rel=0.15)  # some leaves the picture


@pytest.mark.gl
def test_corners_get_less_light_from_around_and_open_floors_do_not(stage, context) -> None:
    """A floor and a wall: at the foot of the wall half the sky is hidden."""
    white = Material(base_color=(1.0, 1.0, 1.0), roughness=1.0)
    stage.add(Transform(position=(0.0, -0.1, 0.0), scale=(40.0, 0.2, 40.0)), MeshRenderer(), white)
    stage.add(Transform(position=(0.0, 2.0, -4.0), scale=(40.0, 4.0, 1.0)), MeshRenderer(), white)
    camera = ViewCamera(position=(0.0, 3.0, 3.0), rotation=tuple(look_rotation((0.0, -0.55, -1.0)).tolist()))
    light = {}
    for amount in (0.0, 1.0):
        base = msgspec.structs.replace(BLACK, ambient=(1.0, 1.0, 1.0))
        stage.settings = settings(base, ambient_occlusion=amount, occlusion_radius=1.0)
        light[amount] = shown(stage, context, EXACT, camera)[1][..., 0]
    share = light[1.0] / light[0.0]
    view = View.of(camera, SIZE, SIZE)
    foot, open_floor = (pixel_of(view, point) for point in ((0.0, 0.0, -3.4), (0.0, 0.0, 0.5)))
    assert 0.4 < share[foot] < 0.85
    assert share[open_floor] > 0.97


def pixel_of(view: View, point: tuple[float, float, float]) -> tuple[int, int]:
    """Row and column where a point of the world is seen."""
    x, y, _, w = view.clip_from_relative @ (*(np.array(point) - view.eye), 1.0)
    return int((1 - y / w) / 2 * view.height), int((x / w + 1) / 2 * view.width)


@pytest.mark.gl
def test_fxaa_smooths_edges_and_leaves_flat_parts_alone(stage, context) -> None:
    stage.add(
        Transform(position=(0.0, 1.0, -6.0), rotation=(0.0, 0.0, 0.13, 0.9915), scale=(1.5, 1.5, 0.1)),
        MeshRenderer(cast_shadows=False),
        Material(base_color=(0.0, 0.0, 0.0), emissive=(0.7, 0.7, 0.7)),
    )
    stage.settings = settings()
    rough, _ = shown(stage, context, FAST)
    stage.settings = settings(fxaa=True)
    smooth, _ = shown(stage, context, FAST)
    assert len(np.unique(rough)) == 2
    assert len(np.unique(smooth)) > 8
    assert smooth[SIZE // 2, SIZE // 2, 0] == rough[SIZE // 2, SIZE // 2, 0]
    np.testing.assert_array_equal(smooth[2, 2], 0)


@pytest.mark.gl
def test_highlights_widen_where_normals_turn_within_a_pixel(stage, context) -> None:
    """A shining ball of a few pixels that mirrors the sun in the middle of one: wider, the image is dimmer."""
    half_pixel = 20.0 * float(np.tan(0.3)) / SIZE
    brightest = {}
    for smoothing in (False, True):
        stage.components.clear()
        stage.parents.clear()
        stage.enabled.clear()
        stage.add(Transform(rotation=tuple(look_rotation((0.0, 0.0, -1.0)).tolist())), Light())
        stage.add(
            Transform(position=(half_pixel, 1.0 + half_pixel, -20.0)),
            MeshRenderer(mesh="sphere", cast_shadows=False),
            Material(metallic=1.0, roughness=0.1),
        )
        stage.settings = settings(specular_antialiasing=smoothing)
        brightest[smoothing] = shown(stage, context, EXACT)[1].max()
    assert brightest[True] < 0.3 * brightest[False]


def test_the_plan_tells_of_effects(stage) -> None:
    glowing_wall(stage, 5.0, 1.0)

    def told() -> dict[str, tuple[bool, str]]:
        passes = told_passes(plan_picture(stage.world(), View.of(AHEAD, SIZE, SIZE)))
        return {entry.name: (entry.is_on, entry.why) for entry in passes}

    plain = told()
    assert [plain[name] for name in ("bloom", "fxaa", "fog", "occlusion")] == [
        (False, "picture.bloom is 0"),
        (False, "picture.fxaa is 0"),
        (False, "picture.fog_density is 0"),
        (False, "picture.ambient_occlusion is 0"),
    ]
    assert plain["environment"] == (False, "all around is black")
    stage.add(Transform(), Environment(kind="sky"))
    stage.settings = settings(bloom=0.1, fog_density=0.2, ambient_occlusion=0.5, fxaa=True)
    asked = told()
    assert all(asked[name][0] for name in ("bloom", "fxaa", "fog", "occlusion", "environment"))
    assert asked["environment"][1].startswith("made once of a clear sky")

"""Light adds up: a picture under many lights is the sum of those under each of them alone; and what is left out is said."""

from __future__ import annotations

import base64
import json
import logging
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from elys.bus.messages.views import ViewCamera
from elys.common.assets import AssetStore
from elys.common.components import Environment, Light, Material, MeshRenderer, Transform
from elys.common.math.matrix import look_rotation
from elys.common.scene import PictureSettings, SceneSettings, open_scene
from elys.render_node.camera import View
from elys.render_node.frame_block import FRAME_DTYPE
from elys.render_node.offline import OfflineRenderer
from elys.render_node.pass_plan import told_passes
from elys.render_node.picture_lights import MOST_FURTHER_SUNS, MOST_LAMPS
from elys.render_node.picture_plan import PicturePlan, plan_picture
from elys.render_node.quality import EXACT, FAST, FULL, Quality
from elys.render_node.renderer import Renderer
from elys.verbs.footage import simulated
from tests.unit.render_node.conftest import Stage

SIZE = 48
EYE = np.array((0.0, 3.0, 4.0))
CAMERA = ViewCamera(position=tuple(EYE), rotation=tuple(look_rotation(-EYE).tolist()), field_of_view=0.7)
KEY, FILL, RIM = (0.4, -1.0, -0.3), (-1.0, -0.5, -0.2), (0.1, -0.4, 1.0)
SETTINGS = SceneSettings(
    background=(0.0, 0.0, 0.0), ambient=(0.0, 0.0, 0.0), picture=PictureSettings(tone_mapping="none")
)
MATTE = Material(base_color=(0.7, 0.5, 0.3), roughness=0.7)
METAL = Material(base_color=(0.9, 0.6, 0.3), metallic=1.0, roughness=0.45)
VARNISHED = Material(base_color=(0.6, 0.2, 0.2), roughness=0.5, clearcoat=1.0, clearcoat_roughness=0.3)
Placed = tuple[Transform, Light]


def sun(direction: tuple[float, float, float], intensity: float, **fields: Any) -> Placed:
    return Transform(rotation=tuple(look_rotation(direction).tolist())), Light(intensity=intensity, **fields)


def lit_stage(lights: Iterable[Placed], material: Material = MATTE, *, cast_shadows: bool = False) -> Stage:
    """Balls on a floor."""
    stage = Stage()
    stage.settings = SETTINGS
    stage.add(
        Transform(scale=(9.0, 1.0, 9.0)), MeshRenderer(mesh="plane", cast_shadows=cast_shadows), Material(roughness=0.8)
    )
    for x in (-0.8, 0.0, 0.8):
        place = Transform(position=(x, 0.4, 0.0), scale=(0.6, 0.6, 0.6))
        stage.add(place, MeshRenderer(mesh="sphere", cast_shadows=cast_shadows), material)
    for light in lights:
        stage.add(*light)
    return stage


def light_of(renderer: Renderer, stage: Stage) -> np.ndarray:
    """Linear radiance (H, W, 3); what the screen shows, where passes write that."""
    renderer.draw(stage.world(), CAMERA, SIZE, SIZE)
    return renderer.read_light(SIZE, SIZE)[..., :3]


def planned(stage: Stage, camera: ViewCamera = CAMERA, **how: int) -> PicturePlan:
    return plan_picture(stage.world(), View.of(camera, SIZE, SIZE), **how)


def told_lights(plan: PicturePlan) -> tuple[bool, str]:
    return next((one.is_on, one.why) for one in told_passes(plan) if one.name == "lights")


def assert_adds_up(
    context: Any,
    quality: Quality,
    lights: list[Placed],
    material: Material = MATTE,
    *,
    alone: list[Placed] | None = None,
) -> None:
    """The lights together against the sum of each `alone`, one light at a time, in 32 bits."""
    alone = lights if alone is None else alone
    exact = Renderer(context, quality=EXACT)
    if quality is FULL:  # four samples a pixel, which the sum has to have as well
        exact = Renderer(context, quality=FULL)
    expected = np.sum([light_of(exact, lit_stage([light], material)).astype(np.float64) for light in alone], axis=0)
    found = light_of(Renderer(context, quality=quality), lit_stage(lights, material))
    assert expected.max() > 0.2
    if quality is FAST:  # the screen's colours at once, in 255 steps
        shown = np.clip(expected, 0.0, 1.0)
        shown = np.where(shown <= 0.0031308, 12.92 * shown, 1.055 * shown ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(found, shown * 255, rtol=0.0, atol=1.01)
    else:
        # Half floats have 11 bits, and each picture of the sum is rounded to them.
        np.testing.assert_allclose(
            found, expected, **({"rtol": 1e-3, "atol": 1e-3} if quality is FULL else {"rtol": 2e-5, "atol": 2e-6})
        )


@pytest.mark.gl
@pytest.mark.parametrize("quality", [EXACT, FULL, FAST], ids=["exact", "full", "fast"])
@pytest.mark.parametrize("material", [MATTE, METAL, VARNISHED], ids=["matte", "metal", "varnished"])
def test_suns_add_up(context, quality: Quality, material: Material) -> None:
    lights = [sun(KEY, 0.9, color=(1.0, 0.9, 0.7)), sun(FILL, 0.6, color=(0.5, 0.7, 1.0)), sun(RIM, 0.4)]
    assert_adds_up(context, quality, lights, material)


@pytest.mark.gl
@pytest.mark.parametrize("quality", [EXACT, FULL, FAST], ids=["exact", "full", "fast"])
def test_suns_and_lamps_add_up(context, quality: Quality) -> None:
    bulb = (Transform(position=(0.5, 1.2, 0.6)), Light(kind="point", intensity=0.5))
    assert_adds_up(context, quality, [bulb, sun(KEY, 0.5), sun(FILL, 0.3)])


@pytest.mark.gl
@pytest.mark.parametrize("quality", [EXACT, FULL], ids=["exact", "full"])
def test_one_sun_throws_shadows_and_the_others_reach_everything(context, quality: Quality) -> None:
    """Whatever the scene's order; and where the brightest throws none, the next one has the maps."""
    renderer = Renderer(context, quality=quality)
    shadowed, open_fill = sun(KEY, 2.0), sun(FILL, 1.0, cast_shadows=False)
    alone = [light_of(renderer, lit_stage([light], cast_shadows=True)) for light in (shadowed, open_fill)]
    for lights in ([shadowed, sun(FILL, 1.0)], [sun(FILL, 1.0), shadowed]):
        found = light_of(renderer, lit_stage(lights, cast_shadows=True))
        np.testing.assert_allclose(found, alone[0] + alone[1], rtol=2e-3, atol=2e-3)
    bright = sun(FILL, 9.0, cast_shadows=False)
    alone[1] = light_of(renderer, lit_stage([bright], cast_shadows=True))
    found = light_of(renderer, lit_stage([bright, shadowed], cast_shadows=True))
    np.testing.assert_allclose(found, alone[0] + alone[1], rtol=2e-3, atol=2e-3)
    unshadowed = light_of(renderer, lit_stage([shadowed]))
    assert np.abs(unshadowed - alone[0]).max() > 0.1  # there is a shadow


@pytest.mark.gl
def test_see_through_things_get_the_light_of_all_suns(context) -> None:
    glass = Material(base_color=(0.7, 0.5, 0.3), opacity=0.5, alpha_mode="blend")
    assert_adds_up(context, EXACT, [sun(KEY, 0.9), sun(FILL, 0.6)], glass)


def test_a_clear_sky_has_the_brightest_sun_whoever_throws_shadows(stage) -> None:
    stage.add(Transform(), Environment(kind="sky"))
    stage.add(*sun(FILL, 9.0, cast_shadows=False))
    alone = planned(stage, shadow_size=512).surroundings.key
    stage.add(*sun(KEY, 2.0))
    plan = planned(stage, shadow_size=512)
    assert plan.sun is not None and plan.sun.light.intensity == 2.0
    assert plan.surroundings.key == alone


def test_the_plan_tells_of_all_lights(stage) -> None:
    assert told_lights(planned(stage)) == (False, "no sun and no lamp shines")
    stage.add(*sun(KEY, 2.0))
    stage.add(Transform(), Light(kind="point"))
    assert told_lights(planned(stage)) == (True, "suns: 1, lamps: 1")
    stage.add(*sun(FILL, 2.0))
    stage.add(*sun(RIM, 0.0))  # is off
    assert told_lights(planned(stage)) == (True, "suns: 2, and one of them throws shadows at most, lamps: 1")


@pytest.mark.gl
def test_one_sun_compiles_no_more_than_it_needs(context) -> None:
    renderer = Renderer(context, quality=FULL)
    asked: list[tuple[str, ...]] = []
    compiled = renderer.resources.programs.program

    def noted(vertex: str, fragment: str, defines: tuple[str, ...] = (), **more: Any) -> Any:
        asked.append(defines)
        return compiled(vertex, fragment, defines, **more)

    renderer.resources.programs.program = noted  # type: ignore[method-assign]
    light_of(renderer, lit_stage([sun(KEY, 1.0)]))
    assert any("SUN" in defines for defines in asked)
    assert not any({"FURTHER_SUNS", "LAMPS"} & set(defines) for defines in asked)
    light_of(renderer, lit_stage([sun(KEY, 1.0), sun(FILL, 1.0)]))
    assert any("FURTHER_SUNS" in defines for defines in asked)


@pytest.mark.gl
def test_the_frame_block_is_as_the_shaders_read_it_and_within_what_gl_promises(context) -> None:
    renderer = Renderer(context, quality=FULL)
    program = renderer.resources.program("shaded.vert", "shaded.frag", ("SUN", "FURTHER_SUNS", "LAMPS", "LAMP_SHADOWS"))
    assert program.raw["Frame"].size == FRAME_DTYPE.itemsize <= 16384


@pytest.mark.gl
def test_nine_suns_are_one_too_many(context) -> None:
    """The weakest is left out, wherever it stands."""
    around = np.linspace(0.0, 2.0 * np.pi, MOST_FURTHER_SUNS + 2, endpoint=False)
    suns = [
        sun((np.cos(angle), -1.0, np.sin(angle)), 0.02 if number == 3 else 0.2 + 0.01 * number)
        for number, angle in enumerate(around.tolist())
    ]
    plan = planned(lit_stage(suns))
    assert plan.left_out == (1, 0)
    assert told_lights(plan)[1] == "suns: 8 of 9, lamps: 0 of 0; left out is what gives the eye least light"
    assert_adds_up(context, EXACT, suns, alone=suns[:3] + suns[4:])


def lamps(count: int, **fields: Any) -> list[Placed]:
    """Bulbs and torches over the floor, each of its own place and strength."""
    random = np.random.default_rng(5)
    made = []
    for number in range(count):
        x, z = random.uniform(-1.2, 1.2, 2).tolist()
        light = Light(
            kind=("point", "spot")[number % 2],
            color=tuple(random.uniform(0.2, 1.0, 3).tolist()),
            intensity=float(random.uniform(4.0, 8.0)) / count,
            range=(0.0, 1.5)[number // 2 % 2],
            outer_cone_angle=0.6,
            cast_shadows=False,
        )
        made.append((Transform(position=(x, 1.1, z), rotation=tuple(look_rotation((0.1, -1.0, 0.0)).tolist())), light))
    return made


@pytest.mark.gl
@pytest.mark.parametrize("quality", [EXACT, FULL, FAST], ids=["exact", "full", "fast"])
def test_twenty_lamps_add_up(context, quality: Quality) -> None:
    assert_adds_up(context, quality, lamps(20))


@pytest.mark.gl
def test_metal_under_as_many_lamps_as_there_is_room_for(context, caplog) -> None:
    many = lamps(MOST_LAMPS)
    with caplog.at_level(logging.WARNING):
        assert_adds_up(context, EXACT, many, METAL)
    assert not caplog.records and not any(planned(lit_stage(many)).left_out)


@pytest.mark.gl
def test_more_lamps_than_that_are_told_of_once(context, caplog) -> None:
    """Those are left out that give the eye least light: here, five weak ones in the midst of the others."""
    many = lamps(MOST_LAMPS)
    weak = [(place, Light(kind="point", intensity=1e-4, cast_shadows=False)) for place, _ in many[:5]]
    crowd = [*many[:9], *weak, *many[9:]]
    stage = lit_stage(crowd)
    plan = planned(stage)
    assert plan.left_out == (0, 5)
    assert [placed.light for placed in plan.lamps] == [light for _, light in many]
    assert told_lights(plan)[1] == "suns: 0 of 0, lamps: 64 of 69; left out is what gives the eye least light"
    renderer, world = Renderer(context, quality=EXACT), stage.world()
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            renderer.draw(world, CAMERA, SIZE, SIZE)
    (record,) = caplog.records
    assert "0 suns and 5 lamps" in record.getMessage()
    assert_adds_up(context, EXACT, crowd, alone=many)


def test_lamps_whose_light_ends_outside_the_view_take_no_room() -> None:
    """A street of 200 lamps, of which the eye sees the near end, and turned round, none."""
    street = [
        (Transform(position=(0.0, 3.0, -5.0 * number)), Light(kind="point", intensity=9.0, range=4.0))
        for number in range(200)
    ]
    seen = ViewCamera(position=(0.0, 2.0, 0.0), rotation=(0.0, 0.0, 0.0, 1.0), far=100.0)
    plan = planned(lit_stage(street), seen)
    assert 15 <= len(plan.lamps) <= 25 and not any(plan.left_out)
    assert [-placed.position[2] for placed in plan.lamps] == sorted(-placed.position[2] for placed in plan.lamps)
    away = ViewCamera(position=(0.0, 2.0, 20.0), rotation=(0.0, 1.0, 0.0, 0.0), far=100.0)
    assert not planned(lit_stage(street), away).lamps


def test_the_same_lamps_shine_while_the_eye_turns_and_takes_a_step() -> None:
    """Those whose light has no end, and those that throw shadows, as long as there is room."""
    random = np.random.default_rng(2)
    stage = lit_stage(
        (
            Transform(position=tuple(random.uniform(-9.0, 9.0, 3).tolist())),
            Light(kind="point", range=number % 2, cast_shadows=number % 2 == 1),
        )
        for number in range(MOST_LAMPS)
    )
    everybody = [placed.light for placed in planned(stage, lamp_shadow_size=1024).lamps]
    assert len(everybody) == MOST_LAMPS
    for place, ahead in (((0.0, 3.0, 4.0), (1.0, -1.0, 0.0)), ((8.0, 1.0, -3.0), (-1.0, 0.0, 0.0))):
        camera = ViewCamera(position=place, rotation=tuple(look_rotation(ahead).tolist()), field_of_view=0.7)
        assert [placed.light for placed in planned(stage, camera, lamp_shadow_size=1024).lamps] == everybody


@pytest.mark.gl
@pytest.mark.parametrize("quality", [EXACT, FAST], ids=["exact", "fast"])
def test_lamps_that_are_not_looped_over_are_seen_by_nobody(context, quality: Quality, monkeypatch) -> None:
    """All pixels are the same where all lamps are in the loop; balls at the edge of what is seen get light from beyond it."""
    row = [
        (Transform(position=(0.25 * number - 5.0, 0.5, 0.7)), Light(kind="point", range=0.9, cast_shadows=False))
        for number in range(41)
    ]
    stage = lit_stage(row)
    assert 10 < len(planned(stage).lamps) < 25
    few = light_of(Renderer(context, quality=quality), stage)
    monkeypatch.setattr("elys.render_node.picture_lights.FEW_LAMPS", MOST_LAMPS)
    assert len(planned(stage).lamps) == len(row)
    assert np.array_equal(light_of(Renderer(context, quality=quality), stage), few)
    assert few.max() > 0.2


def test_the_nearest_of_many_lamps_throw_the_shadows() -> None:
    """Up to eight keep the scene's order; where there are more, those do that give the eye most light, until squares run out."""
    row = [(Transform(position=(3.0 * number, 2.0, 0.0)), Light(kind="point", intensity=5.0)) for number in range(20)]
    for count, x, expected in ((8, 21.0, {0, 1}), (20, 30.0, {10, 11}), (20, 0.0, {0, 1})):
        camera = ViewCamera(position=(x + 0.2, 2.0, 4.0), rotation=(0.0, 0.0, 0.0, 1.0))
        shadows = planned(lit_stage(row[:count], cast_shadows=True), camera, lamp_shadow_size=1024).lamp_shadows
        assert shadows is not None
        assert {number for number, first in enumerate(shadows.first) if first >= 0} == expected
    # A step that changes nothing of who is served leaves the atlas as it was.
    steps = [
        planned(
            lit_stage(row, cast_shadows=True),
            ViewCamera(position=(x, 2.0, 4.0), rotation=(0.0, 0.0, 0.0, 1.0)),
            lamp_shadow_size=1024,
        ).lamp_shadows
        for x in (31.2, 31.8)
    ]
    assert steps[0] is not None and steps[1] is not None and steps[0].key == steps[1].key


@pytest.mark.gl
def test_suns_of_a_gltf_file_add_up(context, tmp_path: Path) -> None:
    """KHR_lights_punctual: a key, a fill and a rim light, of which each shines along its node's -z."""
    kinds = [
        {"type": "directional", "intensity": 2.0},
        {"type": "directional", "intensity": 1.0, "color": [0.3, 0.5, 1.0]},
        {"type": "directional", "intensity": 0.5},
    ]
    pictures = {
        chosen: gltf_light(context, tmp_path, [kinds[number] for number in chosen], [KEY, FILL, RIM], chosen)
        for chosen in ((0,), (1,), (2,), (0, 1, 2))
    }
    together = pictures.pop((0, 1, 2))
    assert all(picture.max() > 0.01 for picture in pictures.values())
    np.testing.assert_allclose(together, sum(pictures.values()), rtol=2e-5, atol=2e-6)


def gltf_light(
    context: Any,
    folder: Path,
    kinds: list[dict[str, Any]],
    ways: list[tuple[float, float, float]],
    chosen: tuple[int, ...],
) -> np.ndarray:
    """Linear radiance of a square that faces a camera, under these lights of a file."""
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], "<f4")
    normals = np.tile(np.array((0, 0, 1), "<f4"), (4, 1))
    data = corners.tobytes() + normals.tobytes() + np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes()
    view = {"buffer": 0, "byteLength": 48}
    model = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": kinds}},
        "buffers": [{"uri": "data:;base64," + base64.b64encode(data).decode(), "byteLength": len(data)}],
        "bufferViews": [view, view | {"byteOffset": 48}, {"buffer": 0, "byteOffset": 96, "byteLength": 12}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.5, 0.2, 1], "metallicFactor": 0.5}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2, "material": 0}]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}],
        "nodes": [
            # Lights come from above, so the square lies on its back, and the camera looks down on it.
            {"mesh": 0, "rotation": look_rotation((0.0, -1.0, 0.0)).tolist()},
            {"camera": 0, "translation": [0, 3, 0], "rotation": look_rotation((0.0, -1.0, 0.0)).tolist()},
            *(
                {"rotation": look_rotation(ways[way]).tolist(), "extensions": {"KHR_lights_punctual": {"light": light}}}
                for light, way in enumerate(chosen)
            ),
        ],
        "scenes": [{"nodes": list(range(2 + len(chosen)))}],
        "scene": 0,
    }
    path = folder / f"suns{''.join(map(str, chosen))}.gltf"
    path.write_text(json.dumps(model))
    assets = AssetStore()
    footage = simulated(open_scene(path, assets), assets, 0.0)
    footage.mirror.keep_frame(next(footage.frames))
    with OfflineRenderer(
        footage.mirror, footage.fetch, width=SIZE, height=SIZE, environment=False, context=context
    ) as renderer:
        return renderer.values().astype(np.float64)[..., :3]

"""Which passes a picture needs and why; what is switched off changes no pixel."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from elys.bus.messages.views import ViewCamera
from elys.common.components import Light, Material, MeshRenderer, Transform
from elys.render_node.camera import View
from elys.render_node.pass_plan import told_passes
from elys.render_node.passes import shading
from elys.render_node.passes.backdrop import SkyPass
from elys.render_node.passes.finishing import OutlinePass
from elys.render_node.passes.shading import OpaquePass, TransparentPass
from elys.render_node.picture_plan import plan_picture
from elys.render_node.renderer import Renderer

SIZE = 96
CAMERA = ViewCamera(position=(0.0, 1.0, 6.0), rotation=(0.0, 0.0, 0.0, 1.0), field_of_view=0.8)


def told(world) -> dict[str, tuple[bool, str]]:
    plan = plan_picture(world, View.of(CAMERA, SIZE, SIZE), shadow_size=512)
    return {name: (is_on, why) for name, is_on, why in told_passes(plan)}


def test_an_empty_stage_needs_nothing_but_the_screen(stage):
    passes = told(stage.world())
    assert [name for name, (is_on, _) in passes.items() if is_on] == ["tonemap"]
    assert passes["shadow"] == (False, "no sun") and passes["tangents"] == (False, "no normal map is seen")


def test_the_plan_follows_the_scene(stage):
    stage.add(Transform(), MeshRenderer(), Material())
    stage.add(Transform(), Light(kind="directional", cast_shadows=False))
    passes = told(stage.world())
    assert passes["opaque"] == (True, "1 solid thing seen, in 1 draw call")
    assert passes["shadow"] == (False, "the sun casts no shadows")
    stage.add(
        Transform(position=(1.0, 0.0, 1.0)),
        MeshRenderer(),
        Material(base_color=(1.0, 0.0, 0.0), opacity=0.5, alpha_mode="blend"),
    )
    stage.add(Transform(), Light(kind="directional", intensity=9.0))
    stage.settings = msgspec.structs.replace(stage.settings, background=(0.2, 0.3, 0.4))
    passes = told(stage.world())
    assert passes["transparent"] == (True, "1 see-through thing seen, in 1 draw call")
    assert passes["shadow"][0] and passes["sky"] == (True, "something is behind everything")


@pytest.mark.gl
@pytest.mark.parametrize("pass_", [SkyPass, OutlinePass, OpaquePass, TransparentPass])
def test_a_pass_that_is_not_needed_changes_no_pixel(pass_, stage, context, monkeypatch):
    if pass_ is not OpaquePass:
        stage.add(Transform(), MeshRenderer(), Material(base_color=(0.8, 0.3, 0.1)))
    stage.add(Transform(rotation=(-0.5, 0.0, 0.0, 0.866)), Light(kind="directional", intensity=3.0))
    plain = picture(stage, context)
    monkeypatch.setattr(pass_, "is_needed", staticmethod(lambda plan: True))
    assert np.array_equal(picture(stage, context), plain)


@pytest.mark.gl
def test_tangents_without_a_normal_map_change_no_pixel(stage, context, monkeypatch):
    stage.add(Transform(rotation=(0.3, 0.2, 0.1, 0.9)), MeshRenderer(), Material(base_color=(0.8, 0.3, 0.1)))
    stage.add(Transform(rotation=(-0.5, 0.0, 0.0, 0.866)), Light(kind="directional", intensity=3.0))
    plain = picture(stage, context)
    monkeypatch.setattr(shading, "TANGENTS", "")  # so that none are left out
    assert np.array_equal(picture(stage, context), plain)
    assert plain[..., :3].max() > 0


@pytest.mark.gl
def test_a_shadow_map_that_nothing_is_drawn_into_changes_no_pixel(stage, context):
    """Without a caster there is no map; with one that is far out of the light's way the map is drawn and darkens nothing."""
    stage.add(Transform(), MeshRenderer(cast_shadows=False), Material(base_color=(0.8, 0.3, 0.1)))
    stage.add(Transform(rotation=(-0.5, 0.0, 0.0, 0.866)), Light(kind="directional", intensity=3.0))
    assert not told(stage.world())["shadow"][0]
    plain = picture(stage, context)
    stage.add(Transform(position=(1.7, 0.0, -3.0)), MeshRenderer(), Material(base_color=(0.1, 0.3, 0.8)))
    assert told(stage.world())["shadow"][0]
    left = slice(0, SIZE // 3)
    assert np.array_equal(picture(stage, context)[:, left], plain[:, left])


def picture(stage, context) -> np.ndarray:
    """RGBA of a new renderer: none of its programs and maps are left from another picture."""
    renderer, world = Renderer(context), stage.world()
    renderer.settle(world)
    world.place()
    return renderer.read_pixels(renderer.draw(world, CAMERA, SIZE, SIZE))

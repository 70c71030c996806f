"""Pictures against rays cast at exact shapes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from elys.common.components import Light
from elys.common.errors import DisplayError
from elys.render_node.camera import View
from elys.render_node.gpu import Context, offscreen_context
from elys.render_node.picture_plan import plan_picture
from elys.render_node.quality import EXACT, FULL, Quality
from elys.render_node.renderer import Renderer
from tests.reference.traced_pictures import relative_errors, wrong_shadow_reach
from tests.reference.truth_scenes import counted, drawn_light, hard_shadow, spheres

pytestmark = pytest.mark.gl

SIZE = 240


@pytest.fixture(scope="module")
def context() -> Iterator[Context]:
    try:
        made = offscreen_context()
    except DisplayError as error:
        pytest.skip(str(error))
    yield made
    made.release()


@pytest.mark.parametrize("quality", ["exact", "full"])
def test_49_spheres_have_the_light_that_rays_find(context: Context, quality: str) -> None:
    scene = spheres(SIZE)
    light = drawn_light(context, scene, SIZE, **({"quality": FULL} if quality == "full" else {}))
    errors = relative_errors(light, scene.truth.light, counted(scene.truth))
    assert len(errors) > 5000
    assert np.median(errors) < 2e-3
    # Four samples a pixel average over it, where the truth has its middle.
    assert np.percentile(errors, 99) < (2e-2 if quality == "exact" else 6e-2)


def test_the_measure_notices_other_light(context: Context) -> None:
    """Three thousandths of light more are more than the test above lets through."""
    scene = spheres(SIZE)
    light = drawn_light(context, scene, SIZE)
    assert np.median(relative_errors(light * 1.003, scene.truth.light, counted(scene.truth))) > 2e-3


@pytest.mark.parametrize("quality", ["exact", "full"])
def test_shadows_end_where_rays_say(context: Context, quality: str) -> None:
    scene = hard_shadow(SIZE)
    light = drawn_light(context, scene, SIZE, **({"quality": FULL} if quality == "full" else {}))
    assert wrong_shadow_reach(light, scene.truth, ground=0) <= 2
    errors = relative_errors(light, scene.truth.light, counted(scene.truth) & scene.truth.lit)
    assert np.median(errors) < 2e-3


@pytest.mark.parametrize("kind", ["point", "spot", "wide spot"])
@pytest.mark.parametrize("quality", [EXACT, FULL])
def test_shadows_of_lamps_end_where_rays_say(context: Context, kind: str, quality: Quality) -> None:
    """Within the inner cone a spot is a bulb."""
    angles = {"point": (0.0, 0.8), "spot": (0.6, 0.7), "wide spot": (1.2, 1.3)}[kind]
    lamp = Light(
        kind="point" if kind == "point" else "spot",
        intensity=20.0,
        inner_cone_angle=angles[0],
        outer_cone_angle=angles[1],
    )
    scene = hard_shadow(SIZE, lamp)
    light = drawn_light(context, scene, SIZE, quality=quality)
    assert (~scene.truth.lit & (scene.truth.hit == 0)).sum() > 1000  # there is a shadow on the floor
    assert wrong_shadow_reach(light, scene.truth, ground=0) <= 2
    errors = relative_errors(light, scene.truth.light, counted(scene.truth) & scene.truth.lit)
    assert np.median(errors) < 2e-3
    # Not darkened by themselves: nowhere but at the edges of shadows is light missing.
    assert np.percentile(errors, 90) < 2e-2


def test_lamps_keep_their_shadows_while_nothing_moves(context: Context) -> None:
    scene = hard_shadow(SIZE, Light(kind="point", intensity=20.0))
    renderer = Renderer(context, quality=FULL)
    renderer.settle(scene.world)
    scene.world.place()

    def squares(eye: tuple[float, float, float]) -> int:
        drawn = renderer._lamp_shadows.drawn  # what the atlas holds
        view = View.of(msgspec.structs.replace(scene.camera, position=eye), SIZE, SIZE)
        plan = plan_picture(scene.world, view, lamp_shadow_size=2048, drawn_lamp_shadows=drawn)
        renderer.draw(scene.world, view.camera, SIZE, SIZE)
        return len(plan.lamp_casters)

    assert squares((0.0, 5.0, 7.0)) == 6
    assert squares((0.5, 5.0, 7.0)) == 0  # who looks around changes nothing
    scene.world.pose_version += 1
    assert squares((0.5, 5.0, 7.0)) == 6


def test_the_measure_notices_a_shadow_that_lies_elsewhere(context: Context) -> None:
    scene = hard_shadow(SIZE)
    light = np.roll(drawn_light(context, scene, SIZE), 5, axis=1)
    assert wrong_shadow_reach(light, scene.truth, ground=0) > 2


def test_long_views_have_a_finer_map_around_the_eye(context: Context) -> None:
    """The ball and the block again, with things that throw shadows as far as 400 m: one map alone would miss the edges by far."""
    shadows = {}
    for long_views in (True, False):
        scene = hard_shadow(SIZE, far_things=True)
        quality = replace(FULL, single_shadow_tap=not long_views)
        light = drawn_light(context, scene, SIZE, quality=quality)
        shadows[long_views] = wrong_shadow_reach(light, scene.truth, ground=0)
        view = View.of(scene.camera, SIZE, SIZE)
        plan = plan_picture(scene.world, view, shadow_size=2048, long_views=long_views)
        assert (len(plan.cascades) > 1) == long_views
    assert shadows[True] <= 2 < shadows[False]
    plain = hard_shadow(SIZE)
    drawn_light(context, plain, SIZE)  # its meshes have come
    assert len(plan_picture(plain.world, view, shadow_size=2048, long_views=True).cascades) == 1  # no need

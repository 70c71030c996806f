"""Pictures against rays cast at exact shapes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from elys.common.errors import DisplayError
from elys.render_node.gpu import Context, offscreen_context
from elys.render_node.quality import FULL
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


def test_the_measure_notices_a_shadow_that_lies_elsewhere(context: Context) -> None:
    scene = hard_shadow(SIZE)
    light = np.roll(drawn_light(context, scene, SIZE), 5, axis=1)
    assert wrong_shadow_reach(light, scene.truth, ground=0) > 2

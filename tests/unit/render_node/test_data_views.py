"""Views of data beside what geometry says, and large pictures beside small ones."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from elys.bus.messages.scene import SceneDelta, Spawned
from elys.bus.messages.views import ViewCamera
from elys.bus.mirror import SceneMirror
from elys.common.components import Component, Light, Material, MeshRenderer, Transform, values_of
from elys.common.errors import ElysError
from elys.common.math.matrix import look_rotation
from elys.render_node.data_colors import data_pixels, depth_unit_of
from elys.render_node.offline import VIEWS, OfflineRenderer
from elys.render_node.passes.data import DATA_KINDS

pytestmark = pytest.mark.gl

WIDTH, HEIGHT = 96, 64
FIELD_OF_VIEW = 0.8
FLOOR, BALL, GLASS = 7, 70_000, 3_000_000_000  # ids need all of their 32 bits
EYE = np.array((0.0, 3.0, 6.0))
CAMERA = ViewCamera(
    position=tuple(EYE.tolist()),
    rotation=tuple(look_rotation((0.0, -0.45, -1.0)).tolist()),
    field_of_view=FIELD_OF_VIEW,
    near=0.1,
    far=200.0,
)
RADIUS = 0.9
CENTRE = np.array((-0.7, 0.9, 0.0))
GLASS_Z = 1.5  # of its front


@pytest.fixture(scope="module")
def mirror() -> SceneMirror:
    """A floor whose top is y = 0, a ball, and a pane of glass that hides a part of both."""
    things: dict[int, tuple[Component, ...]] = {
        FLOOR: (
            Transform(position=(0.0, -0.5, 0.0), scale=(40.0, 1.0, 40.0)),
            MeshRenderer(),
            Material(base_color=(0.25, 0.5, 0.125), roughness=0.75),
        ),
        BALL: (
            Transform(position=tuple(CENTRE.tolist()), scale=(2 * RADIUS,) * 3),
            MeshRenderer(mesh="sphere"),
            Material(base_color=(0.9, 0.1, 0.2), roughness=0.25, metallic=1.0),
        ),
        GLASS: (
            Transform(position=(1.5, 1.0, GLASS_Z - 0.05), scale=(1.6, 1.6, 0.1)),
            MeshRenderer(),
            Material(opacity=0.3, alpha_mode="blend", base_color=(0.2, 0.4, 0.6), roughness=0.5),
        ),
        11: (Transform(rotation=tuple(look_rotation((-0.4, -1.0, -0.3)).tolist())), Light()),
    }
    made = SceneMirror()
    changes = tuple(
        Spawned(
            entity=entity,
            name=str(entity),
            parent=0,
            enabled=True,
            components={type(value).__name__: values_of(value) for value in components},
        )
        for entity, components in things.items()
    )
    made.apply_delta(SceneDelta(epoch=0, sequence=0, tick=0, changes=changes))
    return made


def seen(context, mirror: SceneMirror, view: str, **options) -> NDArray[np.generic]:
    """The values of a view."""
    size = {"width": WIDTH, "height": HEIGHT} | options
    with OfflineRenderer(mirror, context=context, shows=view, **size) as renderer:
        return renderer.values(camera=CAMERA)


@pytest.fixture(scope="module")
def rays() -> NDArray[np.float64]:
    """Directions (H, W, 3) through the pixels' centres, as long as a metre of depth takes."""
    x = (2.0 * (np.arange(WIDTH) + 0.5) / WIDTH - 1.0) * WIDTH / HEIGHT * np.tan(FIELD_OF_VIEW / 2)
    y = (1.0 - 2.0 * (np.arange(HEIGHT) + 0.5) / HEIGHT) * np.tan(FIELD_OF_VIEW / 2)
    forward = np.array((0.0, -0.45, -1.0)) / np.hypot(0.45, 1.0)
    right = np.array((1.0, 0.0, 0.0))
    up = np.cross(right, forward)
    return forward + x[None, :, None] * right + y[:, None, None] * up


@pytest.fixture(scope="module")
def hits(rays: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Depth (H, W) and entity (H, W) of what rays meet first, computed from the shapes alone."""
    depth, entity = np.full((HEIGHT, WIDTH), np.inf), np.zeros((HEIGHT, WIDTH), np.uint32)

    def nearer(distance: NDArray[np.float64], there: NDArray[np.bool_], name: int) -> None:
        better = there & (distance > 0.0) & (distance < depth)
        depth[better], entity[better] = distance[better], name

    with np.errstate(divide="ignore", invalid="ignore"):
        floor = -EYE[1] / rays[..., 1]
        place = EYE + floor[..., None] * rays
        nearer(floor, (np.abs(place[..., (0, 2)]) < 20.0).all(axis=-1), FLOOR)
        a, b = (rays**2).sum(axis=-1), rays @ (EYE - CENTRE)
        root = b**2 - a * (((EYE - CENTRE) ** 2).sum() - RADIUS**2)
        nearer((-b - np.sqrt(np.maximum(root, 0.0))) / a, root > 0.0, BALL)
        for axis, at in ((2, GLASS_Z), (1, 1.8), (0, 0.7)):  # the faces that look at the eye
            pane = (at - EYE[axis]) / rays[..., axis]
            place = EYE + pane[..., None] * rays
            inside = np.abs(place - (1.5, 1.0, GLASS_Z - 0.05)) <= np.array((0.8, 0.8, 0.05)) + 1e-9
            nearer(pane, inside.all(axis=-1), GLASS)
    return depth, entity


def test_entities_are_those_that_rays_meet(context, mirror, hits) -> None:
    entity = seen(context, mirror, "entity")
    assert entity.shape == (HEIGHT, WIDTH, 1)
    assert entity.dtype == np.uint32
    assert set(np.unique(hits[1])) == {0, FLOOR, BALL, GLASS}
    # The ball is a polyhedron, whose outline lies a little inside.
    assert (entity[..., 0] != hits[1]).mean() < 0.005


def test_depth_is_in_metres_along_the_view(context, mirror, hits) -> None:
    depth = seen(context, mirror, "depth")[..., 0]
    entity = seen(context, mirror, "entity")[..., 0]
    expected, of = hits
    assert depth.dtype == np.float32
    np.testing.assert_array_equal(np.isinf(depth), entity == 0)
    for name, tolerance in ((FLOOR, 2e-5), (GLASS, 2e-5), (BALL, 0.02)):
        both = (entity == name) & (of == name)
        assert both.sum() > 100
        error = np.abs(depth[both] - expected[both]) / expected[both]
        assert np.quantile(error, 0.97) < tolerance, (name, error.max())


def test_normals_are_those_of_the_shapes(context, mirror, hits, rays) -> None:
    normals = seen(context, mirror, "normals")
    entity = seen(context, mirror, "entity")[..., 0]
    np.testing.assert_allclose(np.linalg.norm(normals[entity != 0], axis=-1), 1.0, atol=1e-5)
    assert not normals[entity == 0].any()
    np.testing.assert_allclose(normals[entity == FLOOR], np.array([(0.0, 1.0, 0.0)]).repeat((entity == FLOOR).sum(), 0))
    both = (entity == BALL) & (hits[1] == BALL)
    outward = (EYE + hits[0][both][:, None] * rays[both] - CENTRE) / RADIUS
    cosine = np.einsum("ij,ij->i", normals[both], outward)
    assert np.quantile(cosine, 0.05) > 0.999


def test_materials_are_seen_as_they_were_given(context, mirror) -> None:
    albedo, roughness = seen(context, mirror, "albedo"), seen(context, mirror, "roughness")[..., 0]
    entity = seen(context, mirror, "entity")[..., 0]
    for name, color, rough in (
        (FLOOR, (0.25, 0.5, 0.125), 0.75),
        (BALL, (0.9, 0.1, 0.2), 0.25),
        (GLASS, (0.2, 0.4, 0.6), 0.5),
    ):
        np.testing.assert_allclose(
            albedo[entity == name], np.array([color]).repeat((entity == name).sum(), 0), rtol=1e-6
        )
        np.testing.assert_allclose(roughness[entity == name], rough, rtol=1e-6)
    assert not albedo[entity == 0].any()


def test_overdraw_counts_what_is_shaded(context, mirror) -> None:
    count = seen(context, mirror, "overdraw")[..., 0]
    entity = seen(context, mirror, "entity")[..., 0]
    np.testing.assert_array_equal(count == 0, entity == 0)
    np.testing.assert_array_equal(count, np.rint(count))
    behind = entity == GLASS
    assert (count[behind] >= 1).all()
    assert (count[behind] == 2).mean() > 0.5  # a floor or a ball, and the pane over it
    assert count.max() <= 4


def test_a_wireframe_has_lines_where_edges_are(context, mirror) -> None:
    """The glass' front has four edges and a diagonal; between them its surface is dark."""
    picture = seen(context, mirror, "wireframe", width=4 * WIDTH, height=4 * HEIGHT).mean(axis=-1)
    entity = seen(context, mirror, "entity", width=4 * WIDTH, height=4 * HEIGHT)[..., 0]
    bright = picture > 0.4
    outline = np.zeros_like(bright)
    same = entity == GLASS
    outline[1:, :] |= same[1:, :] != same[:-1, :]
    around = np.zeros_like(outline)
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            around |= np.roll(outline, (dy, dx), (0, 1))
    rows, columns = np.nonzero(outline)
    near = [bright[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3].any() for y, x in zip(rows, columns, strict=True)]
    assert np.mean(near) > 0.95
    assert 0.005 < (bright & same & ~around).mean() / same.mean() < 0.3
    assert bright.mean() < 0.5


@pytest.mark.parametrize("view", VIEWS)
def test_a_picture_in_parts_is_the_picture(context, mirror, view: str) -> None:
    whole = seen(context, mirror, view).astype(np.float64)
    parts = seen(context, mirror, view, tile_edge=38).astype(np.float64)  # even: what depends on neighbours keeps them
    assert whole.shape == parts.shape
    both = np.isfinite(whole) & np.isfinite(parts)
    assert (np.isfinite(whole) == np.isfinite(parts)).mean() > 0.999
    # Where an edge is goes by rounding: a few pixels may fall on its other side.
    assert (np.abs(whole[both] - parts[both]) > 5e-3 * np.maximum(1.0, np.abs(whole[both]))).mean() < 0.01


def test_colours_of_data_are_what_the_manual_says() -> None:
    normals = np.array([[(0.0, 1.0, 0.0), (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)]], np.float32)
    np.testing.assert_array_equal(data_pixels(normals, "normals")[0], [(128, 255, 128), (0, 0, 0), (0, 128, 128)])
    np.testing.assert_array_equal(data_pixels(np.array([[[0.5]]]), "roughness")[0], [(128, 128, 128)])
    np.testing.assert_array_equal(data_pixels(np.array([[[0.5, 0.0, 1.0]]]), "albedo")[0], [(188, 0, 255)])
    depth = np.array([[[2.0], [6.0], [np.inf]]], np.float32)
    np.testing.assert_array_equal(data_pixels(depth, "depth", depth_unit=2.0)[0, :, 0], [128, 64, 0])
    assert depth_unit_of(depth) == 4.0
    assert depth_unit_of(np.full((2, 2, 1), np.inf, np.float32)) == 1.0
    ids = np.arange(2000, dtype=np.uint32).reshape(1, -1, 1)
    colors = data_pixels(ids, "entity")[0]
    assert not colors[0].any()
    assert len(np.unique(colors[1:], axis=0)) > 1900
    np.testing.assert_array_equal(colors[5], data_pixels(ids[:, 5:6], "entity")[0, 0])
    counts = np.array([[[0.0], [1.0], [2.0], [16.0], [99.0]]], np.float32)
    heat = data_pixels(counts, "overdraw")[0]
    assert not heat[0].any()
    assert (heat[3:] == 255).all()


def test_an_unknown_view_lists_the_known_ones() -> None:
    assert set(VIEWS) == {"shaded", *DATA_KINDS, "segmentation"}
    with pytest.raises(ElysError, match="views are shaded, normals"):
        OfflineRenderer(SceneMirror(), shows="depht")  # type: ignore[arg-type]

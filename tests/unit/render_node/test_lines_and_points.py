"""Meshes of lines and points: where their vertices are seen there is their colour whatever light there is, and nothing beside."""

from __future__ import annotations

import numpy as np
import pytest

from elys.bus.messages.views import ViewCamera
from elys.common.assets import AssetStore, Mesh, encode_mesh
from elys.common.components import Light, Material, MeshRenderer, Morph, Transform
from elys.common.math.matrix import look_rotation
from elys.common.scene import PictureSettings, SceneSettings
from elys.render_node.camera import View
from elys.render_node.drawable_assets import DrawableAssets
from elys.render_node.ghost_worlds import Parting, ShownGhost
from elys.render_node.passes.data import DATA_KINDS
from elys.render_node.picture_plan import plan_picture

pytestmark = pytest.mark.gl

WIDTH, HEIGHT = 40, 30
EYE = np.array((0.3, -0.2, 5.0))
CAMERA = ViewCamera(position=tuple(EYE), rotation=(0.0, 0.0, 0.0, 1.0), field_of_view=0.9)
PAINT = Material(base_color=(0.25, 0.5, 0.75))  # which half floats hold exactly


def seen_at(x: float, y: float, depth: float) -> np.ndarray:
    """The place (3,) that is seen at a place of the picture [pixels], so deep [m]: the camera looks along -z."""
    tangent = np.tan(CAMERA.field_of_view / 2)
    across, up = (2 * x / WIDTH - 1) * tangent * WIDTH / HEIGHT, (1 - 2 * y / HEIGHT) * tangent
    return EYE + depth * np.array((across, up, -1.0))


def mesh(topology: str, *places: np.ndarray, **fields: np.ndarray) -> Mesh:
    positions = np.array(places, np.float32)
    up = np.tile(np.float32((0, 1, 0)), (len(positions), 1))
    uvs, indices = np.zeros((len(positions), 2), np.float32), np.arange(len(positions), dtype=np.uint32)
    return Mesh(topology=topology, **({"positions": positions, "normals": up, "uvs": uvs, "indices": indices} | fields))


# From the middle of one pixel to that of another, each end in another depth; and two points.
LINES = mesh(
    "lines", seen_at(4.5, 7.5, 3.0), seen_at(30.5, 7.5, 6.0), seen_at(12.5, 12.5, 4.0), seen_at(12.5, 25.5, 3.0)
)
POINTS = mesh("points", seen_at(20.5, 18.5, 4.0), seen_at(33.5, 3.5, 7.0))


@pytest.fixture
def draw(stage, renderer):
    """Puts meshes onto a stage in full light, and gives its world."""
    store = AssetStore()
    assets = DrawableAssets(store.get)

    def place(*components, of: Mesh) -> int:
        reference = store.put(encode_mesh(of), kind="mesh")
        return stage.add(Transform(), MeshRenderer(mesh=reference), *components)

    def world():
        found = stage.world(assets)
        renderer.settle(found)
        found.place()
        return found

    place.world = world
    stage.settings = SceneSettings(background=(0.05, 0.03, 0.01), ambient=(1.0, 1.0, 1.0))
    stage.add(Transform(rotation=tuple(look_rotation((0.3, -1.0, -1.0)).tolist())), Light(intensity=3.0))
    yield place
    assets.close()


def light_of(renderer, world) -> np.ndarray:
    renderer.draw(world, CAMERA, WIDTH, HEIGHT)
    return renderer.read_light(WIDTH, HEIGHT)[..., :3]


def test_lines_have_their_colour_where_they_are_seen(draw, renderer) -> None:
    empty = light_of(renderer, draw.world())
    draw(PAINT, of=LINES)
    light = light_of(renderer, draw.world())
    color = np.float32(PAINT.base_color)
    np.testing.assert_array_equal(light[7, 6:29], np.broadcast_to(color, (23, 3)))
    np.testing.assert_array_equal(light[14:24, 12], np.broadcast_to(color, (10, 3)))
    for beside in np.s_[[6, 8], 14:29], np.s_[14:24, [11, 13]], np.s_[7, 33:]:
        np.testing.assert_array_equal(light[beside], empty[beside])


def test_points_have_their_colour_where_they_are_seen_and_are_a_pixel_large(draw, renderer) -> None:
    empty = light_of(renderer, draw.world())
    draw(PAINT, of=POINTS)
    light = light_of(renderer, draw.world())
    differs = np.argwhere((light != empty).any(axis=-1))
    np.testing.assert_array_equal(differs, ((3, 33), (18, 20)))
    color = np.float32(PAINT.base_color)
    np.testing.assert_array_equal(light[[3, 18], [33, 20]], (color, color))


def test_vertex_colours_are_multiplied_and_go_from_end_to_end(draw, renderer) -> None:
    ends = np.array(((1.0, 0.5, 0.25, 1.0), (0.0, 0.5, 1.0, 1.0)), np.float32)
    line = mesh("lines", seen_at(4.5, 7.5, 4.0), seen_at(30.5, 7.5, 4.0), colors=ends)
    draw(PAINT, of=line)
    light = light_of(renderer, draw.world())
    share = ((np.arange(6, 29) + 0.5 - 4.5) / 26.0)[:, None]
    expected = np.array(PAINT.base_color) * (ends[0, :3] * (1 - share) + ends[1, :3] * share)
    np.testing.assert_allclose(light[7, 6:29], expected, atol=0.75 / 26.0)  # as much as from one pixel to the next


def test_they_are_picked_where_they_are_seen_and_how_deep(draw, renderer) -> None:
    lines, points = draw(PAINT, of=LINES), draw(PAINT, of=POINTS)
    world = draw.world()
    entities = renderer.draw_data(world, CAMERA, WIDTH, HEIGHT, "entity")[..., 0]
    depths = renderer.draw_data(world, CAMERA, WIDTH, HEIGHT, "depth")[..., 0]
    assert set(entities[7, 5:30]) == {lines} == set(entities[13:25, 12])
    assert (entities[3, 33], entities[18, 20]) == (points, points)
    assert not entities[[6, 8], 5:30].any()
    np.testing.assert_allclose(depths[[3, 18], [33, 20]], (7.0, 4.0), rtol=1e-5)
    for x, y in ((5, 7), (17, 7), (29, 7), (12, 20), (20, 18), (33, 3), (21, 18), (17, 8), (0, 0)):
        entity, place = renderer.pick(world, CAMERA, WIDTH, HEIGHT, x, y)
        assert entity == entities[y, x]
        if entity:
            np.testing.assert_allclose(place, seen_at(x + 0.5, y + 0.5, depths[y, x]), atol=2e-3)


@pytest.mark.parametrize("shape", [LINES, POINTS], ids=["lines", "points"])
def test_they_throw_no_shadows(stage, draw, shape) -> None:
    box = stage.add(Transform(position=(0.0, -3.0, 0.0)), MeshRenderer())
    seen = draw(of=shape)
    stage.add(Transform(position=(0.0, 2.0, 0.0)), Light(kind="point", intensity=5.0))
    world = draw.world()
    assert world.instances.casts.tolist() == [entity != seen for entity in world.entity.tolist()]
    plan = plan_picture(world, View.of(CAMERA, WIDTH, HEIGHT), shadow_size=256, lamp_shadow_size=256)
    thrown = [call for calls in (*plan.casters, *plan.lamp_casters) for call in calls]
    assert thrown
    assert {call.batch.mesh for call in thrown} == {"box"}
    assert {entity for call in thrown for entity in world.entity[plan.rows[call.first : call.first + 1]]} == {box}


def test_they_keep_no_light_from_corners(stage, draw, renderer) -> None:
    """Ambient occlusion finds horizons in depths; a line has none."""
    stage.settings = SceneSettings(ambient=(1.0, 1.0, 1.0), picture=PictureSettings(ambient_occlusion=1.0))
    stage.add(Transform(position=(0.0, 0.0, -4.0), scale=(20.0, 20.0, 1.0)), MeshRenderer())
    without = light_of(renderer, draw.world())
    draw(PAINT, of=LINES)
    with_lines = light_of(renderer, draw.world())
    np.testing.assert_array_equal(with_lines[[5, 9]], without[[5, 9]])
    assert not np.array_equal(with_lines[7], without[7])


MATERIALS = {
    "see-through": Material(alpha_mode="blend", opacity=0.5),
    "masked": Material(alpha_mode="mask", alpha_cutoff=0.2),
    "varnished": Material(clearcoat=1.0, ior=2.0, emissive=(1.0, 0.0, 0.0)),
    "images": Material(normal_texture="blake2b:" + "0" * 32, base_color_texture="blake2b:" + "0" * 32),
    "unlit": Material(unlit=True, double_sided=True),
}


@pytest.mark.parametrize("shape", [LINES, POINTS], ids=["lines", "points"])
@pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS.keys())
def test_all_passes_take_them_with_any_material(stage, draw, renderer, shape, material) -> None:
    stage.settings = SceneSettings(picture=PictureSettings(ambient_occlusion=1.0, fxaa=True, bloom=0.1))
    stage.add(Transform(position=(0.0, 0.0, -4.0)), MeshRenderer())
    entity = draw(material, of=shape)
    world = draw.world()
    plain = renderer.read_pixels(renderer.draw(world, CAMERA, WIDTH, HEIGHT))
    selected = renderer.read_pixels(renderer.draw(world, CAMERA, WIDTH, HEIGHT, selection=(entity,)))
    assert not np.array_equal(plain, selected)
    for kind in DATA_KINDS:
        assert renderer.draw_data(world, CAMERA, WIDTH, HEIGHT, kind).shape[:2] == (HEIGHT, WIDTH)


def test_morphed_lines_and_welded_ones(draw, renderer) -> None:
    """Repeated places are drawn as one where places alone are read; a target takes all a row down."""
    corner, ends = seen_at(10.5, 7.5, 4.0), (seen_at(30.5, 7.5, 4.0), seen_at(10.5, 20.5, 4.0), seen_at(4.5, 7.5, 4.0))
    star = mesh("lines", *(place for end in ends for place in (corner, end)))
    drawn = draw(PAINT, of=star)
    down = np.tile(np.float32(seen_at(0.0, 24.5, 4.0) - seen_at(0.0, 7.5, 4.0)), (1, 2, 1))
    flat = mesh(
        "lines",
        seen_at(20.5, 7.5, 4.0),
        seen_at(30.5, 7.5, 4.0),
        target_positions=down,
        target_normals=np.zeros_like(down),
    )
    moved = draw(PAINT, Morph(weights="1"), of=flat)
    entities = renderer.draw_data(draw.world(), CAMERA, WIDTH, HEIGHT, "entity")[..., 0]
    assert set(entities[7, 5:30]) == {drawn}
    assert set(entities[8:20, 10]) == {drawn}
    assert set(entities[24, 21:30]) == {moved}


def test_computed_tangents_are_for_surfaces(stage, draw, renderer) -> None:
    """What asks for tangents along an image gets none on lines, and is drawn."""
    entity = draw(Material(normal_texture="blake2b:" + "1" * 32), of=LINES)
    components = stage.components[entity - 1]
    drawing = MeshRenderer(mesh=components["MeshRenderer"].mesh, tangents="vertices")
    stage.components[entity - 1] = {**components, "MeshRenderer": drawing}
    light = light_of(renderer, draw.world())
    assert light[7, 10:25, 0] == pytest.approx(Material().base_color[0], rel=1e-3)


def test_those_of_another_run_are_tinted(stage, draw, renderer) -> None:
    empty = draw.world()
    draw(PAINT, of=LINES)
    other = draw.world()
    parting = Parting(entity=np.ones(1, np.uint32), here=np.zeros((1, 3)), there=np.ones((1, 3)))
    ghost = ShownGhost("Other", (200, 100, 50), other, (), parting, 1)
    before = light_of(renderer, empty)
    renderer.draw(empty, CAMERA, WIDTH, HEIGHT, ghosts=(ghost,))
    changed = (renderer.read_light(WIDTH, HEIGHT)[..., :3] != before).any(axis=-1)
    assert changed[7, 6:29].all()
    assert not changed[[5, 9]].any()

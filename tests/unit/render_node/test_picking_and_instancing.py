"""Picking against geometry, and instancing against drawing things alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.bus.messages.views import ViewCamera
from elys.common.components import Light, Material, MeshRenderer, Transform
from elys.common.math.matrix import look_rotation
from elys.render_node.camera import View, framing_camera

pytestmark = pytest.mark.gl

CAMERA = framing_camera((-4, 0, -4), (4, 2, 4), aspect=1.5)
WIDTH, HEIGHT = 120, 80


def scattered(stage, count: int = 40) -> list[tuple[int, np.ndarray, float]]:
    """Spheres here and there: entity, centre, radius."""
    random = np.random.default_rng(5)
    found = []
    for _ in range(count):
        centre, radius = random.uniform((-4, 0, -4), (4, 2, 4)), float(random.uniform(0.2, 0.6))
        scale = (2 * radius,) * 3
        entity = stage.add(Transform(position=tuple(centre.tolist()), scale=scale), MeshRenderer(mesh="sphere"))
        found.append((entity, centre, radius))
    return found


def test_picking_finds_the_nearest_sphere_that_a_ray_meets(stage, renderer) -> None:
    spheres = scattered(stage)
    world = stage.world()
    view = View.of(CAMERA, WIDTH, HEIGHT)
    turn = Rotation.from_quat(CAMERA.rotation)
    tangent = np.tan(CAMERA.field_of_view / 2)
    checked = hits = 0
    for x, y in np.random.default_rng(2).integers((0, 0), (WIDTH, HEIGHT), (150, 2)).tolist():
        ray = turn.apply(
            ((x + 0.5) / WIDTH * 2 - 1) * tangent * WIDTH / HEIGHT * np.array((1, 0, 0))
            + (1 - (y + 0.5) / HEIGHT * 2) * tangent * np.array((0, 1, 0))
            + np.array((0, 0, -1))
        )
        ray /= np.linalg.norm(ray)
        nearest, expected, doubtful = np.inf, 0, False
        for entity, centre, radius in spheres:
            offset = view.eye - centre
            along = -float(ray @ offset)
            gap = float(np.linalg.norm(offset + along * ray))
            if 0.9 * radius < gap < 1.05 * radius:
                doubtful = True  # the mesh is a polyhedron inside the sphere
            if gap < radius:
                distance = along - np.sqrt(radius**2 - gap**2)
                if abs(distance - nearest) < 0.1:
                    doubtful = True
                if distance < nearest:
                    nearest, expected = distance, entity
        if doubtful:
            continue
        entity, place = renderer.pick(world, CAMERA, WIDTH, HEIGHT, x, y)
        assert entity == expected
        checked += 1
        if entity:
            hits += 1
            np.testing.assert_allclose(place, view.eye + ray * nearest, atol=0.03)
    assert checked > 60
    assert hits > 10


def test_ids_of_all_bits_are_picked_whole(stage, renderer) -> None:
    from elys.render_node.render_world import RenderWorld
    from elys.render_node.scene_tables import tables_of

    for entity in (1, 0x3FFFFF, 0xFFC00001, 0x80000001, 0xFFFFFFFF, 0x7F800001):
        world = RenderWorld()
        world.set_scene(tables_of([entity], [0], [{"MeshRenderer": MeshRenderer()}]))
        camera = framing_camera((-0.5,) * 3, (0.5,) * 3, aspect=1.0)
        assert renderer.pick(world, camera, 33, 33, 16, 16)[0] == entity


def test_picking_beside_everything_finds_nobody(stage, renderer) -> None:
    stage.add(Transform(), MeshRenderer())
    world = stage.world()
    assert renderer.pick(world, CAMERA, WIDTH, HEIGHT, 0, 0) == (0, (0.0, 0.0, 0.0))
    assert renderer.pick(world, CAMERA, WIDTH, HEIGHT, -1, 5)[0] == 0
    assert renderer.pick(world, CAMERA, WIDTH, HEIGHT, 5, HEIGHT)[0] == 0


def test_picking_far_from_the_origin(stage, renderer) -> None:
    far = 100_000.0
    entity = stage.add(Transform(position=(far, 0.0, 0.0)), MeshRenderer())
    camera = framing_camera((far - 0.5, -0.5, -0.5), (far + 0.5, 0.5, 0.5), aspect=1.0, direction=(0, 0, -1))
    found, place = renderer.pick(stage.world(), camera, 32, 32, 16, 16)
    assert found == entity
    assert place[2] == pytest.approx(0.5, abs=1e-4)


def test_a_crowd_is_the_sum_of_its_members_drawn_alone(stage, renderer) -> None:
    """Things that do not hide one another, each with its own turn, scale and glow, on black."""
    random = np.random.default_rng(3)
    stage.add(Transform(rotation=tuple(look_rotation((-1, -2, -1)).tolist())), Light(cast_shadows=False))
    for i in range(12):
        turn = Rotation.random(random_state=i).as_quat()
        stage.add(
            Transform(
                position=(2.0 * (i % 4) - 3.0, 0.0, 2.0 * (i // 4) - 2.0),
                rotation=tuple(turn.tolist()),
                scale=tuple(random.uniform(0.3, 0.6, 3).tolist()),
            ),
            MeshRenderer(mesh=("box", "cone")[i % 2]),
            Material(base_color=tuple(random.uniform(0.2, 1.0, 3).tolist()), roughness=float(random.uniform(0.2, 1))),
        )
    camera = framing_camera((-4, -0.5, -3), (4, 0.5, 3), aspect=1.5, direction=(0.01, -1.0, 0.0))
    crowd = renderer.read_pixels(renderer.draw(stage.world(), camera, WIDTH, HEIGHT))[..., :3].astype(int)
    everyone = list(stage.components)
    total = np.zeros_like(crowd)
    for i in range(1, len(everyone)):
        stage.components = [found if row in (0, i) else {} for row, found in enumerate(everyone)]
        total += renderer.read_pixels(renderer.draw(stage.world(), camera, WIDTH, HEIGHT))[..., :3]
    assert (crowd > 0).sum() > 500
    np.testing.assert_array_equal(crowd, total)


def test_outline_and_grid_change_only_what_they_should(stage, renderer) -> None:
    entity = stage.add(Transform(), MeshRenderer(mesh="sphere"))
    stage.add(Transform(rotation=tuple(look_rotation((-1, -1, -1)).tolist())), Light())
    world = stage.world()
    plain = renderer.read_pixels(renderer.draw(world, CAMERA, WIDTH, HEIGHT))
    marked = renderer.read_pixels(renderer.draw(world, CAMERA, WIDTH, HEIGHT, selection=(entity,)))
    changed = (plain != marked).any(axis=-1)
    assert 10 < changed.sum() < 200
    inside = renderer.pick(world, CAMERA, WIDTH, HEIGHT, WIDTH // 2, HEIGHT // 2)[0]
    lined = renderer.read_pixels(renderer.draw(world, CAMERA, WIDTH, HEIGHT, grid=True))
    assert (plain != lined).any(axis=-1).sum() > 200
    assert inside in (0, entity)
    again = renderer.read_pixels(renderer.draw(world, CAMERA, WIDTH, HEIGHT))
    assert (plain == again).all()


def test_materials_of_a_batch_stay_apart(stage, renderer) -> None:
    colors = [(0.9, 0.1, 0.1), (0.1, 0.9, 0.1), (0.1, 0.1, 0.9)]
    for i, color in enumerate(colors):
        stage.add(
            Transform(position=(2.0 * i - 2.0, 0.0, 0.0)), MeshRenderer(), Material(base_color=color, emissive=color)
        )
    world = stage.world()
    assert len(world.batches) == 1
    camera = framing_camera((-2.5, -0.5, -0.5), (2.5, 0.5, 0.5), aspect=3.0, direction=(0, 0, -1))
    picture = renderer.read_pixels(renderer.draw(world, camera, 90, 30))
    for i in range(3):
        assert picture[15, 17 + 28 * i, :3].argmax() == i


def test_what_is_passed_over_lets_see_what_is_behind(stage, renderer) -> None:
    near = stage.add(Transform(position=(0.0, 1.0, 2.0), scale=(2.0, 2.0, 0.1)), MeshRenderer())
    knob = stage.add(Transform(position=(0.0, 0.0, 5.0)), MeshRenderer(), parent=near)
    far = stage.add(Transform(position=(0.0, 1.0, -1.0)), MeshRenderer())
    world = stage.world()
    camera = ViewCamera(position=(0.0, 1.0, 6.0), rotation=(0.0, 0.0, 0.0, 1.0))

    def seen(*passed_over: int) -> int:
        return renderer.pick(world, camera, 64, 48, 32, 24, passed_over=passed_over)[0]

    assert seen() == knob
    assert seen(knob) == near
    assert seen(near) == far  # and with it what is below it
    assert seen(near, far) == 0
    assert seen(99) == knob


def test_what_is_hidden_leaves_a_picture_as_if_it_were_not_there(stage, renderer) -> None:
    stage.add(Transform(rotation=look_rotation((0.3, -1.0, -0.2))), Light())
    stage.add(Transform(position=(0.0, -0.05, 0.0), scale=(8.0, 0.1, 8.0)), MeshRenderer())
    pole = Transform(position=(0.5, 1.0, 0.0), scale=(0.4, 2.0, 0.4))
    with_pole = stage.add(pole, MeshRenderer())
    world = stage.world()

    def drawn(*hidden: int) -> np.ndarray:
        return renderer.read_pixels(renderer.draw(world, CAMERA, WIDTH, HEIGHT, hidden=hidden)).astype(int)

    whole, without = drawn(), drawn(with_pole)
    again = drawn()
    assert np.array_equal(whole, again)  # its shadow is back as well, though nothing moved
    stage.enabled[with_pole - 1] = False
    world = stage.world()
    assert np.array_equal(drawn(), without)
    assert np.abs(whole - without).max() > 40

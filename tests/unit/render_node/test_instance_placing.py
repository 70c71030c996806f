"""Where the card puts instances, against what numpy and scipy work out in 64 bits."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.views import ViewCamera
from elys.common.components import Light, Material, MeshRenderer, Transform
from elys.render_node.camera import View, framing_camera
from elys.render_node.gpu import INSTANCE_DTYPE
from elys.render_node.picture_plan import plan_picture
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.scene_reader import SceneEdits

pytestmark = pytest.mark.gl
GAP = 0.1  # [s] between two frames


def placed_rows(renderer: Renderer, world: RenderWorld, camera: ViewCamera, *, for_light: bool = False) -> np.ndarray:
    """The rows (M,) that passes read, in the order of the world's instances, all of which are in view."""
    plan = plan_picture(world, View.of(camera, 64, 64), for_light=for_light)
    renderer.resources.placing.place(plan)
    raw = renderer.resources.placing.rows.raw.read(len(plan.rows) * plan.layout.itemsize)
    rows = np.zeros(world.instance_count, plan.layout)
    rows[plan.rows] = np.frombuffer(raw, plan.layout)
    assert sorted(plan.rows.tolist()) == list(range(world.instance_count))
    return rows


def moving_frames(entities: list[int], origin: np.ndarray, *, turn: float, spin: float = 0.0) -> list[StateFrame]:
    """Two frames of bodies that go up to a metre and turn by up to `turn` [rad], spinning at `spin` [rad/s]."""
    random = np.random.default_rng(4)
    count = len(entities)
    start, way = origin + random.uniform(-4, 4, (count, 3)), random.uniform(-1, 1, (count, 3))
    axis = random.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    first = Rotation.random(count, random_state=1)
    last = Rotation.from_rotvec(axis * turn * np.linspace(0.01, 1.0, count)[:, None]) * first
    ends = [(start, first, 0.0), (start + way, last, GAP)]
    return [
        StateFrame(
            epoch=1,
            tick=tick,
            simulation_time=time,
            published_at=round(time * 1e9),
            delta_sequence=0,
            state_hash=0,
            playing=True,
            position=place,
            rotation=(rotation.as_quat() * (-1.0) ** tick).astype(
                np.float32
            ),  # the same rotation by the other quaternion
            linear_velocity=np.zeros((count, 3), np.float32),
            angular_velocity=(axis * spin).astype(np.float32),
            entity=np.array(entities, np.uint32),
        )
        for tick, (place, rotation, time) in enumerate(ends)
    ]


def staged(stage: Any, count: int, **material: Any) -> tuple[RenderWorld, list[int]]:
    """Bodies of several sizes, a child aside of each second one."""
    entities = []
    for i in range(count):
        body = stage.add(
            Transform(scale=(0.5 + 0.1 * (i % 3), 0.5, 0.8)),
            MeshRenderer(mesh=("box", "cone")[i % 2]),
            Material(**material),
        )
        entities.append(body)
        if i % 2:
            stage.add(Transform(position=(0.7, 0.2, -0.3)), MeshRenderer(mesh="sphere"), parent=body)
    return stage.world(), entities[::-1]  # frames list them in another order


def watching(origin: np.ndarray) -> ViewCamera:
    return framing_camera(origin - 8.0, origin + 8.0, aspect=1.0)


@pytest.mark.parametrize("fraction", [0.0, 0.3, 1.0, 1.4])
@pytest.mark.parametrize("turn", [0.05, 2.5])
@pytest.mark.parametrize("far", [0.0, 200_000.0])
def test_the_card_places_bodies_where_they_are(stage: Any, renderer: Renderer, fraction, turn, far) -> None:
    """Relative to the eye, to 32 bits of the distance; also 200 km from the world's origin."""
    origin = np.array((far, 3.0, -far))
    world, entities = staged(stage, 30)
    frames = moving_frames(entities, origin, turn=turn)
    for frame in frames:
        world.take_state(frame, frame.simulation_time)
    world.place(GAP * (1.0 + fraction))
    assert world.standing.fraction == pytest.approx(fraction)
    camera = watching(origin)
    rows = placed_rows(renderer, world, camera)
    relative = world.position - np.array(camera.position)
    distance = float(np.linalg.norm(relative, axis=1).max())
    np.testing.assert_allclose(rows["affine"][:, :, 3], relative, atol=4e-7 * distance)
    # numpy goes along chords for small turns, as the shader does; at 1e-5 rad they agree with the arc.
    np.testing.assert_allclose(rows["affine"][:, :, :3], world.linear, atol=2e-5)
    assert rows["entity"].tolist() == world.entity.tolist()
    if fraction == 0.3:
        body = int(np.flatnonzero(world.entity == entities[5])[0])
        pair = Rotation.from_quat(np.stack([frame.rotation[5] for frame in frames]))
        expected = Slerp([0, 1], pair)(fraction).as_matrix() @ np.diag(
            stage.components[entities[5] - 1]["Transform"].scale
        )
        np.testing.assert_allclose(rows["affine"][body, :, :3], expected, atol=2e-5)


@pytest.mark.parametrize("fraction", [0.25, 0.9])
def test_who_spins_fast_goes_the_long_way_round_on_the_card_too(
    stage: Any, renderer: Renderer, fraction: float
) -> None:
    world, entities = staged(stage, 20)
    frames = moving_frames(entities, np.zeros(3), turn=1.0, spin=70.0)  # 7 rad from frame to frame
    for frame in frames:
        world.take_state(frame, frame.simulation_time)
    world.place(GAP * (1.0 + fraction))
    assert world.timeline.spins
    rows = placed_rows(renderer, world, watching(np.zeros(3)))
    np.testing.assert_allclose(rows["affine"][:, :, :3], world.linear, atol=3e-5)
    body = int(np.flatnonzero(world.entity == entities[7])[0])
    start = Rotation.from_quat(frames[0].rotation[7])
    way = (Rotation.from_quat(frames[1].rotation[7]) * start.inv()).as_rotvec()
    whole = way + 2.0 * np.pi * way / np.linalg.norm(way)  # once round and what is seen of the way
    expected = Rotation.from_rotvec(whole * fraction) * start
    scale = np.diag(stage.components[entities[7] - 1]["Transform"].scale)
    np.testing.assert_allclose(rows["affine"][body, :, :3], expected.as_matrix() @ scale, atol=1e-4)


def test_who_came_with_the_newest_frame_stands_where_it_says(stage: Any, renderer: Renderer) -> None:
    world, entities = staged(stage, 10)
    first, last = moving_frames(entities, np.zeros(3), turn=1.0)
    few = replace(
        first,
        **{
            name: getattr(first, name)[2:]
            for name in ("position", "rotation", "linear_velocity", "angular_velocity", "entity")
        },
    )
    world.take_state(few, 0.0)
    world.take_state(last, GAP)
    world.place(GAP * 1.5)
    rows = placed_rows(renderer, world, watching(np.zeros(3)))
    eye = np.array(watching(np.zeros(3)).position)
    np.testing.assert_allclose(rows["affine"][:, :, 3], world.position - eye, atol=1e-5)
    new = int(np.flatnonzero(world.entity == entities[0])[0])
    np.testing.assert_allclose(rows["affine"][new, :, 3], last.position[0] - eye, atol=1e-5)


def test_an_edit_that_frames_do_not_contain_yet_holds_on_the_card(stage: Any, renderer: Renderer, make_frame) -> None:
    body = stage.add(Transform(position=(1.0, 2.0, -3.0)), MeshRenderer())
    world = stage.world()
    world.set_scene(replace(stage.tables(), pose_sequence=np.array([5])), SceneEdits(np.array([0])))
    camera = watching(np.zeros(3))
    for sequence, expected in ((4, (1.0, 2.0, -3.0)), (5, (0.5, 0.0, 0.0)), (6, (0.5, 0.0, 0.0))):
        frame = make_frame({body: (0.5, 0.0, 0.0)}, delta_sequence=sequence, tick=sequence, published_at=sequence)
        world.take_state(frame)
        world.place()
        rows = placed_rows(renderer, world, camera)
        np.testing.assert_allclose(rows["affine"][0, :, 3], np.array(expected) - camera.position, atol=1e-5)


@pytest.mark.parametrize(
    "more", [{}, {"emissive": (1.0, 0.5, 0.0)}, {"alpha_mode": "mask", "opacity": 0.7}], ids=["plain", "glows", "holes"]
)
def test_rows_for_light_say_the_same_in_less(stage: Any, renderer: Renderer, more: dict[str, Any]) -> None:
    world, entities = staged(stage, 6, roughness=0.3, **more)
    camera = watching(np.zeros(3))
    for frame in (None, *moving_frames(entities, np.zeros(3), turn=0.5)):
        if frame is not None:
            world.take_state(frame, frame.simulation_time)
            world.place(frame.simulation_time + GAP / 2)
        whole = placed_rows(renderer, world, camera)
        light = placed_rows(renderer, world, camera, for_light=True)
        assert whole.dtype == INSTANCE_DTYPE
        assert light.dtype.itemsize == (72 if not more else 100)
        for name in light.dtype.names:
            np.testing.assert_array_equal(light[name], whole[name])


def test_worlds_drawn_in_turns_keep_apart(stage: Any, renderer: Renderer) -> None:
    """What the card holds of one world is not taken for another's."""
    world, entities = staged(stage, 5)
    other = stage.world()
    camera = watching(np.zeros(3))
    for frame in moving_frames(entities, np.zeros(3), turn=0.5):
        world.take_state(frame, frame.simulation_time)
    world.place(GAP * 1.5)
    eye = np.array(camera.position)
    for _ in range(2):
        for shown in (world, other):
            rows = placed_rows(renderer, shown, camera)
            np.testing.assert_allclose(rows["affine"][:, :, 3], shown.position - eye, atol=1e-5)


def test_many_bodies_fill_many_rows_of_texels(stage: Any, renderer: Renderer) -> None:
    """More than stand in one row of a texture, and in groups of several."""
    stage.add(Transform(), Light())
    world, entities = staged(stage, 1300)
    for frame in moving_frames(entities, np.zeros(3), turn=0.5):
        world.take_state(frame, frame.simulation_time)
    world.place(GAP * 1.5)
    camera = watching(np.zeros(3))
    rows = placed_rows(renderer, world, camera)
    np.testing.assert_allclose(rows["affine"][:, :, 3], world.position - np.array(camera.position), atol=2e-5)
    np.testing.assert_allclose(rows["affine"][:, :, :3], world.linear, atol=2e-5)


@pytest.mark.parametrize(("fraction", "shadows"), [(0.4, False), (1.0, True)])
def test_a_moving_scene_looks_as_a_still_one_that_stands_so(
    stage: Any, renderer: Renderer, fraction: float, shadows: bool
) -> None:
    """The same picture from scene files that say where everything is at that moment. Maps of shadows are alike at ticks."""
    random = np.random.default_rng(6)
    looks = [
        (
            MeshRenderer(mesh=("box", "cone", "sphere")[i % 3]),
            Material(base_color=tuple(random.uniform(0.2, 1.0, 3).tolist()), roughness=float(random.uniform(0.2, 1.0))),
        )
        for i in range(40)
    ]
    entities = [stage.add(Transform(), *look) for look in looks]
    sun = (Transform(rotation=(-0.5, 0.2, 0.1, 0.83)), Light(cast_shadows=shadows))
    stage.add(*sun)
    world = stage.world()
    for frame in moving_frames(entities, np.zeros(3), turn=1.2):
        world.take_state(frame, frame.simulation_time)
    world.place(GAP * (1.0 + fraction))
    still = type(stage)()
    for entity, look in zip(entities, looks, strict=True):
        row = int(np.flatnonzero(world.entity == entity)[0])
        rotation = Rotation.from_matrix(world.linear[row].astype(np.float64)).as_quat()
        still.add(Transform(position=tuple(world.position[row].tolist()), rotation=tuple(rotation.tolist())), *look)
    still.add(*sun)
    camera = framing_camera((-5,) * 3, (5,) * 3, aspect=1.5)
    pictures = [
        renderer.read_pixels(renderer.draw(shown, camera, 240, 160, selection=(3,))).astype(int)
        for shown in (world, still.world())
    ]
    apart = np.abs(pictures[0] - pictures[1]).max(axis=-1)
    assert pictures[0][..., :3].max() > 100
    assert np.percentile(apart, 99.5) <= 1
    assert (apart > 8).mean() < 2e-3  # a sample at an edge here and there

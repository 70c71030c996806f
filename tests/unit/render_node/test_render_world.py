"""Where drawn things stand: batches, hierarchy, bodies and what rides on them, and the time between two ticks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from elys.bus.messages.state_frame import StateFrame
from elys.common.components import Camera, Light, Material, MeshRenderer, Transform
from elys.render_node.camera import View, framing_camera
from elys.render_node.crowd import without_giants
from elys.render_node.picture_plan import plan_picture
from elys.render_node.scene_reader import SceneEdits

TURN = (0.0, float(np.sin(0.4)), 0.0, float(np.cos(0.4)))


def row_of(world, entity: int) -> int:
    return int(np.flatnonzero(world.entity == entity)[0])


def test_instances_are_batched_by_mesh_and_look(stage) -> None:
    for i in range(6):
        stage.add(Transform(), MeshRenderer(mesh="box"), Material(roughness=0.1 * i + 0.1))
    stage.add(Transform(), MeshRenderer(mesh="sphere"))
    stage.add(Transform(), MeshRenderer(mesh="box"), Material(alpha_mode="blend", opacity=0.5))
    stage.add(Transform(scale=(-1.0, 1.0, 1.0)), MeshRenderer(mesh="box"))
    world = stage.world()
    assert [(batch.mesh, batch.instance_count, batch.is_blended) for batch in world.batches] == [
        ("box", 6, False),
        ("sphere", 1, False),
        ("box", 1, False),
        ("box", 1, True),
    ]
    assert [batch.look.is_mirrored for batch in world.batches] == [False, False, True, False]
    np.testing.assert_allclose(world.instances.surface[:6, 2, 1], [0.1, 0.2, 0.3, 0.4, 0.5, 0.6], rtol=1e-6)


def test_hidden_and_disabled_things_are_not_drawn(stage) -> None:
    shown = stage.add(Transform(), MeshRenderer())
    stage.add(Transform(), MeshRenderer(visible=False))
    off = stage.add(Transform(), enabled=False)
    stage.add(Transform(), MeshRenderer(), parent=off)
    assert stage.world().entity.tolist() == [shown]


def test_static_things_follow_the_hierarchy(stage) -> None:
    root = stage.add(Transform(position=(1.0, 2.0, 3.0), rotation=TURN, scale=(2.0, 2.0, 2.0)))
    stage.add(Transform(position=(0.5, 0.0, 0.0)), MeshRenderer(), parent=root)
    world = stage.world()
    expected = np.array((1.0, 2.0, 3.0)) + Rotation.from_quat(TURN).apply((1.0, 0.0, 0.0))
    np.testing.assert_allclose(world.position[0], expected)
    np.testing.assert_allclose(world.linear[0], 2.0 * Rotation.from_quat(TURN).as_matrix(), rtol=1e-6, atol=1e-7)


def test_children_ride_on_bodies(stage, make_frame) -> None:
    body = stage.add(Transform(position=(0.0, 5.0, 0.0), scale=(2.0, 2.0, 2.0)), MeshRenderer())
    stage.add(Transform(position=(1.0, 0.0, 0.0)), MeshRenderer(), parent=body)
    world = stage.world()
    world.take_state(make_frame({body: ((3.0, 1.0, 0.0), TURN)}))
    world.place()
    turn = Rotation.from_quat(TURN)
    np.testing.assert_allclose(world.position[row_of(world, body)], (3.0, 1.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(world.position[1], np.array((3.0, 1.0, 0.0)) + turn.apply((2.0, 0.0, 0.0)), atol=1e-6)
    np.testing.assert_allclose(world.linear[1], 2.0 * turn.as_matrix(), atol=1e-6)


@pytest.mark.parametrize("fraction", [0.0, 0.25, 1.0])
def test_between_two_ticks_things_glide(stage, make_frame, fraction: float) -> None:
    body = stage.add(Transform(), MeshRenderer())
    world = stage.world()
    start, end = Rotation.identity(), Rotation.from_quat(TURN)
    first = make_frame({body: (0.0, 0.0, 0.0)}, tick=1, published_at=0)
    second = make_frame({body: ((1.0, 2.0, 0.0), TURN)}, tick=2, simulation_time=0.1, published_at=100_000_000)
    world.take_state(first, 10.0)
    world.take_state(second, 10.1)
    world.place(10.1 + 0.1 * fraction)
    np.testing.assert_allclose(world.position[0], np.array((1.0, 2.0, 0.0)) * fraction, atol=1e-6)
    expected = Slerp([0, 1], Rotation.concatenate([start, end]))(fraction).as_matrix()
    np.testing.assert_allclose(world.linear[0], expected, atol=1e-6)
    world.place()
    np.testing.assert_allclose(world.position[0], (1.0, 2.0, 0.0))


def test_a_pause_a_jump_and_another_run_show_the_newest_state_at_once(stage, make_frame) -> None:
    body = stage.add(Transform(), MeshRenderer())
    world = stage.world()
    world.take_state(make_frame({body: (0.0, 0.0, 0.0)}, tick=1), 1.0)
    for header in (
        {"tick": 2, "simulation_time": 0.1, "playing": False, "published_at": 1},
        {"tick": 900, "simulation_time": 15.0, "published_at": 2},
        {"tick": 3, "simulation_time": 0.2, "published_at": 3},
        {"tick": 4, "simulation_time": 0.3, "epoch": 2, "published_at": 4},
    ):
        world.take_state(make_frame({body: (float(header["tick"]), 0.0, 0.0)}, **header), 2.0)
        world.place(2.0)
        assert world.position[0][0] == header["tick"]


def test_an_edit_is_not_undone_by_an_older_frame(stage, make_frame) -> None:
    from dataclasses import replace

    body = stage.add(Transform(position=(7.0, 0.0, 0.0)), MeshRenderer())
    tables = replace(stage.tables(), pose_sequence=np.array([5]))
    world = stage.world()
    world.set_scene(tables, SceneEdits(np.array([0])))
    world.take_state(make_frame({body: (1.0, 0.0, 0.0)}, delta_sequence=4))
    world.place()
    assert world.position[0][0] == 7.0
    world.take_state(make_frame({body: (8.0, 0.0, 0.0)}, delta_sequence=5, tick=1, published_at=1))
    world.place()
    assert world.position[0][0] == 8.0


def test_bodies_come_and_go(stage, make_frame) -> None:
    first = stage.add(Transform(), MeshRenderer())
    second = stage.add(Transform(), MeshRenderer())
    world = stage.world()
    for tick, poses in enumerate(({first: (1.0, 0.0, 0.0)}, {second: (2.0, 0.0, 0.0)}, {})):
        world.take_state(make_frame(poses, tick=tick, published_at=tick))
        world.place()
        for entity, position in poses.items():
            assert tuple(world.position[row_of(world, entity)]) == position


def test_far_from_the_origin_a_millimetre_is_kept(stage) -> None:
    stage.add(Transform(position=(100_000.001, 0.0, -5.0)), MeshRenderer())
    world = stage.world()
    camera = framing_camera((99_999.0, -1.0, -6.0), (100_001.0, 1.0, -4.0))
    plan = plan_picture(world, View.of(camera, 64, 64))
    items = world.standing.card_rows().items
    stored = items["affine"][plan.rows, :, 3].astype(np.float64) + items["low"][plan.rows]
    np.testing.assert_allclose(stored, world.position, atol=1e-9)


def test_what_is_behind_the_camera_is_left_out(stage) -> None:
    seen = stage.add(Transform(position=(0.0, 0.0, -5.0)), MeshRenderer())
    stage.add(Transform(position=(0.0, 0.0, 5.0)), MeshRenderer())
    stage.add(Transform(position=(50.0, 0.0, -5.0)), MeshRenderer())
    camera = framing_camera((-1, -1, -6), (1, 1, -4), direction=(0, 0, -1))
    world = stage.world()
    plan = plan_picture(world, View.of(camera, 64, 64))
    assert world.entity[plan.rows].tolist() == [seen]


def test_see_through_things_come_farthest_first(stage) -> None:
    glass = Material(alpha_mode="blend", opacity=0.5)
    order = [
        stage.add(Transform(position=(0.0, 0.0, z)), MeshRenderer(mesh=mesh), glass)
        for z, mesh in ((-3.0, "box"), (-9.0, "sphere"), (-6.0, "box"), (-12.0, "sphere"))
    ]
    camera = framing_camera((-1, -1, -13), (1, 1, -2), direction=(0, 0, -1))
    world = stage.world()
    plan = plan_picture(world, View.of(camera, 64, 64))
    drawn = [
        int(entity)
        for call in plan.transparent
        for entity in world.entity[plan.rows][call.first : call.first + call.instance_count]
    ]
    assert drawn == [order[3], order[1], order[2], order[0]]


def test_solid_things_of_a_batch_come_nearest_first(stage) -> None:
    deep = np.random.default_rng(8).permutation(np.linspace(-3.0, -30.0, 40))
    boxes = [stage.add(Transform(position=(0.0, 0.0, z)), MeshRenderer(mesh="box")) for z in deep]
    balls = [stage.add(Transform(position=(0.0, 0.0, z)), MeshRenderer(mesh="sphere")) for z in deep]
    stage.add(Transform(), Light())
    camera = framing_camera((-1, -1, -31), (1, 1, -2), direction=(0, 0, -1))
    world = stage.world()
    plan = plan_picture(world, View.of(camera, 64, 64), shadow_size=64)
    drawn = [world.entity[plan.rows][call.first : call.first + call.instance_count].tolist() for call in plan.opaque]
    nearest_first = np.argsort(-deep)
    assert drawn == [np.array(boxes)[nearest_first].tolist(), np.array(balls)[nearest_first].tolist()]
    assert plan.casters == [plan.opaque]  # who throws shadows stands there already
    assert len(plan.rows) == 80


def test_what_has_no_depth_keeps_its_order(stage) -> None:
    level = [stage.add(Transform(position=(x, 0.0, -5.0)), MeshRenderer()) for x in (1.0, -1.0, 0.0)]
    camera = framing_camera((-2, -1, -6), (2, 1, -4), direction=(0, 0, -1))
    world = stage.world()
    plan = plan_picture(world, View.of(camera, 64, 64))
    assert world.entity[plan.rows].tolist() == level


def test_the_highest_enabled_camera_counts(stage) -> None:
    stage.add(Transform(position=(1.0, 0.0, 0.0)), Camera(priority=1))
    stage.add(Transform(position=(2.0, 0.0, 0.0)), Camera(priority=3), enabled=False)
    stage.add(Transform(position=(3.0, 0.0, 0.0), rotation=TURN, scale=(2.0, 2.0, 2.0)), Camera(priority=2))
    camera = stage.world().camera()
    assert camera.position == (3.0, 0.0, 0.0)
    np.testing.assert_allclose(camera.rotation, TURN, atol=1e-6)


def test_lamps_shine_where_they_are_turned(stage) -> None:
    stage.add(Transform(rotation=TURN), Light())
    (light,) = stage.world().lights()
    np.testing.assert_allclose(light.direction, Rotation.from_quat(TURN).apply((0, 0, -1)), atol=1e-6)


def test_a_lamp_follows_its_curve_at_the_time_that_is_seen(stage, make_frame) -> None:
    curve = ((0.0, 1.0, 0.0, 2.0), (1.0, 3.0, 2.0, 2.0), (2.0, 3.0, 0.0, 0.0))
    stage.add(Transform(), Light(intensity=10.0, over_time=curve))
    world = stage.world()
    assert world.lights()[0].light.intensity == 10.0
    for time, factor in ((0.5, 2.0), (1.0, 3.0), (2.5, 2.0)):  # straight up to 1 s; from 2 s on it begins anew
        world.take_state(make_frame({}, simulation_time=time, tick=round(60 * time), published_at=round(1e9 * time)))
        world.place()
        assert world.lights()[0].light.intensity == pytest.approx(10.0 * factor)


def test_a_selected_parent_selects_what_is_below_it(stage) -> None:
    root = stage.add(Transform())
    stage.add(Transform(), MeshRenderer(), parent=root)
    stage.add(Transform(), MeshRenderer())
    world = stage.world()
    assert world.entity[world.instances_of((root, 99))].tolist() == [2]


def test_a_floor_does_not_decide_what_is_framed() -> None:
    centre = np.zeros((6, 3))
    centre[:, 0] = np.arange(6.0)
    kept = without_giants(centre, np.array([0.5, 0.5, 0.5, 0.5, 0.5, 80.0]))
    assert kept.tolist() == [True] * 5 + [False]
    assert without_giants(centre[:2], np.array([0.5, 80.0])).all()


def test_spheres_enclose_what_is_drawn(stage) -> None:
    from elys.common.assets import primitive

    parent = stage.add(Transform(scale=(1.0, 3.0, 1.0), rotation=TURN))
    stage.add(
        Transform(rotation=(0.2, 0.0, 0.0, 0.98), scale=(2.0, 0.5, 1.0)), MeshRenderer(mesh="cone"), parent=parent
    )
    world = stage.world()
    points = primitive("cone").positions @ world.linear[0].T + world.position[0]
    assert np.linalg.norm(points - world.centre[0], axis=1).max() <= world.radius[0] + 1e-6


def test_what_rests_is_not_placed_again(stage, make_frame) -> None:
    body = stage.add(Transform(), MeshRenderer())
    world = stage.world()
    poses = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0))
    versions = []
    for tick, pose in enumerate(poses):
        frame = make_frame({body: pose}, tick=tick, simulation_time=tick * 0.1, published_at=tick * 100_000_000)
        world.take_state(frame, tick * 0.1)
        world.place(tick * 0.1)  # at once: still where the frame before was
        versions.append(world.pose_version)
        assert world.position[0][0] == poses[max(tick - 1, 0)][0]
    assert versions[2] > versions[1]  # arrived where the second frame says
    assert versions[3] == versions[2]
    world.place(0.5)
    assert world.position[0][0] == pytest.approx(2.0)


def animated(frame: StateFrame, locals_of: dict[int, tuple]) -> StateFrame:
    """A frame in which entities have these local positions, rotations and scales."""
    columns = [np.array(column, np.float32) for column in zip(*locals_of.values(), strict=True)]
    return replace(
        frame,
        local_position=columns[0],
        local_rotation=columns[1],
        local_scale=columns[2],
        local_entity=np.array(list(locals_of), np.uint32),
    )


def test_what_is_animated_is_placed_from_parent_to_child_on_bodies_too(stage, make_frame) -> None:
    body = stage.add(Transform(position=(0.0, 5.0, 0.0)))
    frame_of_arm = stage.add(Transform(position=(0.0, 1.0, 0.0), scale=(2.0, 2.0, 2.0)), parent=body)
    arm = stage.add(Transform(position=(9.0, 9.0, 9.0)), parent=frame_of_arm)
    hand = stage.add(Transform(position=(1.0, 0.0, 0.0)), MeshRenderer(), parent=arm)
    still = stage.add(Transform(position=(7.0, 0.0, 0.0)), MeshRenderer())
    world = stage.world()
    stretched = (3.0, 1.0, 1.0)
    told = {arm: ((0.5, 0.0, 0.0), TURN, stretched)}
    world.take_state(animated(make_frame({body: ((3.0, 0.0, 0.0), TURN)}), told))
    world.place()
    turn = Rotation.from_quat(TURN)
    shoulder = np.array((3.0, 0.0, 0.0)) + turn.apply((0.0, 1.0, 0.0)) + turn.apply((1.0, 0.0, 0.0))
    np.testing.assert_allclose(
        world.position[row_of(world, hand)], shoulder + (turn * turn).apply((6.0, 0, 0)), atol=1e-6
    )
    np.testing.assert_allclose(
        world.linear[row_of(world, hand)], (turn * turn).as_matrix() @ np.diag((6.0, 2.0, 2.0)), atol=1e-6
    )
    np.testing.assert_allclose(world.position[row_of(world, still)], (7.0, 0.0, 0.0))
    corner = np.linalg.norm(np.array((6.0, 2.0, 2.0)) / 2)
    assert world.radius[row_of(world, hand)] == pytest.approx(corner, rel=1e-5)  # the box as it is stretched now


def test_between_frames_animated_things_go_on_the_short_way(stage, make_frame) -> None:
    arm = stage.add(Transform(), MeshRenderer())
    hand = stage.add(Transform(position=(1.0, 0.0, 0.0)), MeshRenderer(), parent=arm)
    world = stage.world()
    flat, one = (0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 1.0)
    world.take_state(animated(make_frame({}), {arm: ((0.0, 0.0, 0.0), flat, one)}), 0.0)
    later = make_frame({}, tick=1, simulation_time=0.1, published_at=10**8)
    world.take_state(animated(later, {arm: ((0.0, 2.0, 0.0), tuple(-np.array(TURN)), (3.0, 3.0, 3.0))}), 0.1)
    world.place(simulation_time=0.05)
    half = Slerp([0.0, 1.0], Rotation.from_quat([flat, TURN]))(0.5)
    np.testing.assert_allclose(
        world.position[row_of(world, hand)], np.array((0.0, 1.0, 0.0)) + half.apply((2.0, 0.0, 0.0)), atol=1e-6
    )


def test_an_edit_holds_until_a_frame_knows_of_it(stage, make_frame) -> None:
    arm = stage.add(Transform(position=(0.0, 0.0, 4.0)), MeshRenderer())
    world = stage.world()
    tables = replace(stage.tables(), pose_sequence=np.array([3]))
    world.set_scene(tables)
    told = {arm: ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 1.0))}
    world.take_state(animated(make_frame({}, delta_sequence=2), told))
    world.place()
    assert world.position[0].tolist() == [0.0, 0.0, 4.0]
    world.take_state(animated(make_frame({}, tick=1, published_at=1, delta_sequence=3), told))
    world.place()
    assert world.position[0].tolist() == [1.0, 0.0, 0.0]

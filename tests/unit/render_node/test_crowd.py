"""Bounds of groups against where every single instance is, worked out one by one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.bus.messages.state_frame import StateFrame
from elys.common.components import Light, Material, MeshRenderer, Transform
from elys.common.math import quaternion
from elys.common.math.matrix import look_rotation
from elys.render_node.camera import View, framing_camera
from elys.render_node.caster_bounds import KEPT_LIGHTS, caster_bounds
from elys.render_node.picture_plan import plan_picture
from elys.render_node.render_world import RenderWorld

SUN = np.array((-0.4, -1.0, -0.6)) / np.linalg.norm((-0.4, -1.0, -0.6))
TICK = 1 / 60


class Scattered:
    """Bodies that fly apart at a few metres a second and turn, every third with a child aside; some throw no shadows."""

    def __init__(self, stage: Any, count: int, *, spread: float = 10.0, floor: bool = False) -> None:
        self.random = np.random.default_rng(7)
        self.entities = []
        self.places = self.random.uniform(-spread, spread, (count, 3))
        for i, place in enumerate(self.places.tolist()):
            mesh = ("box", "sphere", "cone")[i % 3]
            body = stage.add(Transform(position=tuple(place)), MeshRenderer(mesh=mesh, cast_shadows=bool(i % 5)))
            self.entities.append(body)
            if i % 3 == 0:
                stage.add(Transform(position=(1.5, 0.0, 0.5)), MeshRenderer(), parent=body)
        if floor:
            stage.add(Transform(position=(0.0, -40.0, 0.0), scale=(900.0, 1.0, 900.0)), MeshRenderer())
        stage.add(Transform(rotation=tuple(look_rotation(SUN).tolist())), Light())
        self.velocity = self.random.normal(scale=4.0, size=(count, 3))
        self.spin = self.random.normal(scale=3.0, size=(count, 3))
        self.world: RenderWorld = stage.world()

    def frame(self, tick: int, speed: float = 1.0) -> StateFrame:
        now = tick * TICK
        return StateFrame(
            epoch=1,
            tick=tick,
            simulation_time=now,
            published_at=round(now * 1e9),
            delta_sequence=0,
            state_hash=0,
            playing=True,
            position=self.places + self.velocity * now * speed,
            rotation=Rotation.from_rotvec(self.spin * now * speed).as_quat().astype(np.float32),
            linear_velocity=(self.velocity * speed).astype(np.float32),
            angular_velocity=(self.spin * speed).astype(np.float32),
            entity=np.array(self.entities, np.uint32),
        )

    def play(self, ticks: range, share: float = 0.5) -> None:
        for tick in ticks:
            self.world.take_state(self.frame(tick), tick * TICK)
            self.world.place(tick * TICK + TICK * share)


def spheres_of(world: RenderWorld) -> tuple[np.ndarray, np.ndarray]:
    """Where all solid instances are now, and how large: each by itself."""
    return world.centre, world.radius.astype(np.float64)


@pytest.mark.parametrize("count", [40, 900])
@pytest.mark.parametrize("share", [0.1, 0.9, 1.6])
def test_groups_hold_all_their_members_wherever_they_go(stage: Any, count: int, share: float) -> None:
    scene = Scattered(stage, count)
    world = scene.world
    for tick in range(12):
        scene.play(range(tick, tick + 1), share)
        crowd = world.crowd
        centre, radius = spheres_of(world)
        for group in range(len(crowd.size)):
            rows = crowd.listed(np.array([group])).astype(int)
            far = np.linalg.norm(centre[rows] - crowd.centre[:, group], axis=1) + radius[rows]
            assert far.max() <= crowd.radius[group] * (1 + 1e-5)
            assert len({(world.instances.batch_of[row], bool(world.instances.casts[row])) for row in rows}) == 1
    listed = np.concatenate([crowd.listed(np.array([group])) for group in range(len(crowd.size))])
    assert sorted(listed.tolist()) == list(range(world.instance_count))
    assert len(crowd.size) <= 520


def test_few_things_have_bounds_of_their_own_that_are_exact_at_rest(stage: Any) -> None:
    scene = Scattered(stage, 60)
    scene.play(range(9))
    rest = scene.frame(8)
    for tick in (9, 10):
        again = replace(rest, tick=tick, simulation_time=tick * TICK, published_at=round(tick * TICK * 1e9))
        scene.world.take_state(again, tick * TICK)
        scene.world.place(tick * TICK + TICK / 2)
    crowd = scene.world.crowd
    centre, radius = spheres_of(scene.world)
    rows = crowd.listed(np.arange(len(crowd.size))).astype(int)
    assert (crowd.size == 1).all()
    assert crowd.slack == 0.0
    np.testing.assert_allclose(crowd.centre.T, centre[rows], atol=1e-6)
    np.testing.assert_allclose(crowd.radius, radius[rows], rtol=1e-6)


def test_with_exact_bounds_a_picture_does_not_depend_on_those_before(stage: Any) -> None:
    scene = Scattered(stage, 30)
    worlds = [RenderWorld(exact_bounds=True) for _ in range(2)]
    for world, ticks in zip(worlds, (range(9), range(7, 9)), strict=True):
        world.set_scene(stage.tables())
        for tick in ticks:
            world.take_state(scene.frame(tick), tick * TICK)
            world.place()
            _ = world.crowd
    light = quaternion.to_matrix(look_rotation(SUN)).T
    bounds = [caster_bounds(world.crowd, light) for world in worlds]
    for one, other in zip(*bounds, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_light_that_turns_leaves_nothing_behind(stage: Any) -> None:
    crowd = Scattered(stage, 30).world.crowd
    first = caster_bounds(crowd, np.eye(3))
    for angle in np.linspace(0.1, 3.0, 20):
        caster_bounds(crowd, quaternion.to_matrix(np.array((np.sin(angle / 2), 0.0, 0.0, np.cos(angle / 2)))).T)
    note: Any = crowd.note
    assert len(note._seen_by) == len(note._bounds) == KEPT_LIGHTS
    for one, again in zip(first, caster_bounds(crowd, np.eye(3)), strict=True):
        np.testing.assert_array_equal(one, again)


@pytest.mark.parametrize("floor", [False, True])
def test_no_caster_reaches_out_of_the_bounds_that_maps_are_fitted_to(stage: Any, floor: bool) -> None:
    scene = Scattered(stage, 700, floor=floor)
    world, light = scene.world, quaternion.to_matrix(look_rotation(SUN)).T
    for tick in range(15):
        scene.play(range(tick, tick + 1), 0.7)
        bounds = caster_bounds(world.crowd, light)
        centre, radius = spheres_of(world)
        rows = np.flatnonzero(world.instances.casts & (radius < 100.0))
        in_light = centre[rows] @ light.T
        assert (in_light[:, :2] - radius[rows, None] >= bounds.lower - 1e-5).all()
        assert (in_light[:, :2] + radius[rows, None] <= bounds.upper + 1e-5).all()
        assert (in_light[:, 2] + radius[rows]).max() <= bounds.nearest + 1e-5
        assert (in_light[:, 2] - radius[rows]).min() >= bounds.farthest - 1e-5
        # And they are not much wider than they must be: the floor does not count, nor what has gone long ago.
        tight = (in_light[:, :2] + radius[rows, None]).max(axis=0) - (in_light[:, :2] - radius[rows, None]).min(axis=0)
        assert (bounds.upper - bounds.lower <= 1.15 * tight).all()


@pytest.mark.parametrize("count", [60, 1200])
def test_nobody_in_view_is_left_out(stage: Any, count: int) -> None:
    """By the six half spaces of the view, each sphere by itself, while all fly about."""
    scene = Scattered(stage, count)
    world, view = scene.world, View.of(framing_camera((-3, -3, -3), (3, 3, 3), aspect=1.0), 64, 64)
    left_out = outside = 0
    for tick in range(10):
        scene.play(range(tick, tick + 1), 1.2)
        drawn = set(plan_picture(world, view).rows.tolist())
        centre, radius = spheres_of(world)
        clip = np.concatenate([centre - view.eye, np.ones((len(centre), 1))], axis=1)
        rows = view.clip_from_relative
        planes = np.concatenate([rows[3] + rows[:3], rows[3] - rows[:3]])
        planes /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
        in_view = (clip @ planes.T > -radius[:, None]).all(axis=1)
        assert set(np.flatnonzero(in_view).tolist()) <= drawn
        left_out += world.instance_count - len(drawn)
        outside += int((~in_view).sum())
    assert left_out > 0.5 * outside


def test_one_that_flies_off_does_not_widen_the_map_for_ever(stage: Any) -> None:
    scene = Scattered(stage, 50, spread=4.0)
    world, light = scene.world, quaternion.to_matrix(look_rotation(SUN)).T
    scene.velocity[:] = 0.0
    scene.velocity[1] = (0.0, 30.0, 0.0)
    scene.play(range(20))
    bounds = caster_bounds(world.crowd, light)
    centre, radius = spheres_of(world)
    rows = np.flatnonzero(world.instances.casts)
    tight = np.ptp(centre[rows] @ light.T, axis=0)[:2] + 2 * radius.max()
    assert (bounds.upper - bounds.lower <= tight + 1.5).all()


def test_a_body_that_is_nowhere_takes_nobody_along(stage: Any) -> None:
    scene = Scattered(stage, 900)
    world = scene.world
    scene.play(range(2))
    frame = scene.frame(2)
    position = frame.position.copy()
    position[3] = np.nan
    for tick in (2, 3):
        world.take_state(replace(scene.frame(tick), position=position), tick * TICK)
        world.place(tick * TICK + TICK / 2)
    view = View.of(framing_camera((-30,) * 3, (30,) * 3, aspect=1.0), 64, 64)
    assert len(plan_picture(world, view).rows) >= world.instance_count - 25


def test_what_is_hidden_or_see_through_is_in_no_group_that_is_drawn(stage: Any) -> None:
    scene = Scattered(stage, 40)
    glass = stage.add(Transform(), MeshRenderer(), Material(alpha_mode="blend", opacity=0.5))
    world = stage.world()
    view = View.of(framing_camera((-20,) * 3, (20,) * 3, aspect=1.0), 64, 64)
    hidden = (scene.entities[0], scene.entities[4])  # the first with its child
    plan = plan_picture(world, view, hidden=hidden, selection=(glass, scene.entities[4], scene.entities[6]))
    drawn = world.entity[plan.rows[: sum(call.instance_count for call in plan.opaque)]].tolist()
    assert not {scene.entities[0], scene.entities[4], glass} & set(drawn)
    assert len(drawn) == world.instance_count - 3 - 1
    assert [call.instance_count for call in plan.transparent] == [1]
    chosen = [world.entity[plan.rows[call.first : call.first + call.instance_count]].tolist() for call in plan.selected]
    assert sorted(entity for call in chosen for entity in call) == sorted(
        [glass, *world.entity[world.instances_of((scene.entities[6],))].tolist()]
    )
    for call in plan.opaque:
        assert (
            len(
                {int(world.instances.batch_of[row]) for row in plan.rows[call.first : call.first + call.instance_count]}
            )
            == 1
        )

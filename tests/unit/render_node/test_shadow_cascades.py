"""Cascades of the sun's shadow: how many, what they cover, that they stand still, and that nobody sees where one ends."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from elys.bus.messages.views import ViewCamera
from elys.common.components import Light, Material, MeshRenderer, Transform
from elys.common.math.matrix import look_rotation
from elys.render_node.camera import View
from elys.render_node.passes.shadow import ShadowPass
from elys.render_node.picture_plan import PicturePlan, plan_picture
from elys.render_node.quality import FULL
from elys.render_node.render_world import RenderWorld
from elys.render_node.renderer import Renderer
from elys.render_node.shadow_fit import atlas_shape, fit_cascades, reached

SUN = np.array((-0.6, -0.5, -0.35)) / np.linalg.norm((-0.6, -0.5, -0.35))
SIZE = (320, 180)


def turned(direction: Any) -> tuple[float, float, float, float]:
    x, y, z, w = look_rotation(direction).tolist()
    return (x, y, z, w)


def avenue(stage: Any, length: float = 800.0, *, shadows: bool = True) -> RenderWorld:
    """Pillars along both sides of a way, and a ball before the eye, on a floor."""
    stage.add(Transform(position=(0, -0.5, -length / 2), scale=(2 * length, 1, 2 * length)), MeshRenderer(), Material())
    for z in np.arange(0.0, length, length / 40):
        for x in (-6.0, 6.0):
            stage.add(Transform(position=(x, 2.0, -z), scale=(0.5, 4.0, 0.5)), MeshRenderer())
    stage.add(Transform(position=(0.5, 0.25, 3.0), scale=(0.5,) * 3), MeshRenderer(mesh="sphere"))
    stage.add(Transform(rotation=turned(SUN)), Light(intensity=2.8, cast_shadows=shadows))
    world: RenderWorld = stage.world()
    for batch in world.batches:
        world.assets.mesh(batch.mesh)
    world.assets.settle()
    world.place()
    return world


def looking(direction: Any = (0.05, -0.12, -1.0), position: Any = (0.0, 1.7, 6.0), *, ortho: float = 0.0) -> ViewCamera:
    return ViewCamera(
        position=tuple(position), rotation=turned(direction), field_of_view=0.8, far=3000.0, ortho_height=ortho
    )


def planned(world: RenderWorld, camera: ViewCamera, **options: Any) -> PicturePlan:
    return plan_picture(world, View.of(camera, *SIZE), shadow_size=1024, long_views=True, **options)


def test_as_many_as_the_depths_that_are_seen_need(stage: Any) -> None:
    world = avenue(stage)
    assert len(planned(world, looking()).cascades) >= 3
    assert len(planned(world, looking((0.0, -0.5, -1.0), (0.0, 300.0, 400.0))).cascades) == 1  # all of it is far away
    assert len(planned(world, looking(ortho=20.0)).cascades) == 1
    assert len(plan_picture(world, View.of(looking(), *SIZE), shadow_size=1024).cascades) == 1  # to be quick
    fits = planned(world, looking()).cascades
    assert all(3 * finer.texel <= coarser.texel for finer, coarser in itertools.pairwise(fits))
    small = stage.__class__()
    assert len(planned(avenue(small, 12.0), looking((0.0, -0.4, -1.0), (0.0, 8.0, 14.0))).cascades) == 1


def test_finer_ones_cover_all_that_is_seen_as_far_as_they_reach(stage: Any) -> None:
    world, camera = avenue(stage), looking()
    view = View.of(camera, *SIZE)
    rng = np.random.default_rng(2)
    height = np.tan(0.4)
    for fit in planned(world, camera).cascades[:-1]:
        reach = fit.texel * fit.map_size / 2.2  # of a box around a ball around all up to there
        depth = rng.uniform(0.0, 1.0, 500) * reach
        place = np.stack(
            [rng.uniform(-1, 1, 500) * height * 16 / 9, rng.uniform(-1, 1, 500) * height, -np.ones(500)], axis=1
        )
        relative = (place * depth[:, None]) @ view.world_from_view.T
        clip = relative @ fit.map_from_relative[:3, :3].T + fit.map_from_relative[:3, 3]
        assert np.abs(clip[:, :2]).max() <= 1.0


def test_they_keep_their_size_and_stand_on_texels_of_the_world_while_the_eye_moves(stage: Any) -> None:
    world = avenue(stage)
    first = planned(world, looking()).cascades
    point = np.array((1.0, 0.0, -2.0))
    rng = np.random.default_rng(5)
    for _ in range(20):
        direction = np.array((0.05, -0.12, -1.0)) + rng.normal(0.0, 0.03, 3)
        position = np.array((0.0, 1.7, 6.0)) + rng.normal(0.0, 0.05, 3)
        camera = looking(direction, position)
        moved = planned(world, camera).cascades
        assert len(moved) == len(first)
        for before, after in zip(first[:-1], moved[:-1], strict=True):
            assert after.texel == before.texel
            texels = [
                (fit.map_from_relative[:2] @ np.append(point - eye, 1.0) + 1.0) * fit.map_size / 2
                for fit, eye in ((before, (0.0, 1.7, 6.0)), (after, position))
            ]
            shift = texels[1] - texels[0]
            np.testing.assert_allclose(shift, np.rint(shift), atol=1e-3)


def test_into_each_is_drawn_who_throws_a_shadow_there(stage: Any) -> None:
    world, camera = avenue(stage), looking()
    view = View.of(camera, *SIZE)
    rows = np.flatnonzero(world.instances.casts)
    groups = np.flatnonzero(world.crowd.casts)
    for fit in fit_cascades(world, view, SUN, map_size=1024, most=4)[:-1]:
        chosen = set(world.crowd.listed(reached(world.crowd, fit, view, groups)).tolist())
        for row in rows.tolist():
            lower, upper = (corner[0] for corner in world.boxes(np.array([row])))
            grid = np.stack(np.meshgrid(*(np.linspace(a, b, 9) for a, b in zip(lower, upper, strict=True))), axis=-1)
            inside = grid.reshape(-1, 3) - view.eye
            clip = inside @ fit.map_from_relative[:2, :3].T + fit.map_from_relative[:2, 3]
            if (np.abs(clip) <= 1.0).all(axis=1).any():
                assert row in chosen
    plan = planned(world, camera)
    counts = [sum(call.instance_count for call in calls) for calls in plan.casters]
    assert counts == sorted(counts)
    assert counts[0] < counts[-1] / 3


@pytest.mark.gl
def test_only_what_changed_is_drawn_again(context: Any, stage: Any) -> None:
    world, renderer = avenue(stage), Renderer(context, quality=FULL)

    def stale(camera: ViewCamera) -> int:
        plan = plan_picture(
            world,
            View.of(camera, *SIZE),
            shadow_size=FULL.shadow_size,
            long_views=True,
            drawn_cascades=renderer._shadow.drawn,
        )
        assert ShadowPass.is_needed(plan) == bool(plan.stale_cascades)
        renderer.draw(world, camera, *SIZE)
        return len(plan.stale_cascades)

    every = stale(looking())
    assert every >= 3
    assert stale(looking()) == 0
    assert 1 <= stale(looking(position=(0.03, 1.7, 6.0))) < every  # the finest goes along, what is coarser holds
    world.pose_version += 1
    assert stale(looking(position=(0.03, 1.7, 6.0))) == every


@pytest.mark.gl
def test_what_is_hidden_throws_no_shadow_into_any(renderer: Renderer, stage: Any) -> None:
    """The finest cascade shows the ball's shadow, the others those of pillars; all go with who threw them and come back."""
    world = avenue(stage)
    ball = int(world.entity[next(batch.first for batch in world.batches if batch.mesh == "sphere")])
    floor = int(world.entity[np.argmax(world.radius)])
    pillars = tuple(set(world.entity.tolist()) - {ball, floor})
    bare = avenue(stage.__class__(), shadows=False)

    def drawn(of: RenderWorld, *hidden: int) -> np.ndarray:
        return renderer.read_pixels(renderer.draw(of, looking((0.05, -0.35, -1.0)), *SIZE, hidden=hidden)).astype(int)

    whole = drawn(world)
    hidden = (*pillars, ball)
    plan = planned(world, looking(), hidden=hidden)
    assert len(plan.cascades) >= 3
    assert all(sum(call.instance_count for call in calls) <= 1 for calls in plan.casters)  # the floor is left
    assert (drawn(world, *hidden) == drawn(bare, *hidden)).all()
    alone = drawn(world, *pillars)
    assert (alone != drawn(bare, *pillars)).any()
    assert (alone != whole).any()
    assert (drawn(world) == whole).all()


@pytest.mark.gl
def test_nobody_sees_where_one_ends_and_nothing_shades_itself(renderer: Renderer, stage: Any) -> None:
    """With and without shadows the picture differs where a shadow lies and nowhere else, and shadows are whole."""
    stage.settings = stage.settings.__class__(background=(0.0, 0.0, 0.0), ambient=(0.2, 0.2, 0.2))
    camera = looking((0.05, -0.35, -1.0))
    light = [
        renderer.read_pixels(renderer.draw(avenue(stage.__class__(), shadows=shadows), camera, 640, 360)).astype(int)[
            ..., 0
        ]
        for shadows in (True, False)
    ]
    # A pixel whose ray to the sun, cast from the floor, meets no pillar and not the ball is lit.
    view = View.of(camera, 640, 360)
    x, y = np.meshgrid((np.arange(640) + 0.5) / 320 - 1, 1 - (np.arange(360) + 0.5) / 180)
    rays = np.stack([x * np.tan(0.4) * 16 / 9, y * np.tan(0.4), -np.ones_like(x)], axis=-1) @ view.world_from_view.T
    below = rays[..., 1] < -0.02
    distance = np.where(below, -1.7 / np.where(below, rays[..., 1], -1.0), 0.0)
    floor = rays * distance[..., None] + view.eye
    shadowed, near_edge = _shadowed(floor, 0.0), _shadowed(floor, 0.05 + 0.02 * distance)
    eye = np.broadcast_to(view.eye, rays.shape)
    plain = below & ~_slabs(eye, rays, 0.05) & ~_ball(eye, rays, 0.03) & (distance < 120.0)
    darker = light[1] - light[0] > 10
    assert not (darker & plain & ~near_edge).any()
    core = plain & shadowed & _shadowed(floor, -0.08 - 0.02 * distance)
    assert core.sum() > 300
    assert darker[core].mean() > 0.995
    assert (light[0][plain & ~near_edge] == light[1][plain & ~near_edge]).all()


def _slabs(start: np.ndarray, ray: np.ndarray, grow: Any) -> np.ndarray:
    """Whether rays (..., 3) meet a pillar of the avenue, thicker by `grow` (...) [m] to each side."""
    met = np.zeros(start.shape[:-1], bool)
    for z in np.arange(0.0, 800.0, 20.0):
        for x in (-6.0, 6.0):
            wide = np.broadcast_to(0.25 + np.asarray(grow), met.shape)
            half = np.stack([wide, 2.0 + np.maximum(wide - 0.25, 0.0), wide], axis=-1)
            middle = np.array((x, 2.0, -z))
            with np.errstate(divide="ignore", invalid="ignore"):
                a, b = (middle - half - start) / ray, (middle + half - start) / ray
            enter, leave = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
            met |= (enter <= leave) & (leave > 0) & (half > 0).all(axis=-1)
    return met


def _ball(start: np.ndarray, ray: np.ndarray, grow: Any) -> np.ndarray:
    to = np.array((0.5, 0.25, 3.0)) - start
    along = (to * ray).sum(axis=-1) / np.linalg.norm(ray, axis=-1)
    radius = 0.25 + np.asarray(grow)
    return ((to**2).sum(axis=-1) - along**2 < radius * np.abs(radius)) & (along > 0)


def _shadowed(floor: np.ndarray, grow: Any) -> np.ndarray:
    """Whether the sun is hidden from places of the floor (..., 3)."""
    ray = np.broadcast_to(-SUN, floor.shape)
    return _slabs(floor, ray, grow) | _ball(floor, ray, grow)


def test_an_atlas_has_room_for_each() -> None:
    assert [atlas_shape(count) for count in (1, 2, 3, 4)] == [(1, 1), (2, 1), (2, 2), (2, 2)]

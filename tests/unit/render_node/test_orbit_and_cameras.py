"""Cameras: framing, orbiting, pixels and planes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.bus.messages.views import ViewCamera
from elys.common.math import quaternion
from elys.render_node.camera import View, framing_camera, frustum_corners, frustum_planes
from elys.render_node.orbit import Orbit

place = st.tuples(*[st.floats(-50, 50)] * 3)
size = st.tuples(*[st.floats(0.1, 20)] * 3)


def projected(view: View, points: np.ndarray) -> np.ndarray:
    """Clip coordinates over w of world points (N, 3)."""
    relative = np.append(points - view.eye, np.ones((len(points), 1)), axis=1)
    clip = relative @ view.clip_from_relative.T
    return clip[:, :3] / clip[:, 3:]


def corners(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    return np.array([[(lower, upper)[bit >> axis & 1][axis] for axis in range(3)] for bit in range(8)])


@given(place, size, st.floats(0.3, 3.0))
def test_a_framed_box_is_all_in_the_picture_and_fills_it(centre, extent, aspect) -> None:
    lower, upper = np.array(centre) - extent, np.array(centre) + extent
    view = View.of(framing_camera(lower, upper, aspect=aspect), round(1000 * aspect), 1000)
    seen = projected(view, corners(lower, upper))
    assert np.abs(seen).max() < 1.0
    assert np.abs(seen[:, :2]).max() > 0.6


def test_nothing_to_frame_gives_a_camera_all_the_same() -> None:
    camera = framing_camera((np.inf,) * 3, (-np.inf,) * 3)
    assert np.isfinite(camera.position).all()


@given(place, st.floats(0.5, 40), st.floats(-3, 3), st.floats(-1.4, 1.4))
def test_an_orbit_taken_from_its_own_camera_is_the_same(target, distance, yaw, pitch) -> None:
    orbit = Orbit()
    orbit.target, orbit.distance, orbit.yaw, orbit.pitch = np.array(target), distance, yaw, pitch
    camera = orbit.camera()
    other = Orbit()
    other.take(camera, distance)
    np.testing.assert_allclose(other.target, target, atol=1e-9 + 1e-9 * distance * 50)
    assert other.pitch == pytest.approx(pitch, abs=1e-7)
    np.testing.assert_allclose(other.camera().position, camera.position, atol=1e-6)


def test_dragging_up_and_right_looks_from_below_and_the_left() -> None:
    orbit = Orbit()
    orbit.pitch = 0.0
    orbit.turn(0.1, -0.1)
    position = np.array(orbit.camera().position)
    assert position[1] < 0
    assert position[0] < 0


def test_panning_keeps_what_is_looked_at_under_the_pointer() -> None:
    orbit = Orbit()
    before = orbit.target.copy()
    orbit.pan(0.25, -0.125)
    view = View.of(orbit.camera(), 800, 800)
    seen = projected(view, before[None])[0]
    np.testing.assert_allclose(seen[:2], (0.5, 0.25), atol=1e-6)


@given(st.integers(0, 39), st.integers(0, 29))
def test_the_view_of_a_pixel_is_that_pixel(x: int, y: int) -> None:
    camera = framing_camera((-1, -1, -1), (1, 1, 1))
    view = View.of(camera, 40, 30)
    point = np.array([(x + 0.5) / 40 * 2 - 1, 1 - (y + 0.5) / 30 * 2, 0.5, 1.0])
    relative = np.linalg.solve(view.clip_from_relative, point)
    pixel = view.of_pixel(x, y).clip_from_relative @ relative
    np.testing.assert_allclose(pixel[:2] / pixel[3], (0, 0), atol=1e-6)


def test_planes_enclose_exactly_what_is_seen() -> None:
    view = View.of(framing_camera((-1, -2, -3), (4, 5, 6)), 64, 48)
    planes = frustum_planes(view.clip_from_relative)
    points = np.random.default_rng(1).uniform(-30, 30, (2000, 3))
    inside = (np.append(points, np.ones((2000, 1)), axis=1) @ planes.T >= 0).all(axis=1)
    homogeneous = np.append(points, np.ones((2000, 1)), axis=1) @ view.clip_from_relative.T
    expected = (np.abs(homogeneous[:, :3]) <= homogeneous[:, 3:]).all(axis=1)
    np.testing.assert_array_equal(inside, expected)
    middle = frustum_corners(view.clip_from_relative).mean(axis=0)
    forward = quaternion.rotate(np.array(view.camera.rotation), np.array((0.0, 0.0, -1.0)))
    assert middle @ forward > 0


def test_an_orbit_takes_a_parallel_view_and_zooms_it() -> None:
    orbit = Orbit()
    orbit.take(ViewCamera(position=(0.0, 0.0, 9.0), rotation=(0.0, 0.0, 0.0, 1.0), ortho_height=4.0), 9.0)
    assert orbit.camera().ortho_height == pytest.approx(4.0)
    assert orbit.target == pytest.approx((0.0, 0.0, 0.0))
    orbit.zoom(1.0)
    assert 0.0 < orbit.camera().ortho_height < 4.0
    orbit.frame((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), aspect=1.0)
    assert orbit.camera().ortho_height >= 2.0


def test_a_parallel_view_keeps_what_is_inside_and_culls_what_is_not() -> None:
    camera = ViewCamera(position=(5.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0, 1.0), ortho_height=2.0, near=1.0, far=10.0)
    view = View.of(camera, 200, 100)
    corners = frustum_corners(view.clip_from_relative)
    assert corners.min(axis=0) == pytest.approx((-2.0, -1.0, -10.0))
    assert corners.max(axis=0) == pytest.approx((2.0, 1.0, -1.0))
    planes = frustum_planes(view.clip_from_relative)
    inside = planes @ (1.9, -0.9, -9.9, 1.0)
    assert (inside > 0).all()
    assert (planes @ (1.9, -1.1, -9.9, 1.0)).min() == pytest.approx(-0.1)

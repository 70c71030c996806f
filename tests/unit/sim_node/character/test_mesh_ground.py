"""Characters on ground of triangles: they feel the surface, and not that it is made of triangles."""

from __future__ import annotations

import math

import numpy as np
import pytest

from elys.common.assets.mesh import Mesh, encode_mesh
from elys.common.components import Collider, MeshRenderer, Transform
from tests.unit.sim_node.character.stage import DT, Stage
from tests.unit.sim_node.physics.test_rolling_on_meshes import surface

SPEED = 3.0  # [m/s] of its sheet


def on_mesh(height, *, along: float, at: float = 2.0, **sheet) -> Stage:
    """A character that stands on y = height(x, z) at x = `at`."""
    points, triangles = surface(height, length=60.0, width=6.0, along=along, across=0.5)
    stage = Stage(floor=False, at=(at, float(height(np.array(at), np.array(0.0))) + 0.02, 0.0), **sheet)
    up = np.tile(np.float32((0.0, 1.0, 0.0)), (len(points), 1))
    uvs = np.zeros((len(points), 2), np.float32)
    corners = triangles.reshape(-1).astype(np.uint32)
    mesh = Mesh(positions=points.astype(np.float32), normals=up, uvs=uvs, indices=corners)
    reference = stage.simulation.assets.put(encode_mesh(mesh), kind="mesh")
    stage.world.spawn([Transform(), Collider(shape="mesh"), MeshRenderer(mesh=reference)], name="Ground")
    stage.step(30)
    return stage


@pytest.mark.parametrize("heading", [0.0, 25.0, 90.0])
def test_on_level_triangles_it_goes_as_on_a_box(heading: float) -> None:
    stage = on_mesh(lambda x, z: 0.0 * x * z, along=0.4)
    way = np.array((math.cos(math.radians(heading)), 0.0, math.sin(math.radians(heading))))
    stage.step(20, wish=tuple(way))
    path = stage.path(40 if heading == 90.0 else 120)
    np.testing.assert_allclose(np.diff(path, axis=0), np.tile(SPEED * DT * way, (len(path) - 1, 1)), atol=2e-5)
    assert stage.walker().grounded and np.ptp(path[:, 1]) < 1e-5


def test_over_hills_it_keeps_to_the_ground_at_its_speed() -> None:
    """The sheet's speed is along the ground: over sinus hills of at most 27 degrees, up and down."""
    length, tall = 10.0, 0.8

    def height(x, z):
        return tall * (1.0 - np.cos(2.0 * math.pi * x / length)) + 0.0 * z

    stage = on_mesh(height, along=0.25, at=5.0)
    stage.step(20, wish=(1.0, 0.0, 0.0))
    path = stage.path(500)
    assert np.abs(path[:, 2]).max() < 1e-3
    # A round foot touches a hollow's sides before its middle, and nothing of a hilltop: within the capsule's sagitta.
    off = path[:, 1] - height(path[:, 0], 0.0)
    assert off.min() > -0.01 and off.max() < 0.06
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1) / DT
    assert np.median(speed) == pytest.approx(SPEED, rel=0.01)
    assert np.percentile(np.abs(speed - SPEED), 95) < 0.15
    assert stage.walker().grounded


def test_it_stands_still_on_a_corner_of_triangles() -> None:
    stage = on_mesh(lambda x, z: 0.3 * np.maximum(0.0, 1.0 - np.hypot(x - 5.0, z)), along=0.5, at=5.0)
    before = stage.place()
    path = stage.path(240)
    assert np.abs(path - before).max() < 1e-4
    assert stage.walker().grounded


def test_it_does_not_fall_through_what_it_runs_off_and_lands_on() -> None:
    """Stairs of triangles as high as a storey, run down at 6 m/s."""
    stage = on_mesh(lambda x, z: -2.5 * np.floor((x + 1e-9) / 6.0) + 0.0 * z, along=0.05, at=1.0)
    stage.step(1, wish=(1.0, 0.0, 0.0), wish_run=True)
    path = stage.path(360)
    floor = -2.5 * np.floor((path[:, 0] - 0.35) / 6.0)
    assert path[-1, 0] > 25.0
    assert (path[:, 1] > np.minimum(floor, -2.5 * np.floor(path[:, 0] / 6.0)) - 0.02).all()

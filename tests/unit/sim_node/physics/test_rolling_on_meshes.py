"""A ball that rolls over a surface of triangles feels the surface, and not that it is made of triangles."""

from __future__ import annotations

import math

import numpy as np
import pytest

from elys.sim_node.physics import MESH, SPHERE, PhysicsSettings, PhysicsWorld

RADIUS, MASS, GRAVITY = 0.5, 2.0, 9.81


def surface(height, *, length: float, width: float, along: float, across: float):
    """Vertices and triangles of y = height(x, z), for x in 0 to `length` and z about 0, in rectangles cut in two."""
    x = np.linspace(0.0, length, round(length / along) + 1)
    z = np.linspace(-width / 2, width / 2, round(width / across) + 1)
    xs, zs = np.meshgrid(x, z, indexing="ij")
    points = np.stack([xs, height(xs, zs), zs], axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(len(x), len(z))
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    return points, np.concatenate([np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])


def rolling(points, triangles, *, speed: float, height: float, gravity: float = GRAVITY) -> PhysicsWorld:
    """A ball that rolls along x, at first on level ground at x = 1."""
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, -gravity, 0.0)))
    world.add_bodies(
        [1, 2],
        motion=[2, 0],
        position=[[0, 0, 0], [1.0, height + RADIUS, 0.0]],
        mass=MASS,
        linear_velocity=[[0, 0, 0], [speed, 0, 0]],
        angular_velocity=[[0, 0, 0], [0, 0, -speed / RADIUS]],
    )
    world.add_colliders([1], shape=MESH, geometry=world.add_mesh(points, triangles), friction=1.0)
    world.add_colliders([2], shape=SPHERE, radius=RADIUS, friction=1.0)
    return world


@pytest.mark.parametrize("speed", [5.0, 16.0, 40.0, 90.0])
@pytest.mark.parametrize("shared", [True, False])
def test_on_level_ground_it_goes_as_far_as_it_is_fast(speed, shared):
    """Also where each triangle has corners of its own, as models with sharp edges in their colours have."""
    points, triangles = surface(lambda x, z: 0.0 * x, length=110.0, width=4.0, along=0.5, across=0.5)
    if not shared:
        points, triangles = points[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3)
    world = rolling(points, triangles, speed=speed, height=0.0)
    for _ in range(60):
        world.step(1 / 60)
    x, y, z = world.bodies.position[1]
    assert x == pytest.approx(1.0 + speed, abs=2e-3)
    assert (y, z) == (pytest.approx(RADIUS, abs=1e-3), pytest.approx(0.0, abs=1e-3))


def test_over_hills_its_energy_stays():
    """Rolling without sliding: v^2 (1 + 2/5) / 2 + g y is the same everywhere."""
    points, triangles = surface(
        lambda x, z: 0.4 * (1.0 - np.cos(2.0 * math.pi * x / 24.0)), length=120.0, width=4.0, along=0.25, across=0.5
    )
    world = rolling(points, triangles, speed=8.0, height=0.027)
    energies, heights = [], []
    while world.bodies.position[1, 0] < 110.0:
        world.step(1 / 60)
        vx, vy, vz = world.bodies.linear_velocity[1]
        energies.append(0.7 * (vx * vx + vy * vy + vz * vz) + GRAVITY * world.bodies.position[1, 1])
        heights.append(world.bodies.position[1, 1])
    assert max(heights) - min(heights) > 0.75
    assert np.ptp(energies) / energies[0] < 0.02


def test_where_a_road_leans_over_it_stays_on_it():
    """A level road that twists to 15 degrees within ten metres, at 16 m/s: edges and corners along the way throw nothing up."""
    lean = math.radians(15.0)

    def height(x, z):
        share = np.clip((x - 20.0) / 10.0, 0.0, 1.0)
        return -z * np.tan(lean * share * share * (3.0 - 2.0 * share))

    points, triangles = surface(height, length=60.0, width=9.0, along=0.5, across=0.5)
    world = rolling(points, triangles, speed=16.0, height=0.0)
    most = 0.0
    for _ in range(150):
        world.step(1 / 60)
        x, y, z = world.bodies.position[1]
        share = float(np.clip((x - 20.0) / 10.0, 0.0, 1.0))
        slope = lean * share * share * (3.0 - 2.0 * share)
        most = max(most, abs((y + z * math.tan(slope)) * math.cos(slope) - RADIUS))
        if x > 31.0:
            break
    assert x > 31.0
    assert most < 0.02


def test_a_corner_and_an_edge_hold_what_lies_on_them():
    """A ball laid with care on the ridge of a roof, and on the tip of a pyramid, has nothing to fall from at first."""
    roof = np.array([[-2, 0, -2], [2, 0, -2], [-2, 1, 0], [2, 1, 0], [-2, 0, 2], [2, 0, 2]], float)
    sides = np.array([[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]])
    tip = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [0, 1, 0]], float)
    flanks = np.array([[1, 0, 4], [2, 1, 4], [3, 2, 4], [0, 3, 4]])
    for points, triangles in ((roof, sides), (tip, flanks)):
        world = rolling(points, triangles, speed=0.0, height=0.0)
        world.set_poses([2], position=[[0.0, 1.0 + RADIUS, 0.0]], rotation=[[0.0, 0.0, 0.0, 1.0]])
        for _ in range(12):
            world.step(1 / 60)
        assert world.bodies.position[1, 1] == pytest.approx(1.0 + RADIUS, abs=2e-3)

"""Shapes in motion against closed forms: what rolls, what slides over seams, what rests on what."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elys.sim_node.physics import (
    BOX,
    CAPSULE,
    CYLINDER,
    HEIGHT_FIELD,
    HULL,
    MESH,
    PLANE,
    SPHERE,
    PhysicsSettings,
    PhysicsWorld,
)

DT = 1.0 / 60.0
GRAVITY = 9.81
LYING = Rotation.from_euler("x", 90, degrees=True).as_quat()  # along z
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
CUBE = np.stack(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5]), -1).reshape(-1, 3)
SHAPES = {
    "box": ({"shape": BOX}, UPRIGHT, 0.5),
    "sphere": ({"shape": SPHERE}, UPRIGHT, 0.5),
    "standing capsule": ({"shape": CAPSULE, "radius": 0.3, "half_length": 0.2}, UPRIGHT, 0.5),
    "lying capsule": ({"shape": CAPSULE, "radius": 0.3}, LYING, 0.3),
    "standing cylinder": ({"shape": CYLINDER, "radius": 0.4, "half_length": 0.3}, UPRIGHT, 0.3),
    "lying cylinder": ({"shape": CYLINDER, "radius": 0.3}, LYING, 0.3),
    "hull": ({"shape": HULL}, UPRIGHT, 0.5),
}
GROUNDS = ["box", "hull", "plane", "mesh", "height field"]


def ground(world, name, *, rotation=UPRIGHT, friction=0.5):
    """A static ground through the origin, its normal along the y axis of the rotation."""
    world.add_bodies([1], motion=2, rotation=[rotation])
    shape = {"friction": friction}
    if name == "box":
        shape |= {"shape": BOX, "size": [40, 2, 40], "position": [0, -1, 0]}
    elif name == "hull":
        shape |= {"shape": HULL, "geometry": world.add_hull((CUBE - [0, 0.5, 0]) * [40, 2, 40])}
    elif name == "plane":
        shape |= {"shape": PLANE}
    elif name == "mesh":
        corners = [[-20, 0, -20], [-20, 0, 20], [20, 0, 20], [20, 0, -20]]
        shape |= {"shape": MESH, "geometry": world.add_mesh(corners, [[0, 1, 2], [0, 2, 3]])}
    else:
        shape |= {"shape": HEIGHT_FIELD, "geometry": world.add_height_field(np.zeros((81, 81)), [40, 40])}
    world.add_colliders([1], **shape)


def body(world, name, *, position, friction=0.5, **properties):
    shape, rotation, _ = SHAPES[name]
    shape = dict(shape)
    if shape["shape"] == HULL:
        shape["geometry"] = world.add_hull(CUBE)
    turn = Rotation.from_quat(properties.pop("rotation", UPRIGHT)) * Rotation.from_quat(rotation)
    world.add_bodies([2], position=[position], rotation=[turn.as_quat()], **properties)
    world.add_colliders([2], friction=friction, **shape)


def run(world, seconds):
    for _ in range(round(seconds / DT)):
        world.step(DT)


@pytest.mark.parametrize("where", GROUNDS)
@pytest.mark.parametrize("what", SHAPES)
def test_each_shape_rests_on_each_ground(what, where):
    world = PhysicsWorld(PhysicsSettings(sleeping=False))
    ground(world, where)
    height = SHAPES[what][2]
    body(world, what, position=[0.3, height, 0.2])
    run(world, 3.0)
    moved = world.bodies.position[1] - [0.3, height, 0.2]
    assert abs(moved).max() < 1e-3
    assert np.linalg.norm(world.bodies.linear_velocity[1]) < 1e-3
    assert world.contacts.normal_impulse.sum() == pytest.approx(GRAVITY * DT, rel=0.01)


@pytest.mark.parametrize("where", GROUNDS)
@pytest.mark.parametrize(("what", "share"), [("sphere", 5 / 7), ("lying cylinder", 2 / 3)])
def test_what_rolls_down_a_slope_covers_the_distance_of_the_textbook(what, share, where):
    angle = math.radians(20)
    slope = Rotation.from_rotvec([0, 0, -angle])
    world = PhysicsWorld()
    ground(world, where, rotation=slope.as_quat(), friction=0.8)
    start = slope.apply([-8.0, SHAPES[what][2], 0.1])
    body(world, what, position=start, friction=0.8, rotation=slope.as_quat())
    run(world, 2.0)
    way = slope.apply(world.bodies.position[1] - start, inverse=True)
    expected = 0.5 * share * GRAVITY * math.sin(angle) * 2.0**2
    assert way[0] == pytest.approx(expected, rel=5e-4)
    assert abs(way[1:]).max() < 1e-3
    # No bumps: the speed is that of rolling, and nothing hops.
    radius = SHAPES[what][2]
    assert np.linalg.norm(world.bodies.linear_velocity[1]) == pytest.approx(
        radius * np.linalg.norm(world.bodies.angular_velocity[1]), rel=1e-3
    )


@pytest.mark.parametrize("where", ["mesh", "height field"])
@pytest.mark.parametrize("what", ["box", "sphere", "hull", "lying capsule"])
def test_sliding_over_seams_equals_sliding_over_a_plane(what, where):
    ways, heights = [], []
    for name in (where, "plane"):
        world = PhysicsWorld()
        ground(world, name, friction=0.1)
        start = [-6.0, SHAPES[what][2], 0.13]
        body(world, what, position=start, friction=0.1, linear_velocity=[[5.0, 0.0, 0.0]])
        height = []
        for _ in range(120):
            world.step(DT)
            height.append(world.bodies.position[1, 1])
        ways.append(world.bodies.position[1] - start)
        heights.append(height)
    assert ways[1][0] > 7.0
    np.testing.assert_allclose(ways[0], ways[1], atol=1e-4)
    np.testing.assert_allclose(heights[0], heights[1], atol=3e-5)


def test_a_ball_crosses_the_ridges_of_a_roof_where_they_are():
    """What is convex stays an obstacle: a ball rolls over a ridge and follows the surface on either side."""
    heights = np.where(np.arange(21) == 10, 0.5, 0.0)[:, None] * np.ones((1, 21))
    world = PhysicsWorld()
    world.add_bodies([1], motion=2)
    world.add_colliders([1], shape=HEIGHT_FIELD, geometry=world.add_height_field(heights, [40, 40]))
    world.add_bodies(
        [2], position=[[-5.0, 0.5, 0.3]], linear_velocity=[[3.4, 0.0, 0.0]], angular_velocity=[[0, 0, -6.8]]
    )
    world.add_colliders([2], shape=SPHERE, friction=1.0)
    top = 0.0
    for _ in range(300):
        world.step(DT)
        top = max(top, world.bodies.position[1, 1])
    assert 0.99 < top < 1.3
    assert world.bodies.position[1, 0] > 3.0
    assert world.bodies.position[1, 1] == pytest.approx(0.5, abs=0.01)


def test_a_pile_of_every_shape_on_a_bumpy_field_stays_on_it_and_comes_to_rest():
    rng = np.random.default_rng(4)
    x = np.linspace(-1, 1, 41)
    field = 3.0 * (x[:, None] ** 2 + x[None] ** 2) + 0.1 * rng.random((41, 41))
    world = PhysicsWorld()
    world.add_bodies([1], motion=2)
    world.add_colliders([1], shape=HEIGHT_FIELD, geometry=world.add_height_field(field, [16, 16]), friction=0.8)
    count = 60
    entities = np.arange(2, 2 + count)
    position = np.stack([entities % 4 - 1.5, entities // 16 + 1.5, entities // 4 % 4 - 1.5], 1) * 1.1
    world.add_bodies(
        entities, position=position, rotation=Rotation.random(count, random_state=rng).as_quat(), angular_damping=0.5
    )
    hull = world.add_hull(rng.normal(size=(16, 3)) * 0.35)
    world.add_colliders(
        entities,
        shape=np.array([BOX, SPHERE, CAPSULE, CYLINDER, HULL])[entities % 5],
        size=[0.8, 0.6, 0.7],
        radius=0.3,
        half_length=0.35,
        geometry=hull,
        friction=0.8,
    )
    run(world, 6.0)
    inside = world.bodies.position[1:]
    # Some are put into others where they begin, and that is told.
    assert {problem.cause for problem in world.take_problems()} <= {"deep_overlap"}
    assert (abs(inside[:, [0, 2]]) < 8.0).all() and (inside[:, 1] > 0.0).all()
    assert np.median(np.linalg.norm(world.bodies.linear_velocity[1:], axis=1)) < 0.05
    assert np.quantile(world.contacts.depth, 0.99) < 0.02

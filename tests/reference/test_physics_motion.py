"""Motion against closed forms and against scipy's integrator."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from elys.sim_node.physics import BOX, DYNAMIC, SPHERE, STATIC, PhysicsSettings, PhysicsWorld

DT = 1.0 / 60.0
G = 9.81
WEIGHTLESS = PhysicsSettings(gravity=(0.0, 0.0, 0.0))


def run(world, seconds):
    for _ in range(round(seconds / DT)):
        world.step(DT)


def turn_about_z(angle):
    return [0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)]


def slope(degrees, *, friction, shape):
    """A body on an inclined plane: the world, and the direction downhill."""
    angle = math.radians(degrees)
    normal = np.array([-math.sin(angle), math.cos(angle), 0.0])
    turn = turn_about_z(angle)
    world = PhysicsWorld()
    rotation = [turn, turn if shape == BOX else [0, 0, 0, 1]]
    world.add_bodies([1, 2], motion=[STATIC, DYNAMIC], position=[-0.5 * normal, 0.5 * normal], rotation=rotation)
    world.add_colliders([1, 2], shape=[BOX, shape], size=[[400, 1, 400], [1, 1, 1]], friction=friction)
    return world, np.array([-math.cos(angle), -math.sin(angle), 0.0])


def test_free_flight_is_a_parabola():
    world = PhysicsWorld()
    world.add_bodies([1], position=[0, 10, 0], linear_velocity=[3, 2, 1], angular_velocity=[4, 5, 6])
    world.add_colliders([1], size=[1, 2, 3])
    run(world, 2.0)
    np.testing.assert_allclose(world.bodies.position[0], [6.0, 14.0 - 2.0 * G, 2.0], atol=1e-10)


def test_a_box_is_held_by_friction_on_20_degrees():
    world, downhill = slope(20, friction=0.6, shape=BOX)
    start = world.bodies.position[1].copy()
    run(world, 1.0)
    early = world.bodies.position[1].copy()
    run(world, 9.0)
    assert abs((early - start) @ downhill) < 2e-4  # while it settles
    assert abs((world.bodies.position[1] - early) @ downhill) < 1e-7


def test_a_box_slides_down_30_degrees():
    world, downhill = slope(30, friction=0.2, shape=BOX)
    start = world.bodies.position[1].copy()
    run(world, 2.0)
    angle = math.radians(30)
    expected = 0.5 * G * (math.sin(angle) - 0.2 * math.cos(angle)) * 4.0
    assert (world.bodies.position[1] - start) @ downhill == pytest.approx(expected, rel=1e-3)


def test_the_friction_cone_is_round():
    """Pushed along a diagonal of the tangents a block slows by mu g too, straight ahead: a pyramid would let it turn."""
    world = PhysicsWorld()
    world.add_bodies([1, 2], motion=[STATIC, DYNAMIC], position=[[0, -0.5, 0], [0, 0.5, 0]])
    world.add_colliders([1, 2], size=[[200, 1, 200], [1, 1, 1]], friction=0.3)
    run(world, 0.5)
    direction = np.array([math.cos(0.6), 0.0, math.sin(0.6)])
    world.set_velocities([2], linear=6.0 * direction)
    run(world, 1.0)
    np.testing.assert_allclose(world.bodies.linear_velocity[1], (6.0 - 0.3 * G) * direction, atol=2e-3 * 6.0)


def test_a_ball_rolls_down_20_degrees_without_slipping():
    world, downhill = slope(20, friction=0.6, shape=SPHERE)
    start = world.bodies.position[1].copy()
    run(world, 2.0)
    expected = 0.5 * G * math.sin(math.radians(20)) * 5.0 / 7.0 * 4.0
    assert (world.bodies.position[1] - start) @ downhill == pytest.approx(expected, rel=1e-4)
    speed = world.bodies.linear_velocity[1] @ downhill
    assert world.bodies.angular_velocity[1, 2] * 0.5 == pytest.approx(speed, rel=1e-3)


@pytest.mark.parametrize("restitution", [0.5, 0.8, 1.0])
@pytest.mark.parametrize("height", [2.0, 1.87])
def test_a_ball_rebounds_to_e_squared_of_the_height(restitution, height):
    world = PhysicsWorld()
    world.add_bodies([1, 2], motion=[STATIC, DYNAMIC], position=[[0, -0.5, 0], [0, height + 0.5, 0]])
    world.add_colliders([1, 2], shape=[BOX, SPHERE], size=[20, 1, 20], restitution=restitution)
    apexes, upward = [], False
    for _ in range(300):
        world.step(DT)
        speed = float(world.bodies.linear_velocity[1, 1])
        if speed > 0.0 and not upward:
            apexes.append(world.bodies.position[1, 1] - 0.5 + speed**2 / (2 * G))
        upward = speed > 0.0
    expected = [height * restitution ** (2 * k) for k in range(1, 4)]
    np.testing.assert_allclose(apexes[:3], expected, rtol=1e-5)


def test_a_bounce_comes_to_rest_in_finite_time():
    """All bounces together last sqrt(2 h / g) (1 + e) / (1 - e)."""
    world = PhysicsWorld()
    world.add_bodies([1, 2], motion=[STATIC, DYNAMIC], position=[[0, -0.5, 0], [0, 1.5, 0]])
    world.add_colliders([1, 2], shape=[BOX, SPHERE], size=[20, 1, 20], restitution=0.6)
    run(world, math.sqrt(2 / G) * 1.6 / 0.4 + 0.1)
    assert abs(world.bodies.linear_velocity[1, 1]) < 1e-3
    assert world.bodies.position[1, 1] == pytest.approx(0.5, abs=1e-3)


def test_a_cube_that_lands_flat_bounces_straight():
    world = PhysicsWorld()
    world.add_bodies([1, 2], motion=[STATIC, DYNAMIC], position=[[0, -0.5, 0], [0, 2.5, 0]])
    world.add_colliders([1, 2], size=[[20, 1, 20], [1, 1, 1]], restitution=0.5)
    run(world, 0.75)
    apex = world.bodies.position[1, 1] - 0.5 + world.bodies.linear_velocity[1, 1] ** 2 / (2 * G)
    assert apex == pytest.approx(0.5, rel=1e-4)
    assert abs(world.bodies.angular_velocity[1]).max() < 1e-4


def test_a_row_of_balls_hands_the_blow_on():
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies(
        np.arange(1, 6),
        position=[[-2, 0, 0], [0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]],
        linear_velocity=[[1, 0, 0]] + [[0, 0, 0]] * 4,
    )
    world.add_colliders(np.arange(1, 6), shape=SPHERE, restitution=1.0, friction=0.0)
    run(world, 2.0)
    np.testing.assert_allclose(world.bodies.linear_velocity[:, 0], [0, 0, 0, 0, 1], atol=1e-6)


def test_friction_in_a_bounce_is_limited_by_its_own_impulse():
    """A ball that comes down sideways leaves with v_x less mu (1 + e) v_y, spinning by 5/2 of that over r."""
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([1, 2], motion=[STATIC, DYNAMIC], position=[[0, -0.5, 0], [0, 1.0, 0]], linear_velocity=[8, -2, 0])
    world.add_colliders([1, 2], shape=[BOX, SPHERE], size=[20, 1, 20], friction=0.1, restitution=0.5)
    run(world, 0.5)
    change = 0.1 * 1.5 * 2.0
    np.testing.assert_allclose(world.bodies.linear_velocity[1], [8 - change, 1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(world.bodies.angular_velocity[1], [0, 0, -2.5 * change / 0.5], atol=1e-5)


@pytest.mark.parametrize("perturbation", [0.1, 0.001])
def test_free_tumbling_follows_eulers_equations(perturbation):
    """A box about its middle axis for five seconds, against scipy at twelve digits."""
    size = np.array([1.0, 0.2, 0.5])
    moments = 4.0 / 12.0 * ((size**2).sum() - size**2)
    spin = np.array([10 * perturbation, 10 * perturbation, 10.0])
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([1], mass=4.0, angular_velocity=spin)
    world.add_colliders([1], size=size)
    energy, momentum = world.energy().kinetic, world.momentum().angular

    def euler(_, state):
        x, y, z, w, a, b, c = state
        omega = state[4:]
        derivative = 0.5 * np.array(
            [w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -x * a - y * b - z * c]
        )
        return np.append(derivative, np.cross(moments * omega, omega) / moments)

    start = np.append([0.0, 0.0, 0.0, 1.0], spin)
    exact = solve_ivp(euler, (0.0, 5.0), start, rtol=1e-12, atol=1e-12).y[:, -1]
    run(world, 5.0)
    turn = Rotation.from_quat(exact[:4] / np.linalg.norm(exact[:4]))
    np.testing.assert_allclose(abs(world.bodies.rotation[0] @ turn.as_quat()), 1.0, atol=1e-6)
    np.testing.assert_allclose(world.bodies.angular_velocity[0], turn.apply(exact[4:]), atol=5e-3)
    assert world.energy().kinetic == pytest.approx(energy, rel=1e-7)
    np.testing.assert_allclose(world.momentum().angular, momentum, atol=1e-6 * np.linalg.norm(momentum))


def test_ten_kilometres_away_a_box_rests_as_at_the_origin():
    sides, depths = [], []
    for x in (0.0, 1e4):
        world = PhysicsWorld()
        world.add_bodies([1, 2], motion=[STATIC, DYNAMIC], position=[[x, -0.5, 0], [x, 0.5, 0]])
        world.add_colliders([1, 2], size=[[20, 1, 20], [1, 1, 1]])
        run(world, 3.0)
        depths.append(0.5 - world.bodies.position[1, 1])
        sides.append(world.bodies.position[1, 0] - x)
    assert depths[1] == pytest.approx(depths[0], rel=1e-3)
    assert sides == pytest.approx([0.0, 0.0], abs=1e-5)

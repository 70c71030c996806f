"""Forces, impulses, point gravity and locked axes, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from elys.common.errors import PhysicsError
from elys.sim_node.physics import BOX, KINEMATIC, SPHERE, STATIC, Attractor, PhysicsSettings, PhysicsWorld

DT = 1.0 / 60.0
WEIGHTLESS = PhysicsSettings(gravity=(0.0, 0.0, 0.0))


def test_a_force_acts_in_the_next_step_only():
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([1, 2], mass=[2.0, 4.0], position=[[0, 0, 0], [9, 0, 0]])
    world.apply_force([1, 2], [[6.0, 0.0, 0.0], [0.0, 6.0, 0.0]])
    world.apply_force([1], [6.0, 0.0, 0.0])
    world.step(DT)
    np.testing.assert_allclose(world.bodies.linear_velocity, [[6.0 * DT, 0, 0], [0, 1.5 * DT, 0]], rtol=1e-6)
    np.testing.assert_allclose(world.bodies.position[0], [0.5 * 6.0 * DT**2, 0, 0], rtol=1e-12)
    before = world.bodies.linear_velocity.copy()
    world.step(DT)
    np.testing.assert_array_equal(world.bodies.linear_velocity, before)


def test_forces_on_one_body_add_up_within_one_call_too():
    together, one_by_one = PhysicsWorld(WEIGHTLESS), PhysicsWorld(WEIGHTLESS)
    forces, points = [[6.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 5.0]], [[0, 1, 0], [8, 0, 0], [0, 0.5, 0]]
    for world in (together, one_by_one):
        world.add_bodies([1, 2], mass=[2.0, 4.0], position=[[0, 0, 0], [9, 0, 0]])
        world.add_colliders([1, 2], radius=0.5)
    together.apply_force([1, 2, 1], forces, points)
    together.apply_torque([2, 2], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    for entity, force, point in zip((1, 2, 1), forces, points, strict=True):
        one_by_one.apply_force([entity], force, [point])
    one_by_one.apply_torque([2], [1.0, 1.0, 0.0])
    for world in (together, one_by_one):
        world.step(DT)
    np.testing.assert_allclose(together.bodies.linear_velocity[0], [3.0 * DT, 0.0, 2.5 * DT], rtol=1e-6)
    np.testing.assert_array_equal(together.bodies.linear_velocity, one_by_one.bodies.linear_velocity)
    np.testing.assert_allclose(together.bodies.angular_velocity, one_by_one.bodies.angular_velocity, rtol=1e-6)
    assert (np.abs(together.bodies.angular_velocity[:, 0]) > 1e-3).all()


def test_a_lasting_force_acts_until_it_is_ended():
    world = PhysicsWorld()
    world.add_bodies([1], mass=3.0)
    world.set_forces([1], force=(0.0, 3.0 * 9.81, 6.0))
    for _ in range(120):
        world.step(DT)
    np.testing.assert_allclose(world.bodies.position[0], [0.0, 0.0, 0.5 * 2.0 * 4.0], atol=1e-12)
    world.set_forces([1])
    world.step(DT)
    np.testing.assert_allclose(world.bodies.linear_velocity[0], [0.0, -9.81 * DT, 4.0], rtol=1e-6)


def test_a_weak_force_moves_what_would_sleep():
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([1])
    world.set_forces([1], force=(0.01, 0.0, 0.0))
    for _ in range(600):
        world.step(DT)
    np.testing.assert_allclose(world.bodies.position[0, 0], 0.5 * 0.01 * 100.0, rtol=1e-9)


def test_a_force_at_a_point_turns():
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([1], mass=2.0, position=(1.0, 0.0, 0.0), inertia=(2.0, 3.0, 4.0))
    world.apply_force([1], (0.0, 5.0, 0.0), point=(3.0, 0.0, 0.0))
    world.step(DT)
    np.testing.assert_allclose(world.bodies.angular_velocity[0], [0.0, 0.0, 10.0 / 4.0 * DT], rtol=1e-4)
    world.apply_torque([1], (0.0, 0.0, -10.0))
    world.step(DT)
    np.testing.assert_allclose(world.bodies.angular_velocity[0], 0.0, atol=1e-7)


def test_forces_move_what_lies_on_the_ground_as_friction_lets_them():
    world = PhysicsWorld()
    world.add_bodies([1, 2, 3], motion=[STATIC, 0, 0], mass=2.0, position=[[0, -0.5, 0], [0, 0.5, 0], [5, 0.5, 0]])
    world.add_colliders([1, 2, 3], size=[[100, 1, 100], [1, 1, 1], [1, 1, 1]], friction=0.5)
    weight = 2.0 * 9.81
    for _ in range(10):  # until the ground carries them
        world.step(DT)
    for _ in range(60):
        world.apply_force([2, 3], [[0, 0, 0.4 * weight], [0, 0, 0.7 * weight]], point=world.bodies.position[1:])
        world.step(DT)
    moved = world.bodies.position[1:, 2]
    assert abs(moved[0]) < 2e-5
    # As the force sets in the box tips by a hair before all of its friction is there: half of one substep's is missed.
    missed = 0.5 * (0.5 * 9.81 * DT / world.settings.substeps)
    assert 0.0 <= moved[1] - 0.5 * 0.2 * 9.81 < missed * 1.0


def test_impulses_come_for_many_at_once_and_for_one():
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([1, 2, 3], mass=[1.0, 2.0, 4.0], motion=[0, 0, KINEMATIC])
    world.apply_impulse([1, 2, 3], (0.0, 8.0, 0.0))
    world.apply_impulse(2, [2.0, 0.0, 0.0])
    world.apply_angular_impulse([1, 2], [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0]])
    np.testing.assert_allclose(world.bodies.linear_velocity, [[0, 8, 0], [1, 4, 0], [0, 0, 0]])
    np.testing.assert_allclose(world.momentum().angular, [0.1, 0.1, 0.0], atol=1e-12)


def test_a_force_on_nobody_is_refused():
    world = PhysicsWorld()
    world.add_bodies([1])
    with pytest.raises(PhysicsError, match="entity 7 has no body"):
        world.apply_force([1, 7], (1.0, 0.0, 0.0))
    with pytest.raises(PhysicsError, match="force must be finite: entity 1"):
        world.apply_force([1], (math.nan, 0.0, 0.0))


@pytest.mark.parametrize("eccentricity", [0.0, 0.5])
def test_a_kepler_orbit_closes_and_keeps_its_energy(eccentricity):
    strength, nearest = 100.0, 10.0
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0), attractors=(Attractor(strength=strength),)))
    speed = math.sqrt(strength / nearest * (1.0 + eccentricity))
    world.add_bodies([1], position=(nearest, 0.0, 0.0), linear_velocity=(0.0, speed, 0.0))
    period = 2.0 * math.pi * math.sqrt((nearest / (1.0 - eccentricity)) ** 3 / strength)
    first = sum(world.energy())
    steps = round(period / DT)
    for _ in range(5 * steps):
        world.step(period / steps)
        assert sum(world.energy()) == pytest.approx(first, rel=1e-8)
    np.testing.assert_allclose(world.bodies.position[0], [nearest, 0.0, 0.0], atol=1e-5)


def test_two_attractors_pull_as_scipy_says():
    suns = (
        Attractor(position=(3.0, 0.0, 0.0), strength=20.0, softening=0.5),
        Attractor(position=(-2.0, 1.0, 0.0), strength=9.0),
    )
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, -0.3, 0.0), attractors=suns))
    start, velocity = np.array([0.0, 0.0, 6.0]), np.array([1.0, 0.5, 0.0])
    world.add_bodies([1], position=start, linear_velocity=velocity, gravity_scale=0.5)

    def rates(_, state):
        pull = np.array([0.0, -0.3, 0.0])
        for sun in suns:
            away = np.array(sun.position) - state[:3]
            pull = pull + sun.strength * away / (away @ away + sun.softening**2) ** 1.5
        return np.concatenate([state[3:], 0.5 * pull])

    for _ in range(300):
        world.step(DT)
    expected = solve_ivp(rates, (0.0, 5.0), np.concatenate([start, velocity]), rtol=1e-11, atol=1e-11).y[:, -1]
    np.testing.assert_allclose(world.bodies.position[0], expected[:3], atol=1e-6)


def test_a_box_rests_on_a_planet():
    radius, strength = 5.0, 9.81 * 25.0
    planet = Attractor(position=(0.0, -radius, 0.0), strength=strength)
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0), attractors=(planet,)))
    world.add_bodies([1, 2], motion=[STATIC, 0], position=[[0, -radius, 0], [0.0, 0.5, 0.0]])
    world.add_colliders([1, 2], shape=[SPHERE, BOX], radius=radius)
    for _ in range(120):
        world.step(DT)
    np.testing.assert_allclose(world.bodies.position[1], [0.0, 0.5, 0.0], atol=2e-3)


# ---------------------------------------------------------------- locked axes

LOCKS = [(0, 2), (1,), (0, 1, 2), (3, 5), (4,), (3, 4, 5), (0, 3, 4), (2, 3, 4, 5)]


@pytest.mark.parametrize("axes", LOCKS)
def test_what_is_locked_never_moves(axes):
    world = PhysicsWorld()
    locked = np.zeros((8, 6), bool)
    locked[1:4, axes] = True
    position = [
        [0, -0.5, 0],
        [0, 0.45, 0],
        [0.2, 1.5, 0.1],
        [4, 2, 0],
        [0.3, 3, 0.3],
        [-0.4, 4, -0.2],
        [4.2, 5, 0.2],
        [0, 9, 0],
    ]
    world.add_bodies(
        np.arange(1, 9),
        motion=[STATIC] + 7 * [0],
        position=position,
        angular_velocity=[1.0, -2.0, 0.5],
        linear_velocity=[0.5, 0.0, -0.3],
        mass=[1, 1, 0.1, 2, 10, 1, 5, 1],
        locked=locked,
    )
    world.add_colliders(
        np.arange(1, 9),
        shape=[BOX, BOX, SPHERE, BOX, BOX, SPHERE, BOX, BOX],
        size=[[50, 1, 50]] + 7 * [[1.0, 0.9, 0.6]],
        restitution=[0, 0, 0.5, 0, 0, 0.5, 0.5, 0.5],
        rolling_friction=0.001,
    )
    world.set_forces([2, 3], force=(1.0, 2.0, 3.0), torque=(0.3, 0.2, 0.1))
    moves = [axis for axis in axes if axis < 3]
    turns = [axis - 3 for axis in axes if axis >= 3]
    before = world.bodies.position.copy()
    first = world._bodies.rows["rotation"].copy()
    for _ in range(180):
        world.step(DT)
        np.testing.assert_array_equal(world.bodies.position[1:4][:, moves], before[1:4][:, moves])
        velocity = world._bodies.rows["velocity"][1:4]
        assert (velocity[:, list(axes)] == 0.0).all()
        assert np.isfinite(world.bodies.position).all()
    if len(turns) == 3:
        np.testing.assert_array_equal(world._bodies.rows["rotation"][1:4], first[1:4])
    elif len(turns) == 2:
        (free,) = {0, 1, 2} - set(turns)
        axis = np.eye(3)[free]
        turned = Rotation.from_quat(world._bodies.rows["rotation"][1:4]).apply(axis)
        np.testing.assert_allclose(turned, Rotation.from_quat(first[1:4]).apply(axis), atol=1e-12)


def test_a_body_with_one_free_turn_answers_with_its_inertia_about_it():
    tilted = Rotation.from_euler("xyz", [0.4, 0.3, 0.2])
    world = PhysicsWorld(WEIGHTLESS)
    locked = [False, False, False, True, False, True]
    world.add_bodies([1], inertia=(1.0, 2.0, 2.5), rotation=tilted.as_quat(), locked=locked)
    about_y = (tilted.as_matrix() @ np.diag([1.0, 2.0, 2.5]) @ tilted.as_matrix().T)[1, 1]
    world.apply_angular_impulse([1], (5.0, 3.0, -4.0))
    np.testing.assert_allclose(world.bodies.angular_velocity[0], [0.0, 3.0 / about_y, 0.0], rtol=1e-6)
    world.apply_torque([1], (7.0, 3.0, 1.0))
    world.step(DT)
    np.testing.assert_allclose(world.bodies.angular_velocity[0], [0.0, (3.0 + 3.0 * DT) / about_y, 0.0], rtol=1e-6)


def test_a_body_with_two_free_turns_keeps_its_energy():
    world = PhysicsWorld(WEIGHTLESS)
    world.add_bodies([1], inertia=(1.0, 2.0, 2.5), angular_velocity=(2.0, 0.1, 0.0), locked=[False] * 5 + [True])
    first = world.energy().kinetic
    for _ in range(1200):
        world.step(DT)
    assert world.energy().kinetic == pytest.approx(first, rel=1e-3)


def test_something_heavy_does_not_press_through_a_locked_body():
    world = PhysicsWorld()
    world.add_bodies(
        [1, 2],
        mass=[0.01, 100.0],
        position=[[0, 0, 0], [0, 1, 0]],
        locked=[[False, True, False, True, False, True], [False] * 6],
    )
    world.add_colliders([1, 2], friction=1.0)
    for _ in range(120):
        world.step(DT)
    np.testing.assert_allclose(world.bodies.position[:, 1], [0.0, 1.0], atol=2e-3)


# ---------------------------------------------------------------- rolling and spinning friction


def ball_on_plane(**friction):
    world = PhysicsWorld()
    world.add_bodies([1, 2], motion=[STATIC, 0], position=[[0, -0.5, 0], [0, 0.5, 0]])
    world.add_colliders([1, 2], shape=[BOX, SPHERE], size=[200, 1, 200], radius=0.5, **friction)
    return world


def test_rolling_friction_slows_a_ball_down_by_the_closed_form():
    world = ball_on_plane(rolling_friction=[0.0, 0.01])
    world.set_velocities([2], linear=(2.0, 0.0, 0.0), angular=(0.0, 0.0, -4.0))
    for _ in range(60):
        world.step(DT)
    slowed = 0.01 * 9.81 / 0.5 * 5.0 / 7.0
    assert world.bodies.linear_velocity[1, 0] == pytest.approx(2.0 - slowed, rel=1e-4)


def test_rolling_friction_holds_a_ball_on_a_slight_slope():
    slope = 0.015  # less than rolling_friction over radius
    for friction, rests in ((0.01, True), (0.005, False)):
        world = ball_on_plane(rolling_friction=friction)
        world.settings = PhysicsSettings(gravity=(9.81 * math.sin(slope), -9.81 * math.cos(slope), 0.0), sleeping=False)
        for _ in range(300):
            world.step(DT)
        way = world.bodies.position[1, 0]
        free = 0.5 * 5.0 / 7.0 * 9.81 * (math.sin(slope) - friction / 0.5 * math.cos(slope)) * 25.0
        assert abs(way) < 1e-4 if rests else way == pytest.approx(free, rel=1e-2)


def test_spinning_friction_stops_a_ball_on_its_pole():
    world = ball_on_plane(spin_friction=[0.02, 0.0])
    world.set_velocities([2], angular=(0.0, 10.0, 0.0))
    for _ in range(60):
        world.step(DT)
    assert world.bodies.angular_velocity[1, 1] == pytest.approx(10.0 - 0.02 * 9.81 / (0.4 * 0.25), rel=1e-4)
    for _ in range(300):
        world.step(DT)
    np.testing.assert_allclose(world.bodies.angular_velocity[1], 0.0, atol=1e-5)


# ---------------------------------------------------------------- the same bits


def test_a_snapshot_keeps_forces_locks_and_rolling():
    world = ball_on_plane(rolling_friction=0.01)
    world.add_bodies([3], position=(0.3, 2.0, 0.0), locked=[False, False, True, True, True, False])
    world.add_colliders([3])
    world.set_forces([2], force=(2.0, 0.0, 0.0), torque=(0.0, 1.0, 0.0))
    for _ in range(40):
        world.step(DT)
    world.apply_force([3], (4.0, 0.0, 0.0))
    kept = world.snapshot()
    hashes = []
    for _ in range(30):
        world.step(DT)
        hashes.append(world.state_hash())
    other = PhysicsWorld()
    other.restore(kept)
    for expected in hashes:
        other.step(DT)
        assert other.state_hash() == expected


def test_a_locked_body_is_not_shot_away_by_a_ground_that_is_all_but_level():
    world = PhysicsWorld()
    tilt = Rotation.from_euler("z", 1e-4).as_quat()
    world.add_bodies(
        [1, 2],
        motion=[STATIC, 0],
        position=[[0, -0.5, 0], [0, 0.45, 0]],
        rotation=[tilt, [0, 0, 0, 1]],
        locked=[[False] * 6, [False, True, False, True, True, True]],
    )
    world.add_colliders([1, 2], size=[[20, 1, 20], [1, 1, 1]], friction=0.5, rolling_friction=0.01)
    for _ in range(60):
        world.step(DT)
        assert np.abs(world.bodies.linear_velocity).max() < 0.1
    assert world.bodies.position[1, 1] == 0.45

"""Joints against closed forms and against scipy's integrator."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from elys.sim_node.physics import SPHERE, STATIC, PhysicsSettings, PhysicsWorld

DT = 1.0 / 60.0
G = 9.81
WEIGHTLESS = PhysicsSettings(gravity=(0.0, 0.0, 0.0))
ABOUT_Z = [0.0, 0.0, 1.0]
THIN = 0.1


def run(world, seconds):
    for _ in range(round(seconds / DT)):
        world.step(DT)


def add_boxes(world, entities, position, size=(1.0, 1.0, 1.0), **bodies):
    world.add_bodies(entities, position=position, **bodies)
    world.add_colliders(entities, size=size)


def rod_pendulum(angle=0.0, **joint):
    """A rod of 1 kg and 1 m on a hinge at the origin, `angle` above the horizontal."""
    world = PhysicsWorld()
    half = [0.5 * math.cos(angle), 0.5 * math.sin(angle), 0.0]
    turn = [0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)]
    add_boxes(world, [1], [half], size=[1.0, THIN, THIN], rotation=turn)
    world.add_joints([1], kind="hinge", entity_b=1, anchor_a=[0, 0, 0], axis_a=ABOUT_Z, **joint)
    return world


ROD_INERTIA = (1.0 + THIN**2) / 12.0  # about the centre of mass


@pytest.mark.parametrize(("amplitude", "error"), [(0.1, 1e-4), (1.0, 1e-4), (2.0, 3e-4)])
def test_a_pendulum_has_the_period_of_the_elliptic_integral(amplitude, error):
    world = rod_pendulum(amplitude - math.pi / 2)
    rate = math.sqrt(G * 0.5 / (ROD_INERTIA + 0.25))
    expected = 4.0 / rate * ellipk(math.sin(amplitude / 2) ** 2)
    crossings = []
    before = amplitude
    for step in range(600):
        world.step(DT)
        now = world.joints.coordinate[0] + amplitude
        if before < 0.0 <= now:
            crossings.append((step + 1 - now / (now - before)) * DT)
        before = now
    assert np.diff(crossings).mean() == pytest.approx(expected, rel=error)


def test_a_pendulum_keeps_its_energy_for_a_minute():
    world = rod_pendulum()
    run(world, 60.0)
    # It began at rest on the height of its hinge, and swings half a metre below.
    assert abs(sum(world.energy())) < 2e-3 * G * 0.5
    assert np.linalg.norm(world.bodies.position[0]) == pytest.approx(0.5, abs=1e-5)


def double_pendulum(seconds):
    """Angles of two rods above the horizontal, at every step: Lagrange's equations."""

    def slope(_, state):
        a, b, u, v = state
        mixed = 0.5 * math.cos(a - b)
        matrix = [[ROD_INERTIA + 0.25 + 1.0, mixed], [mixed, ROD_INERTIA + 0.25]]
        swirl = 0.5 * math.sin(a - b)
        force = [-swirl * v * v - 1.5 * G * math.cos(a), swirl * u * u - 0.5 * G * math.cos(b)]
        return [u, v, *np.linalg.solve(matrix, force)]

    times = np.arange(1, round(seconds / DT) + 1) * DT
    return solve_ivp(slope, [0.0, times[-1]], [0.0] * 4, rtol=1e-10, atol=1e-12, t_eval=times).y


def test_a_double_pendulum_follows_the_equations_of_lagrange():
    world = PhysicsWorld()
    add_boxes(world, [1, 2], [[0.5, 0, 0], [1.5, 0, 0]], size=[1.0, THIN, THIN])
    world.add_joints(
        [1, 2],
        kind="hinge",
        entity_a=[0, 1],
        entity_b=[1, 2],
        anchor_a=[[0, 0, 0], [0.5, 0, 0]],
        axis_a=ABOUT_Z,
    )
    a, b, *_ = double_pendulum(2.0)
    expected = np.array([np.cos(a) + 0.5 * np.cos(b), np.sin(a) + 0.5 * np.sin(b)]).T
    found = []
    for _ in range(len(expected)):
        world.step(DT)
        found.append(world.bodies.position[1, :2].copy())
    errors = np.linalg.norm(found - expected, axis=1)
    assert errors[:60].max() < 3e-4
    assert errors.max() < 2e-3


@pytest.mark.parametrize("kind", ["slider", "distance"])
@pytest.mark.parametrize("damping", [0.0, 0.1, 1.0])
def test_a_spring_swings_as_a_damped_oscillator(kind, damping):
    frequency = 2.0
    world = PhysicsWorld(WEIGHTLESS)
    add_boxes(world, [1], [[2.0, 0.0, 0.0]], mass=3.0)
    spring = {"spring_frequency": frequency, "spring_damping": damping, "spring_rest": 1.5}
    world.add_joints([1], kind=kind, entity_b=1, anchor_a=[0, 0, 0], anchor_b=[0, 0, 0], **spring)
    omega = 2.0 * math.pi * frequency

    def slope(_, state):
        return [state[1], -(omega**2) * (state[0] - 1.5) - 2.0 * damping * omega * state[1]]

    times = np.arange(1, 121) * DT
    expected = solve_ivp(slope, [0.0, 2.0 + DT], [2.0, 0.0], rtol=1e-10, t_eval=times).y[0]
    found = []
    for _ in times:
        world.step(DT)
        found.append(world.joints.coordinate[0])
    np.testing.assert_allclose(found, expected, atol=4e-3)
    if damping == 0.0:  # the frequency is a little low, the amplitude stays
        run(world, 60.0)
        assert max(_coordinates(world, 60)) == pytest.approx(2.0, abs=1e-3)


def _coordinates(world, steps):
    for _ in range(steps):
        world.step(DT)
        yield world.joints.coordinate[0]


def test_a_motor_reaches_its_speed_with_the_torque_it_has():
    world = PhysicsWorld(WEIGHTLESS)
    add_boxes(world, [1], [[0.0, 0.0, 0.0]], mass=6.0)  # 1 kg m^2
    world.add_joints([1], kind="hinge", entity_b=1, axis_a=ABOUT_Z, motor_speed=10.0, motor_limit=2.0)
    run(world, 1.0)
    assert world.joints.speed[0] == pytest.approx(2.0, rel=1e-9)
    assert world.joints.torque[0] == pytest.approx(2.0, rel=1e-9)
    assert world.joints.coordinate[0] == pytest.approx(1.0, rel=1e-6)
    run(world, 5.0)
    assert world.joints.speed[0] == pytest.approx(10.0, rel=1e-9)
    assert world.joints.torque[0] == pytest.approx(0.0, abs=1e-9)
    # Angles are counted over turns: 25 rad while it speeds up, then 1 s at 10 rad/s.
    assert world.joints.coordinate[0] == pytest.approx(35.0, abs=1e-3)


def test_a_brake_holds_up_to_its_torque():
    weight = G * 0.5
    for limit, moves in ((1.01 * weight, False), (0.99 * weight, True)):
        world = rod_pendulum(motor_limit=limit)
        run(world, 1.0)
        assert (abs(world.joints.coordinate[0]) > 1e-3) == moves


def test_a_servo_goes_to_its_angle():
    world = PhysicsWorld(PhysicsSettings(gravity=(0.0, 0.0, 0.0), sleeping=False))
    add_boxes(world, [1], [[0.0, 0.0, 0.0]])
    world.add_joints([1], kind="hinge", entity_b=1, axis_a=ABOUT_Z, spring_frequency=3.0, spring_damping=1.0)
    world.set_joints([1], spring_rest=2.0, spring_limit=1.0)
    run(world, 1.0 / 60.0)
    assert world.joints.torque[0] == pytest.approx(1.0, rel=1e-9)
    run(world, 5.0)
    assert world.joints.coordinate[0] == pytest.approx(2.0, abs=1e-6)


def test_a_rope_is_never_longer_than_it_is():
    world = PhysicsWorld()
    add_boxes(world, [1], [[0.0, 0.0, 0.0]], size=[THIN] * 3, mass=2.0)
    world.add_joints([1], kind="distance", entity_b=1, anchor_a=[0, 0, 0], lower=0.0, upper=1.0)
    assert max(_coordinates(world, 120)) < 1.0 + 1e-6
    assert world.bodies.position[0, 1] == pytest.approx(-1.0, abs=1e-6)
    assert world.joints.force[0] == pytest.approx(2.0 * G, rel=1e-6)


def test_a_hinge_stops_at_its_limit():
    world = rod_pendulum(lower=-0.5, upper=1.0)
    assert min(_coordinates(world, 120)) > -0.5 - 1e-6
    assert world.joints.coordinate[0] == pytest.approx(-0.5, abs=1e-6)
    assert world.joints.torque[0] == pytest.approx(G * 0.5 * math.cos(0.5), rel=1e-4)


def test_a_cone_keeps_swing_and_twist_within():
    world = PhysicsWorld()
    add_boxes(world, [1], [[0.5, 0.0, 0.0]], size=[1.0, 0.2, THIN], angular_damping=1.0)
    world.add_joints(
        [1], kind="cone_twist", entity_b=1, anchor_a=[0, 0, 0], axis_a=[1, 0, 0], swing_limit=0.6, lower=-0.3, upper=0.3
    )
    world.set_velocities([1], linear=[0.0, 0.0, 2.0], angular=[5.0, -4.0, 0.0])
    for _ in range(300):
        world.step(DT)
        assert world.joints.swing[0] < 0.6 + 2e-3
        assert abs(world.joints.coordinate[0]) < 0.3 + 2e-3
    run(world, 10.0)
    # Hanging on the edge of the cone, its axis 0.6 below the horizontal.
    assert world.bodies.position[0, 1] == pytest.approx(-0.5 * math.sin(0.6), abs=2e-3)


def test_gears_keep_their_ratio_and_share_the_torque():
    world = PhysicsWorld(WEIGHTLESS)
    add_boxes(world, [1, 2], [[0, 0, 0], [3, 0, 0]], size=[[1, 1, 1], [2, 2, 1]], mass=[1.0, 3.0])
    world.add_joints(
        [1, 2], kind="hinge", entity_b=[1, 2], axis_a=ABOUT_Z, motor_speed=[20.0, 0.0], motor_limit=[5.0, 0.0]
    )
    world.add_joints([3], kind="gear", joint_a=1, joint_b=2, ratio=-0.5)
    run(world, DT)
    felt = 1.0 / 6.0 + 0.5**2 * 3.0 * 8.0 / 12.0
    assert world.joints.speed[0] == pytest.approx(5.0 / felt * DT, rel=1e-9)
    run(world, 10.0)
    turned = world.joints.coordinate
    assert turned[0] > 20.0 * math.pi
    assert turned[1] == pytest.approx(-0.5 * turned[0], abs=1e-6)


def test_a_rack_follows_its_pinion():
    world = PhysicsWorld(WEIGHTLESS)
    add_boxes(world, [1, 2], [[0, 0, 0], [0, 2, 0]], mass=[6.0, 2.0])
    world.add_joints([1], kind="hinge", entity_b=1, axis_a=ABOUT_Z, motor_speed=3.0, motor_limit=100.0)
    world.add_joints([2], kind="slider", entity_b=2, axis_a=[1, 0, 0])
    world.add_joints([3], kind="gear", joint_a=1, joint_b=2, ratio=0.25)
    run(world, 2.0)
    assert world.bodies.linear_velocity[1, 0] == pytest.approx(0.75, rel=1e-6)
    assert world.joints.coordinate[1] == pytest.approx(0.25 * world.joints.coordinate[0], abs=1e-6)


def test_a_joint_breaks_when_more_hangs_on_it():
    for share, breaks in ((1.001, False), (0.999, True)):
        world = PhysicsWorld()
        add_boxes(world, [4], [[0, 0, 0]], mass=2.0)
        world.add_joints([9], kind="fixed", entity_b=4, break_force=share * 2.0 * G)
        run(world, 1.0)
        broken = world.take_broken_joints()
        assert [(b.joint, b.entity_a, b.entity_b) for b in broken] == ([(9, 0, 4)] if breaks else [])
        assert world.joints.broken.tolist() == [breaks]
        assert (world.bodies.position[0, 1] < -1.0) == breaks
        if breaks:
            assert broken[0].force == pytest.approx(2.0 * G, rel=1e-3)


def test_a_joint_breaks_by_torque():
    for share, breaks in ((1.01, False), (0.99, True)):
        world = PhysicsWorld()
        add_boxes(world, [4], [[0.5, 0, 0]], size=[1.0, THIN, THIN])
        world.add_joints([9], kind="fixed", entity_b=4, anchor_a=[0, 0, 0], break_torque=share * G * 0.5)
        run(world, 0.5)
        assert bool(world.take_broken_joints()) == breaks


def test_a_heavy_weight_does_not_stretch_a_chain():
    links, ratio = 20, 100.0
    world = PhysicsWorld()
    entities = np.arange(1, links + 2)
    heights = [-0.25 - 0.5 * k for k in range(links)] + [-0.5 * links - 0.5]
    add_boxes(
        world,
        entities,
        [[0.0, height, 0.0] for height in heights],
        size=[[THIN, 0.5, THIN]] * links + [[1.0, 1.0, 1.0]],
        mass=[1.0] * links + [ratio],
    )
    world.add_joints(
        entities,
        kind="ball",
        entity_a=entities - 1,
        entity_b=entities,
        anchor_a=[[0, 0, 0]] + [[0, -0.25, 0]] * links,
        anchor_b=[[0, 0.25, 0]] * links + [[0, 0.5, 0]],
    )
    run(world, 2.0)
    assert world.bodies.position[-1, 1] == pytest.approx(heights[-1], abs=2e-5)
    world.apply_impulse(links + 1, [2.0 * ratio, 0.0, 0.0])
    run(world, 3.0)
    top, end = world.bodies.position[0], world.bodies.position[-1]
    assert np.linalg.norm(end) < 0.5 * links + 0.5 + 1e-4
    assert np.linalg.norm(top) == pytest.approx(0.25, abs=1e-4)
    assert world.joints.force[0] == pytest.approx((ratio + links) * G, rel=0.5)


def test_a_closed_loop_of_hinges_turns_for_ever():
    """Four bars of equal length two by two, where every hinge condition out of the plane is there twice."""
    world = PhysicsWorld()
    world.add_bodies([1, 2, 3], position=[[0, 0.5, 0], [1, 1, 0], [2, 0.5, 0]])
    world.add_joints(
        [1, 2, 3, 4],
        kind="hinge",
        entity_a=[0, 1, 2, 0],
        entity_b=[1, 2, 3, 3],
        anchor_a=[[0, 0, 0], [0, 0.5, 0], [1, 0, 0], [2, 0, 0]],
        axis_a=ABOUT_Z,
    )
    world.apply_impulse(2, [2.0, 0.0, 0.0])
    world.step(DT)
    before = sum(world.energy())
    run(world, 10.0)
    assert sum(world.energy()) == pytest.approx(before, rel=2e-3)
    crank = world.joints.coordinate[0]
    assert abs(crank) > 4.0 * math.pi
    np.testing.assert_allclose(abs(world.joints.coordinate), abs(crank), atol=1e-3)
    assert abs(world.bodies.position[:, 2]).max() < 1e-9


def taut_row(kind):
    """Twenty planks on an arc, held at both ends: nothing damps them, so that what is gained would add up."""
    count, half, sag = 20, 6.0, 0.7
    radius = (half**2 + sag**2) / (2.0 * sag)
    opening = 2.0 * math.asin(half / radius)
    length = 2.0 * radius * math.sin(opening / count / 2.0)
    angle = (np.arange(count) + 0.5) * opening / count - opening / 2.0
    out = radius * math.cos(opening / count / 2.0)
    place = np.stack([out * np.sin(angle), radius - sag - out * np.cos(angle), 0.0 * angle], axis=1)
    turn = np.stack([0.0 * angle, 0.0 * angle, np.sin(angle / 2.0), np.cos(angle / 2.0)], axis=1)
    planks = np.arange(1, count + 1)
    world = PhysicsWorld(PhysicsSettings(sleeping=False))
    world.add_bodies(planks, position=place, rotation=turn, mass=73.0)
    world.add_colliders(planks, size=(length, 0.1, 2.4), mask=0)
    world.add_joints(
        planks, kind=kind, entity_a=planks - 1, entity_b=planks, anchor_b=[-length / 2.0, 0.0, 0.0], axis_a=ABOUT_Z
    )
    world.add_joints([99], kind=kind, entity_b=count, anchor_b=[length / 2.0, 0.0, 0.0], axis_a=ABOUT_Z)
    return world


@pytest.mark.parametrize("kind", ["ball", "hinge"])
def test_a_taut_row_of_planks_gains_no_energy_from_a_blow(kind):
    world = taut_row(kind)
    at_rest = sum(world.energy())
    world.apply_impulse([7], [0.0, -400.0, 0.0])
    world.step(DT)
    blow = sum(world.energy()) - at_rest
    for _ in range(20):
        run(world, 1.0)
        assert 0.8 * blow < sum(world.energy()) - at_rest < 1.01 * blow


@pytest.mark.parametrize("blow", [20.0, 200.0, 2000.0, 20000.0])
def test_no_blow_is_so_hard_that_a_taut_row_gains_energy(blow):
    """Up to 270 m/s for a plank of 0.6 m: no substep can follow such turns, and what cannot be followed must be lost."""
    world = taut_row("hinge")
    at_rest = sum(world.energy())
    world.apply_impulse([7], [0.0, -blow, 0.0])
    world.step(DT)
    least = sum(world.energy()) - at_rest
    for _ in range(25):
        run(world, 1.0)
        energy = sum(world.energy()) - at_rest
        assert energy < 1.01 * least
        least = min(least, energy)
    assert world.take_problems() == []
    ends = world.bodies.position[[0, -1], 0]
    np.testing.assert_allclose(abs(ends), 6.0, atol=0.35)  # half a plank from where they are held


@pytest.mark.parametrize("lean", [0.7, 0.9, 1.2])
def test_a_heavy_ball_on_a_light_chain_gains_no_energy_from_a_post(lean):
    """Ten links of 4.7 kg, a ball of 359 kg, and a post in its way."""
    length, links = 0.26, 10
    world = PhysicsWorld(PhysicsSettings(sleeping=False))
    world.add_bodies([1, 99], motion=STATIC, position=[[0, 3.7, 0], [1.2, 1.8, 0]])
    world.add_colliders([1, 99], size=[(1.6, 0.2, 0.2), (0.25, 3.7, 0.25)], position=[(0.6, 0, 0), (0, 0, 0)])
    entities = np.arange(2, links + 3)
    turn = [0.0, 0.0, -math.sin(lean / 2), math.cos(lean / 2)]
    down = np.array([-math.sin(lean), -math.cos(lean), 0.0])
    along = np.append((np.arange(links) + 0.5) * length, links * length + 0.35)
    hook = np.array([0.0, 3.6, 0.0])
    world.add_bodies(entities, position=hook + along[:, None] * down, rotation=turn, mass=[4.68] * links + [359.0])
    world.add_colliders(entities[:-1], size=[(0.09, length, 0.05), (0.05, length, 0.09)] * (links // 2))
    world.add_colliders(entities[-1:], shape=SPHERE, radius=0.35)
    above = [[0.0, length / 2, 0.0]] * links + [[0.0, 0.35, 0.0]]
    world.add_joints(entities, kind="ball", entity_a=entities - 1, entity_b=entities, anchor_b=above)
    start = least = sum(world.energy())
    for _ in range(40):
        run(world, 0.5)
        energy = sum(world.energy())
        assert energy < least + 2e-3 * abs(start)
        least = min(least, energy)
    assert world.take_problems() == []
    assert np.linalg.norm(world.bodies.position[-1] - hook) < links * length + 0.36


@pytest.mark.parametrize("ratio", [1.0, 30.0, 1000.0])
def test_a_chain_with_a_weight_gains_no_energy_from_a_kick_of_20_m_s(ratio):
    links = 10
    world = PhysicsWorld(PhysicsSettings(sleeping=False))
    entities = np.arange(1, links + 2)
    heights = [-0.25 - 0.5 * k for k in range(links)] + [-0.5 * links - 0.5]
    add_boxes(
        world,
        entities,
        [[0.0, height, 0.0] for height in heights],
        size=[[THIN, 0.5, THIN]] * links + [[1.0, 1.0, 1.0]],
        mass=[1.0] * links + [ratio],
    )
    above = [[0.0, 0.25, 0.0]] * links + [[0.0, 0.5, 0.0]]
    world.add_joints(entities, kind="ball", entity_a=entities - 1, entity_b=entities, anchor_b=above)
    at_rest = sum(world.energy())
    world.apply_impulse(links + 1, [20.0 * ratio, 0.0, 0.0])
    world.step(DT)
    least = sum(world.energy()) - at_rest
    for _ in range(15):
        run(world, 1.0)
        energy = sum(world.energy()) - at_rest
        assert energy < 1.01 * least
        least = min(least, energy)
    assert np.linalg.norm(world.bodies.position[-1]) < 0.5 * links + 0.5 + 1e-3


def test_a_drive_whose_torque_is_small_does_not_spin_up_what_it_holds_far_from_its_middle():
    world = PhysicsWorld(WEIGHTLESS)
    add_boxes(world, [1], [[0.0, 0.0, 0.0]], size=[0.2, 0.3, 0.4], mass=0.5, angular_velocity=[3.0, -2.0, 5.0])
    world.add_joints([1], kind="motor", entity_b=1, anchor_b=[0.5, -0.7, 0.3], drive_force=50.0, drive_torque=0.1)
    before = sum(world.energy())
    for _ in range(120):
        world.step(DT)
        energy = sum(world.energy())
        assert energy < before + 1e-6
        before = energy


def test_a_soft_joint_sags_by_its_frequency():
    world = PhysicsWorld(PhysicsSettings(sleeping=False))
    add_boxes(world, [1], [[1.0, 0.0, 0.0]], mass=2.0)
    world.add_joints([1], kind="fixed", entity_b=1, frequency=3.0, damping_ratio=0.5)
    run(world, 5.0)
    np.testing.assert_allclose(world.bodies.position[0], [1.0, -G / (6.0 * math.pi) ** 2, 0.0], atol=1e-6)


def test_a_drive_pushes_with_its_force_and_torque():
    world = PhysicsWorld(WEIGHTLESS)
    add_boxes(world, [1], [[0.0, 0.0, 0.0]], mass=6.0)
    world.add_joints(
        [1], kind="motor", entity_b=1, drive_velocity=[1, 0, 0, 0, 0, 2], drive_force=3.0, drive_torque=0.5
    )
    run(world, 1.0)
    np.testing.assert_allclose(world.bodies.linear_velocity[0], [0.5, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(world.bodies.angular_velocity[0], [0.0, 0.0, 0.5], atol=1e-6)
    run(world, 5.0)
    np.testing.assert_allclose(world.bodies.linear_velocity[0], [1.0, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(world.bodies.angular_velocity[0], [0.0, 0.0, 2.0], atol=1e-6)


@pytest.mark.parametrize(
    "joint",
    [
        {"kind": "ball"},
        {"kind": "hinge", "axis_a": [0, 1, 0], "motor_speed": 3.0, "motor_limit": 0.5},
        {"kind": "fixed"},
        {"kind": "slider", "lower": -0.2, "upper": 0.3, "motor_speed": 1.0, "motor_limit": 1.0},
        {"kind": "distance", "anchor_b": [-0.4, 0.1, 0.0], "spring_frequency": 2.0},
        {"kind": "cone_twist", "swing_limit": 0.5, "lower": -0.2, "upper": 0.2},
        {"kind": "fixed", "frequency": 4.0, "damping_ratio": 0.3},
        {"kind": "motor", "drive_velocity": [0, 0, 0, 1, 2, 3], "drive_force": 5.0, "drive_torque": 2.0},
    ],
    ids=lambda joint: joint["kind"],
)
def test_joints_between_bodies_keep_momentum(joint):
    world = PhysicsWorld(WEIGHTLESS)
    add_boxes(world, [1, 2], [[0, 0, 0], [1.5, 0.2, 0]], size=[[1.0, 0.5, 0.3], [1.0, 0.2, 0.6]], mass=[1.0, 2.0])
    world.set_velocities([1, 2], linear=[[0.5, 0, 0], [0, 0.3, 0]], angular=[[1.0, 2.0, 1.5], [-1.5, 0.5, 1.0]])
    world.add_joints([1], entity_a=1, entity_b=2, anchor_a=[0.7, 0.2, 0.0], **joint)
    before = world.momentum()
    run(world, 5.0)
    after = world.momentum()
    np.testing.assert_allclose(after.linear, before.linear, atol=1e-5)
    np.testing.assert_allclose(after.angular, before.angular, atol=5e-3 * np.linalg.norm(before.angular))


def test_a_thousandfold_weight_swings_on_a_light_chain():
    """Links so light under such a force turn faster than a substep can follow: nothing may fly apart, nothing stretch."""
    links, ratio = 20, 1000.0
    world = PhysicsWorld()
    entities = np.arange(1, links + 2)
    heights = [-0.25 - 0.5 * k for k in range(links)] + [-0.5 * links - 0.5]
    size = [[THIN, 0.5, THIN]] * links + [[1.0, 1.0, 1.0]]
    add_boxes(world, entities, [[0.0, y, 0.0] for y in heights], size=size, mass=[1.0] * links + [ratio])
    anchors = [[0, 0, 0]] + [[0, -0.25, 0]] * links
    world.add_joints(entities, kind="ball", entity_a=entities - 1, entity_b=entities, anchor_a=anchors)
    world.apply_impulse(links + 1, [2.0 * ratio, 0.0, 0.0])
    world.step(DT)
    before = sum(world.energy())
    run(world, 5.0)
    assert np.linalg.norm(world.bodies.position[-1]) < 0.5 * links + 0.5 + 1e-3
    swing = 0.5 * (ratio + links) * 2.0**2
    assert sum(world.energy()) == pytest.approx(before, abs=0.05 * swing)

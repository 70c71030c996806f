"""Characters and what is in their way: walls, fences, seams, platforms, loose bodies, one another."""

from __future__ import annotations

import math

import numpy as np
import pytest

from elys.common.components import Character, Collider, RigidBody, Transform
from elys.common.math import quaternion
from elys.sim_node.character.kernels.tables import SKIN
from tests.unit.sim_node.character.stage import GRAVITY, Stage


@pytest.mark.parametrize("half_angle", [15, 20, 45, 60, 80])
def test_two_walls_in_a_v_hold_it_without_trembling(half_angle):
    angle = math.radians(half_angle)
    stage = Stage(at=(-3.0, SKIN, 0.1))
    for side in (1.0, -1.0):
        along = (-math.cos(angle), 0.0, side * math.sin(angle))
        outward = (math.sin(angle), 0.0, side * math.cos(angle))
        middle = [5.0 * along[k] + 0.5 * outward[k] for k in range(3)]
        turn = quaternion.from_axis_angle((0.0, 1.0, 0.0), side * angle)
        stage.box((10.0, 4.0, 1.0), (middle[0], 2.0, middle[2]), rotation=turn.tolist())
    path = stage.path(300, wish=(1.0, 0.0, 0.1), wish_run=True)
    assert np.ptp(path[-120:], axis=0).max() < 1e-9
    # The circle of radius and skin that touches both walls has its middle there.
    assert path[-1] == pytest.approx((-(0.3 + SKIN) / math.sin(angle), SKIN, 0.0), abs=1e-3)


def test_nothing_is_felt_of_the_seams_between_boxes():
    stage = Stage(floor=False, at=(0.0, SKIN, 0.2))
    for x in range(-1, 30):
        for z in (-1, 0, 1, 2, 3):
            stage.box((1.0, 1.0, 1.0), (float(x), -0.5, float(z)))
    stage.step(30, wish=(1.0, 0.0, 0.13))
    path = stage.path(240)
    assert np.ptp(path[:, 1]) < 1e-7
    steps = np.diff(path, axis=0)
    assert np.ptp(steps[:, 0]) < 1e-7
    assert np.ptp(steps[:, 2]) < 1e-7


def test_a_wall_of_many_boxes_is_slid_along_evenly():
    stage = Stage()
    for x in range(30):
        stage.box((1.0, 2.0, 1.0), (float(x), 1.0, 1.5))
    stage.step(60, wish=(0.8, 0.0, 0.6))
    steps = np.diff(stage.path(200), axis=0)
    assert steps[:, 0].min() == pytest.approx(0.8 * 3.0 / 60.0, abs=1e-6)
    assert np.abs(steps[:, 1:]).max() < 1e-7


@pytest.mark.parametrize("speed", [6.0, 20.0, 100.0])
@pytest.mark.parametrize("mode", ["walk", "fly"])
def test_a_thin_fence_stops_it_at_any_speed(mode, speed):
    stage = Stage(mode=mode, run_speed=speed, fly_speed=speed, acceleration=1e4)
    stage.box((0.002, 3.0, 20.0), (4.0, 1.5, 0.0))
    path = stage.path(120, wish=(1.0, 0.0, 0.0), wish_run=True)
    assert path[-1, 0] == pytest.approx(4.0 - 0.001 - 0.3 - SKIN, abs=1e-6)
    assert path[:, 0].max() < 4.0 - 0.3 - 0.4 * SKIN


def test_a_thin_floor_stops_a_fall_of_a_hundred_metres():
    stage = Stage(floor=False, at=(0.0, 100.0, 0.0), fall_speed=200.0)
    stage.box((20.0, 0.002, 20.0), (0.0, 0.0, 0.0))
    path = stage.path(400)
    assert path[:, 1].min() > 0.001
    assert stage.walker().grounded


@pytest.mark.parametrize("velocity", [(1.5, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, -0.6, 0.4)])
def test_it_is_carried_by_what_moves(velocity):
    stage = Stage(floor=False, at=(0.3, 1.0 + SKIN, 0.2))
    motion = RigidBody(motion="kinematic", linear_velocity=velocity)
    platform = stage.box((3.0, 0.4, 3.0), (0.0, 0.8, 0.0), body=motion)
    stage.step(10)
    offset = stage.place() - stage.place(platform)
    stage.step(120)
    assert stage.place() - stage.place(platform) == pytest.approx(offset, abs=1e-6)
    assert stage.walker().carried == pytest.approx(velocity, abs=1e-6)
    assert stage.walker().velocity == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_what_turns_takes_it_along_and_turns_it():
    stage = Stage(at=(2.0, 1.0 + SKIN, 0.0))
    motion = RigidBody(motion="kinematic", angular_velocity=(0.0, 1.0, 0.0))
    stage.box((8.0, 0.4, 8.0), (0.0, 0.8, 0.0), body=motion)
    stage.step(10)
    start, yaw = stage.place(), stage.walker().yaw
    stage.step(600)
    turn = quaternion.from_axis_angle((0.0, 1.0, 0.0), 10.0)
    assert stage.place() == pytest.approx(quaternion.rotate(turn, start), abs=1e-5)  # no spiral outwards
    assert stage.walker().yaw - yaw == pytest.approx(10.0, abs=1e-9)


def test_a_jump_from_a_platform_keeps_its_speed():
    stage = Stage(floor=False, at=(0.0, 1.0 + SKIN, 0.0), air_control=0.0)
    motion = RigidBody(motion="kinematic", linear_velocity=(4.0, 1.0, 0.0))
    platform = stage.box((3.0, 0.4, 3.0), (0.0, 0.8, 0.0), body=motion)
    stage.step(10)
    aside, offset, _ = stage.place() - stage.place(platform)
    stage.step(1, wish_jump=True)
    highest = 0.0
    for _ in range(90):
        stage.step()
        highest = max(highest, (stage.place() - stage.place(platform))[1] - offset)
        assert (stage.place() - stage.place(platform))[0] == pytest.approx(aside, abs=1e-5)
    assert highest == pytest.approx(1.2, abs=1e-5)  # as seen from the platform
    assert stage.walker().grounded


def test_a_kinematic_wall_pushes_it_and_never_enters_it():
    stage = Stage()
    motion = RigidBody(motion="kinematic", linear_velocity=(2.0, 0.0, 0.0))
    wall = stage.box((1.0, 2.0, 4.0), (-3.0, 1.1, 0.0), body=motion)
    for _ in range(240):
        stage.step()
        assert stage.place()[0] - stage.place(wall)[0] - 0.5 - 0.3 > 0.9 * SKIN
    assert stage.place()[0] > 4.0


@pytest.mark.parametrize("mass", [20.0, 50.0, 120.0])
def test_it_pushes_with_its_strength_and_no_more(mass):
    friction, force = 0.3, 500.0
    stage = Stage(push_force=force, walk_speed=20.0, acceleration=100.0)
    crate = stage.box((1.0, 1.0, 1.0), (1.0, 0.5, 0.0), body=RigidBody(mass=mass), friction=friction)
    stage.step(60)
    stage.step(20, wish=(1.0, 0.0, 0.0))
    before = stage.world.get(crate, RigidBody).linear_velocity[0]
    stage.step(12)
    gained = (stage.world.get(crate, RigidBody).linear_velocity[0] - before) / 0.2
    # A pair takes the geometric mean of 0.3 and the floor's 0.5.
    expected = max(force / mass - math.sqrt(friction * 0.5) * GRAVITY, 0.0)
    assert gained == pytest.approx(expected, rel=0.1, abs=0.01)


def test_what_is_too_heavy_stays_and_what_is_light_is_not_kicked_away():
    stage = Stage()
    heavy = stage.box((1.0, 1.0, 1.0), (2.0, 0.5, 0.0), body=RigidBody(mass=400.0))
    stage.step(200, wish=(1.0, 0.0, 0.0), wish_run=True)
    assert stage.place(heavy)[0] == pytest.approx(2.0, abs=1e-3)
    other = Stage()
    light = other.box((0.8, 0.8, 0.8), (2.0, 0.4, 0.0), body=RigidBody(mass=2.0))
    fastest = 0.0
    other.step(1, wish=(1.0, 0.0, 0.0))
    for _ in range(120):
        other.step()
        fastest = max(fastest, other.world.get(light, RigidBody).linear_velocity[0])
    assert 2.5 < fastest < 3.3


def test_its_weight_is_on_what_it_stands_on():
    stage = Stage(at=(0.0, 1.0 + SKIN, 0.0), mass=80.0)
    stage.box((2.0, 1.0, 2.0), (0.0, 0.5, 0.0), body=RigidBody(mass=20.0))
    stage.step(60)
    stage.step(120)
    load = stage.simulation.physics.contacts.normal_impulse.sum() * 60.0
    assert load == pytest.approx((80.0 + 20.0) * GRAVITY, rel=0.02)


def test_loose_bodies_bounce_off_it():
    stage = Stage()
    ball = stage.world.spawn(
        [
            Transform(position=(3.0, 1.0, 0.0)),
            RigidBody(linear_velocity=(-8.0, 0.0, 0.0), gravity_scale=0.0),
            Collider(shape="sphere", radius=0.2, restitution=0.5),
        ]
    )
    stage.step(60)
    assert stage.place(ball)[0] > 0.4
    assert np.hypot(*stage.place()[[0, 2]]) < 0.05


def test_two_characters_do_not_enter_each_other():
    stage = Stage(at=(-2.0, SKIN, 0.0))
    other = stage.add((2.0, SKIN, 0.05))
    stage.step(1, wish=(1.0, 0.0, 0.0), wish_run=True)
    stage.step(1, who=other, wish=(-1.0, 0.0, 0.0), wish_run=True)
    for _ in range(120):
        stage.step()
        apart = np.hypot(*(stage.place() - stage.place(other))[[0, 2]])
        assert apart > 0.6 + 0.4 * SKIN


def test_it_hears_no_walls_of_layers_that_it_does_not_meet():
    stage = Stage()
    stage.box((0.2, 3.0, 20.0), (2.0, 1.5, 0.0), layer=2)
    stage.step(2)
    stage.world.set_fields(stage.one, Collider, {"mask": 1})
    stage.step(120, wish=(1.0, 0.0, 0.0))
    assert stage.place()[0] > 4.0


def test_what_it_cannot_move_is_said_and_how_to_mend_it():
    stage = Stage()
    stage.world.add(stage.one, RigidBody())
    stage.step(2)
    texts = [event.values["text"] for event in stage.simulation.take_events()]
    assert len(texts) == 1
    assert "must be kinematic" in texts[0] and "Walker" in texts[0]


def test_a_sheet_that_changes_changes_the_capsule():
    stage = Stage()
    stage.step(3)
    stage.world.set_fields(stage.one, Character, {"radius": 0.5, "height": 2.4})
    stage.step(3)
    collider = stage.world.get(stage.one, Collider)
    assert (collider.radius, collider.half_length) == (0.5, pytest.approx(0.7))
    assert stage.walker().stature == pytest.approx(2.4)
    assert stage.place()[1] == pytest.approx(SKIN, abs=1e-6)


def test_who_is_stretched_is_told():
    stage = Stage()
    stage.world.set_fields(stage.one, Transform, {"scale": (2.0, 1.0, 1.0)})
    stage.step()
    assert any("make its scale 1" in event.values.get("text", "") for event in stage.simulation.take_events())

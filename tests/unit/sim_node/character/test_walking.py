"""What a character does on the ground and in the air, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from elys.common.components import Character
from elys.common.math import quaternion
from elys.common.scene import SceneSettings
from elys.sim_node.character.kernels.tables import SKIN
from tests.unit.sim_node.character.stage import GRAVITY, Stage


@pytest.mark.parametrize(
    ("wishes", "speed"),
    [
        ({}, 3.0),
        ({"wish_run": True}, 6.0),
        ({"wish_crouch": True}, 1.5),
        ({"wish_run": True, "wish_crouch": True}, 1.5),
    ],
)
def test_it_goes_as_fast_as_its_sheet_says(wishes, speed):
    stage = Stage()
    stage.step(40, wish=(0.6, 0.0, -0.8), **wishes)
    start = stage.place()
    stage.step(60)
    assert stage.place() - start == pytest.approx((0.6 * speed, 0.0, -0.8 * speed), abs=1e-6)
    assert stage.walker().velocity == pytest.approx((0.6 * speed, 0.0, -0.8 * speed), abs=1e-9)


def test_half_a_wish_is_half_the_speed_and_more_than_one_is_one():
    stage = Stage()
    stage.step(40, wish=(0.5, 0.0, 0.0))
    assert stage.walker().velocity[0] == pytest.approx(1.5)
    stage.step(40, wish=(7.0, 0.0, 0.0))
    assert stage.walker().velocity[0] == pytest.approx(3.0)


def test_it_speeds_up_and_brakes_evenly():
    stage = Stage(acceleration=12.0, braking=6.0)
    stage.step(5)
    stage.step(6, wish=(1.0, 0.0, 0.0))
    assert stage.walker().velocity[0] == pytest.approx(12.0 * 0.1)
    stage.step(60)
    stage.step(15, wish=(0.0, 0.0, 0.0))
    assert stage.walker().velocity[0] == pytest.approx(3.0 - 6.0 * 0.25)
    stage.step(30)
    assert stage.walker().velocity == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("rate", [30, 60, 144])
@pytest.mark.parametrize("height", [0.3, 1.2, 2.5, 7.0])
def test_a_jump_is_as_high_as_its_sheet_says_at_any_rate(height, rate):
    stage = Stage(jump_height=height)
    stage.simulation.change_settings(SceneSettings(tick_rate=rate))
    stage.step(5)
    start = stage.place()[1]
    path = stage.path(4 * rate, wish_jump=True)
    assert path[:, 1].max() - start == pytest.approx(height, abs=1e-6)
    # It is launched nearly as fast as energy says, and back when that says, within a tick.
    flight = np.count_nonzero(path[:, 1] > start + 1e-6) / rate
    assert flight == pytest.approx(2.0 * math.sqrt(2.0 * height / GRAVITY), abs=1.5 / rate)
    assert path[-1, 1] == pytest.approx(start, abs=1e-6)  # one jump each time that it is told


def test_it_may_jump_a_moment_after_the_ground_ended_and_no_later():
    for late, jumps in ((4, True), (7, False)):  # of a coyote time of 6 ticks
        stage = Stage(floor=False, at=(0.0, SKIN, 0.0))
        stage.box((2.0, 1.0, 4.0), (0.0, -0.5, 0.0))
        stage.step(5)
        stage.step(1, wish=(1.0, 0.0, 0.0), wish_run=True)
        while stage.walker().grounded:
            stage.step()
        stage.step(late - 1)
        before = stage.place()[1]
        stage.step(2, wish_jump=True)
        assert (stage.place()[1] > before) == jumps


def test_there_is_no_second_jump_in_the_air():
    stage = Stage()
    stage.step(5)
    stage.step(3, wish_jump=True)
    stage.step(1, wish_jump=False)
    rising = stage.walker().velocity[1]
    stage.step(1, wish_jump=True)
    assert stage.walker().velocity[1] < rising


def test_a_jump_told_shortly_before_landing_is_done_then():
    for early, jumps in ((5, True), (12, False)):  # of a buffer of 7 ticks
        stage = Stage(at=(0.0, 2.0, 0.0))
        ticks = 0
        probe = Stage(at=(0.0, 2.0, 0.0))
        while not probe.walker().grounded:
            probe.step()
            ticks += 1
        stage.step(ticks - early)
        path = stage.path(early + 20, wish_jump=True)
        assert (path[-1, 1] > 0.5) == jumps


def test_it_falls_as_stones_do_and_no_faster_than_its_sheet_says():
    stage = Stage(floor=False, at=(0.0, 100.0, 0.0), fall_speed=15.0)
    stage.step(60)
    assert 100.0 - stage.place()[1] == pytest.approx(0.5 * GRAVITY, abs=1e-6)
    stage.step(120)
    assert stage.walker().velocity[1] == -15.0


def test_in_the_air_it_steers_by_a_share_of_its_strength():
    stage = Stage(floor=False, at=(0.0, 100.0, 0.0), acceleration=20.0, air_control=0.25)
    stage.step(12, wish=(1.0, 0.0, 0.0))
    assert stage.walker().velocity[0] == pytest.approx(20.0 * 0.25 * 0.2)


@pytest.mark.parametrize("degrees", [10.0, 35.0, 49.9])
def test_it_climbs_slopes_up_to_its_limit_at_full_speed(degrees):
    stage = Stage()
    stage.ramp(degrees)
    stage.step(120, wish=(1.0, 0.0, 0.0))
    start = stage.place()
    stage.step(60)
    way = stage.place() - start
    assert np.linalg.norm(way) == pytest.approx(3.0, abs=1e-6)
    assert math.degrees(math.atan2(way[1], way[0])) == pytest.approx(degrees, abs=1e-4)
    assert stage.walker().grounded


@pytest.mark.parametrize("degrees", [50.1, 60.0, 80.0])
def test_it_climbs_nothing_steeper(degrees):
    stage = Stage(at=(-2.0, SKIN, 0.0))
    stage.ramp(degrees)
    path = stage.path(240, wish=(1.0, 0.0, 0.0), wish_run=True)
    assert path[:, 1].max() <= 1.01 * SKIN
    stage.step(1, wish_jump=True)  # nor by jumping against it
    path = stage.path(300)
    assert path[-1, 1] <= 1.01 * SKIN


@pytest.mark.parametrize("degrees", [55.0, 70.0])
def test_it_slides_down_steep_slopes_as_without_friction(degrees):
    angle = math.radians(degrees)
    stage = Stage(floor=False, at=(10.0 * math.cos(angle), 10.0 * math.sin(angle) + 0.5, 0.0))
    stage.ramp(degrees)
    stage.step(60)
    before = np.linalg.norm(stage.walker().velocity)
    stage.step(30)
    gained = np.linalg.norm(stage.walker().velocity) - before
    assert gained / 0.5 == pytest.approx(GRAVITY * math.sin(angle), rel=1e-6)
    assert not stage.walker().grounded
    assert stage.walker().ground_normal == pytest.approx((-math.sin(angle), math.cos(angle), 0.0), abs=1e-6)


def test_it_stands_still_on_a_slope_and_keeps_to_it_downhill():
    angle = math.radians(45.0)
    stage = Stage(at=(10.0 * math.cos(angle), 10.0 * math.sin(angle) + 0.2, 0.0))
    stage.ramp(45.0)
    stage.step(60)
    start = stage.place()
    stage.step(120)
    assert np.abs(stage.place() - start).max() < 1e-6
    for _ in range(60):
        stage.step(1, wish=(-1.0, 0.0, 0.0), wish_run=True)
        assert stage.walker().grounded


@pytest.mark.parametrize("wish", [1.0, 0.1])
@pytest.mark.parametrize(("height", "climbs"), [(0.05, True), (0.2, True), (0.349, True), (0.355, False), (0.6, False)])
def test_it_climbs_steps_as_high_as_its_sheet_says(height, climbs, wish):
    stage = Stage(step_height=0.35)
    stage.box((40.0, height, 4.0), (21.0, height / 2.0, 0.0))
    path = stage.path(int(120 / wish), wish=(wish, 0.0, 0.0))
    assert path[-1, 1] == pytest.approx(SKIN + (height if climbs else 0.0), abs=1e-6)
    assert (path[-1, 0] > 1.5) == climbs


def test_it_goes_up_and_down_stairs_without_leaving_them():
    stage = Stage()
    for k in range(10):
        stage.box((20.0, 0.2, 4.0), (12.0 + 0.3 * k, 0.1 + 0.2 * k, 0.0))
    path = stage.path(150, wish=(1.0, 0.0, 0.0))
    assert path[-1, 1] == pytest.approx(2.0 + SKIN, abs=1e-6)
    assert path[-1, 0] > 0.9 * 3.0 * 2.5
    stage.step(1, wish=(-1.0, 0.0, 0.0))
    for _ in range(150):
        stage.step()
        assert stage.walker().grounded
    assert stage.place()[1] == pytest.approx(SKIN, abs=1e-6)


def test_it_stands_on_the_edge_of_a_step_without_trembling():
    stage = Stage(at=(0.73, 1.0 + SKIN, 0.0))
    stage.box((4.0, 1.0, 4.0), (3.0, 0.5, 0.0))
    path = stage.path(240)
    assert np.ptp(path[-120:], axis=0).max() < 1e-9
    assert stage.walker().grounded
    assert stage.walker().ground_normal == (0.0, 1.0, 0.0)


def test_it_crouches_under_what_is_low_and_stands_up_where_there_is_room():
    stage = Stage()
    stage.box((4.0, 1.0, 4.0), (4.0, 1.3 + 0.5, 0.0))
    stage.step(90, wish=(1.0, 0.0, 0.0))
    assert stage.place()[0] == pytest.approx(2.0 - 0.3 - SKIN, abs=1e-6)  # upright it does not fit
    stage.step(120, wish_crouch=True)
    inside = stage.place()
    assert 3.0 < inside[0] < 5.5
    stage.step(30, wish_crouch=False, wish=(0.0, 0.0, 0.0))
    assert stage.walker().stature == pytest.approx(1.1)
    assert stage.place()[1] == pytest.approx(SKIN, abs=1e-6)
    stage.step(200, wish=(1.0, 0.0, 0.0))
    assert stage.walker().stature == pytest.approx(1.8)


def test_its_body_and_its_contacts_outlive_crouching():
    stage = Stage()
    stage.box((2.0, 2.0, 2.0), (0.0, 1.0, 0.0), is_trigger=True)
    stage.step(5)
    assert len(stage.simulation.events.triggers.stayed.trigger) == 1
    for crouch in (True, False):
        stage.step(1, wish_crouch=crouch)
        assert not len(stage.simulation.events.triggers.entered.trigger)
        assert not len(stage.simulation.events.triggers.exited.trigger)
    assert stage.place()[1] == pytest.approx(SKIN, abs=1e-6)


@pytest.mark.parametrize("mode", ["swim", "fly"])
def test_who_swims_or_flies_goes_where_it_looks_and_does_not_fall(mode):
    stage = Stage(at=(0.0, 5.0, 0.0), mode=mode, swim_speed=2.0, fly_speed=2.0)
    stage.step(60)
    assert stage.place() == pytest.approx((0.0, 5.0, 0.0), abs=1e-9)
    stage.step(30, wish=(0.6, 0.8, 0.0))
    start = stage.place()
    stage.step(60)
    assert stage.place() - start == pytest.approx((1.2, 1.6, 0.0), abs=1e-6)
    stage.step(60, wish=(0.0, 0.0, 0.0), wish_crouch=True)
    assert stage.walker().velocity == pytest.approx((0.0, -2.0, 0.0))
    stage.world.set_fields(stage.one, Character, {"mode": "walk", "wish_crouch": False})
    stage.step(120)
    assert stage.walker().grounded


def test_it_faces_where_it_is_told():
    stage = Stage()
    stage.step(2, yaw=0.7)
    rotation = stage.world.transforms.world_pose(stage.one)[1]
    assert rotation == pytest.approx(tuple(quaternion.from_axis_angle((0.0, 1.0, 0.0), 0.7)), abs=1e-6)

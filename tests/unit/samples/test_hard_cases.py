"""The registry of hard cases: sound scenes, answers and measures; exact motion has no error, wrong motion the error it should."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from elys.common.assets import AssetStore
from elys.common.errors import SceneError
from elys.common.math import quaternion
from elys.common.scene import expand, format_scene, parse_scene
from elys.samples import sample
from elys.samples.hard_cases import HARD_CASES, CaseRun, carried, driven, hard_case, jointed, moving, spinning
from elys.samples.hard_cases.measures import angle_about_z, crossing, tilt
from elys.samples.registry import SAMPLES
from elys.samples.rigid_cases import RIGID_CASES, Trajectory

G = 9.81
DT = 1.0 / 60.0


def at_rest(name: str, seconds: float = 3.0) -> CaseRun:
    """A run of a case in which nothing moves."""
    records = expand(hard_case(name).build(0), directory=Path(), assets=AssetStore())
    bodies = [record for record in records if "Collider" in record.components or "RigidBody" in record.components]
    count = round(seconds / DT) + 1
    place = np.array([body.components["Transform"]["position"] for body in bodies])
    turn = np.array([body.components["Transform"].get("rotation", (0.0, 0.0, 0.0, 1.0)) for body in bodies])
    none = np.zeros((count, len(bodies), 3))
    motion = Trajectory(
        np.arange(count) * DT,
        np.array(np.broadcast_to(place, none.shape)),
        np.array(np.broadcast_to(turn, (count, len(bodies), 4))),
        none,
        none.copy(),
    )
    still = np.zeros(count)
    return CaseRun(
        seed=0,
        names=tuple(body.name for body in bodies),
        motion=motion,
        energy=still + 1.0,
        kinetic=still.copy(),
        momentum=np.zeros((count, 3)),
        overlap=still.copy(),
        joint_gap=still.copy(),
    )


def errors(name: str, run: CaseRun) -> dict[str, float]:
    return hard_case(name).errors(run)


# ---------------------------------------------------------------- the registry


@pytest.mark.parametrize("name", HARD_CASES)
def test_a_case_is_a_scene_that_a_file_can_hold(name):
    case = HARD_CASES[name].quick
    document = case.build(case.seeds[0])
    text = format_scene(document)
    assert format_scene(parse_scene(text)) == text
    records = expand(document, directory=Path(), assets=AssetStore())
    assert len({record.name for record in records}) == len(records)
    present = {component for record in records for component in record.components}
    assert {"Camera", "Light", "Collider", "RigidBody"} <= present


@pytest.mark.parametrize("name", HARD_CASES)
def test_a_case_says_what_it_is(name):
    case = HARD_CASES[name]
    assert case.name == name and case.title and case.difficulty and case.answer and case.measures
    assert 0.0 <= case.picture_time <= case.duration
    assert len({measure.name for measure in case.measures}) == len(case.measures)
    assert [measure.name for measure in case.quick.measures] == [measure.name for measure in case.measures]


def test_the_registry_holds_every_case_of_columns_and_no_sample():
    assert set(RIGID_CASES) <= set(HARD_CASES)
    assert not set(SAMPLES) & set(HARD_CASES)
    assert sample("zeno").title == HARD_CASES["zeno"].title


def test_cases_are_the_same_every_time():
    code = (
        "from elys.samples.hard_cases import HARD_CASES; from elys.common.scene import format_scene; "
        "print(*(format_scene(case.quick.build(case.seeds[0])) for case in HARD_CASES.values()))"
    )
    outputs = {
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, check=True, env={**os.environ, "PYTHONHASHSEED": seed}
        ).stdout
        for seed in ("1", "2")
    }
    assert len(outputs) == 1 and len(outputs.pop()) > 100_000


def test_an_unknown_case_is_named_with_the_nearest():
    with pytest.raises(SceneError, match="no hard case 'newton-cradle'; did you mean 'newtons-cradle'"):
        hard_case("newton-cradle")
    with pytest.raises(SceneError, match="elys cases list"):
        hard_case("qq")


@pytest.mark.parametrize("name", [name for name in HARD_CASES if name != "rain-10000"])
def test_motion_that_is_not_finite_is_infinitely_wrong(name):
    run = at_rest(name)
    run.motion.position[-1, 0, 1] = math.nan
    assert set(errors(name, run).values()) == {math.inf}


def test_columns_are_told_as_they_are():
    columns = RIGID_CASES["five-balls"].build(0)
    run = at_rest("five-balls")
    assert run.names == tuple(f"Body {number}" for number in range(1, 6))
    np.testing.assert_array_equal(run.motion.position[0], columns.bodies.position)


# ---------------------------------------------------------------- measures


@pytest.mark.parametrize(
    "name", ["wall", "card-house", "masonry-arch", "ratio-up", "ratio-down", "wedge", "tiny-on-huge", "hour-at-rest"]
)
def test_what_stays_in_its_place_has_no_error(name):
    found = errors(name, at_rest(name))
    stays = {"thin one stands": 1.0}  # the arch that must not
    assert found == pytest.approx({measure: stays.get(measure, 0.0) for measure in found}, abs=1e-9)


def test_what_moves_has_the_error_it_moved():
    run = at_rest("wall")
    run.motion.position[5, run.place("Brick 7")] += [0.003, 0.5, 0.004]
    run.motion.position[-1, run.place("Brick 9"), 1] -= 0.3
    run.overlap[-1] = 0.0007
    assert errors("wall", run) == pytest.approx({"fallen": 1.0, "drift": 5.0, "overlap": 0.7})


def test_sliding_past_the_threshold_by_a_percent():
    run = at_rest("friction-threshold", 4.0)
    way = 0.5 * G * math.sin(moving.SLOPE) * 0.01 * run.time**2
    downhill = np.array([-math.cos(moving.SLOPE), -math.sin(moving.SLOPE), 0.0])
    run.motion.position[:, run.place("Slips")] += 1.1 * way[:, None] * downhill
    run.motion.position[:, run.place("Sticks")] += 2e-3 * downhill * run.time[:, None]
    assert errors("friction-threshold", run) == pytest.approx({"creep": 8.0, "slip": 10.0})


@pytest.mark.parametrize(("restitution", "late"), [(0.7, False), (0.75, True)])
def test_a_ball_comes_to_rest_after_the_series(restitution, late):
    run = at_rest("zeno", 4.5)
    begin, speed = math.sqrt(2.0 * moving.ZENO_DROP / G), math.sqrt(2.0 * G * moving.ZENO_DROP)
    time = run.time
    height = np.where(time < begin, moving.ZENO_DROP - 0.5 * G * time**2, 0.0)
    for _ in range(60):
        speed *= restitution
        inside = (time >= begin) & (time < begin + 2.0 * speed / G)
        height[inside] = (speed * (time - begin) - 0.5 * G * (time - begin) ** 2)[inside]
        begin += 2.0 * speed / G
    run.motion.position[:, run.place("Ball"), 1] = 0.5 + height
    found = errors("zeno", run)
    assert (found["time to rest"] > 1000.0 * DT) is late
    assert (found["unrest"] > 0.5) is late


def test_a_rider_that_turns_with_its_platform_has_no_drift():
    run = at_rest("platforms", 4.0)
    angle = carried.TURNING * run.time
    arm = carried.STAYING_RADIUS * np.stack([np.cos(angle), 0.0 * angle, -np.sin(angle)], axis=1)
    run.motion.position[:, run.place("Stays")] = carried._TURNING_PLACE + arm + (0.0, 0.1, 0.0)
    assert errors("platforms", run)["rider's drift"] < 1e-9
    run.motion.position[-1, run.place("Stays"), 1] += 0.002
    assert errors("platforms", run)["rider's drift"] == pytest.approx(2.0)
    assert errors("platforms", run)["not thrown off"] == 1.0


def test_a_cradle_whose_last_ball_rises_as_high_as_the_first_was():
    run = at_rest("newtons-cradle", 3.0)
    pivot = np.array([4 * 0.25, 2.6, 0.0])
    for lift, error in (
        (40.0, 0.0),
        (20.0, 100.0 * (1 - (1 - math.cos(math.radians(20))) / (1 - math.cos(math.radians(40))))),
    ):
        angle = math.radians(lift)
        run.motion.position[80, run.place("Ball 5")] = pivot + 2.0 * np.array([math.sin(angle), -math.cos(angle), 0.0])
        assert errors("newtons-cradle", run)["height"] == pytest.approx(error, abs=1e-9)


def test_a_linkage_whose_rocker_is_off():
    run = at_rest("closed-loop", 3.0)
    assert errors("closed-loop", run)["rocker"] < 1e-6
    angle = angle_about_z(run.rotation("Rocker"))[0] + math.radians(3.0)
    run.motion.rotation[7, run.place("Rocker")] = quaternion.from_axis_angle((0.0, 0.0, 1.0), angle)
    assert errors("closed-loop", run)["rocker"] == pytest.approx(3.0, abs=1e-6)


def test_a_gyroscope_that_precesses_and_nods():
    run = at_rest("gyroscopes", 10.0)
    heading = 1.01 * spinning.PRECESSION * run.time
    nod = math.radians(0.1) * np.sin(30.0 * run.time)
    away = spinning.ARM * np.stack([np.cos(heading) * np.cos(nod), np.sin(nod), -np.sin(heading) * np.cos(nod)], axis=1)
    run.motion.position[:, run.place("Steady")] = away + np.array([-1.2, 1.04, 0.0])
    found = errors("gyroscopes", run)
    assert found["precession"] == pytest.approx(math.degrees(0.1 * spinning.PRECESSION), rel=1e-6)
    assert found["nutation"] == pytest.approx(0.1, abs=1e-3)
    assert found["dip"] == pytest.approx(100.0)


def test_planks_that_hang_as_they_should_have_no_error():
    run = at_rest("rope-bridge")
    order = [run.place(f"Plank {number + 1}") for number in range(24)]
    run.motion.position[-1, order, :2] = driven.hanging_places()
    assert errors("rope-bridge", run)["hangs off"] == pytest.approx(0.0, abs=1e-9)
    run.motion.position[-1, order[3], 0] += 0.004
    run.joint_gap[4] = 0.001
    assert errors("rope-bridge", run) == pytest.approx({"hangs off": 4.0, "joint gap": 1.0})


def test_energy_that_grows_is_a_gain_and_what_is_lost_is_none():
    run = at_rest("heavy-chain", 2.0)
    run.kinetic[:] = 50.0
    run.energy[10], run.energy[20] = 0.5, 2.0
    assert errors("heavy-chain", run)["energy gain"] == pytest.approx(2.0)


def test_angles_and_crossings():
    angles = np.array([0.0, 1e-6, 0.5, math.pi])
    turns = quaternion.from_axis_angle(np.tile([0.0, 0.0, 1.0], (4, 1)), angles)
    np.testing.assert_allclose(tilt(turns), angles, atol=1e-9)
    many = np.linspace(0.0, 20.0, 200)
    turned = quaternion.from_axis_angle(np.tile([0.0, 0.0, 1.0], (200, 1)), many)
    np.testing.assert_allclose(angle_about_z(turned), many, atol=1e-9)
    assert crossing(np.array([0.0, 1.0, 2.0]), np.array([-3.0, -1.0, 3.0])) == pytest.approx(1.25)
    assert crossing(np.array([0.0, 1.0]), np.array([1.0, 2.0])) == math.inf
    assert jointed.CHAIN_PASSES > 0.0

"""The measures of the hard cases: exact motion has no error, wrong motion has the error it should."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from elys.samples.rigid_cases import CROWDS, DYNAMIC, RIGID_CASES, TIME_STEP, Trajectory, deepest_overlap, rays_into
from elys.samples.rigid_cases.motion import TUMBLING_SPIN, box_moments, flip_period

G = 9.81


def at_rest(scene, moments=121):
    """Nothing moves."""
    shape = (moments, len(scene.bodies.motion))
    still = np.zeros((*shape, 3))
    return Trajectory(
        np.arange(moments) * TIME_STEP,
        np.array(np.broadcast_to(scene.bodies.position, still.shape)),
        np.array(np.broadcast_to(scene.bodies.rotation, (*shape, 4))),
        still,
        still.copy(),
    )


@pytest.mark.parametrize("name", RIGID_CASES)
def test_motion_that_is_not_finite_is_infinitely_wrong(name):
    case = RIGID_CASES[name]
    scene = case.build(case.seeds[0])
    trajectory = at_rest(scene)
    trajectory.position[-1, 0, 1] = math.nan
    assert set(case.errors(scene, trajectory).values()) == {math.inf}


@pytest.mark.parametrize("name", ["held-20", "stack-10", "stack-30", "ratio-100", "ratio-1000", "pyramid-20"])
def test_what_stays_in_its_place_has_no_error(name):
    case = RIGID_CASES[name]
    scene = case.build(case.seeds[0])
    errors = case.errors(scene, at_rest(scene, 13))
    assert errors == pytest.approx(dict.fromkeys(errors, 0.0), abs=1e-9)


def test_what_moves_from_its_place_has_the_error_it_moved():
    case = RIGID_CASES["pyramid-20"]
    scene = case.build(0)
    trajectory = at_rest(scene, 13)
    trajectory.position[-1, -1] += [0.003, -0.004, 0.0]
    trajectory.position[5, 30] += [0.0, 0.0, 0.006]
    assert case.errors(scene, trajectory) == pytest.approx({"top sinks": 4.0, "drift": 6.0})
    stack = RIGID_CASES["stack-30"]
    scene = stack.build(2)
    trajectory = at_rest(scene, 13)
    trajectory.position[:, 7, 1] -= 0.003
    assert stack.errors(scene, trajectory) == pytest.approx({"fallen": 0.0, "overlap": 3.0})
    trajectory.position[-1, 20:] -= [1.0, 0.0, 0.0]
    assert stack.errors(scene, trajectory) == {"fallen": 11.0, "overlap": math.inf}


def test_a_far_stack_is_measured_against_the_near_one():
    case = RIGID_CASES["stack-far"]
    scene = case.build(0)
    trajectory = at_rest(scene, 13)
    near, far = 5, 11 + 5
    trajectory.position[-1, near] += [0.001, -0.002, 0.0]
    trajectory.position[-1, far] += [0.003, -0.003, 0.0]
    assert case.errors(scene, trajectory) == pytest.approx({"drift ratio": 3.0, "overlap ratio": 1.5}, rel=1e-6)


def test_free_flight_by_half_a_kick_too_far():
    case = RIGID_CASES["free-flight"]
    scene = case.build(0)
    trajectory = at_rest(scene)
    time = trajectory.time[:, None]
    start, velocity = scene.bodies.position[0], scene.bodies.linear_velocity[0]
    trajectory.position[:, 0] = start + velocity * time - [0.0, 0.5 * G, 0.0] * time**2
    assert case.errors(scene, trajectory)["position"] < 1e-12
    trajectory.position[:, 0] -= [0.0, 0.5 * G * TIME_STEP, 0.0] * time  # what symplectic Euler does
    assert case.errors(scene, trajectory)["position"] == pytest.approx(G * TIME_STEP, rel=1e-9)


@pytest.mark.parametrize("seed", RIGID_CASES["rebound"].seeds)
@pytest.mark.parametrize(("restitution", "error"), [(0.8, 0.0), (0.79, 100.0 * (1.0 - (0.79 / 0.8) ** 6))])
def test_the_third_rebound_is_found_between_moments(seed, restitution, error):
    case = RIGID_CASES["rebound"]
    scene = case.build(seed)
    trajectory = at_rest(scene, 241)
    height = scene.bodies.position[1, 1] - 0.5
    begin, speed = math.sqrt(2.0 * height / G), math.sqrt(2.0 * G * height)
    time = trajectory.time
    y = np.where(time < begin, height - 0.5 * G * time**2, 0.0)
    for _ in range(8):
        speed *= restitution
        hop = 2.0 * speed / G
        inside = (time >= begin) & (time < begin + hop)
        y[inside] = (speed * (time - begin) - 0.5 * G * (time - begin) ** 2)[inside]
        begin += hop
    trajectory.position[:, 1, 1] = 0.5 + y
    assert case.errors(scene, trajectory)["height"] == pytest.approx(error, abs=1e-6)


def test_a_bullet_that_was_ever_behind_the_wall_has_passed():
    case = RIGID_CASES["bullet-wall"]
    scene = case.build(0)
    trajectory = at_rest(scene, 5)
    assert case.errors(scene, trajectory)["passed"] == 0.0
    trajectory.position[2, [3, 4], 0] = 1.0
    assert case.errors(scene, trajectory)["passed"] == 2.0


def euler(moments):
    """Free rotation, as a function for solve_ivp: rotation and angular velocity in own axes."""

    def derivative(_, state):
        x, y, z, w, a, b, c = state
        turn = 0.5 * np.array(
            [w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -x * a - y * b - z * c]
        )
        return np.append(turn, np.cross(moments * state[4:], state[4:]) / moments)

    return derivative


def test_tumbling_integrated_by_scipy_has_no_error_and_the_closed_period():
    case = RIGID_CASES["tumbling"]
    scene = case.build(0)
    moments = box_moments(scene.bodies)[0]
    time = np.arange(case.step_count + 1) * TIME_STEP
    start = np.append([0.0, 0.0, 0.0, 1.0], TUMBLING_SPIN)

    def flip(_, state):
        return state[6]

    found = solve_ivp(
        euler(moments), (0.0, time[-1]), start, method="DOP853", t_eval=time, rtol=1e-12, atol=1e-13, events=flip
    )
    flips = found.t_events[0]
    assert np.diff(flips).mean() == pytest.approx(flip_period(moments, np.array(TUMBLING_SPIN)), rel=1e-9)
    trajectory = at_rest(scene, len(time))
    rotation = found.y[:4].T / np.linalg.norm(found.y[:4], axis=0)[:, None]
    trajectory.rotation[:, 0] = rotation
    trajectory.angular_velocity[:, 0] = Rotation.from_quat(rotation).apply(found.y[4:].T)
    errors = case.errors(scene, trajectory)
    assert errors["energy"] < 1e-9
    assert errors["momentum"] < 1e-9
    assert errors["flip period"] < 1e-4
    trajectory.angular_velocity[-1] *= 1.001
    assert case.errors(scene, trajectory)["energy"] == pytest.approx(0.002, rel=0.01)


@pytest.mark.parametrize("spin", [(0.1, 0.2, 5.0), (2.0, 0.1, 5.0), (0.1, 2.0, 5.0)])
def test_the_closed_period_holds_on_both_sides_of_the_separatrix(spin):
    moments = np.array([0.29, 1.25, 1.04]) / 12.0

    def flip(_, state):
        return state[6]

    start = np.append([0.0, 0.0, 0.0, 1.0], spin)
    flips = solve_ivp(
        euler(moments), (0.0, 20.0), start, method="DOP853", rtol=1e-11, atol=1e-12, events=flip
    ).t_events[0]
    assert np.diff(flips).mean() == pytest.approx(flip_period(moments, np.array(spin)), rel=1e-7)


@pytest.mark.parametrize("name", CROWDS)
def test_a_crowd_starts_apart_and_has_its_bodies(name):
    crowd = CROWDS[name]
    scene = crowd.build()
    assert deepest_overlap(scene.bodies, scene.bodies.position, scene.bodies.rotation) < 1e-9
    wanted = {"pyramid-40": 820, "asleep-1000": 1001, "asleep-5000": 5001}.get(name) or int(name.split("-")[1])
    assert (scene.bodies.motion == DYNAMIC).sum() == wanted


def test_rays_point_down_into_the_bin():
    scene = CROWDS["pile-1000"].build()
    origins, directions = rays_into(scene, 1000)
    ends = origins + directions
    half = abs(scene.bodies.position[scene.bodies.motion == DYNAMIC]).max(0)
    assert (abs(origins[:, [0, 2]]) <= half[[0, 2]]).all()
    assert (abs(ends[:, [0, 2]]) <= half[[0, 2]]).all()
    assert (ends[:, 1] == 0.5).all()

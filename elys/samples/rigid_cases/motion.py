"""Single bodies whose motion is known in closed form: flight, slopes, bounces, a chain of impacts, tumbling."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from elys.common.math import quaternion
from elys.samples.rigid_cases.case import Measure, RigidCase, Trajectory
from elys.samples.rigid_cases.scene import (
    BOX,
    SPHERE,
    STATIC,
    Bodies,
    G,
    RigidScene,
    bodies,
    ground,
    joined,
    turn_about_z,
)

Array = np.ndarray[Any, Any]

WEIGHTLESS: Final = (0.0, 0.0, 0.0)


# ---------------------------------------------------------------- flight


def _flight(seed: int) -> RigidScene:
    flying = bodies((0, 10, 0), size=(1, 2, 3), linear_velocity=(3, 2, 1), angular_velocity=(4, 5, 6))
    return RigidScene(flying)


def _flight_error(scene: RigidScene, trajectory: Trajectory) -> float:
    time = trajectory.time[:, None]
    start, velocity = scene.bodies.position[0], scene.bodies.linear_velocity[0]
    exact = start + velocity * time + 0.5 * np.asarray(scene.gravity) * time**2
    return float(np.linalg.norm(trajectory.position[:, 0] - exact, axis=1).max())


# ---------------------------------------------------------------- slopes


def _slope(degrees: float, *, friction: float, shape: int) -> RigidScene:
    """One body of 1 m that touches an inclined plane; downhill is -x."""
    angle = math.radians(degrees)
    normal = np.array([-math.sin(angle), math.cos(angle), 0.0])
    turn = turn_about_z(angle)
    plane = bodies(-0.5 * normal, motion=STATIC, size=(400, 1, 400), rotation=turn, friction=friction)
    own_turn = turn if shape == BOX else (0, 0, 0, 1)
    return RigidScene(joined(plane, bodies(0.5 * normal, shape=shape, rotation=own_turn, friction=friction)))


def _downhill(degrees: float) -> Array:
    angle = math.radians(degrees)
    return np.array([-math.cos(angle), -math.sin(angle), 0.0])


def _slip_at_20(scene: RigidScene, trajectory: Trajectory) -> float:
    """Farthest from the start, within the plane."""
    moved = trajectory.position[:, 1] - trajectory.position[0, 1]
    return float(np.hypot(moved @ _downhill(20), moved[:, 2]).max())


def _distance_error(degrees: float, acceleration: float, trajectory: Trajectory) -> float:
    """Of the distance covered downhill from rest [%]."""
    covered = float((trajectory.position[-1, 1] - trajectory.position[0, 1]) @ _downhill(degrees))
    exact = 0.5 * acceleration * float(trajectory.time[-1]) ** 2
    return 100.0 * abs(covered / exact - 1.0)


def _slide_error(scene: RigidScene, trajectory: Trajectory) -> float:
    angle = math.radians(30)
    return _distance_error(30, G * (math.sin(angle) - 0.2 * math.cos(angle)), trajectory)


def _roll_error(scene: RigidScene, trajectory: Trajectory) -> float:
    # A full ball that rolls keeps 5/7 of what it would have sliding freely.
    return _distance_error(20, G * math.sin(math.radians(20)) * 5.0 / 7.0, trajectory)


# ---------------------------------------------------------------- impacts

_DROPS: Final = (2.0, 1.87, 1.61, 1.43)  # [m] what falls between ball and ground, so that impacts meet ticks anywhere


def _bounce(seed: int) -> RigidScene:
    ball = bodies((0, 0.5 + _DROPS[seed], 0), shape=SPHERE, restitution=0.8)
    return RigidScene(joined(ground(restitution=0.8), ball))


def _third_rebound_error(scene: RigidScene, trajectory: Trajectory) -> float:
    """Of the third highest point after the start [%]; its height is that of the parabola through three moments."""
    height = trajectory.position[:, 1, 1] - 0.5
    before, here, after = height[:-2], height[1:-1], height[2:]
    tops = np.flatnonzero((here >= before) & (here > after) & (here > 0.1 * height[0]))
    if len(tops) < 3:
        return math.inf
    top = tops[2]
    slope, bend = 0.5 * (after[top] - before[top]), after[top] - 2.0 * here[top] + before[top]
    apex = here[top] - 0.5 * slope**2 / bend
    return float(100.0 * abs(apex / (height[0] * 0.8**6) - 1.0))


_BALL_SPEED: Final = 2.0  # [m/s]


def _five_balls(seed: int) -> RigidScene:
    position = [[-2, 0, 0], [0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]
    velocity = [[_BALL_SPEED, 0, 0]] + [[0, 0, 0]] * 4
    row = bodies(position, shape=SPHERE, linear_velocity=velocity, restitution=1.0, friction=0.0)
    return RigidScene(row, WEIGHTLESS)


def _blow_error(scene: RigidScene, trajectory: Trajectory) -> float:
    exact = np.zeros((5, 3))
    exact[4, 0] = _BALL_SPEED
    return float(np.sqrt(((trajectory.linear_velocity[-1] - exact) ** 2).sum(1).mean()))


# ---------------------------------------------------------------- tumbling

TUMBLING_SIZE: Final = (1.0, 0.2, 0.5)  # [m]: z is the middle axis
TUMBLING_SPIN: Final = (1.0, 1.0, 10.0)  # [rad/s] at the start


def box_moments(bodies: Bodies) -> Array:
    """Principal moments (N, 3) of full boxes [kg m^2]."""
    squared = bodies.size**2
    return np.asarray(bodies.mass[:, None] / 12.0 * (squared.sum(1, keepdims=True) - squared))


def _tumbling(seed: int) -> RigidScene:
    return RigidScene(bodies((0, 0, 0), size=TUMBLING_SIZE, angular_velocity=TUMBLING_SPIN), WEIGHTLESS)


def _own_spin(trajectory: Trajectory) -> Array:
    """Angular velocity (T, 3) of the first body in its own axes [rad/s]."""
    turn = quaternion.normalize(np.asarray(trajectory.rotation[:, 0], np.float64))
    return quaternion.rotate(quaternion.conjugate(turn), np.asarray(trajectory.angular_velocity[:, 0], np.float64))


def _energy_drift(scene: RigidScene, trajectory: Trajectory) -> float:
    energy = (box_moments(scene.bodies)[0] * _own_spin(trajectory) ** 2).sum(1)
    return float(abs(energy / energy[0] - 1.0).max())


def _momentum_drift(scene: RigidScene, trajectory: Trajectory) -> float:
    turn = quaternion.normalize(np.asarray(trajectory.rotation[:, 0], np.float64))
    momentum = quaternion.rotate(turn, box_moments(scene.bodies)[0] * _own_spin(trajectory))
    return float(np.linalg.norm(momentum - momentum[0], axis=1).max() / np.linalg.norm(momentum[0]))


def flip_period(moments: Array, spin: Array) -> float:
    """The time [s] between two flips of a free body about its middle axis, in closed form.

    moments (3,) and spin (3,) in principal axes, the middle moment anywhere among them. Landau & Lifshitz, "Mechanics",
    section 37: the middle component is an elliptic sine, which changes its sign every 2 K(m) / rate.
    """
    low, middle, high = np.sort(moments)
    twice_energy = float((moments * spin**2).sum())
    squared_momentum = float(((moments * spin) ** 2).sum())
    near, far = squared_momentum - twice_energy * low, twice_energy * high - squared_momentum
    if squared_momentum > twice_energy * middle:  # closer to a spin about the largest moment
        rate = (high - middle) * near
        modulus = (middle - low) * far / rate
    else:
        rate = (middle - low) * far
        modulus = (high - middle) * near / rate
    rate = math.sqrt(rate / (low * middle * high))
    # K(m) = pi / (2 agm(1, sqrt(1 - m)))
    a, b = 1.0, math.sqrt(1.0 - modulus)
    for _ in range(30):
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return math.pi / a / rate


def _flip_error(scene: RigidScene, trajectory: Trajectory) -> float:
    """Of the mean time between changes of sign of the spin about the middle axis [%]."""
    spin, time = _own_spin(trajectory)[:, 2], trajectory.time
    flips = np.flatnonzero(spin[:-1] * spin[1:] < 0.0)
    if len(flips) < 3:
        return math.inf
    moments = time[flips] + (time[flips + 1] - time[flips]) * spin[flips] / (spin[flips] - spin[flips + 1])
    measured = float(moments[-1] - moments[0]) / (len(flips) - 1)
    exact = flip_period(box_moments(scene.bodies)[0], scene.bodies.angular_velocity[0])
    return 100.0 * abs(measured / exact - 1.0)


MOTION_CASES: Final = (
    RigidCase(
        name="free-flight",
        title="free flight, 2 s",
        difficulty="gravity added before the move, or after it, is wrong by half a kick every step",
        build=_flight,
        duration=2.0,
        measures=(Measure(name="position", unit="m", bound=1e-5, of=_flight_error),),
    ),
    RigidCase(
        name="held-20",
        title="box held by friction on 20 degrees, 10 s",
        difficulty="soft contacts creep downhill, and slip while they settle",
        build=lambda seed: _slope(20, friction=0.6, shape=BOX),
        duration=10.0,
        measures=(Measure(name="slip", unit="m", bound=1e-5, of=_slip_at_20),),
    ),
    RigidCase(
        name="sliding-30",
        title="box sliding down 30 degrees, friction 0.2, 2 s",
        difficulty="friction limited by the impulse of the step before, and the half kick of free flight",
        build=lambda seed: _slope(30, friction=0.2, shape=BOX),
        duration=2.0,
        measures=(Measure(name="distance", unit="%", bound=0.02, of=_slide_error),),
    ),
    RigidCase(
        name="rolling-20",
        title="ball rolling down 20 degrees, 2 s",
        difficulty="static friction at a point that moves on with the ball",
        build=lambda seed: _slope(20, friction=0.6, shape=SPHERE),
        duration=2.0,
        measures=(Measure(name="distance", unit="%", bound=0.02, of=_roll_error),),
    ),
    RigidCase(
        name="rebound",
        title="ball of restitution 0.8, third rebound",
        difficulty="impacts fall between ticks, and each error of the speed comes back squared",
        build=_bounce,
        duration=4.0,
        measures=(Measure(name="height", unit="%", bound=0.5, of=_third_rebound_error),),
        seeds=tuple(range(len(_DROPS))),
    ),
    RigidCase(
        name="five-balls",
        title="five balls, e = 1: four touch, one comes at 2 m/s",
        difficulty="impacts solved all at once spread the blow over the row",
        build=_five_balls,
        duration=2.0,
        measures=(Measure(name="velocity RMS", unit="m/s", bound=0.05, of=_blow_error),),
    ),
    RigidCase(
        name="tumbling",
        title="box tumbling about its middle axis, 20 s",
        difficulty="unstable: what is lost or gained in one flip changes all flips after it",
        build=_tumbling,
        duration=20.0,
        measures=(
            Measure(name="energy", unit="1", bound=1e-5, of=_energy_drift),
            Measure(name="momentum", unit="1", bound=1e-5, of=_momentum_drift),
            Measure(name="flip period", unit="%", bound=0.1, of=_flip_error),
        ),
    ),
)

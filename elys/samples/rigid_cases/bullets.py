"""Small bodies so fast that a step carries them farther than what they should hit is thick."""

from __future__ import annotations

from typing import Final

import numpy as np

from elys.samples.rigid_cases.case import Measure, RigidCase, Trajectory
from elys.samples.rigid_cases.motion import WEIGHTLESS
from elys.samples.rigid_cases.scene import SPHERE, STATIC, RigidScene, bodies, joined

_COUNT: Final = 16
_SPEED: Final = 200.0  # [m/s]: 3.3 m a step
_RADIUS: Final = 0.05  # [m]
# Each meets its wall at another share of a step.
_PHASES: Final = np.arange(_COUNT) / _COUNT * _SPEED / 60.0  # [m]
_LANES: Final = np.arange(_COUNT) * 1.0  # [m]


def _bullets(distance: float, direction: float) -> np.ndarray:
    lanes = np.zeros((_COUNT, 3))
    lanes[:, 0] = -direction * (distance + _PHASES)
    lanes[:, 2] = _LANES
    return lanes


def _wall(seed: int) -> RigidScene:
    wall = bodies((0, 0, _LANES.mean()), motion=STATIC, size=(0.05, 20, 40))
    velocity = (_SPEED, 0, 0)
    shots = bodies(_bullets(10.0, 1.0), shape=SPHERE, radius=_RADIUS, mass=0.05, linear_velocity=velocity, fast=True)
    return RigidScene(joined(wall, shots), WEIGHTLESS)


def _through_wall(scene: RigidScene, trajectory: Trajectory) -> float:
    return float((trajectory.position[:, 1:, 0] > 0.0).any(0).sum())


def _meeting(seed: int) -> RigidScene:
    shots = [
        bodies(
            _bullets(10.0, direction),
            shape=SPHERE,
            radius=_RADIUS,
            mass=0.05,
            linear_velocity=(direction * _SPEED, 0, 0),
            fast=True,
        )
        for direction in (1.0, -1.0)
    ]
    return RigidScene(joined(*shots), WEIGHTLESS)


def _through_each_other(scene: RigidScene, trajectory: Trajectory) -> float:
    from_left, from_right = trajectory.position[:, :_COUNT, 0], trajectory.position[:, _COUNT:, 0]
    return float((from_left > from_right).any(0).sum())


BULLET_CASES: Final = (
    RigidCase(
        name="bullet-wall",
        title="16 bullets of 200 m/s against a wall of 5 cm",
        difficulty="3.3 m a step",
        build=_wall,
        duration=0.5,
        measures=(Measure(name="passed", unit="of 16", bound=0, of=_through_wall),),
    ),
    RigidCase(
        name="bullets-meet",
        title="16 pairs of bullets of 200 m/s that meet",
        difficulty="both move: neither is where the other's sweep looks for it",
        build=_meeting,
        duration=0.5,
        measures=(Measure(name="passed", unit="of 16", bound=0, of=_through_each_other),),
    ),
)

"""What is carried, and what is so thin that it is nearly missed: platforms, rollers, plates, needles."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from elys.common.math import quaternion
from elys.common.scene import EntityNode, SceneDocument
from elys.samples.entities import PALETTE
from elys.samples.hard_cases.case import CaseMeasure, CaseRun, HardCase, always
from elys.samples.hard_cases.measures import overlap_under, tilt
from elys.samples.hard_cases.scenery import DARK, IRON, G, fixture, ground, scene, solid

Array = np.ndarray[Any, Any]

# ---------------------------------------------------------------- platforms

PLATFORM_SPEED: Final = 2.0  # [m/s]
PLATFORM_FRICTION: Final = 0.4
TURNING: Final = 2.0  # [rad/s] of the turning platform
STAYING_RADIUS: Final = 0.9  # [m] w^2 r = 3.6 m/s^2 is less than mu g = 3.9
LEAVING_RADIUS: Final = 1.15  # [m] w^2 r = 4.6 is more
_TURNING_PLACE: Final = np.array([0.0, 0.0, -4.0])  # [m] middle of the turning platform's top


def platforms() -> SceneDocument:
    """A box set down on a platform that moves along x, and two on one that turns, which move with it at first."""
    mu = PLATFORM_FRICTION
    sliding = solid(
        "Moving platform",
        "box",
        size=(8.0, 0.4, 1.5),
        position=(0.0, -0.2, 0.0),
        motion="kinematic",
        linear_velocity=(PLATFORM_SPEED, 0.0, 0.0),
        friction=mu,
        color=DARK,
    )
    late = solid("Late", "box", size=(0.6, 0.3, 0.6), position=(2.0, 0.15, 0.0), friction=mu, color=PALETTE[1])
    disc = solid(
        "Turning platform",
        "cylinder",
        size=(4.0, 0.4, 4.0),
        position=_TURNING_PLACE - (0.0, 0.2, 0.0),
        motion="kinematic",
        angular_velocity=(0.0, TURNING, 0.0),
        friction=mu,
        color=DARK,
    )
    riders = [
        _rider("Stays", np.array([STAYING_RADIUS, 0.0, 0.0]), 4),
        _rider("Leaves", np.array([-LEAVING_RADIUS, 0.0, 0.0]), 0),
    ]
    return scene("Platforms", [sliding, late, disc, *riders], eye=(1.2, 4.6, 6.2), target=(0.8, -0.6, -2.0))


def _rider(name: str, arm: Array, color: int) -> EntityNode:
    """A box on the turning platform; at the start it moves along a circle."""
    place = _TURNING_PLACE + arm + (0.0, 0.1, 0.0)
    return solid(
        name,
        "box",
        size=(0.3, 0.2, 0.3),
        position=place,
        friction=PLATFORM_FRICTION,
        color=PALETTE[color],
        linear_velocity=np.cross([0.0, TURNING, 0.0], arm),
        angular_velocity=(0.0, TURNING, 0.0),
    )


def _platform_slip_error(run: CaseRun) -> float:
    """The way it slips until it rides along is v^2 / (2 mu g)."""
    slipped = run.position("Moving platform")[-1, 0] - (run.position("Late")[-1, 0] - run.position("Late")[0, 0])
    exact = PLATFORM_SPEED**2 / (2.0 * PLATFORM_FRICTION * G)
    return 100.0 * abs(float(slipped) / exact - 1.0)


def _rider_drift(run: CaseRun) -> float:
    """How far the staying box moves in the axes of the platform [mm]."""
    angle = TURNING * run.time
    away = run.position("Stays") - _TURNING_PLACE
    own = np.stack([np.cos(angle) * away[:, 0] - np.sin(angle) * away[:, 2], away[:, 1], 0.0 * angle], axis=1)
    own[:, 2] = np.sin(angle) * away[:, 0] + np.cos(angle) * away[:, 2]
    return 1000.0 * float(np.linalg.norm(own - own[0], axis=1).max())


def _not_left(run: CaseRun) -> float:
    """Whether the other is still on the platform: 1 for yes."""
    return float(np.linalg.norm(run.position("Leaves")[-1] - _TURNING_PLACE) < 2.0)


# ---------------------------------------------------------------- conveyor

ROLLER_RADIUS: Final = 0.2  # [m]
ROLLER_SPIN: Final = 5.0  # [rad/s]
ROLLER_COUNT: Final = 16


def conveyor() -> SceneDocument:
    """A box on a row of turning rollers: colliders have no surface that moves by itself."""
    lying = quaternion.from_axis_angle((1.0, 0.0, 0.0), 0.5 * math.pi)
    rollers = [
        solid(
            f"Roller {number + 1}",
            "cylinder",
            size=(2.0 * ROLLER_RADIUS, 1.2, 2.0 * ROLLER_RADIUS),
            position=(0.45 * number, -ROLLER_RADIUS, 0.0),
            rotation=lying,
            motion="kinematic",
            angular_velocity=(0.0, 0.0, -ROLLER_SPIN),
            friction=0.5,
            color=IRON,
            metallic=0.8,
            roughness=0.35,
        )
        for number in range(ROLLER_COUNT)
    ]
    crate = solid("Crate", "box", size=(1.4, 0.5, 0.8), position=(0.75, 0.25, 0.0), color=PALETTE[1], mass=20.0)
    return scene("Conveyor", [*rollers, crate], eye=(2.8, 2.4, 6.0), target=(2.8, -0.1, 0.0))


def _belt_speed_error(run: CaseRun) -> float:
    """Of the last half second, while it is on the rollers."""
    speed = run.velocity("Crate")[run.time > run.time[-1] - 0.5, 0]
    return 100.0 * float(np.abs(speed / (ROLLER_SPIN * ROLLER_RADIUS) - 1.0).max())


def _belt_distance_error(run: CaseRun) -> float:
    """Against an even acceleration mu g up to the speed of the rollers."""
    speed, time = ROLLER_SPIN * ROLLER_RADIUS, float(run.time[-1])
    exact = speed * time - speed**2 / (2.0 * 0.5 * G)
    return 100.0 * abs(float(run.position("Crate")[-1, 0] - run.position("Crate")[0, 0]) / exact - 1.0)


# ---------------------------------------------------------------- thin things

PLATE: Final = (2.0, 0.02, 2.0)  # [m]
_NEEDLE: Final = (0.01, 0.4, 0.01)  # [m]
_NEEDLES: Final = 9
_NEEDLE_SPEED: Final = 60.0  # [m/s]: 1 m a tick, over twice its length
_SHEET: Final = 0.005  # [m] thickness of what it must not pass


def thin_plate() -> SceneDocument:
    """A plate of 2 cm, 2 m wide, exactly level, above the ground."""
    plate = solid("Plate", "box", size=PLATE, position=(0.0, 3.0, 0.0), color=PALETTE[2], mass=10.0)
    return scene("Thin plate", [ground(), plate], eye=(3.5, 2.5, 6.0), target=(0.0, 0.7, 0.0))


def _plate_height(run: CaseRun) -> float:
    return 1000.0 * abs(float(run.position("Plate")[-1, 1]) - 0.5 * PLATE[1])


def _plate_tilt(run: CaseRun) -> float:
    return math.degrees(float(tilt(run.rotation("Plate"))[-1]))


def _plate_rise(run: CaseRun) -> float:
    """How high it gets after it has met the ground: it has no restitution [mm]."""
    height = run.position("Plate")[:, 1] - 0.5 * PLATE[1]
    met = int(np.flatnonzero(height < 0.05)[0]) if (height < 0.05).any() else 0
    return 1000.0 * float(height[met + 1 :].max())


def needle_and_plate() -> SceneDocument:
    """Needles of 1 cm that come down on a sheet of 5 mm point first, each at another share of a tick."""
    sheet = fixture("Sheet", size=(4.0, _SHEET, 2.0), position=(0.0, 0.0, 0.0), color=IRON)
    needles = [
        solid(
            f"Needle {number + 1}",
            "box",
            size=_NEEDLE,
            position=(0.4 * (number - 4), 2.0 + number / _NEEDLES, 0.0),
            linear_velocity=(0.0, -_NEEDLE_SPEED, 0.0),
            mass=0.05,
            color=PALETTE[0],
        )
        for number in range(_NEEDLES)
    ]
    return scene("Needle and plate", [sheet, *needles], eye=(1.5, 1.6, 4.6), target=(0.0, 0.2, 0.0))


def _needles_passed(run: CaseRun) -> float:
    return float((run.motion.position[-1, run.places("Needle "), 1] < -_SHEET).sum())


CARRIED_CASES: Final = (
    HardCase(
        name="platforms",
        title="boxes on a moving and on a turning platform",
        difficulty="what is at rest on a platform moves with it, by friction alone, and along a circle",
        answer="slips v^2 / (2 mu g); stays where w^2 r < mu g, leaves where it is more",
        build=always(platforms),
        duration=4.0,
        measures=(
            CaseMeasure(name="slip", unit="%", bound=1.0, of=_platform_slip_error),
            CaseMeasure(name="rider's drift", unit="mm", bound=5.0, of=_rider_drift),
            CaseMeasure(name="not thrown off", unit="boxes", bound=0, of=_not_left),
        ),
        picture_time=0.8,
    ),
    HardCase(
        name="conveyor",
        title="a crate on turning rollers",
        difficulty="no surface moves by itself in the model: sixteen rollers carry it, and it meets each with an edge",
        answer="mu g up to the rollers' w r, then w r",
        build=always(conveyor),
        duration=4.5,
        measures=(
            # An edge that meets a roller at the height of its top bumps into what contacts give way.
            CaseMeasure(name="speed", unit="%", bound=2.0, of=_belt_speed_error),
            CaseMeasure(name="distance", unit="%", bound=2.0, of=_belt_distance_error),
        ),
        picture_time=3.0,
    ),
    HardCase(
        name="thin-plate",
        title="a plate of 2 cm falls flat from 3 m",
        difficulty="13 cm a tick, six times its thickness, and four corners that meet the ground at once",
        answer="it lies level, 1 cm high, without a bounce",
        build=always(thin_plate),
        duration=2.0,
        measures=(
            CaseMeasure(name="height", unit="mm", bound=1.0, of=_plate_height),
            CaseMeasure(name="tilt", unit="deg", bound=0.05, of=_plate_tilt),
            CaseMeasure(name="bounce", unit="mm", bound=1.0, of=_plate_rise),
            overlap_under(1.0),
        ),
        picture_time=0.6,
    ),
    HardCase(
        name="needle-and-plate",
        title="needles of 60 m/s onto a sheet of 5 mm",
        difficulty="a point of 1 cm that moves 1 m a tick against 5 mm",
        answer="none passes",
        build=always(needle_and_plate),
        duration=1.0,
        measures=(CaseMeasure(name="passed", unit="of 9", bound=0, of=_needles_passed),),
        picture_time=0.1,
    ),
)

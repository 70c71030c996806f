"""Spinning bodies: tops on their tip, gyroscopes on a point, a top that turns itself upside down."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from elys.common.math import quaternion
from elys.common.scene import EntityNode, SceneDocument
from elys.samples.entities import PALETTE
from elys.samples.hard_cases.case import CaseMeasure, CaseRun, HardCase, always
from elys.samples.hard_cases.measures import joint_gap_under, tilt
from elys.samples.hard_cases.scenery import DARK, IRON, G, fixture, frame, ground, part, scene, solid

Array = np.ndarray[Any, Any]

# ---------------------------------------------------------------- gyroscope on a point

ARM: Final = 0.5  # [m] from the point to the disc's middle
_DISC: Final = (0.6, 0.1, 0.6)  # [m] diameter, thickness
MASS: Final = 1.0  # [kg]
SPIN: Final = 60.0  # [rad/s] about the disc's axis
AXIAL: Final = 0.5 * MASS * (0.5 * _DISC[0]) ** 2  # [kg m^2] about the axis
# About any axis through the point across the disc's own.
ACROSS: Final = MASS * ((0.5 * _DISC[0]) ** 2 / 4.0 + _DISC[1] ** 2 / 12.0 + ARM**2)
# With the axis level, gravity's moment m g l turns the axial momentum alone: an exact steady motion at this rate [rad/s].
PRECESSION: Final = MASS * G * ARM / (AXIAL * SPIN)


def gyroscopes() -> SceneDocument:
    """Two discs on a point each, axes level: one set going at the steady rate, one let go with its spin alone."""
    entities: list[EntityNode] = []
    for name, x, rate, color in (("Steady", -1.2, PRECESSION, PALETTE[4]), ("Released", 1.2, 0.0, PALETTE[0])):
        post = fixture(
            f"{name} post",
            size=(0.08, 1.0, 0.08),
            position=(x, 0.5, 0.0),
            color=DARK,
            collider={"mask": 0},
        )
        rod = EntityNode(
            name=f"{name} rod",
            components={
                # In the disc's space, which is stretched as the disc is.
                "Transform": {
                    "position": [0.0, -0.5 * ARM / _DISC[1], 0.0],
                    "scale": [0.04 / _DISC[0], ARM / _DISC[1], 0.04 / _DISC[2]],
                },
                "MeshRenderer": {"mesh": "cylinder"},
                "Material": {"base_color": list(IRON), "metallic": 0.8, "roughness": 0.35},
            },
        )
        disc = solid(
            name,
            "cylinder",
            size=_DISC,
            position=(x + ARM, 1.04, 0.0),
            # Its own y, which is its axis, along x, away from the point.
            rotation=quaternion.from_axis_angle((0.0, 0.0, 1.0), -0.5 * math.pi),
            mass=MASS,
            angular_velocity=(SPIN, rate, 0.0),
            linear_velocity=(0.0, 0.0, -rate * ARM),
            joint={"kind": "ball", "anchor": [0.0, -ARM / _DISC[1], 0.0]},
            collider={"mask": 0},
            color=color,
            metallic=0.3,
            children=[rod],
        )
        entities += [post, disc]
    return scene("Gyroscopes", [ground(), *entities], eye=(0.9, 2.0, 3.9), target=(0.0, 0.85, 0.0))


def axis_angles(run: CaseRun, name: str) -> tuple[Array, Array]:
    """Heading, counted over turns, and elevation (T,) of a disc's middle as seen from its point [rad]."""
    away = run.position(name) - (-1.2 if name == "Steady" else 1.2, 1.04, 0.0)
    heading = np.unwrap(np.arctan2(-away[:, 2], away[:, 0]))
    return heading, np.arctan2(away[:, 1], np.hypot(away[:, 0], away[:, 2]))


def released_dip() -> float:
    """How far a level axis dips that is let go at rest [rad].

    From energy and both momenta: with u the sine of the elevation, 2 A m g l (1 - u^2) = -(C n)^2 u where it turns back.
    """
    momentum, moment = (AXIAL * SPIN) ** 2, 2.0 * ACROSS * MASS * G * ARM
    return math.asin((math.sqrt(momentum**2 + 4.0 * moment**2) - momentum) / (2.0 * moment))


def _precession_error(run: CaseRun) -> float:
    heading, _ = axis_angles(run, "Steady")
    return math.degrees(abs(float(heading[-1] - heading[0]) - PRECESSION * float(run.time[-1])))


def _nutation(run: CaseRun) -> float:
    return math.degrees(float(np.abs(axis_angles(run, "Steady")[1]).max()))


def _dip_error(run: CaseRun) -> float:
    lowest = -float(axis_angles(run, "Released")[1].min())
    return 100.0 * abs(lowest / released_dip() - 1.0)


# ---------------------------------------------------------------- a top on its tip

_TOP: Final = (0.4, 0.4, 0.4)  # [m] a cone that stands on its tip
_TOP_MASS: Final = 1.0  # [kg]
_FAST: Final = 120.0  # [rad/s]
_SLOW: Final = 25.0  # [rad/s]
_FIRST_LEAN: Final = math.radians(1.0)


def sleeping_spin() -> float:
    """From which spin on a cone on its tip stands upright [rad/s]: n^2 > 4 A m g l / C^2, about the tip."""
    radius, height = 0.5 * _TOP[0], _TOP[1]
    axial = 0.3 * _TOP_MASS * radius**2
    across = _TOP_MASS * (0.15 * radius**2 + 0.6 * height**2)
    return math.sqrt(4.0 * across * _TOP_MASS * G * 0.75 * height) / axial


def spinning_tops() -> SceneDocument:
    """Two cones on their tips, a degree off the upright: one faster, one slower than what keeps it up."""
    over = quaternion.from_axis_angle((1.0, 0.0, 0.0), math.pi)  # the tip down
    entities: list[EntityNode] = []
    for name, x, spin, color in (("Fast", -0.5, _FAST, PALETTE[4]), ("Slow", 0.5, _SLOW, PALETTE[0])):
        turn = quaternion.multiply(quaternion.from_axis_angle((0.0, 0.0, 1.0), _FIRST_LEAN), over)
        up = quaternion.rotate(turn, (0.0, -1.0, 0.0))  # from the tip
        middle = 0.5 * _TOP[1] * up
        entities.append(
            solid(
                name,
                "hull",
                size=_TOP,
                position=(x + middle[0], middle[1], middle[2]),
                rotation=turn,
                mass=_TOP_MASS,
                angular_velocity=spin * up,
                friction=0.8,
                color=color,
            )
        )
    return scene("Spinning tops", [ground(friction=0.8), *entities], eye=(0.6, 0.9, 1.9), target=(0.0, 0.2, 0.0))


def _fast_lean(run: CaseRun) -> float:
    return math.degrees(float(tilt(run.rotation("Fast"), (0.0, -1.0, 0.0)).max()))


def _slow_stands(run: CaseRun) -> float:
    """Whether the slow top has leaned less than 45 degrees: 1 for yes."""
    return float(tilt(run.rotation("Slow"), (0.0, -1.0, 0.0)).max() < math.radians(45.0))


# ---------------------------------------------------------------- tippe top

TIPPE_RADIUS: Final = 0.25  # [m] of the ball
TIPPE_FRICTION: Final = 0.3
TIPPE_SPIN: Final = 40.0  # [rad/s]
TIPPE_LEAN: Final = 0.1  # [rad] at the start
_SHELL: Final = 100.0  # [kg/m^3]
_CORE: Final = 5000.0  # [kg/m^3]
_CORE_RADIUS: Final = 0.08  # [m]
_CORE_DEPTH: Final = 0.1  # [m] below the ball's middle
# A top turns over only where the moments across and about its axis differ by no more than its middle is off the ball's, as a
# share of the radius: a heavy disc inside brings them near enough.
_BELT: Final = 500.0  # [kg/m^3]
_BELT_RADIUS: Final = 0.22  # [m]
_BELT_HEIGHT: Final = 0.05  # [m]


def tippe_masses() -> tuple[float, float, float, float]:
    """Mass [kg], how far its middle is below the ball's [m], moments about and across its axis [kg m^2]."""
    ball = _SHELL * 4.0 / 3.0 * math.pi * TIPPE_RADIUS**3
    core = _CORE * 4.0 / 3.0 * math.pi * _CORE_RADIUS**3
    belt = _BELT * math.pi * _BELT_RADIUS**2 * _BELT_HEIGHT
    mass = ball + core + belt
    low = core * _CORE_DEPTH / mass
    balls = 0.4 * (ball * TIPPE_RADIUS**2 + core * _CORE_RADIUS**2)
    axial = balls + 0.5 * belt * _BELT_RADIUS**2
    across = balls + belt * (_BELT_RADIUS**2 / 4.0 + _BELT_HEIGHT**2 / 12.0)
    return mass, low, axial, across + (ball + belt) * low**2 + core * (_CORE_DEPTH - low) ** 2


def tippe_top() -> SceneDocument:
    """A ball with a heavy core off its middle, spun about its axis of symmetry."""
    turn = quaternion.from_axis_angle((0.0, 0.0, 1.0), TIPPE_LEAN)
    up = quaternion.rotate(turn, (0.0, 1.0, 0.0))
    wide, narrow = (2.0 * TIPPE_RADIUS,) * 3, (2.0 * _CORE_RADIUS,) * 3
    disc = (2.0 * _BELT_RADIUS, _BELT_HEIGHT, 2.0 * _BELT_RADIUS)
    parts = [
        part("Shell", shape="sphere", size=wide, position=(0.0, 0.0, 0.0), density=_SHELL, friction=TIPPE_FRICTION),
        part("Core", shape="sphere", size=narrow, position=(0.0, -_CORE_DEPTH, 0.0), density=_CORE),
        part("Belt", shape="cylinder", size=disc, position=(0.0, 0.0, 0.0), density=_BELT),
        _stem(),
    ]
    parts[0].components["Material"] = {"base_color": list(PALETTE[0]), "roughness": 0.4}
    _, low, _, _ = tippe_masses()
    spin = TIPPE_SPIN * up
    top = frame(
        "Top",
        position=(0.0, TIPPE_RADIUS, 0.0),
        rotation=turn,
        children=parts,
        angular_velocity=spin,
        # The ball's middle stands still at first, the centre of mass below it moves around.
        linear_velocity=np.cross(spin, -low * up),
    )
    return scene(
        "Tippe top", [ground(friction=TIPPE_FRICTION), top], eye=(0.9, 0.9, 1.8), target=(0.0, 0.25, 0.0)
    )  # fmt: skip


def _stem() -> EntityNode:
    """The stem by which one would spin it, to be seen only: in the model it weighs nothing and touches nothing."""
    return EntityNode(
        name="Stem",
        components={
            "Transform": {"position": [0.0, 1.2 * TIPPE_RADIUS, 0.0], "scale": [0.06, 0.5 * TIPPE_RADIUS, 0.06]},
            "MeshRenderer": {"mesh": "cylinder"},
            "Material": {"base_color": list(PALETTE[2]), "roughness": 0.5},
        },
    )


# How far its axis leans at most from 0.5 s to 2 s, by the equations of motion with Coulomb friction, integrated by
# tests/reference/test_hard_case_answers.py [rad]. Where friction fades at low slip it leans more, and turns over sooner.
TIPPE_LEANS: Final = math.radians(4.2)
TIPPE_WINDOW: Final = (0.5, 2.0)  # [s]


def _lean_error(run: CaseRun) -> float:
    within = (run.time >= TIPPE_WINDOW[0]) & (run.time <= TIPPE_WINDOW[1])
    return math.degrees(abs(float(tilt(run.rotation("Top"))[within].max()) - TIPPE_LEANS))


_ONCE_A_TICK: Final = "the joint is solved once a tick, in which the disc goes round by a radian"
_TIP_STANDS: Final = (
    "contacts keep their places within a tick, in which the tip rolls on: its lean grows by 40 % a second"
)
_TOO_SOON: Final = (
    "contacts keep their places within a tick: it turns over within 2 s, and does not at 960 ticks a second"
)

SPINNING_CASES: Final = (
    HardCase(
        name="gyroscopes",
        title="two gyroscopes on a point, 10 s",
        difficulty="gravity turns a momentum that changes direction with every step; errors show as nutation or as a fall",
        answer="steady at m g l / (C n); let go, it dips to the root of a quadratic, (C n)^2 u = 2 A m g l (1 - u^2)",
        build=always(gyroscopes),
        duration=10.0,
        measures=(
            CaseMeasure(name="precession", unit="deg", bound=2.0, of=_precession_error),
            CaseMeasure(name="nutation", unit="deg", bound=0.2, of=_nutation),
            CaseMeasure(name="dip", unit="%", bound=2.0, of=_dip_error, known_miss=_ONCE_A_TICK),
            joint_gap_under(0.5, known_miss=_ONCE_A_TICK),
        ),
        picture_time=1.0,
        sleeping=False,
    ),
    HardCase(
        name="spinning-tops",
        title="a fast and a slow top on their tips, 5 s",
        difficulty="a single contact at a tip holds it, and only the spin keeps it up",
        answer="upright where n^2 > 4 A m g l / C^2, which is 91 rad/s: 120 stands, 25 falls",
        build=always(spinning_tops),
        duration=5.0,
        measures=(
            CaseMeasure(name="lean", unit="deg", bound=3.0, of=_fast_lean, known_miss=_TIP_STANDS),
            CaseMeasure(name="slow one stands", unit="tops", bound=0, of=_slow_stands),
        ),
        picture_time=1.0,
        sleeping=False,
    ),
    HardCase(
        name="tippe-top",
        title="a tippe top, which turns itself upside down",
        difficulty="a small, fast slip at one point lifts its weight, slowly: what a step gets wrong there lifts it too",
        answer="nodding between 1.6 and 4.2 degrees for its first 2 s; by Coulomb's friction it takes far longer to turn over",
        build=always(tippe_top),
        duration=6.0,
        measures=(CaseMeasure(name="lean", unit="deg", bound=1.0, of=_lean_error, known_miss=_TOO_SOON),),
        picture_time=2.0,
        sleeping=False,
    ),
)

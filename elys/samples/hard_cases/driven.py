"""Bridges that hang, motors that push against a limit, springs: what acts on a joint's own coordinate, or on many at once."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from elys.common.scene import EntityNode, SceneDocument
from elys.samples.entities import PALETTE
from elys.samples.hard_cases.case import CaseMeasure, CaseRun, HardCase, always
from elys.samples.hard_cases.measures import angle_about_z, joint_gap_under
from elys.samples.hard_cases.scenery import ABOUT_Z, DARK, NO_TOUCH, WOOD, G, about_z, fixture, ground, scene, solid

Array = np.ndarray[Any, Any]


# ---------------------------------------------------------------- rope bridge

PLANKS: Final = 24
BRIDGE_SPAN: Final = 6.0  # [m]
_PLANK_LENGTH: Final = 0.27  # [m] from joint to joint: longer than the span in all
_BRIDGE_HEIGHT: Final = 2.5  # [m]


def hanging_angles() -> Array:
    """Angles (24,) of the planks at rest [rad]: each carries the mean of the loads at its ends, so that the tangents rise evenly.

    The step is found by bisection, so that the planks reach from cliff to cliff.
    """
    low, high = 0.0, 10.0
    angles = np.zeros(PLANKS)
    for _ in range(80):
        step = 0.5 * (low + high)
        angles = np.arctan(step * (np.arange(PLANKS) - 0.5 * (PLANKS - 1)))
        is_wide = _PLANK_LENGTH * float(np.cos(angles).sum()) > BRIDGE_SPAN
        low, high = (step, high) if is_wide else (low, step)
    return np.asarray(angles)


def hanging_places() -> Array:
    """Middles (24, 2) of the planks at rest [m]."""
    angles = hanging_angles()
    ways = _PLANK_LENGTH * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.asarray(np.cumsum(ways, axis=0) - 0.5 * ways + (-0.5 * BRIDGE_SPAN, _BRIDGE_HEIGHT))


def rope_bridge() -> SceneDocument:
    """Planks on hinges between two cliffs, laid out on an arc from which they swing down to where they hang."""
    # The arc of the same span and length, by bisection on half its opening.
    low, high = 1e-3, 3.0
    for _ in range(80):
        half = 0.5 * (low + high)
        chord = _PLANK_LENGTH / (2.0 * math.sin(half / PLANKS))
        low, high = (half, high) if 2.0 * chord * math.sin(half) > BRIDGE_SPAN else (low, half)
    radius = _PLANK_LENGTH / (2.0 * math.sin(half / PLANKS))
    entities: list[EntityNode] = [ground()]
    for name, side in (("West", -1.0), ("East", 1.0)):
        entities.append(
            fixture(
                name,
                size=(2.0, _BRIDGE_HEIGHT, 2.0),
                position=(side * (0.5 * BRIDGE_SPAN + 1.0), 0.5 * _BRIDGE_HEIGHT, 0.0),
                collider=NO_TOUCH,
            )
        )
    for number in range(PLANKS):
        angle = (2.0 * (number + 0.5) / PLANKS - 1.0) * half
        out = radius * math.cos(half / PLANKS)
        middle = np.array([out * math.sin(angle), _BRIDGE_HEIGHT + radius * math.cos(half) - out * math.cos(angle), 0])
        children = []
        if number == PLANKS - 1:
            ending = {"kind": "hinge", "other": "East", "anchor": [0.5, 0.0, 0.0], "axis": ABOUT_Z}
            children = [EntityNode(name="Eastern hinge", components={"Joint": ending})]
        entities.append(
            solid(
                f"Plank {number + 1}",
                "box",
                size=(_PLANK_LENGTH, 0.06, 1.2),
                position=middle,
                rotation=about_z(angle),
                mass=5.0,
                linear_damping=1.0,
                angular_damping=1.0,
                collider=NO_TOUCH,
                joint={
                    "kind": "hinge",
                    "other": f"Plank {number}" if number else "West",
                    "anchor": [-0.5, 0.0, 0.0],
                    "axis": ABOUT_Z,
                },
                color=WOOD if number % 2 else tuple(0.8 * c for c in WOOD),  # type: ignore[arg-type]
                children=children,
            )
        )
    return scene("Rope bridge", entities, eye=(3.0, 4.0, 8.5), target=(0.0, 1.9, 0.0))


def _hang_error(run: CaseRun) -> float:
    found = run.motion.position[-1, [run.place(f"Plank {number + 1}") for number in range(PLANKS)], :2]
    return 1000.0 * float(np.linalg.norm(found - hanging_places(), axis=1).max())


# ---------------------------------------------------------------- a motor against its limit

_LIMIT: Final = 1.0  # [rad]


def motor_limit() -> SceneDocument:
    """An arm of 1 kg and 1 m that a motor of 500 N m drives upward against a limit at 1 rad."""
    post = fixture("Post", size=(0.2, 1.0, 0.2), position=(0.0, 0.5, 0.0), color=DARK, collider=NO_TOUCH)
    arm = solid(
        "Arm",
        "box",
        size=(1.0, 0.1, 0.2),
        position=(0.5, 1.0, 0.0),
        collider=NO_TOUCH,
        joint={
            "kind": "hinge",
            "other": "Post",
            "anchor": [-0.5, 0.0, 0.0],
            "axis": ABOUT_Z,
            "limited": True,
            "lower": -0.5,
            "upper": _LIMIT,
            "motor_speed": 20.0,
            "motor_limit": 500.0,
        },
        color=PALETTE[0],
    )
    return scene("Motor against a limit", [ground(), post, arm], eye=(1.4, 1.8, 3.6), target=(0.3, 1.1, 0.0))


def _beyond_limit(run: CaseRun) -> float:
    """How far it ever is beyond [deg]."""
    return math.degrees(max(0.0, float(angle_about_z(run.rotation("Arm")).max()) - _LIMIT))


def _off_limit(run: CaseRun) -> float:
    """How far it is from the limit in the end, or ever was in the last second [deg]."""
    late = run.time > run.time[-1] - 1.0
    return math.degrees(float(np.abs(angle_about_z(run.rotation("Arm"))[late] - _LIMIT).max()))


# ---------------------------------------------------------------- springs

STIFF: Final = 50.0  # [Hz]: nearly a full swing in a tick of 60 Hz
SOFT: Final = 2.0  # [Hz]


def stiff_spring() -> SceneDocument:
    """Two weights on sliders with springs: one stiffer than the tick can follow, one that it can."""
    entities: list[EntityNode] = []
    for name, x, frequency, damping, color in (("Stiff", -0.8, STIFF, 0.05, 0), ("Soft", 0.8, SOFT, 0.0, 4)):
        beam = fixture(
            f"{name} beam", size=(0.8, 0.1, 0.4), position=(x, 2.4, 0.0), color=DARK, collider=NO_TOUCH
        )  # fmt: skip
        weight = solid(
            name,
            "box",
            size=(0.4,) * 3,
            position=(x, 1.5, 0.0),
            mass=10.0,
            collider=NO_TOUCH,
            joint={
                "kind": "slider",
                "axis": [0.0, 1.0, 0.0],
                "spring_frequency": frequency,
                "spring_damping": damping,
            },
            color=PALETTE[color],
        )
        entities += [beam, weight]
    return scene("Stiff spring", [ground(), *entities], eye=(1.2, 2.0, 4.4), target=(0.0, 1.5, 0.0))


def _stiff_rest_error(run: CaseRun) -> float:
    """Where the stiff one comes to rest is g / w^2 below [mm]."""
    sag = 1.5 - float(run.position("Stiff")[-1, 1])
    return 1000.0 * abs(sag - G / (2.0 * math.pi * STIFF) ** 2)


def _stiff_amplitude(run: CaseRun) -> float:
    """How far the stiff one ever is beyond twice its sag, which is as far as it may swing [mm]."""
    sag = 1.5 - run.position("Stiff")[:, 1]
    most = 2.0 * G / (2.0 * math.pi * STIFF) ** 2
    return 1000.0 * max(0.0, float(sag.max()) - most, -float(sag.min()))


def _soft_error(run: CaseRun) -> float:
    """Against the closed form g / w^2 (1 - cos w t), of its amplitude, over the first two seconds [%]."""
    early = run.time <= 2.0
    rate = 2.0 * math.pi * SOFT
    exact = G / rate**2 * (1.0 - np.cos(rate * run.time[early]))
    return 100.0 * float(np.abs(1.5 - run.position("Soft")[early, 1] - exact).max()) / (G / rate**2)


def _soft_amplitude(run: CaseRun) -> float:
    """How much the soft one's swing has changed in the last two seconds [%]."""
    swing = 1.5 - run.position("Soft")[run.time > run.time[-1] - 2.0, 1]
    return 100.0 * abs(float(swing.max() - swing.min()) / (2.0 * G / (2.0 * math.pi * SOFT) ** 2) - 1.0)


DRIVEN_CASES: Final = (
    HardCase(
        name="rope-bridge",
        title="24 planks on hinges hang between two cliffs, 15 s",
        difficulty="a chain held at both ends, whose loads come from its shape and its shape from the loads",
        answer="each plank's tangent is one step steeper than its neighbour's",
        build=always(rope_bridge),
        duration=15.0,
        measures=(CaseMeasure(name="hangs off", unit="mm", bound=1.0, of=_hang_error), joint_gap_under(2.0)),
        picture_time=12.0,
        stride=3,
        sleeping=False,
    ),
    HardCase(
        name="motor-limit",
        title="a motor of 500 N m against a limit",
        difficulty="motor and limit act on the same coordinate, 100 times stronger than the arm's weight",
        answer="the arm stands at 1 rad and never beyond",
        build=always(motor_limit),
        duration=3.0,
        measures=(
            CaseMeasure(name="beyond", unit="deg", bound=0.1, of=_beyond_limit),
            CaseMeasure(name="off in the end", unit="deg", bound=0.05, of=_off_limit),
        ),
        picture_time=1.0,
        sleeping=False,
    ),
    HardCase(
        name="stiff-spring",
        title="springs of 50 Hz and of 2 Hz at 60 ticks a second",
        difficulty="the stiff one swings almost once a tick: explicit steps explode, implicit ones eat the soft one's swing",
        answer="rests g / w^2 below; swings as g / w^2 (1 - cos w t)",
        build=always(stiff_spring),
        duration=10.0,
        measures=(
            CaseMeasure(name="stiff rest", unit="mm", bound=0.01, of=_stiff_rest_error),
            CaseMeasure(name="stiff beyond", unit="mm", bound=0.01, of=_stiff_amplitude),
            CaseMeasure(name="soft swing", unit="%", bound=2.0, of=_soft_error),
            CaseMeasure(name="soft amplitude", unit="%", bound=0.5, of=_soft_amplitude),
        ),
        picture_time=0.3,
        sleeping=False,
    ),
)

"""Things held together by joints: cradles, chains, closed loops, bridges, motors, springs."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from elys.common.math import quaternion
from elys.common.scene import EntityNode, SceneDocument
from elys.samples.entities import PALETTE, STONE
from elys.samples.hard_cases.case import CaseMeasure, CaseRun, HardCase, always
from elys.samples.hard_cases.measures import angle_about_z, at_time, crossing, energy_gain_under, joint_gap_under
from elys.samples.hard_cases.scenery import ABOUT_Z, DARK, IRON, NO_TOUCH, G, about_z, fixture, ground, scene, solid

Array = np.ndarray[Any, Any]


# ---------------------------------------------------------------- Newton's cradle

CRADLE_BALLS: Final = 5
_CRADLE_RADIUS: Final = 0.25  # [m]
_CRADLE_LENGTH: Final = 2.0  # [m] from the hinge to a ball's middle
_CRADLE_HEIGHT: Final = 2.6  # [m] of the hinges
CRADLE_LIFT: Final = math.radians(40.0)


def newtons_cradle() -> SceneDocument:
    """Five balls that touch, each a pendulum on a hinge; the first is lifted by 40 degrees."""
    beam = fixture(
        "Beam",
        size=(3.0, 0.1, 0.3),
        position=(0.0, _CRADLE_HEIGHT, 0.0),
        color=DARK,
        collider=NO_TOUCH,
    )
    balls = []
    for number in range(CRADLE_BALLS):
        hinge = np.array([(number - 2) * 2.0 * _CRADLE_RADIUS, _CRADLE_HEIGHT, 0.0])
        angle = -CRADLE_LIFT if number == 0 else 0.0
        turn = about_z(angle)
        place = hinge + quaternion.rotate(turn, (0.0, -_CRADLE_LENGTH, 0.0))
        diameter = 2.0 * _CRADLE_RADIUS
        rod = EntityNode(
            name=f"Rod {number + 1}",
            components={
                "Transform": {
                    "position": [0.0, 0.5 * _CRADLE_LENGTH / diameter, 0.0],
                    "scale": [0.02 / diameter, _CRADLE_LENGTH / diameter, 0.02 / diameter],
                },
                "MeshRenderer": {"mesh": "cylinder"},
                "Material": {"base_color": list(DARK)},
            },
        )
        balls.append(
            solid(
                f"Ball {number + 1}",
                "sphere",
                size=(diameter,) * 3,
                position=place,
                rotation=turn,
                friction=0.0,
                restitution=1.0,
                joint={"kind": "hinge", "anchor": [0.0, _CRADLE_LENGTH / diameter, 0.0], "axis": ABOUT_Z},
                color=IRON,
                metallic=1.0,
                roughness=0.25,
                children=[rod],
            )
        )
    return scene("Newton's cradle", [ground(), beam, *balls], eye=(1.6, 2.0, 6.2), target=(0.0, 1.4, 0.0))


def cradle_angles(run: CaseRun) -> Array:
    """(T, 5) of the pendulums from the vertical [rad]."""
    angles = []
    for number in range(CRADLE_BALLS):
        away = run.position(f"Ball {number + 1}") - ((number - 2) * 2.0 * _CRADLE_RADIUS, _CRADLE_HEIGHT, 0.0)
        angles.append(np.arctan2(away[:, 0], -away[:, 1]))
    return np.stack(angles, axis=1)


def _swing_error(run: CaseRun) -> float:
    """How far the last ball's first swing is from the height that the first fell from [%]."""
    first_swing = cradle_angles(run)[: at_time(run, 2.5), -1].max()
    return 100.0 * abs(float((1.0 - math.cos(first_swing)) / (1.0 - math.cos(CRADLE_LIFT))) - 1.0)


def _middle_motion(run: CaseRun) -> float:
    """The largest swing of the middle ball within the first 2.5 s [deg]."""
    return math.degrees(float(np.abs(cradle_angles(run)[: at_time(run, 2.5), 2]).max()))


def _lost_energy(run: CaseRun) -> float:
    """Of what the lifted ball had above its rest [%]."""
    lift = float(run.energy[0] + CRADLE_BALLS * G * (_CRADLE_LENGTH - _CRADLE_HEIGHT))
    return 100.0 * float(np.abs(run.energy - run.energy[0]).max()) / lift


# ---------------------------------------------------------------- a long chain with a heavy end

CHAIN_LINKS: Final = 20
LINK: Final = 0.2  # [m]
LINK_MASS: Final = 0.1  # [kg]
CHAIN_BALL: Final = 0.5  # [m] diameter
CHAIN_BALL_MASS: Final = 100.0  # [kg]
CHAIN_LEAN: Final = math.radians(60.0)
_CHAIN_TOP: Final = 5.2  # [m]
# When the ball first passes below the hook, by Lagrange's equations of 20 rods and a ball, integrated to ten digits by
# tests/reference/test_hard_case_answers.py [s].
CHAIN_PASSES: Final = 1.10844019


def heavy_chain() -> SceneDocument:
    """Twenty links of 100 g in a straight line 60 degrees off the vertical, and a ball of 100 kg at the end."""
    hook = np.array([0.0, _CHAIN_TOP, 0.0])
    turn = about_z(CHAIN_LEAN)
    down = quaternion.rotate(turn, (0.0, -1.0, 0.0))
    entities: list[EntityNode] = [
        fixture("Hook", size=(0.3,) * 3, position=(0.0, _CHAIN_TOP + 0.15, 0.0), color=DARK, collider=NO_TOUCH)
    ]
    entities += [
        solid(
            f"Link {number + 1}",
            "box",
            size=(0.06, LINK, 0.06),
            position=hook + (number + 0.5) * LINK * down,
            rotation=turn,
            mass=LINK_MASS,
            collider=NO_TOUCH,
            joint={
                "kind": "hinge",
                "other": f"Link {number}" if number else "Hook",
                "anchor": [0.0, 0.5, 0.0],
                "axis": ABOUT_Z,
            },
            color=IRON if number % 2 else STONE,
        )
        for number in range(CHAIN_LINKS)
    ]
    entities.append(
        solid(
            "Ball",
            "sphere",
            size=(CHAIN_BALL,) * 3,
            position=hook + (CHAIN_LINKS * LINK + 0.5 * CHAIN_BALL) * down,
            rotation=turn,
            mass=CHAIN_BALL_MASS,
            collider=NO_TOUCH,
            joint={"kind": "hinge", "other": f"Link {CHAIN_LINKS}", "anchor": [0.0, 0.5, 0.0], "axis": ABOUT_Z},
            color=PALETTE[0],
        )
    )
    return scene("Heavy chain", [ground(), *entities], eye=(2.0, 3.4, 9.0), target=(1.2, 2.9, 0.0))


def _pass_time_error(run: CaseRun) -> float:
    return 100.0 * abs(crossing(run.time, -run.position("Ball")[:, 0]) / CHAIN_PASSES - 1.0)


def _stretch(run: CaseRun) -> float:
    """How far the ball ever is beyond the chain's length [mm]."""
    reach = np.linalg.norm(run.position("Ball") - (0.0, _CHAIN_TOP, 0.0), axis=1).max()
    return 1000.0 * max(0.0, float(reach) - CHAIN_LINKS * LINK - 0.5 * CHAIN_BALL)


# ---------------------------------------------------------------- a closed loop

CRANK: Final = 0.5  # [m]
COUPLER: Final = 1.8
ROCKER: Final = 1.2
BASE: Final = 1.6
CRANK_SPEED: Final = 4.0  # [rad/s]
_LOOP_HEIGHT: Final = 1.0  # [m]


def four_bar_angles(crank: Array) -> tuple[Array, Array]:
    """Angles of coupler and rocker (T,) that close the loop over a crank's (T,) [rad]: where two circles meet, above."""
    joint = CRANK * np.stack([np.cos(crank), np.sin(crank)], axis=-1)
    away = np.array([BASE, 0.0]) - joint
    distance = np.linalg.norm(away, axis=-1)
    along = (distance**2 + COUPLER**2 - ROCKER**2) / (2.0 * distance)
    height = np.sqrt(COUPLER**2 - along**2)
    unit = away / distance[..., None]
    end = joint + along[..., None] * unit + height[..., None] * np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
    coupler = np.arctan2(end[..., 1] - joint[..., 1], end[..., 0] - joint[..., 0])
    return coupler, np.arctan2(end[..., 1], end[..., 0] - BASE)


def closed_loop() -> SceneDocument:
    """A crank with a motor, a coupler and a rocker: a four-bar linkage, whose last hinge closes the loop."""
    start = np.zeros(1)
    coupler, rocker = (float(angle[0]) for angle in four_bar_angles(start))
    near, far = np.array([-0.5 * BASE, _LOOP_HEIGHT, 0.0]), np.array([0.5 * BASE, _LOOP_HEIGHT, 0.0])

    def bar(name: str, length: float, begin: Array, angle: float, z: float, **more: Any) -> EntityNode:
        middle = begin + 0.5 * length * np.array([math.cos(angle), math.sin(angle), 0.0]) + (0.0, 0.0, z)
        return solid(
            name,
            "box",
            size=(length, 0.1, 0.06),
            position=middle,
            rotation=about_z(angle),
            collider=NO_TOUCH,
            mass=length,
            **more,
        )

    def hinge(other: str, end: float, z: float, **more: Any) -> dict[str, Any]:
        values = {"kind": "hinge", "anchor": [0.5 * end, 0.0, z / 0.06], "axis": ABOUT_Z, **more}
        return {**values, "other": other} if other else values

    tip = near + CRANK * np.array([1.0, 0.0, 0.0])
    last = EntityNode(name="Last hinge", components={"Joint": hinge("Rocker", 1.0, -0.04)})
    driven = hinge("", -1.0, 0.0, motor_speed=CRANK_SPEED, motor_limit=1e5)
    entities = [
        bar("Crank", CRANK, near, 0.0, 0.0, joint=driven, color=PALETTE[0], angular_velocity=(0.0, 0.0, CRANK_SPEED)),
        bar(
            "Coupler",
            COUPLER,
            tip,
            coupler,
            0.08,
            joint=hinge("Crank", -1.0, -0.04),
            color=PALETTE[2],
            children=[last],
        ),
        bar("Rocker", ROCKER, far, rocker, 0.0, joint=hinge("", -1.0, 0.0), color=PALETTE[4]),
    ]
    posts = [
        fixture(
            f"Post {side}",
            size=(0.1, _LOOP_HEIGHT, 0.1),
            position=place - (0.0, 0.5 * _LOOP_HEIGHT, 0.12),
            color=DARK,
            collider=NO_TOUCH,
        )
        for side, place in (("left", near), ("right", far))
    ]
    return scene("Closed loop", [ground(), *posts, *entities], eye=(0.9, 1.7, 4.6), target=(0.0, 1.2, 0.0))


def _rocker_error(run: CaseRun) -> float:
    """Against the angle that closes the loop over the crank as it stands [deg]."""
    _, exact = four_bar_angles(angle_about_z(run.rotation("Crank")))
    return math.degrees(float(np.abs(angle_about_z(run.rotation("Rocker")) - exact).max()))


def _crank_error(run: CaseRun) -> float:
    """How far the crank lags behind its motor's speed after all turns [deg]."""
    return math.degrees(abs(float(angle_about_z(run.rotation("Crank"))[-1]) - CRANK_SPEED * float(run.time[-1])))


_PARTED: Final = "each blow loses a percent or two: it is dealt out as if no joint made the balls turn while they swing"

JOINTED_CASES: Final = (
    HardCase(
        name="newtons-cradle",
        title="Newton's cradle: five balls that touch",
        difficulty="a blow must pass through three balls at rest within one tick, and joints must not eat it",
        answer="the last ball rises as high as the first fell, the others rest; no energy is lost",
        build=always(newtons_cradle),
        duration=10.0,
        measures=(
            CaseMeasure(name="height", unit="%", bound=2.0, of=_swing_error),
            CaseMeasure(name="middle ball", unit="deg", bound=1.0, of=_middle_motion),
            CaseMeasure(name="energy", unit="%", bound=2.0, of=_lost_energy, known_miss=_PARTED),
        ),
        picture_time=1.35,
        sleeping=False,
    ),
    HardCase(
        name="heavy-chain",
        title="a chain of 20 links of 100 g with 100 kg at its end",
        difficulty="a thousandfold mass ratio over twenty joints: iterations stretch it like rubber",
        answer="Lagrange's equations of 20 rods and a ball; no link gives way",
        build=always(heavy_chain),
        duration=8.0,
        measures=(
            CaseMeasure(name="passes below", unit="%", bound=0.5, of=_pass_time_error),
            CaseMeasure(name="stretch", unit="mm", bound=2.0, of=_stretch),
            joint_gap_under(2.0),
            energy_gain_under(1.0),
        ),
        picture_time=0.5,
        sleeping=False,
    ),
    HardCase(
        name="closed-loop",
        title="a four-bar linkage driven by a motor, 6 turns",
        difficulty="a loop has more constraints than it can use: the last hinge repeats what the others say",
        answer="the rocker stands where two circles meet over the crank",
        build=always(closed_loop),
        duration=12.0 * math.pi / CRANK_SPEED,
        measures=(
            CaseMeasure(name="rocker", unit="deg", bound=0.2, of=_rocker_error),
            CaseMeasure(name="crank", unit="deg", bound=2.0, of=_crank_error),  # a thousandth of the way
            joint_gap_under(1.0),
        ),
        picture_time=0.6,
        sleeping=False,
    ),
)

"""Friction, rolling and impacts of single bodies, whose motion is known in closed form."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from elys.common.math import quaternion
from elys.common.scene import EntityNode, SceneDocument
from elys.samples.entities import PALETTE
from elys.samples.hard_cases.case import CaseMeasure, CaseRun, HardCase, always
from elys.samples.hard_cases.scenery import G, fixture, ground, scene, solid

Array = np.ndarray[Any, Any]

# ---------------------------------------------------------------- friction: stick just below, slip just above

SLOPE: Final = math.radians(20.0)
NEARNESS: Final = 0.01  # by which share of tan(slope) the two coefficients miss it, one above and one below
_THRESHOLD_TIME: Final = 4.0  # [s]


def friction_threshold() -> SceneDocument:
    """Two slopes of 20 degrees with a box each; downhill is -x."""
    turn = quaternion.from_axis_angle((0.0, 0.0, 1.0), SLOPE)
    normal = np.array([-math.sin(SLOPE), math.cos(SLOPE), 0.0])
    entities: list[EntityNode] = []
    for name, z, share, color in (("Sticks", -1.0, 1.0, PALETTE[4]), ("Slips", 1.0, -1.0, PALETTE[0])):
        friction = math.tan(SLOPE) * (1.0 + share * NEARNESS)
        slab = np.array([0.0, 0.0, z]) - 0.5 * normal
        entities.append(fixture(f"Slope {name}", size=(8.0, 1.0, 1.8), position=slab, rotation=turn, friction=friction))
        place = np.array([0.0, 0.0, z]) + 0.25 * normal
        size = (1.0, 0.5, 1.0)
        entities.append(
            solid(name, "box", size=size, position=place, rotation=turn, friction=friction, color=color)
        )  # fmt: skip
    return scene("Friction threshold", entities, eye=(-3.2, 3.0, 7.0), target=(-0.3, 0.0, 0.0))


def _downhill(run: CaseRun, name: str) -> Array:
    moved = run.position(name) - run.position(name)[0]
    return np.asarray(moved @ np.array([-math.cos(SLOPE), -math.sin(SLOPE), 0.0]))


def _creep(run: CaseRun) -> float:
    return 1000.0 * float(np.abs(_downhill(run, "Sticks")).max())


def _slip_error(run: CaseRun) -> float:
    exact = 0.5 * G * math.sin(SLOPE) * NEARNESS * float(run.time[-1]) ** 2
    return 100.0 * abs(float(_downhill(run, "Slips")[-1]) / exact - 1.0)


# ---------------------------------------------------------------- slipping, then rolling

SLIP_SPEED: Final = 5.0  # [m/s]
SLIP_FRICTION: Final = 0.2
_BALL: Final = 0.5  # [m] radius


def slip_to_roll() -> SceneDocument:
    """A ball that touches the ground and moves along x without spin."""
    ball = solid(
        "Ball",
        "sphere",
        position=(0.0, _BALL, 0.0),
        friction=SLIP_FRICTION,
        linear_velocity=(SLIP_SPEED, 0.0, 0.0),
        color=PALETTE[1],
    )
    return scene("Slip to roll", [ground(friction=SLIP_FRICTION), ball], eye=(4.0, 3.0, 10.0), target=(4.0, 0.3, 0.0))


def _rolling_distance(time: float) -> float:
    """Sliding under mu g until 2 v / (7 mu g), then at 5/7 v (Coriolis 1835)."""
    grip = SLIP_FRICTION * G
    until = min(time, 2.0 * SLIP_SPEED / (7.0 * grip))
    return SLIP_SPEED * until - 0.5 * grip * until**2 + 5.0 / 7.0 * SLIP_SPEED * (time - until)


def _roll_distance_error(run: CaseRun) -> float:
    return 100.0 * abs(float(run.position("Ball")[-1, 0]) / _rolling_distance(float(run.time[-1])) - 1.0)


def _roll_speed_error(run: CaseRun) -> float:
    speed, spin = run.velocity("Ball")[-1, 0], run.spin("Ball")[-1, 2]
    exact = 5.0 / 7.0 * SLIP_SPEED
    return 100.0 * max(abs(float(speed) / exact - 1.0), abs(float(-spin) * _BALL / exact - 1.0))


# ---------------------------------------------------------------- bouncing to rest

ZENO_RESTITUTION: Final = 0.7
ZENO_DROP: Final = 1.3  # [m] under the ball at the start
# Infinitely many bounces in a finite time: the fall, and twice the geometric series of the rises.
ZENO_TIME: Final = math.sqrt(2.0 * ZENO_DROP / G) * (1.0 + ZENO_RESTITUTION) / (1.0 - ZENO_RESTITUTION)
_LOW: Final = 1e-3  # [m] a ball that rises no higher any more has come to rest


def zeno() -> SceneDocument:
    """A ball above the ground."""
    ball = solid(
        "Ball", "sphere", position=(0.0, _BALL + ZENO_DROP, 0.0), restitution=ZENO_RESTITUTION, color=PALETTE[0]
    )
    return scene(
        "Bouncing to rest", [ground(restitution=ZENO_RESTITUTION), ball], eye=(2.0, 2.2, 6.0), target=(0.0, 0.9, 0.0)
    )


def _rest_time_error(run: CaseRun) -> float:
    """When it last was above 1 mm, against when the series says so."""
    height = run.position("Ball")[:, 1] - _BALL
    high = np.flatnonzero(height > _LOW)
    # The hop that still reaches 1 mm: the n-th has e^2n of the drop; it comes down through 1 mm at the end of its arc.
    hops = math.floor(0.5 * math.log(_LOW / ZENO_DROP) / math.log(ZENO_RESTITUTION))
    fall = math.sqrt(2.0 * ZENO_DROP / G)
    before = fall * (1.0 + 2.0 * sum(ZENO_RESTITUTION**n for n in range(1, hops)))
    top = fall * ZENO_RESTITUTION**hops
    down = math.sqrt(2.0 * (ZENO_DROP * ZENO_RESTITUTION ** (2 * hops) - _LOW) / G)
    return 1000.0 * abs(float(run.time[high[-1]]) - (before + top + down))


def _after_rest(run: CaseRun) -> float:
    """How high it still is once it must rest [mm]."""
    late = run.time > ZENO_TIME + 0.1
    return 1000.0 * float(np.abs(run.position("Ball")[late, 1] - _BALL).max())


MOVING_CASES: Final = (
    HardCase(
        name="friction-threshold",
        title="two boxes on 20 degrees, friction 1 % above and below the threshold",
        difficulty="the friction cone must be right to a percent: soft or averaged friction creeps, or holds too long",
        answer="one stays; the other covers g sin 20 (0.01) t^2 / 2",
        build=always(friction_threshold),
        duration=_THRESHOLD_TIME,
        measures=(
            CaseMeasure(name="creep", unit="mm", bound=0.1, of=_creep),
            CaseMeasure(name="slip", unit="%", bound=2.0, of=_slip_error),
        ),
        picture_time=4.0,
        sleeping=False,
    ),
    HardCase(
        name="slip-to-roll",
        title="a ball that slips and then rolls",
        difficulty="friction must end at the very moment at which the ball rolls, not turn it on",
        answer="under mu g until 2 v / (7 mu g), then at 5/7 v (Coriolis 1835)",
        build=always(slip_to_roll),
        duration=2.0,
        measures=(
            CaseMeasure(name="distance", unit="%", bound=0.1, of=_roll_distance_error),
            CaseMeasure(name="final speed", unit="%", bound=0.1, of=_roll_speed_error),
        ),
        picture_time=1.2,
    ),
    HardCase(
        name="zeno",
        title="a ball that bounces to rest",
        difficulty="infinitely many bounces in 3.1 s, nearly all of them within one tick",
        answer="at rest after sqrt(2 h / g) (1 + e) / (1 - e)",
        build=always(zeno),
        duration=4.5,
        measures=(
            # A moment is recorded each tick: nothing can be told to less than that.
            CaseMeasure(name="time to rest", unit="ms", bound=1000.0 / 60.0, of=_rest_time_error),
            CaseMeasure(name="unrest", unit="mm", bound=0.5, of=_after_rest),
        ),
        picture_time=0.9,
    ),
)

"""Many bodies that something strikes: a plough, a bullet, one domino after another."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from elys.common.scene import EntityNode, SceneDocument
from elys.samples.entities import PALETTE, STONE
from elys.samples.hard_cases.case import CaseMeasure, CaseRun, HardCase, always
from elys.samples.hard_cases.scenery import DARK, IRON, fixture, ground, scene, solid

Array = np.ndarray[Any, Any]


def bin_of(half: float, height: float, *, friction: float = 0.5, restitution: float = 0.0) -> list[EntityNode]:
    """A floor and four walls, 1 m thick, about a square of half width `half` [m]; its top is open."""
    surface: dict[str, Any] = {"friction": friction, "restitution": restitution}
    middle, wide = half + 0.5, 2.0 * half + 2.0
    walls = [
        fixture(name, size=size, position=position, **surface)
        for name, size, position in (
            ("North", (wide, height, 1.0), (0.0, 0.5 * height, -middle)),
            ("South", (wide, height, 1.0), (0.0, 0.5 * height, middle)),
            ("West", (1.0, height, 2.0 * half), (-middle, 0.5 * height, 0.0)),
            ("East", (1.0, height, 2.0 * half), (middle, 0.5 * height, 0.0)),
        )
    ]
    return [ground(width=wide + 4.0, **surface), *walls]


# ---------------------------------------------------------------- a kinematic body through a pile

PLOUGH_SPEED: Final = 2.0  # [m/s]


def plough() -> SceneDocument:
    """A block of infinite weight that moves through a hundred cubes."""
    cubes = [
        solid(
            f"Cube {number + 1}",
            "box",
            size=(0.4,) * 3,
            position=(0.42 * (number % 5) - 0.84, 0.2 + 0.4 * (number // 25), 0.42 * (number // 5 % 5) - 0.84),
            color=PALETTE[(number * 3) % len(PALETTE)],
        )
        for number in range(100)
    ]
    block = solid(
        "Plough",
        "box",
        size=(0.6, 1.2, 3.0),
        position=(-4.0, 0.6, 0.0),
        motion="kinematic",
        linear_velocity=(PLOUGH_SPEED, 0.0, 0.0),
        color=DARK,
    )
    return scene("Plough", [ground(), *cubes, block], eye=(3.0, 3.6, 8.0), target=(0.2, 0.5, 0.0))


def _plough_error(run: CaseRun) -> float:
    exact = -4.0 + PLOUGH_SPEED * run.time
    return 1000.0 * float(np.abs(run.position("Plough")[:, 0] - exact).max())


def _inside_plough(run: CaseRun) -> float:
    """Deepest that a cube's middle ever is behind the block's front [mm]: its half edge is 200 mm."""
    front = run.position("Plough")[:, 0] + 0.3
    cubes = run.motion.position[:, run.places("Cube ")]
    beside = (np.abs(cubes[:, :, 2]) < 1.5) & (cubes[:, :, 1] < 1.1)
    is_ahead = cubes[:, :, 0] > run.position("Plough")[:, 0][:, None]
    depth = np.where(beside & is_ahead, front[:, None] + 0.2 - cubes[:, :, 0], 0.0)
    return 1000.0 * max(0.0, float(depth.max()))


def _thrown(run: CaseRun) -> float:
    """The fastest cube, beyond three times the block's speed [m/s]: inelastic bodies leave a moving wall with its speed."""
    speed = np.linalg.norm(run.motion.linear_velocity[:, run.places("Cube ")], axis=2).max()
    return max(0.0, float(speed) - 3.0 * PLOUGH_SPEED)


# ---------------------------------------------------------------- woken by a bullet

_BULLET_SPEED: Final = 100.0  # [m/s]
_BULLET_MASS: Final = 0.5  # [kg]
_ARRIVES: Final = 3.0  # [s]


def woken_pile() -> SceneDocument:
    """A pyramid of cubes that has fallen asleep when a bullet, which has been under way for 3 s, meets its foot."""
    cubes: list[EntityNode] = []
    for row in range(5):
        for column in range(5 - row):
            cubes.append(
                solid(
                    f"Cube {len(cubes) + 1}",
                    "box",
                    position=(column + 0.5 * row - 2.0, row + 0.5, 0.0),
                    color=PALETTE[len(cubes) % len(PALETTE)],
                )
            )
    bullet = solid(
        "Bullet",
        "sphere",
        size=(0.2,) * 3,
        position=(-2.6 - _BULLET_SPEED * _ARRIVES, 2.4, 0.0),
        linear_velocity=(_BULLET_SPEED, 0.0, 0.0),
        gravity_scale=0.0,
        mass=_BULLET_MASS,
        color=IRON,
        metallic=1.0,
    )
    return scene("Woken pile", [ground(width=40.0), *cubes, bullet], eye=(5.5, 4.5, 10.5), target=(0.6, 2.0, 0.0))


def _moved_before(run: CaseRun) -> float:
    """How far any cube moved in the second before the bullet came [mm]: what sleeps does not move at all."""
    places = run.places("Cube ")
    early = (run.time > _ARRIVES - 1.2) & (run.time < _ARRIVES - 0.2)
    positions = run.motion.position[early][:, places]
    return 1000.0 * float(np.linalg.norm(positions - positions[0], axis=2).max())


def _not_moved_after(run: CaseRun) -> float:
    """By how much the cube that was struck fell short of moving 10 cm [mm]."""
    struck = run.position("Cube 10")
    return max(0.0, 100.0 - 1000.0 * float(np.linalg.norm(struck[-1] - struck[0])))


def _momentum_error(run: CaseRun) -> float:
    """Of the momentum along x just after the blow, against the bullet's [%].

    Within that tick the ground's friction may take mu m g dt, which is 1.2 N s of 50, and more under the blow.
    """
    after = int(np.flatnonzero(np.abs(run.velocity("Bullet")[:, 0] - _BULLET_SPEED) > 1.0)[0])
    return 100.0 * abs(float(run.momentum[after, 0]) / (_BULLET_MASS * _BULLET_SPEED) - 1.0)


# ---------------------------------------------------------------- dominoes

DOMINO_COUNT: Final = 24
DOMINO: Final = (0.1, 1.0, 0.5)  # [m] thickness, height, width
DOMINO_SPACING: Final = 0.5  # [m] from middle to middle
# Of this scene at 3840 ticks a second, from the middle of the row on [m/s]; at 960 it is 0.1 % more.
DOMINO_SPEED: Final = 3.638


def dominoes() -> SceneDocument:
    """A row of which the first is pushed over."""
    stones = [
        solid(
            f"Domino {number + 1}",
            "box",
            size=DOMINO,
            position=((number - 0.5 * (DOMINO_COUNT - 1)) * DOMINO_SPACING, 0.5 * DOMINO[1], 0.0),
            friction=0.4,
            angular_velocity=(0.0, 0.0, -1.5) if number == 0 else (0.0, 0.0, 0.0),
            linear_velocity=(0.75, 0.0, 0.0) if number == 0 else (0.0, 0.0, 0.0),
            color=STONE if number % 2 else PALETTE[0],
        )
        for number in range(DOMINO_COUNT)
    ]
    return scene("Dominoes", [ground(friction=0.4), *stones], eye=(3.0, 3.2, 10.0), target=(0.3, 0.3, 0.0))


def domino_speed(run: CaseRun) -> float:
    """How fast the wave runs over the second half of the row [m/s]: between moments at which dominoes lean by 0.2 rad."""
    moments = []
    for number in (DOMINO_COUNT // 2, DOMINO_COUNT - 2):
        turn = run.rotation(f"Domino {number}")
        lean = np.abs(2.0 * np.arctan2(turn[:, 2], turn[:, 3]))
        at = int(np.flatnonzero(lean > 0.2)[0]) if (lean > 0.2).any() else 0
        if at == 0:
            return 0.0
        share = (0.2 - lean[at - 1]) / (lean[at] - lean[at - 1])
        moments.append(float(run.time[at - 1] + share * (run.time[at] - run.time[at - 1])))
    return (DOMINO_COUNT - 2 - DOMINO_COUNT // 2) * DOMINO_SPACING / (moments[1] - moments[0])


def _domino_speed_error(run: CaseRun) -> float:
    return 100.0 * abs(domino_speed(run) / DOMINO_SPEED - 1.0)


def _standing(run: CaseRun) -> float:
    return float((run.motion.position[-1, run.places("Domino "), 1] > 0.48).sum())


STRUCK_CASES: Final = (
    HardCase(
        name="dominoes",
        title="a row of 24 dominoes",
        difficulty="a wave of blows and of friction at edges, whose speed sums up every error",
        answer="all fall; the wave runs as fast as in the same scene at 3840 ticks a second, which is no proof",
        build=always(dominoes),
        duration=8.0,
        measures=(
            CaseMeasure(name="standing", unit="dominoes", bound=0, of=_standing),
            CaseMeasure(name="speed", unit="%", bound=5.0, of=_domino_speed_error),
        ),
        picture_time=2.4,
        sleeping=False,
    ),
    HardCase(
        name="plough",
        title="a kinematic block is driven through 100 cubes",
        difficulty="it never gives way: what is before it must, all of it, and nothing may be thrown",
        answer="the block is where its velocity takes it; cubes stay before it and leave no faster than a few times its speed",
        build=always(plough),
        duration=4.0,
        measures=(
            CaseMeasure(name="block", unit="mm", bound=0.01, of=_plough_error),
            CaseMeasure(name="inside", unit="mm", bound=10.0, of=_inside_plough),
            CaseMeasure(name="thrown", unit="m/s", bound=0.0, of=_thrown),
        ),
        picture_time=2.2,
    ),
    HardCase(
        name="woken-pile",
        title="a sleeping pyramid is woken by a bullet",
        difficulty="what sleeps costs nothing and is not looked at, until something of 100 m/s is within it",
        answer="no motion at all before; all of the bullet's momentum after",
        build=always(woken_pile),
        duration=6.0,
        measures=(
            CaseMeasure(name="moved asleep", unit="mm", bound=0.0, of=_moved_before),
            CaseMeasure(name="short of 10 cm", unit="mm", bound=0.0, of=_not_moved_after),
            CaseMeasure(name="momentum", unit="%", bound=5.0, of=_momentum_error),
        ),
        picture_time=3.3,
    ),
)

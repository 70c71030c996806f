"""Many bodies at once: rain, piles without friction and with too much, things put into each other, dominoes."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from elys.common.scene import EntityNode, SceneDocument
from elys.samples.entities import PALETTE
from elys.samples.hard_cases.case import CaseMeasure, CaseRun, HardCase, always
from elys.samples.hard_cases.measures import energy_gain_under, no_problems, overlap_under
from elys.samples.hard_cases.scenery import fixture, ground, scene, solid

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


# ---------------------------------------------------------------- rain


def rain(count: int) -> SceneDocument:
    """Boxes and spheres of 0.4 to 0.6 m in layers above a bin."""
    chance = np.random.default_rng(count)
    columns = max(math.ceil(math.sqrt(count / 25.0)), 3)
    half = 0.5 * columns * 0.75 + 0.1
    bodies = []
    for number in range(count):
        layer, place = divmod(number, columns * columns)
        row, column = divmod(place, columns)
        x, z = ((at - 0.5 * (columns - 1)) * 0.75 for at in (column, row))
        is_box = number % 2 == 0
        edge = round(float(chance.uniform(0.3, 0.42) if is_box else chance.uniform(0.4, 0.6)), 2)
        turn = chance.normal(size=4)
        # Balls exactly above balls would stand on each other.
        x, z = np.array([x, z]) + chance.uniform(-0.04, 0.04, 2)
        bodies.append(
            solid(
                f"Drop {number + 1}",
                "box" if is_box else "sphere",
                size=(edge,) * 3,
                position=(x, 0.5 + layer * 0.75, z),
                rotation=turn / np.linalg.norm(turn) if is_box else None,
                mass=500.0 * edge**3,
                color=PALETTE[int(chance.integers(len(PALETTE)))],
            )
        )
    view: dict[str, Any] = {"eye": (1.4 * half, 0.9 * half + 9.0, 3.4 * half), "target": (0.0, 0.35 * half + 2.0, 0.0)}
    return scene(f"Rain of {count}", [*bin_of(half, 30.0)[:1], *_low_bin(half), *bodies], **view)


def _low_bin(half: float) -> list[EntityNode]:
    """Walls that keep everything in; only their lowest part is drawn."""
    walls = bin_of(half, 30.0)[1:]
    for wall in walls:
        del wall.components["MeshRenderer"]
        del wall.components["Material"]
    return walls


def _outside(run: CaseRun) -> float:
    """How many ended in or below the ground, or where the walls should have kept them from."""
    end = run.motion.position[-1, run.places("Drop ")]
    half = float(run.position("East")[0, 0]) - 0.5
    is_out = (end[:, 1] < 0.1) | (np.abs(end[:, [0, 2]]).max(axis=1) > half)
    return float(is_out.sum())


_MANY: Final = (
    "in an island of thousands contacts get the fewest substeps, and the deepest of them all gives way by more"
)


def _rain_measures(*, deep: str) -> tuple[CaseMeasure, ...]:
    return (
        CaseMeasure(name="got out", unit="bodies", bound=0, of=_outside),
        overlap_under(10.0, last=0.1, known_miss=deep),
        energy_gain_under(0.1),
        no_problems(),
    )


_RAIN: Final = HardCase(
    name="rain-10000",
    title="10,000 boxes and spheres rain into a bin, 8 s",
    difficulty="twenty-five layers fall on each other: every kind of contact begins at every moment",
    answer="all lie within the walls, none deeper in another than a few millimetres, and energy was only lost",
    build=always(partial(rain, 10_000)),
    duration=8.0,
    measures=_rain_measures(deep=_MANY),
    picture_time=2.0,
    stride=10,
)

# ---------------------------------------------------------------- bodies put into each other

_SPAWNED: Final = 12
_PUSHES: Final = "each pair is parted at 3 m/s at most, but a body in ten pairs gets what all of them push"


def spawned_inside() -> SceneDocument:
    """A dozen cubes of 1 m within a cube of 1.6 m, just above the ground."""
    chance = np.random.default_rng(5)
    cubes = [
        solid(
            f"Cube {number + 1}",
            "box",
            position=np.array([0.0, 1.4, 0.0]) + chance.uniform(-0.3, 0.3, 3),
            color=PALETTE[number % len(PALETTE)],
        )
        for number in range(_SPAWNED)
    ]
    return scene("Spawned inside", [ground(), *cubes], eye=(5.0, 4.5, 12.0), target=(0.0, 1.3, 0.0))


def _fastest(run: CaseRun) -> float:
    """Beyond what the fall from their highest start could give: sqrt(2 g h) is 5.8 m/s [m/s]."""
    speed = np.linalg.norm(run.motion.linear_velocity, axis=2).max()
    return max(0.0, float(speed) - math.sqrt(2.0 * 9.81 * 1.7))


def _farthest(run: CaseRun) -> float:
    end = run.motion.position[-1, run.places("Cube ")]
    return float(np.linalg.norm(end[:, [0, 2]], axis=1).max())


# ---------------------------------------------------------------- friction of nothing and of too much


def friction_pile(friction: float) -> SceneDocument:
    """A hundred boxes and spheres that fall into a bin."""
    chance = np.random.default_rng(11)
    half, bodies = 1.5, []
    for number in range(100):
        layer, place = divmod(number, 9)
        row, column = divmod(place, 3)
        turn = chance.normal(size=4)
        is_box = number % 3 != 0
        bodies.append(
            solid(
                f"Body {number + 1}",
                "box" if is_box else "sphere",
                size=(0.5, 0.5, 0.5),
                position=(0.92 * (column - 1), 0.6 + 0.9 * layer, 0.92 * (row - 1)),
                rotation=turn / np.linalg.norm(turn) if is_box else None,
                friction=friction,
                color=PALETTE[number % len(PALETTE)],
            )
        )
    walls = bin_of(half, 14.0, friction=friction)
    for wall in walls[1:]:
        del wall.components["MeshRenderer"], wall.components["Material"]
    return scene(f"Pile with friction {friction:g}", [*walls, *bodies], eye=(4.6, 5.0, 10.0), target=(0.0, 1.9, 0.0))


def _unrest(run: CaseRun) -> float:
    """The fastest body at the end [mm/s]."""
    return 1000.0 * float(np.linalg.norm(run.motion.linear_velocity[-1], axis=1).max())


def _pile_case(
    name: str, friction: float, title: str, difficulty: str, answer: str, *more: CaseMeasure
) -> HardCase:  # fmt: skip
    return HardCase(
        name=name,
        title=title,
        difficulty=difficulty,
        answer=answer,
        build=always(partial(friction_pile, friction)),
        duration=12.0,
        measures=(
            energy_gain_under(0.1),
            overlap_under(5.0),
            no_problems(),
            *more,
        ),
        picture_time=6.0,
        stride=4,
        sleeping=False,
    )


# ---------------------------------------------------------------- restitution 1

_BOUNCERS: Final = 12
_BOX: Final = 3.0  # [m] inside


def perfect_bounces() -> SceneDocument:
    """Balls of restitution 1 without friction in a closed box, in gravity."""
    chance = np.random.default_rng(3)
    wall: dict[str, Any] = {"friction": 0.0, "restitution": 1.0}
    wide = _BOX + 2.0
    box = bin_of(0.5 * _BOX, _BOX, **wall)
    lid = fixture("Lid", size=(wide, 1.0, wide), position=(0.0, _BOX + 0.5, 0.0), **wall)
    for name in ("South", "East"):
        hidden = next(node for node in box if node.name == name)
        del hidden.components["MeshRenderer"], hidden.components["Material"]
    del lid.components["MeshRenderer"], lid.components["Material"]
    balls = []
    for number in range(_BOUNCERS):
        layer, place = divmod(number, 4)
        row, column = divmod(place, 2)
        balls.append(
            solid(
                f"Ball {number + 1}",
                "sphere",
                size=(0.5,) * 3,
                position=np.array([column - 0.5, 0.5 + 0.9 * layer, row - 0.5]) + chance.uniform(-0.1, 0.1, 3),
                linear_velocity=chance.normal(0.0, 2.0, 3),
                friction=0.0,
                restitution=1.0,
                color=PALETTE[number % len(PALETTE)],
            )
        )
    return scene("Perfect bounces", [*box, lid, *balls], eye=(4.6, 4.0, 6.4), target=(-0.2, 1.2, -0.2))


def _energy_change(run: CaseRun) -> float:
    return 100.0 * float(np.abs(run.energy / run.energy[0] - 1.0).max())


_BOUNCES: Final = HardCase(
    name="perfect-bounces",
    title="12 balls of restitution 1 in a box, for 10 minutes",
    difficulty="some twenty thousand blows, each of which may gain or lose a little, among balls and walls, several in a tick",
    answer="the energy stays",
    build=always(perfect_bounces),
    duration=600.0,
    measures=(CaseMeasure(name="energy", unit="%", bound=1.0, of=_energy_change),),
    picture_time=2.0,
    stride=10,
)


CROWDED_CASES: Final = (
    replace(
        _RAIN, small=replace(_RAIN, build=always(partial(rain, 400)), duration=6.0, measures=_rain_measures(deep=""))
    ),
    HardCase(
        name="spawned-inside",
        title="twelve cubes put into each other, 5 s",
        difficulty="overlaps of half a metre that must be undone without making speed of them",
        answer="they part no faster than they could fall, lie within 4 m and overlap no more",
        build=always(spawned_inside),
        duration=5.0,
        measures=(
            CaseMeasure(name="too fast", unit="m/s", bound=0.0, of=_fastest, known_miss=_PUSHES),
            CaseMeasure(name="farthest", unit="m", bound=4.0, of=_farthest, known_miss=_PUSHES),
            overlap_under(2.0),
        ),
        picture_time=0.7,
    ),
    _pile_case(
        "zero-friction-pile",
        0.0,
        "a pile without any friction, 12 s",
        "nothing damps: what the solver adds stays, and boxes slide out from under each other",
        "energy is only lost, and nothing is squeezed into anything; it may go on sliding",
    ),
    _pile_case(
        "huge-friction-pile",
        100.0,
        "a pile with friction 100, 12 s",
        "friction far beyond what pushes: a cone cut into a pyramid, or solved after the push, throws things about",
        "energy is only lost, nothing is squeezed into anything, and it comes to rest",
        CaseMeasure(name="unrest", unit="mm/s", bound=20.0, of=_unrest),
    ),
    replace(_BOUNCES, small=replace(_BOUNCES, duration=60.0)),
)

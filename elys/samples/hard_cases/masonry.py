"""What is built of loose parts: walls, card houses, arches."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, Final

import numpy as np

from elys.common.scene import EntityNode, SceneDocument
from elys.samples.entities import PALETTE, STONE, Color
from elys.samples.hard_cases.case import CaseMeasure, CaseRun, HardCase, always
from elys.samples.hard_cases.measures import drift_under, moved_under, none_fallen, overlap_under
from elys.samples.hard_cases.scenery import (
    DARK,
    about_z,
    fixture,
    frame,
    ground,
    part,
    scene,
    solid,
)

Array = np.ndarray[Any, Any]

_BRICK_COLORS: Final[tuple[Color, ...]] = ((0.55, 0.24, 0.16), (0.48, 0.20, 0.13), (0.60, 0.30, 0.20))


# ---------------------------------------------------------------- wall

COURSES: Final = 12
_BRICK: Final = (0.5, 0.25, 0.25)  # [m]
_BRICKS_LONG: Final = 8


def wall() -> SceneDocument:
    """Courses of bricks in running bond, with half bricks at the ends of every other one."""
    length, height, depth = _BRICK
    bricks: list[EntityNode] = []
    for course in range(COURSES):
        is_odd = course % 2
        lengths = [0.5 * length, *[length] * (_BRICKS_LONG - 1), 0.5 * length] if is_odd else [length] * _BRICKS_LONG
        left = -0.5 * length * _BRICKS_LONG
        for own in lengths:
            number = len(bricks)
            bricks.append(
                solid(
                    f"Brick {number + 1}",
                    "box",
                    size=(own, height, depth),
                    position=(left + 0.5 * own, (course + 0.5) * height, 0.0),
                    mass=2.0 * own / length,
                    friction=0.6,
                    color=_BRICK_COLORS[(number * number + 5 * course) % 7 % 3],
                )
            )
            left += own
    return scene("Wall", [ground(friction=0.6), *bricks], eye=(2.6, 2.6, 5.6), target=(0.0, 1.4, 0.0))


# ---------------------------------------------------------------- card house

CARD: Final = (0.02, 0.9, 0.6)  # [m] thickness, length, width
_LEAN: Final = math.radians(18.0)  # of a card, from the vertical
_STOREYS: Final = 3


def card_house() -> SceneDocument:
    """Three storeys of cards that lean on each other in pairs, with cards across."""
    thick, long, wide = CARD
    # A leaning card touches the ground with one edge and its partner with another: heights and places of those edges.
    rise = thick * math.sin(_LEAN) + long * math.cos(_LEAN)
    half_width = 0.5 * thick * math.cos(_LEAN) + 0.5 * long * math.sin(_LEAN)
    spacing = 2.0 * (long * math.sin(_LEAN) + thick * math.cos(_LEAN))
    cards: list[EntityNode] = []

    def add(size: tuple[float, float, float], x: float, y: float, angle: float) -> None:
        number = len(cards)
        cards.append(
            solid(
                f"Card {number + 1}",
                "box",
                size=size,
                position=(x, y, 0.0),
                rotation=about_z(angle),
                mass=0.2,
                friction=0.7,
                color=PALETTE[(3 * number) % len(PALETTE)],
            )
        )

    floor = 0.0
    for storey in range(_STOREYS):
        count = _STOREYS - storey
        middles = [(pair - 0.5 * (count - 1)) * spacing for pair in range(count)]
        for x in middles:
            add(CARD, x - half_width, floor + 0.5 * rise, -_LEAN)
            add(CARD, x + half_width, floor + 0.5 * rise, _LEAN)
        for left, right in pairwise(middles):
            add((spacing, thick, wide), 0.5 * (left + right), floor + rise + 0.5 * thick, 0.0)
        floor += rise + thick
    return scene("Card house", [ground(friction=0.7), *cards], eye=(1.6, 1.9, 5.2), target=(0.0, 1.25, 0.0))


# ---------------------------------------------------------------- masonry arch

STONES: Final = 13  # of an arch
_MEAN_RADIUS: Final = 2.0  # [m]
# A semicircular arch of its own weight stands from a thickness of 0.1075 of its mean radius on (Milankovitch 1907; Cocchetti,
# Colasante & Rizzi 2011): thinner, no line of thrust fits into it.
THICK: Final = 0.115
THIN: Final = 0.1


def masonry_arch() -> SceneDocument:
    """Two half circles of wedges without mortar, one thick enough to stand, one not; both lean on fixed stones."""
    entities: list[EntityNode] = [ground()]
    for name, share, x, color in (("Thick", THICK, -2.7, STONE), ("Thin", THIN, 2.7, _BRICK_COLORS[0])):
        entities += _arch(name, share * _MEAN_RADIUS, x, color)
    return scene("Masonry arch", entities, eye=(1.5, 3.0, 11.0), target=(0.0, 1.2, 0.0))


def _arch(name: str, thickness: float, x: float, color: Color) -> list[EntityNode]:
    step = math.pi / STONES
    inner, outer = _MEAN_RADIUS - 0.5 * thickness, _MEAN_RADIUS + 0.5 * thickness
    # A wedge is two boxes, each with a face in one of its radial planes; they overlap at the inner end and leave a gap outside.
    width = 2.0 * inner * math.sin(0.5 * step) * 0.5
    base = 0.5  # [m] height of the springing above the ground
    stones: list[EntityNode] = []
    for number in range(STONES):
        angle = (number + 0.5) * step  # of its middle, from +x
        middle = _MEAN_RADIUS * np.array([math.cos(angle), math.sin(angle)])
        parts = []
        for side, half in (("left", 0.5 * step), ("right", -0.5 * step)):
            # In the stone's own axes, y outward: a box whose outer face lies in the plane turned by `half`.
            outward = np.array([-math.sin(half), math.cos(half)])
            inward = -math.copysign(1.0, half) * np.array([-math.cos(half), -math.sin(half)])
            center = _MEAN_RADIUS * outward + 0.5 * width * inward - (0.0, _MEAN_RADIUS)
            parts.append(
                part(
                    f"{name} {number + 1} {side}",
                    size=(width, outer - inner, 0.6),
                    position=(*center, 0.0),
                    rotation=about_z(half),
                    color=color if number % 2 else tuple(0.8 * c for c in color),  # type: ignore[arg-type]
                    friction=0.7,
                )
            )
        place = (x + middle[0], base + middle[1], 0.0)
        stones.append(
            frame(
                f"{name} {number + 1}",
                position=place,
                rotation=about_z(angle - 0.5 * math.pi),
                mass=20.0 * thickness,
                children=parts,
            )
        )
    feet = [
        fixture(
            f"{name} foot {side}",
            size=(thickness + 0.4, base, 0.8),
            position=(x + side * _MEAN_RADIUS, 0.5 * base, 0.0),
            color=DARK,
            friction=0.7,
        )
        for side in (-1, 1)
    ]
    return [*feet, *stones]


def _thin_stands(run: CaseRun) -> float:
    """Whether the thin arch still holds its keystone up: 1 for yes."""
    height = run.position(f"Thin {STONES // 2 + 1}")[:, 1]
    return float(height[-1] > height[0] - 0.5)


MASONRY_CASES: Final = (
    HardCase(
        name="wall",
        title="a wall of 12 courses in running bond, 10 s",
        difficulty="each brick rests on two and touches its neighbours; weight spreads and pushes the ends out",
        answer="every brick stays",
        build=always(wall),
        duration=10.0,
        measures=(none_fallen("Brick "), drift_under(2.0, "Brick "), overlap_under(1.0)),
        picture_time=5.0,
        stride=6,
        sleeping=False,
    ),
    HardCase(
        name="card-house",
        title="a house of cards of three storeys, 10 s",
        difficulty="thin, steep, held by friction alone, on contacts of an edge with an edge",
        answer="it stands: tan(18 degrees) / 2 of the load must be held by friction, of which there is 0.7",
        build=always(card_house),
        duration=10.0,
        measures=(none_fallen("Card ", far=0.1), moved_under(10.0, "Card ")),
        picture_time=5.0,
        stride=6,
        sleeping=False,
    ),
    HardCase(
        name="masonry-arch",
        title="two arches without mortar, one too thin",
        difficulty="thirteen stones push each other up, and only what leaves room for the line of thrust may stand",
        answer="a half circle stands from a thickness of 0.1075 of its mean radius on: one has 0.115, the other 0.1",
        build=always(masonry_arch),
        duration=8.0,
        measures=(
            none_fallen("Thick ", far=0.1),
            moved_under(20.0, "Thick "),
            CaseMeasure(name="thin one stands", unit="arches", bound=0, of=_thin_stands),
        ),
        picture_time=1.0,
        stride=6,
        sleeping=False,
    ),
)

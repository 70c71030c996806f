"""A bridge of planks hinged to one another, a cart whose wheels have motors, and a ball on a chain: what joints are for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from elys.common.math import quaternion
from elys.common.scene import EntityNode, SceneDocument
from elys.samples.entities import STONE, Color, Vector, body, camera, group, joined, obstacle, ornament, sun

PLANK_COUNT: Final = 20
LINK_COUNT: Final = 10
HALF_SPAN: Final = 6.0  # [m] from the middle of the gorge to either cliff
SAG: Final = 0.7  # [m] of the unloaded deck's middle
_WIDTH: Final = 2.4  # [m]
_THICKNESS: Final = 0.1  # [m] of a plank
_CLIFF: Final = 8.0  # [m] of either cliff along x
_DEPTH: Final = 5.0  # [m] of the gorge
_WHEEL: Final = 0.7  # [m] diameter
_START: Final = -HALF_SPAN - 3.5  # [m] where the cart's middle is at first
_HOOK: Final = (HALF_SPAN + 2.2, 3.6, -3.0)  # [m] where the chain hangs
_LINK: Final = 0.26  # [m] from joint to joint of the chain
_BALL: Final = 0.7  # [m] diameter
_LEAN: Final = 0.7  # [rad] of the chain at first, from the vertical

_GROUND: Final[Color] = (0.30, 0.34, 0.20)
_WOOD: Final[Color] = (0.52, 0.33, 0.16)
_OLD_WOOD: Final[Color] = (0.43, 0.26, 0.12)
_RAIL: Final[Color] = (0.36, 0.22, 0.11)
_PAINT: Final[Color] = (0.75, 0.16, 0.09)
_RUBBER: Final[Color] = (0.04, 0.04, 0.045)
_IRON: Final[Color] = (0.30, 0.31, 0.33)


def bridge() -> SceneDocument:
    """The cart starts on the western cliff and ends at the wall on the eastern one."""
    view = camera((6.0, 6.0, 19.0), (1.3, -0.3, 0.0), field_of_view=0.7)
    return SceneDocument(
        name="Bridge", entities=[sun((-0.5, -0.75, -0.45), intensity=3.2), view, _gorge(), _deck(), _cart(), _chain()]
    )


def check_bridge(positions: Mapping[str, Sequence[float]]) -> str:
    """What is wrong with the final positions [m], by entity name: "" if the cart is across, and all hangs together."""
    x, y, z = positions["Cart"]
    if not (x > HALF_SPAN and y > 0.0 and abs(z) < _WIDTH / 2.0):
        return f"the cart is not on the eastern cliff, it is at ({x:.2f}, {y:.2f}, {z:.2f})"
    for number in range(1, PLANK_COUNT + 1):
        x, y, z = positions[f"Plank {number}"]
        if not (abs(x) < HALF_SPAN and -2.0 * SAG < y < 0.2 and abs(z) < 0.1):
            return f"Plank {number} left the bridge, it is at ({x:.2f}, {y:.2f}, {z:.2f})"
    length = math.dist(positions["Ball"], _HOOK)
    if not length < LINK_COUNT * _LINK + _BALL / 2.0 + 0.01:
        return f"the ball hangs {length:.2f} m from its hook, farther than the chain is long"
    return ""


def _gorge() -> EntityNode:
    middle = HALF_SPAN + _CLIFF / 2.0
    size = (_CLIFF, _DEPTH, 9.0)
    end = HALF_SPAN + _CLIFF - 1.0
    return group(
        "Gorge",
        [
            obstacle("West", size=size, position=(-middle, -_DEPTH / 2.0, 0.0), color=STONE),
            obstacle("East", size=size, position=(middle, -_DEPTH / 2.0, 0.0), color=STONE),
            obstacle("Bottom", size=(60.0, 1.0, 60.0), position=(0.0, -_DEPTH - 0.5, 0.0), color=_GROUND),
            obstacle("Wall", size=(0.4, 1.2, 3.0), position=(end, 0.6, 0.0), color=_RAIL),
            obstacle("Post", size=(0.25, _HOOK[1] + 0.1, 0.25), position=(_HOOK[0] + 2.9, _HOOK[1] / 2.0, _HOOK[2])),
            obstacle("Arm", size=(3.2, 0.2, 0.2), position=(_HOOK[0] + 1.45, _HOOK[1] + 0.1, _HOOK[2])),
        ],
    )


def _deck() -> EntityNode:
    """Planks as chords of a circle, each hinged to the one before it, the first and the last to the cliffs."""
    radius = (HALF_SPAN**2 + SAG**2) / (2.0 * SAG)
    opening = 2.0 * math.asin(HALF_SPAN / radius)
    step = opening / PLANK_COUNT
    length = 2.0 * radius * math.sin(step / 2.0)
    size = (length, _THICKNESS, _WIDTH)
    planks = []
    for number in range(1, PLANK_COUNT + 1):
        angle = (number - 0.5) * step - opening / 2.0
        out = radius * math.cos(step / 2.0)
        place = (out * math.sin(angle), radius - SAG - out * math.cos(angle) - _THICKNESS / 2.0, 0.0)
        turn = quaternion.from_axis_angle((0.0, 0.0, 1.0), angle).tolist()
        color = _WOOD if number % 2 else _OLD_WOOD
        plank = body(f"Plank {number}", "box", size=size, position=place, rotation=turn, color=color, friction=0.8)
        joined(
            plank,
            "hinge",
            f"Plank {number - 1}" if number > 1 else "West",
            anchor=[-0.5, 0.0, 0.0],
            axis=[0.0, 0.0, 1.0],
        )
        plank.children = [_curb(f"{side} curb {number}", at, size) for side, at in (("North", -1.0), ("South", 1.0))]
        planks.append(plank)
    # A body has one joint of its own; what else holds it stands below it.
    end = joined(EntityNode(name="Eastern hinge"), "hinge", "East", anchor=[0.5, 0.0, 0.0], axis=[0.0, 0.0, 1.0])
    planks[-1].children.append(end)
    return group("Deck", planks)


def _curb(name: str, side: float, plank: Vector) -> EntityNode:
    """Keeps wheels on the deck: a part of its plank, whose space is stretched as the plank is."""
    height, width = 0.14, 0.1
    position = (0.0, 0.5 + height / plank[1] / 2.0, side * (0.5 - width / plank[2] / 2.0))
    scale = (0.92, height / plank[1], width / plank[2])
    return obstacle(name, size=scale, position=position, color=_RAIL, friction=0.2)


def _cart() -> EntityNode:
    """A chassis on four driven wheels."""
    height = _WHEEL / 2.0 + 0.1
    chassis = body("Cart", "box", size=(2.0, 0.3, 1.0), position=(_START, height, 0.0), color=_PAINT, roughness=0.35)
    cabin = ornament("Load", "box", size=(0.55, 1.6, 0.8), position=(-0.12, 1.2, 0.0), color=_WOOD)
    chassis.children = [cabin]
    wheels = []
    for name, along, across in (
        ("Front left", 1, -1),
        ("Front right", 1, 1),
        ("Rear left", -1, -1),
        ("Rear right", -1, 1),
    ):
        wheel = body(
            f"{name} wheel",
            "cylinder",
            size=(_WHEEL, 0.22, _WHEEL),
            position=(_START + 0.68 * along, _WHEEL / 2.0, 0.66 * across),
            rotation=quaternion.from_axis_angle((1.0, 0.0, 0.0), -math.pi / 2.0).tolist(),
            color=_RUBBER,
            roughness=0.9,
            friction=0.9,
        )
        wheel.children = [
            ornament(f"{name} hub", "box", size=(0.75, 1.04, 0.14), position=(0.0, 0.0, 0.0), color=_IRON)
        ]
        joined(wheel, "hinge", "Cart", axis=[0.0, 1.0, 0.0], motor_speed=11.0, motor_limit=150.0)
        wheels.append(wheel)
    return group("Vehicle", [chassis, *wheels])


def _chain() -> EntityNode:
    """Links from a hook to a ball, let go at an angle."""
    turn = quaternion.from_axis_angle((0.0, 0.0, 1.0), -_LEAN).tolist()
    down = (-math.sin(_LEAN), -math.cos(_LEAN))

    def at(length: float) -> tuple[float, float, float]:
        return (_HOOK[0] + length * down[0], _HOOK[1] + length * down[1], _HOOK[2])

    links = []
    for number in range(1, LINK_COUNT + 1):
        size = (0.09, _LINK, 0.05) if number % 2 else (0.05, _LINK, 0.09)
        place = at((number - 0.5) * _LINK)
        link = body(
            f"Link {number}", "box", size=size, position=place, rotation=turn, color=_IRON, metallic=1.0, density=4000.0
        )
        links.append(joined(link, "ball", f"Link {number - 1}" if number > 1 else "Arm", anchor=[0.0, 0.5, 0.0]))
    place = at(LINK_COUNT * _LINK + _BALL / 2.0)
    ball = body(
        "Ball", "sphere", size=(_BALL,) * 3, position=place, rotation=turn, color=_IRON, metallic=1.0, density=800.0
    )
    links.append(joined(ball, "ball", f"Link {LINK_COUNT}", anchor=[0.0, 0.5, 0.0]))
    return group("Chain", links)

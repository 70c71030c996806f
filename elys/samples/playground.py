"""A playground for whoever walks: a station for each thing a character can do, and for each that often goes wrong.

Green is what a character with the default sheet can do, red what it cannot, blue moves by itself, amber can be pushed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from elys.common.math import quaternion
from elys.common.scene import ComponentChanges, EntityNode, SceneDocument
from elys.samples.entities import Color, Vector, body, camera, group, joined, obstacle, ornament, rounded, sun
from elys.samples.pieces import piece

START: Final = (0.0, 0.01, 13.0)  # [m] where the walker stands at first
STEPS: Final = (0.05, 0.10, 0.20, 0.30, 0.35, 0.40)  # [m] high; the last is too high
SLOPES: Final = (20.0, 35.0, 48.0, 60.0)  # [deg]; the last is too steep
CEILING: Final = 1.3  # [m] under which only who crouches fits
WATER: Final = 1.5  # [m] high it stands in the pool, whose floor is the ground
LANDING: Final = 3.25  # [m] high, where the lift goes
STEP_HEIGHT: Final = 0.35  # [m] as the default sheet of a Character has it
SLOPE_LIMIT: Final = 50.0  # [deg] likewise

_CAN: Final[Color] = (0.20, 0.45, 0.18)
_CANNOT: Final[Color] = (0.62, 0.10, 0.07)
_MOVES: Final[Color] = (0.07, 0.22, 0.55)
_LOOSE: Final[Color] = (0.86, 0.46, 0.08)
_FLOOR: Final[Color] = (0.48, 0.46, 0.42)
_WALL: Final[Color] = (0.66, 0.62, 0.55)
_TILES: Final[tuple[Color, Color]] = ((0.62, 0.58, 0.50), (0.40, 0.37, 0.33))
_COAT: Final[Color] = (0.90, 0.62, 0.10)
_GLASS: Final[Color] = (0.03, 0.04, 0.06)


def playground() -> SceneDocument:
    """Who starts it walks at once: `elys run playground` and `elys view`, P plays. See docs/characters.md."""
    stations = [
        _steps(),
        _stairs(),
        _slopes(),
        _tunnel(),
        _corner(),
        _tiles(),
        _disc(),
        _carousel(),
        _crates(),
        _seesaw(),
        _fence(),
        _pool(),
        _lift(),
    ]
    surroundings = [sun((-0.5, -0.72, -0.42), intensity=3.3), _camera(), _overview(), _ground()]
    return SceneDocument(name="Playground", entities=[*surroundings, *stations, _walker()])


def check_playground(positions: Mapping[str, Sequence[float]]) -> str:
    """What is wrong with the final positions [m], by entity name: "" if the walker still stands where it was put."""
    x, y, z = positions["Walker"]
    if math.hypot(x - START[0], z - START[2]) > 0.01 or abs(y - START[1]) > 0.005:
        return f"the walker does not stand where it was put, it is at ({x:.2f}, {y:.2f}, {z:.2f})"
    return ""


def _walker() -> EntityNode:
    """A capsule with a visor, so that one sees where it faces."""
    parts = [
        ornament("Coat", "capsule", size=(1.2, 1.8, 1.2), position=(0.0, 0.9, 0.0), color=_COAT, roughness=0.5),
        ornament("Visor", "box", size=(0.42, 0.14, 0.2), position=(0.0, 1.48, -0.2), color=_GLASS, roughness=0.15),
        ornament("Pack", "box", size=(0.36, 0.5, 0.16), position=(0.0, 1.05, 0.31), color=(0.28, 0.14, 0.06)),
    ]
    return EntityNode(
        name="Walker",
        components={"Transform": {"position": rounded(START)}, "Character": {"player": 1}},
        children=parts,
    )


def _camera() -> EntityNode:
    node = camera((0.4, 2.4, 17.5), (0.4, 1.6, 13.0), field_of_view=0.95)
    node.components["Camera"] = {**(node.components["Camera"] or {}), "priority": 1}
    node.components["CameraRig"] = {"target": "Walker", "player": 1}
    return node


def _overview() -> EntityNode:
    node = camera((2.0, 24.0, 33.0), (-0.5, 0.0, 0.5), field_of_view=0.95)
    node.name = "Overview"
    return node


def _ground() -> EntityNode:
    walls = [
        obstacle("Floor", size=(50.0, 1.0, 44.0), position=(0.0, -0.5, -2.0), color=_FLOOR, roughness=0.95),
        obstacle("North", size=(50.0, 1.2, 0.5), position=(0.0, 0.6, -24.0), color=_WALL),
        obstacle("South", size=(50.0, 1.2, 0.5), position=(0.0, 0.6, 20.0), color=_WALL),
        obstacle("West", size=(0.5, 1.2, 44.0), position=(-25.0, 0.6, -2.0), color=_WALL),
        obstacle("East", size=(0.5, 1.2, 44.0), position=(25.0, 0.6, -2.0), color=_WALL),
    ]
    return group("Ground", walls)


def _steps() -> EntityNode:
    """One step each, higher and higher."""
    blocks = [
        obstacle(
            f"Step {height:.2f} m",
            size=(1.5, height, 2.5),
            position=(1.8 * place, height / 2.0, 0.0),
            color=_CAN if height <= STEP_HEIGHT else _CANNOT,
        )
        for place, height in enumerate(STEPS)
    ]
    return group("Steps", blocks, position=(-14.5, 0.0, 5.0))


def _stairs() -> EntityNode:
    """Up by stairs, over a deck, down by a slope."""
    rise, run, count = 0.2, 0.32, 12
    parts = [
        obstacle(
            f"Stair {k + 1}",
            size=(run, rise * (k + 1), 3.0),
            position=(run * (k + 0.5), rise * (k + 1) / 2.0, 0.0),
            color=_TILES[k % 2],
        )
        for k in range(count)
    ]
    deck = count * rise
    parts.append(obstacle("Deck", size=(3.0, 0.3, 3.0), position=(count * run + 1.5, deck - 0.15, 0.0), color=_CAN))
    parts += [
        obstacle(
            f"Post {k}", size=(0.2, deck - 0.3, 0.2), position=(count * run + x, (deck - 0.3) / 2.0, z), color=_WALL
        )
        for k, (x, z) in enumerate(((0.3, 1.2), (0.3, -1.2), (2.7, 1.2), (2.7, -1.2)))
    ]
    parts.append(
        _slope("Way down", 25.0, (count * run + 3.0 + deck / math.tan(math.radians(25.0)), 0.0, 0.0), 3.0, deck, -1.0)
    )
    return group("Stairs", parts, position=(-20.0, 0.0, -8.0))


def _slopes() -> EntityNode:
    """Beside one another, steeper and steeper."""
    parts = [
        _slope(f"Slope {degrees:.0f} deg", degrees, (0.0, 0.0, 3.2 * place), 2.8, 2.6, 1.0)
        for place, degrees in enumerate(SLOPES)
    ]
    return group("Slopes", parts, position=(13.0, 0.0, -14.0))


def _slope(name: str, degrees: float, foot: Vector, width: float, height: float, sign: float) -> EntityNode:
    """A board from its foot up to a height, along x."""
    angle, thickness = math.radians(degrees), 0.3
    length = height / math.sin(angle)
    x, y = length * math.cos(angle) / 2.0, length * math.sin(angle) / 2.0
    middle = (
        foot[0] + sign * (x + thickness / 2.0 * math.sin(angle)),
        foot[1] + y - thickness / 2.0 * math.cos(angle),
        foot[2],
    )
    node = obstacle(
        name,
        size=(length, thickness, width),
        position=middle,
        color=_CAN if degrees <= SLOPE_LIMIT else _CANNOT,
    )
    turn = quaternion.from_axis_angle((0.0, 0.0, 1.0), sign * angle)
    node.components["Transform"] = {
        **(node.components["Transform"] or {}),
        "rotation": [round(float(x), 7) for x in turn],
    }
    return node


def _tunnel() -> EntityNode:
    """A ceiling that is too low to stand under."""
    parts = [
        obstacle("Roof", size=(2.4, 0.3, 4.0), position=(0.0, CEILING + 0.15, 0.0), color=_CAN),
        obstacle("Side A", size=(0.3, CEILING, 4.0), position=(-1.05, CEILING / 2.0, 0.0), color=_WALL),
        obstacle("Side B", size=(0.3, CEILING, 4.0), position=(1.05, CEILING / 2.0, 0.0), color=_WALL),
    ]
    return group("Tunnel", parts, position=(8.5, 0.0, 4.0))


def _corner() -> EntityNode:
    """Two walls in a V, into which one can run without trembling."""
    parts = []
    for name, side in (("Wall A", 1.0), ("Wall B", -1.0)):
        wall = obstacle(name, size=(0.4, 2.0, 5.0), position=(side * 1.1, 1.0, 0.0), color=_WALL)
        turn = quaternion.from_axis_angle((0.0, 1.0, 0.0), side * math.radians(25.0))
        wall.components["Transform"] = {
            **(wall.components["Transform"] or {}),
            "rotation": [round(float(x), 7) for x in turn],
        }
        parts.append(wall)
    return group("Corner", parts, position=(15.0, 0.0, 1.0))


def _tiles() -> EntityNode:
    """A floor of many boxes: nothing may be felt of the seams between them."""
    parts = [
        obstacle(
            f"Tile {x} {z}",
            size=(1.0, 0.2, 1.0),
            position=(x - 3.5, 0.0, z - 3.5),
            color=_TILES[(x + z) % 2],
        )
        for x in range(8)
        for z in range(8)
    ]
    return group("Tiles", parts, position=(0.0, 0.0, 3.0))


def _turning(name: str, speed: float, position: Vector, children: list[EntityNode]) -> EntityNode:
    """What turns about y by itself, with all below it."""
    return EntityNode(
        name=name,
        components={
            "Transform": {"position": rounded(position)},
            "RigidBody": {"motion": "kinematic", "angular_velocity": [0.0, speed, 0.0]},
        },
        children=children,
    )


def _disc() -> EntityNode:
    """A platform that turns whoever stands on it."""
    values: dict[str, Any] = {"shape": "cylinder", "radius": 2.6, "half_length": 0.12}
    plate = ornament("Plate", "cylinder", size=(5.2, 0.24, 5.2), position=(0.0, 0.0, 0.0), color=_MOVES)
    mark = ornament("Mark", "box", size=(0.4, 0.02, 2.4), position=(0.0, 0.125, -1.2), color=_TILES[0])
    disc = _turning("Disc", 0.7, (-8.0, 0.14, -2.0), [plate, mark])
    disc.components["Collider"] = values
    return disc


def _carousel() -> EntityNode:
    """Two platforms that go round."""
    arms = [
        obstacle(f"Gondola {k}", size=(2.2, 0.3, 2.2), position=(side * 4.0, 0.0, 0.0), color=_MOVES)
        for k, side in enumerate((1.0, -1.0))
    ]
    arms.append(ornament("Arm", "box", size=(6.0, 0.12, 0.3), position=(0.0, 0.0, 0.0), color=_WALL))
    return _turning("Carousel", 0.4, (0.0, 0.45, -16.0), arms)


def _crates() -> EntityNode:
    """Things to push: a character's strength moves the light ones."""
    parts = [
        body(f"Crate {k}", "box", size=(size,) * 3, position=(x, size / 2.0, z), color=_LOOSE, density=density)
        for k, (size, x, z, density) in enumerate(
            ((0.9, -2.5, 0.0, 40.0), (0.9, -0.8, 0.3, 80.0), (1.1, 1.2, 0.0, 400.0), (0.6, 3.0, 0.2, 60.0))
        )
    ]
    parts.append(body("Ball", "sphere", size=(0.8,) * 3, position=(4.4, 0.4, 0.0), color=_LOOSE, density=40.0))
    return group("Crates", parts, position=(0.0, 0.0, -5.0))


def _seesaw() -> EntityNode:
    """A plank that goes down under who stands on its end."""
    plank = body("Plank", "box", size=(5.0, 0.14, 1.2), position=(0.0, 0.62, 0.0), color=_LOOSE, density=120.0)
    joined(plank, "hinge", "", axis=[0, 0, 1], limited=True, lower=-0.24, upper=0.24)
    block = ornament("Block", "box", size=(0.3, 0.55, 1.2), position=(0.0, 0.275, 0.0), color=_WALL)
    return group("Seesaw", [plank, block], position=(8.0, 0.0, -6.0))


def _fence() -> EntityNode:
    """Five millimetres of sheet metal, and room to run at it."""
    return group(
        "Fence",
        [
            obstacle("Sheet", size=(9.0, 1.9, 0.005), position=(0.0, 0.95, 0.0), color=_CANNOT, roughness=0.4),
            *(
                obstacle(f"Pole {k}", size=(0.12, 2.1, 0.12), position=(x, 1.05, -0.08), color=_WALL)
                for k, x in enumerate((-4.5, 0.0, 4.5))
            ),
        ],
        position=(0.0, 0.0, -21.0),
    )


def _pool() -> EntityNode:
    """Stairs up to its rim, and down into water in which one cannot stand any more."""
    rise, run, count, length, inner = 0.2, 0.32, 8, 8.0, 4.0
    rim = count * rise
    first = count * run + 1.0  # behind the rim
    parts = [
        obstacle(
            f"Stair {side} {k + 1}",
            size=(run, rise * (k + 1), inner),
            position=(x + way * run * (k + 0.5), rise * (k + 1) / 2.0, 0.0),
            color=_TILES[k % 2],
        )
        for side, x, way, steps in (("up", 0.0, 1.0, count), ("down", first + (count - 1) * run, -1.0, count - 1))
        for k in range(steps)
    ]
    parts.append(obstacle("Rim", size=(1.0, rim, inner), position=(first - 0.5, rim / 2.0, 0.0), color=_CAN))
    parts += [
        obstacle(
            f"Side {name}",
            size=(length + 1.0, rim + 0.3, 0.3),
            position=(first - 1.0 + (length + 1.0) / 2.0, rim / 2.0 + 0.15, side * (inner / 2.0 + 0.15)),
            color=_WALL,
        )
        for name, side in (("A", 1.0), ("B", -1.0))
    ]
    parts.append(
        obstacle(
            "End",
            size=(0.3, rim + 0.3, inner + 0.6),
            position=(first + length + 0.15, rim / 2.0 + 0.15, 0.0),
            color=_WALL,
        )
    )
    volume = {"position": [0.0, -WATER / 2.0 + 0.01, 0.0], "scale": [length, WATER, inner]}
    water = piece("Water", "water", (first + length / 2.0, WATER, 0.0), overrides={"Volume": {"Transform": volume}})
    water.components["Collider"] = {"size": [length, 2.2, inner]}
    return group("Pool", [*parts, water], position=(-21.0, 0.0, 13.0))


def _lift() -> EntityNode:
    """A platform up to a landing, and down again."""
    platform: ComponentChanges = {"Material": {"base_color": list(_MOVES)}}
    lift = piece(
        "Lift",
        "moving_platform",
        (0.0, 0.125, 0.0),
        overrides={"Platform": platform, "Path/Point 2": {"Transform": {"position": [0.0, LANDING - 0.25, 0.0]}}},
    )
    landing = obstacle(
        "Landing", size=(4.0, LANDING, 2.4), position=(3.15, LANDING / 2.0, 0.0), color=_CAN, roughness=0.9
    )
    return group("Lift's place", [lift, landing], position=(14.0, 0.0, 13.0))

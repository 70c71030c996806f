"""All gameplay pieces in one park: a ball is sent round a course by what it meets, and everything else shows itself beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from elys.common.scene import ComponentChanges, EntityNode, SceneDocument
from elys.common.scene_files import PIECES, PREFAB_SUFFIX
from elys.samples.entities import PALETTE, Color, Vector, body, camera, group, obstacle, rounded, sun

_GROUND: Final[Color] = (0.30, 0.34, 0.24)
_DECK: Final[Color] = (0.44, 0.42, 0.38)
_QUARTER: Final = [0.0, 0.7071068, 0.0, 0.7071068]  # about y: what faced -z faces -x


def pieces() -> SceneDocument:
    """Four rows: what moves, what blows, what breaks and what counts."""
    floor = obstacle("Ground", size=(60.0, 1.0, 60.0), position=(0.0, -0.5, 0.0), color=_GROUND, friction=0.8)
    return SceneDocument(
        name="Pieces",
        entities=[
            sun((-0.5, -0.75, -0.42), intensity=3.2),
            camera((3.0, 10.5, 19.5), (0.0, 0.2, 0.5), field_of_view=0.74),
            floor,
            _movers(),
            _course(),
            _zones(),
            _shots(),
        ],
    )


def check_pieces(positions: Mapping[str, Sequence[float]]) -> str:
    """What is wrong with the final positions [m], by entity name: "" if belt, wind and signals have done their work."""
    if "Coin" in positions:
        return "the coin on the belt was not taken"
    x, y, z = positions["Parcel"]
    if x < 1.5:
        return f"the belt has not brought the parcel on, it is at ({x:.2f}, {y:.2f}, {z:.2f})"
    height = positions["Feather"][1]
    return "" if height > 2.5 else f"the wind does not carry the feather, it is {height:.2f} m high"


def piece(
    name: str,
    prefab: str,
    position: Vector,
    *,
    values: Mapping[str, Any] | None = None,
    rotation: Vector | None = None,
    overrides: dict[str, ComponentChanges] | None = None,
) -> EntityNode:
    """An instance of a piece that ELYS brings; `values` are fields of the script on its root."""
    placed: dict[str, Any] = {"position": rounded(position)}
    if rotation is not None:
        placed["rotation"] = list(rotation)
    components: ComponentChanges = {"Transform": placed}
    if values:
        components["Script"] = {"values": dict(values)}
    return EntityNode(
        name=name, prefab=f"{PIECES}{prefab}{PREFAB_SUFFIX}", components=components, overrides=overrides or {}
    )


def _movers() -> EntityNode:
    """Behind: a timer opens the first door, a plate under a box the second; a lift, a wheel and a gate that swings."""
    clock = EntityNode(
        name="Clock",
        components={
            "Transform": {},
            "Script": {
                "source": f"{PIECES}timer.py#Timer",
                "values": {"duration": 4.0, "rings": 2.0, "tells": "clock"},
            },
        },
    )
    rider = body("Rider", "box", size=(0.5, 0.5, 0.5), position=(0.4, 0.78, -6.0), color=PALETTE[2], friction=0.8)
    weight = body("Weight", "box", size=(0.5, 0.5, 0.5), position=(-5.0, 0.6, -3.4), color=PALETTE[6])
    return group(
        "Movers",
        [
            clock,
            piece("Timed door", "door", (-8.5, 0.0, -6.0), values={"signal": "clock"}),
            piece("Plate", "button", (-5.0, 0.0, -3.4), values={"tells": "plate"}),
            weight,
            piece("Plate's door", "door", (-5.0, 0.0, -6.0), values={"signal": "plate"}),
            piece("Lift", "moving_platform", (0.0, 0.4, -6.0), overrides=_path((0.0, 0.0, 0.0), (0.0, 2.2, 0.0))),
            rider,
            piece("Wheel", "rotator", (5.0, 0.0, -6.0), values={"speed": 1.5}),
            piece("Swing", "rotator", (9.5, 0.0, -4.0), values={"angle": 1.5708, "speed": 1.2}),
        ],
    )


def _path(*points: Vector) -> dict[str, ComponentChanges]:
    return {f"Path/Point {number}": {"Transform": {"position": list(at)}} for number, at in enumerate(points, 1)}


def _course() -> EntityNode:
    """In the middle: a belt brings a parcel past a coin; balls roll down a ramp through a gate into the goal, and come back."""
    ramp = obstacle("Ramp", size=(5.0, 0.2, 2.4), position=(4.6, 1.05, 0.0), color=_DECK)
    ramp.components["Transform"] = {
        "position": [4.6, 1.05, 0.0],
        "rotation": [0.0, 0.0, -0.1305262, 0.9914449],
        "scale": [5, 0.2, 2.4],
    }
    return group(
        "Course",
        [
            piece("Belt", "conveyor", (-1.5, 0.15, 0.0)),
            body("Parcel", "box", size=(0.6, 0.6, 0.6), position=(-4.0, 0.61, 0.0), color=PALETTE[1], friction=0.9),
            piece("Coin", "collectible", (-1.5, 0.9, 0.0)),
            piece(
                "Feeder",
                "spawner",
                (2.9, 2.2, 0.0),
                values={"prefab": f"{PIECES}respawning_ball{PREFAB_SUFFIX}", "interval": 2.5, "limit": 3},
            ),
            ramp,
            piece("Gate", "gate", (8.2, 0.0, 0.0), rotation=_QUARTER),
            piece("Goal", "goal", (11.2, 0.0, 0.0), rotation=_QUARTER, values={"gates": 1}),
            piece("Lava", "kill_zone", (14.2, 0.0, 0.0)),
        ],
    )


def _zones() -> EntityNode:
    """In front on the left: air that rises, water that lifts, and a flag to come back to."""
    feather = body(
        "Feather", "sphere", size=(0.5, 0.5, 0.5), position=(-8.5, 1.0, -1.0), color=PALETTE[7], density=120.0
    )
    rim = [
        obstacle("Near rim", size=(4.4, 1.0, 0.2), position=(-8.0, 0.5, 6.1), color=_DECK),
        obstacle("Far rim", size=(4.4, 1.0, 0.2), position=(-8.0, 0.5, 1.9), color=_DECK),
        obstacle("Left rim", size=(0.2, 1.0, 4.4), position=(-10.1, 0.5, 4.0), color=_DECK),
        obstacle("Right rim", size=(0.2, 1.0, 4.4), position=(-5.9, 0.5, 4.0), color=_DECK),
    ]
    corks = [
        body(
            f"Cork {number}",
            "box",
            size=(0.5, 0.5, 0.5),
            position=(-9.0 + number, 1.6, 3.4 + 0.6 * number),
            color=color,
        )
        for number, color in enumerate((PALETTE[0], PALETTE[2], PALETTE[3]))
    ]
    return group(
        "Zones",
        [
            piece("Wind", "wind", (-8.5, 0.0, -1.0)),
            feather,
            piece("Water", "water", (-8.0, 0.9, 4.0)),
            *rim,
            *corks,
            piece("Flag", "checkpoint", (-3.0, 0.0, 4.5), values={"number": 1}),
        ],
    )


def _shots() -> EntityNode:
    """In front on the right: a stack, and a cannon that shoots at it."""
    return group(
        "Shots",
        [
            piece("Stack", "breakable_stack", (3.5, 0.0, 3.6)),
            piece(
                "Cannon",
                "spawner",
                (3.5, 1.0, 10.0),
                values={
                    "prefab": f"{PIECES}shot{PREFAB_SUFFIX}",
                    "interval": 3.0,
                    "limit": 2,
                    "spread": [1.0, 0.0, 0.0],
                    "velocity": [0.0, 2.0, -16.0],
                },
            ),
        ],
    )

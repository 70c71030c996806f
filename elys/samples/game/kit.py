"""What levels are put together from: the road, gates, a ball with its camera, light, and things to hit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.mesh import Mesh, encode_mesh
from elys.common.assets.primitives import primitive
from elys.common.assets.store import AssetStore
from elys.common.components.input_map import ACTIONS
from elys.common.scene import EntityNode
from elys.common.scene_files import PIECES
from elys.samples.entities import body, group, material, rounded, sun
from elys.samples.game.course import Course, Place

BALL_DIAMETER: Final = 1.0  # [m]
BALL_MASS: Final = 8.0  # [kg]
PLAYER_COLORS: Final = ((0.90, 0.28, 0.05), (0.06, 0.30, 0.75), (0.10, 0.50, 0.15), (0.55, 0.12, 0.45))
FALL: Final = 5.0  # [m] below the road, and above the ground, at which a ball has fallen
FERRY_HEIGHT: Final = 0.4  # [m]
WIDE: Final = 16.0 / 9.0  # heights of the picture
_GORES: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Medals:
    """Times [s] that earn them; at first those of `race.py`."""

    gold: float = 30.0
    silver: float = 40.0
    bronze: float = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Daylight:
    """A sun and the sky around it; colours are linear."""

    direction: tuple[float, float, float] = (-0.5, -0.75, -0.35)  # into which the sun shines
    sun: float = 3.4  # [lx]
    sun_color: tuple[float, float, float] = (1.0, 0.93, 0.82)
    sky: float = 0.42  # radiance of a white level surface in the shade
    sky_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    turbidity: float = 2.2

    def entities(self) -> list[EntityNode]:
        """What shines."""
        lamp = sun(self.direction, intensity=self.sun)
        lamp.components["Light"] = {**(lamp.components["Light"] or {}), "color": list(self.sun_color)}
        sky = {
            "kind": "sky",
            "turbidity": self.turbidity,
            "intensity": self.sky,
            "color": list(self.sky_color),
        }
        return [lamp, EntityNode(name="Sky", components={"Transform": {}, "Environment": sky})]


def script(name: str, **values: Any) -> dict[str, Any]:
    """A Script component: one of the game's behaviours, as "ball.py#Ball"."""
    return piece(f"game/{name}", **values)


def piece(name: str, **values: Any) -> dict[str, Any]:
    """A Script component of one of the pieces that ELYS brings, as "rotator.py#Rotator"."""
    return {"source": f"{PIECES}{name}", "values": values} if values else {"source": f"{PIECES}{name}"}


def road(course: Course, assets: AssetStore, *, friction: float = 1.2) -> EntityNode:
    """All stretches of a course, to be rolled along."""
    stretches = []
    for number, stretch in enumerate(s for s in course.stretches if len(s.places) > 1):
        mesh, origin = stretch.mesh()
        stretches.append(
            EntityNode(
                name=f"Stretch {number + 1}",
                components={
                    "Transform": {"position": rounded(origin)},
                    "Collider": {"shape": "mesh", "friction": friction},
                    "MeshRenderer": {"mesh": assets.put(encode_mesh(mesh), kind="mesh")},
                    "Material": {"base_color": [1.0, 1.0, 1.0], "roughness": 0.75},
                },
            )
        )
    return group("Road", stretches)


def gate(place: Place, number: int, *, width: float, height: float = 5.0) -> EntityNode:
    """A lit arch across the road, that counts when it is gone through the way the road leads."""
    half = width / 2.0
    posts = [
        ("Left", (-half, height / 2.0, 0.0), (0.3, height, 0.3)),
        ("Right", (half, height / 2.0, 0.0), (0.3, height, 0.3)),
    ]
    parts = [*posts, ("Beam", (0.0, height, 0.0), (2.0 * half + 0.3, 0.35, 0.35))]
    return EntityNode(
        name=f"Gate {number}",
        components={
            "Transform": {"position": place.at(), "rotation": _upright(place)},
            "Script": script("race.py#Gate", number=number, width=round(width, 4), height=height),
        },
        children=[
            EntityNode(
                name=name,
                components={
                    "Transform": {"position": rounded(position), "scale": rounded(size)},
                    "MeshRenderer": {"mesh": "box"},
                    "Material": material((0.10, 0.11, 0.13), roughness=0.4),
                },
            )
            for name, position, size in parts
        ],
    )


def player(place: Place, number: int, assets: AssetStore, *, side: float = 0.0) -> list[EntityNode]:
    """A ball at the start, and the camera that follows it."""
    name = f"Ball {number}"
    mesh = assets.put(encode_mesh(striped_ball(PLAYER_COLORS[number - 1])), kind="mesh")
    eye = place.at(right=side, up=3.4, forward=-6.5)
    ball = EntityNode(
        name=name,
        components={
            "Transform": {
                "position": place.at(right=side, up=BALL_DIAMETER / 2.0),
                "rotation": _upright(place),
                "scale": [BALL_DIAMETER] * 3,
            },
            "RigidBody": {"mass": BALL_MASS},
            "Collider": {"shape": "sphere", "friction": 1.2, "restitution": 0.15, "rolling_friction": 0.002},
            "MeshRenderer": {"mesh": mesh},
            "Material": {"base_color": [1.0, 1.0, 1.0], "roughness": 0.35, "clearcoat": 0.6},
            "Script": script("ball.py#Ball", player=number),
        },
    )
    camera = EntityNode(
        name=f"Camera {number}",
        components={
            "Transform": {"position": eye, "rotation": _upright(place)},
            "RigidBody": {"motion": "kinematic"},
            "Camera": {"field_of_view": 1.05, "player": number, "far": 2500.0},
            "Script": script("ball.py#ChaseCamera", ball=name),
        },
    )
    return [ball, camera]


def controls() -> EntityNode:
    """What players can do, and with which keys."""
    actions = {name: ACTIONS[name] for name in ("jump", "use", "pause", "restart")}
    actions["confirm"] = "enter, space, pad_a"
    return EntityNode(name="Controls", components={"Transform": {}, "InputMap": {"actions": actions}})


def hud(number: int) -> EntityNode:
    """What stands on a player's picture."""
    lines = (
        ("Clock", {"anchor": "top", "y": 0.025}, {"text": "{:time}", "size": 0.075, "outline": 0.08}),
        ("Gates", {"anchor": "top_right", "x": -0.04, "y": 0.035}, {"text": "", "size": 0.05, "outline": 0.08}),
        (
            "Speed",
            {"anchor": "bottom_left", "x": 0.04, "y": -0.035},
            {"text": "{:.0f} km/h", "size": 0.045, "outline": 0.08},
        ),
        ("Message", {"anchor": "top", "y": 0.13}, {"text": "", "size": 0.12, "outline": 0.08, "align": "center"}),
    )
    return EntityNode(
        name=f"Display {number}",
        components={
            "Overlay": {"width": WIDE, "height": 1.0, "anchor": "center", "player": number},
            "Script": script("hud.py#Hud", player=number),
        },
        children=[
            EntityNode(name=name, components={"Overlay": place, "OverlayText": text}) for name, place, text in lines
        ],
    )


def menu() -> EntityNode:
    """Which level to race on, and how; its lines are filled in by who knows the times."""
    title = {"text": "Time trial", "size": 0.09, "color": [1.0, 0.8, 0.25]}
    keys = {
        "text": "arrows: choose, change   space: go   P: pause   backspace: again   E: last gate",
        "size": 0.026,
    }
    return EntityNode(
        name="Menu",
        components={
            "Overlay": {"anchor": "center", "width": 1.0, "height": 0.78, "visible": False},
            "OverlayPanel": {"color": [0.015, 0.02, 0.03], "opacity": 0.95, "radius": 0.03},
            "Script": script("menu.py#Menu"),
        },
        children=[
            EntityNode(name="Title", components={"Overlay": {"anchor": "top", "y": 0.05}, "OverlayText": title}),
            EntityNode(name="Rows", components={"Overlay": {"anchor": "top", "y": 0.18, "width": 0.9, "height": 0.6}}),
            EntityNode(name="Keys", components={"Overlay": {"anchor": "bottom", "y": -0.035}, "OverlayText": keys}),
        ],
    )


def race(medals: Medals) -> EntityNode:
    """What measures."""
    values = {"gold": medals.gold, "silver": medals.silver, "bronze": medals.bronze, "fall": FALL}
    return EntityNode(name="Race", components={"Transform": {}, "Script": script("race.py#Race", **values)})


def wall_of_boxes(
    place: Place,
    *,
    columns: int,
    rows: int,
    size: Sequence[float] = (1.0, 0.7, 0.6),
    colors: Sequence[Any] = PLAYER_COLORS,
) -> EntityNode:
    """Light boxes in courses like bricks, across the road, to be driven through."""
    boxes = []
    for row in range(rows):
        shift = (row % 2) * 0.5
        for column in range(columns - row % 2):
            right = (column + shift - (columns - 1) / 2.0) * (size[0] + 0.01)
            boxes.append(
                body(
                    f"Brick {row + 1}.{column + 1}",
                    "box",
                    size=size,
                    position=place.at(right=right, up=size[1] * (row + 0.5)),
                    rotation=_upright(place),
                    color=colors[(row + column) % len(colors)],
                    density=3.0,  # light and slippery enough that who comes slowly pushes them away as well
                    friction=0.3,
                )
            )
    return group("Bricks", boxes)


def ferry(
    name: str, near: Place, far: Place, *, length: float = 4.0, width: float = 4.0, speed: float = 3.0
) -> EntityNode:
    """A platform that goes to and fro between two edges, and waits at each."""
    first, last = docks(near, far, length=length)
    travel = [round(float(value), 4) for value in last - first]
    return EntityNode(
        name=name,
        components={
            "Transform": {
                "position": [round(float(value), 4) for value in first],
                "rotation": _upright(near),
                "scale": [width, FERRY_HEIGHT, length],
            },
            "RigidBody": {"motion": "kinematic"},
            "Collider": {"friction": 1.2},
            "MeshRenderer": {"mesh": "box"},
            "Material": material((0.80, 0.42, 0.05), roughness=0.6),
            "Script": piece("moving_platform.py#MovingPlatform", travel=travel, speed=speed, pause=1.6, ease="smooth"),
        },
    )


def docks(near: Place, far: Place, *, length: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the middle of a ferry waits at either edge, its top as high as the road."""
    down = np.array([0.0, FERRY_HEIGHT / 2.0, 0.0])
    away = length / 2.0 + 0.12
    return near.position + away * near.forward - down, far.position - away * far.forward - down


def bar(name: str, place: Place, *, length: float, speed: float) -> EntityNode:
    """A bar that turns just above the road about an upright axis, and sweeps away what does not wait or jump."""
    return EntityNode(
        name=name,
        components={
            "Transform": {"position": place.at(up=0.45), "rotation": _upright(place), "scale": [length, 0.35, 0.35]},
            "RigidBody": {"motion": "kinematic"},
            "Collider": {"friction": 0.4},
            "MeshRenderer": {"mesh": "box"},
            "Material": material((0.70, 0.07, 0.05), roughness=0.5),
            "Script": piece("rotator.py#Rotator", speed=speed),
        },
    )


def boost(name: str, place: Place, *, length: float = 5.0, width: float = 3.0, speed: float = 26.0) -> EntityNode:
    """A stretch of wind that hurries what rolls along it."""
    wind = [round(float(value), 4) for value in speed * place.forward]
    glow = {"emissive": [0.1, 1.6, 2.2], "base_color": [0.02, 0.3, 0.4], "roughness": 0.4}
    arrows = [
        EntityNode(
            name=f"Mark {number + 1}",
            components={
                "Transform": {
                    "position": [0.0, 0.02, length * (0.5 - (number + 0.5) / 3.0)],
                    "scale": [width, 0.03, 0.5],
                },
                "MeshRenderer": {"mesh": "box", "cast_shadows": False},
                "Material": glow,
            },
        )
        for number in range(3)
    ]
    return EntityNode(
        name=name,
        components={
            "Transform": {"position": place.at(), "rotation": _upright(place)},
            "Collider": {"size": [width, 2.0, length], "offset": [0, 1, 0], "is_trigger": True},
            "Script": piece("force_zone.py#ForceZone", wind=wind, drag=2.5),
        },
        children=arrows,
    )


def striped_ball(color: tuple[float, float, float]) -> Mesh:
    """A sphere of diameter 1 in gores of two colours, so that its rolling is seen."""
    plain = primitive("sphere")
    corners = plain.positions[plain.indices].reshape(-1, 3, 3)
    normals = plain.normals[plain.indices].reshape(-1, 3)
    middle = corners.mean(axis=1)
    sector = np.floor((np.arctan2(middle[:, 2], middle[:, 0]) / math.tau + 1.0) * _GORES).astype(int) % 2
    tinted = np.where(sector[:, None] == 1, np.array([[*color, 1.0]]), np.array([[0.86, 0.84, 0.78, 1.0]]))
    return Mesh(
        positions=corners.reshape(-1, 3).astype(np.float32),
        normals=normals.astype(np.float32),
        uvs=plain.uvs[plain.indices].astype(np.float32),
        colors=np.repeat(tinted, 3, axis=0).astype(np.float32),
        indices=np.arange(len(normals), dtype=np.uint32),
    )


def _upright(place: Place) -> list[float]:
    """How a thing stands that looks along the road, straight up however the road lies."""
    yaw = math.atan2(-place.forward[0], -place.forward[2])
    return [0.0, round(math.sin(yaw / 2.0), 7), 0.0, round(math.cos(yaw / 2.0), 7)]

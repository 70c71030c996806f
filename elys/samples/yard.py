"""The demo: 200 boxes and spheres rain in tidy layers into a walled yard, around a stone lantern."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from elys.common.assets import AssetStore
from elys.common.assets.gltf import import_gltf
from elys.common.errors import AssetError
from elys.common.math import quaternion
from elys.common.scene import EntityNode, SceneDocument, SceneSettings, scene_bounds
from elys.samples.entities import PALETTE, STONE, Color, body, camera, group, obstacle, ornament, rounded, sun

BODY_COUNT: Final = 200
HALF_WIDTH: Final = 6.0  # [m] from the middle to the inside of a wall
WALL_HEIGHT: Final = 1.6  # [m]
_WALL_THICKNESS: Final = 0.4  # [m]
_SPACING: Final = 1.2  # [m] between the middles of neighbours in a layer: more than any body's diameter
_LAYER_HEIGHT: Final = 1.3  # [m]
_FIRST_LAYER: Final = 3.6  # [m] above the ground, clear of the lantern
_MODEL_HEIGHT: Final = 2.0  # [m] of the model's longest side
_MODEL_DENSITY: Final = 300.0  # [kg/m3] of the box around it: mostly air

_GROUND: Final[Color] = (0.42, 0.40, 0.35)
_WALL: Final[Color] = (0.55, 0.33, 0.24)
_SLATE: Final[Color] = (0.10, 0.11, 0.13)
_GLOW: Final[Color] = (5.0, 2.4, 0.7)


def yard() -> SceneDocument:
    """The yard with its lantern in the middle."""
    return _document("Yard", [_lantern(), _rain(_FIRST_LAYER)])


def yard_with_model(model_path: str | Path) -> SceneDocument:
    """The yard, into which a glTF model, scaled to 2 m, falls as one rigid body onto the 200 boxes and spheres.

    The document names the model by its absolute path. Raises AssetError if the model cannot be read or has nothing to draw.
    """
    return _document("Yard with a model", [_rain(1.0), _model(Path(model_path).absolute())])


def check_yard(positions: Mapping[str, Sequence[float]]) -> str:
    """What is wrong with the final positions [m], by entity name: "" if all that rained lies within the walls, on the ground."""
    for name, (x, y, z) in positions.items():
        if not name.startswith(("Box ", "Sphere ")):
            continue
        if not (abs(x) <= HALF_WIDTH and abs(z) <= HALF_WIDTH):
            return f"{name} left the yard, it is at ({x:.2f}, {y:.2f}, {z:.2f})"
        if not 0.1 <= y <= _FIRST_LAYER:
            return f"{name} is {y:.2f} m high, in the ground or still in the air"
    return ""


def _document(name: str, contents: list[EntityNode]) -> SceneDocument:
    surroundings = [
        sun((-0.55, -0.75, -0.35), intensity=3.2),
        camera((7.4, 10.0, 13.6), (0.0, 0.1, 0.7), field_of_view=0.72),
        _walls(),
    ]
    return SceneDocument(name=name, settings=SceneSettings(), entities=surroundings + contents)


def _walls() -> EntityNode:
    outside = 2.0 * (HALF_WIDTH + _WALL_THICKNESS)
    middle = HALF_WIDTH + _WALL_THICKNESS / 2.0
    height = WALL_HEIGHT / 2.0
    along_x, along_z = (outside, WALL_HEIGHT, _WALL_THICKNESS), (_WALL_THICKNESS, WALL_HEIGHT, 2.0 * HALF_WIDTH)
    return group(
        "Walls",
        [
            obstacle("Ground", size=(60.0, 1.0, 60.0), position=(0.0, -0.5, 0.0), color=_GROUND, roughness=0.95),
            obstacle("North", size=along_x, position=(0.0, height, -middle), color=_WALL),
            obstacle("South", size=along_x, position=(0.0, height, middle), color=_WALL),
            obstacle("West", size=along_z, position=(-middle, height, 0.0), color=_WALL),
            obstacle("East", size=along_z, position=(middle, height, 0.0), color=_WALL),
        ],
    )


def _lantern() -> EntityNode:
    """A lantern of stone, as they stand in gardens; what things bounce off are its boxes."""
    parts = [
        obstacle("Step", size=(2.2, 0.25, 2.2), position=(0.0, 0.125, 0.0)),
        obstacle("Base", size=(1.5, 0.25, 1.5), position=(0.0, 0.375, 0.0)),
        obstacle("Post", size=(0.5, 0.9, 0.5), position=(0.0, 0.95, 0.0)),
        ornament("Ring", "cylinder", size=(0.8, 0.12, 0.8), position=(0.0, 0.92, 0.0)),
        obstacle("Table", size=(1.2, 0.16, 1.2), position=(0.0, 1.48, 0.0)),
        ornament("Flame", "sphere", size=(0.44, 0.44, 0.44), position=(0.0, 1.9, 0.0), emissive=_GLOW),
        obstacle("Eaves", size=(1.5, 0.12, 1.5), position=(0.0, 2.3, 0.0), color=_SLATE, roughness=0.5),
        ornament("Roof", "cone", size=(1.7, 0.6, 1.7), position=(0.0, 2.66, 0.0), color=_SLATE, roughness=0.5),
        ornament(
            "Finial",
            "sphere",
            size=(0.26, 0.26, 0.26),
            position=(0.0, 3.02, 0.0),
            color=(0.9, 0.68, 0.3),
            roughness=0.25,
            metallic=1.0,
        ),
    ]
    for name, x, z in (("Pillar A", 1, 1), ("Pillar B", -1, 1), ("Pillar C", -1, -1), ("Pillar D", 1, -1)):
        parts.append(obstacle(name, size=(0.16, 0.68, 0.16), position=(0.46 * x, 1.9, 0.46 * z), color=STONE))
    lamp = EntityNode(
        name="Lamp",
        components={
            "Transform": {"position": [0, 1.9, 0]},
            "Light": {"kind": "point", "color": [1, 0.62, 0.28], "intensity": 6, "range": 6, "cast_shadows": False},
        },
    )
    return group("Lantern", [*parts, lamp])


def _rain(height: float) -> EntityNode:
    """The bodies, in layers of a grid, each turned and coloured by chance (always the same)."""
    chance = random.Random(2024)
    columns = 8  # leaves a margin in which what bounces off the pile still meets a wall
    places = [
        ((x - (columns - 1) / 2.0) * _SPACING, (z - (columns - 1) / 2.0) * _SPACING)
        for x in range(columns)
        for z in range(columns)
    ]
    bodies: list[EntityNode] = []
    layer = 0
    while len(bodies) < BODY_COUNT:
        chance.shuffle(places)
        for x, z in places[: min(BODY_COUNT - len(bodies), 50)]:
            bodies.append(_drop(len(bodies), (x, height + layer * _LAYER_HEIGHT, z), chance))
        layer += 1
    return group("Rain", bodies)


def _drop(number: int, position: tuple[float, float, float], chance: random.Random) -> EntityNode:
    color = chance.choice(PALETTE)
    metallic = float(chance.random() < 0.15)
    roughness = round(chance.uniform(0.25, 0.8), 2)
    if number % 2:
        diameter = round(chance.uniform(0.4, 0.9), 2)
        return body(
            f"Sphere {number // 2 + 1}",
            "sphere",
            size=(diameter,) * 3,
            position=position,
            friction=0.5,
            restitution=0.25,
            color=color,
            metallic=metallic,
            roughness=roughness,
        )
    # The diagonal stays below the grid's spacing, so that no two touch, however they are turned.
    size = [round(chance.uniform(0.35, 0.65), 2) for _ in range(3)]
    axis = [chance.gauss(0.0, 1.0) for _ in range(3)]
    rotation = quaternion.from_axis_angle(axis, chance.uniform(0.0, math.pi)).tolist()
    return body(
        f"Box {number // 2 + 1}",
        "box",
        size=size,
        position=position,
        rotation=rotation,
        restitution=0.1,
        color=color,
        metallic=metallic,
        roughness=roughness,
    )


def _model(path: Path) -> EntityNode:
    """A rigid body with a box collider around the model, which hangs below it so that the body's origin is the box's middle."""
    assets = AssetStore()
    lower, upper = scene_bounds(import_gltf(path, assets), assets)
    if not np.isfinite(lower).all():
        raise AssetError(f"{path} has nothing to draw, so nothing that could fall")
    scale = _MODEL_HEIGHT / max(float((upper - lower).max()), 1e-6)
    size = np.maximum((upper - lower) * scale, 0.02)
    position = -(lower + upper) / 2.0 * scale
    appearance = EntityNode(
        prefab=str(path),
        components={"Transform": {"position": rounded(position), "scale": [float(f"{scale:.6g}")] * 3}},
    )
    return EntityNode(
        name="Model",
        components={
            "Transform": {
                "position": [0, 9, 0],
                "rotation": [round(x, 7) for x in quaternion.from_euler((0.25, 0.5, 0.15)).tolist()],
            },
            "RigidBody": {"mass": float(f"{_MODEL_DENSITY * float(size.prod()):.4g}")},
            "Collider": {"size": rounded(size), "friction": 0.6, "restitution": 0.1},
        },
        children=[appearance],
    )

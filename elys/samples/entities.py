"""The pieces that sample scenes are built of: bodies, obstacles, lights and cameras as EntityNodes with rounded numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from elys.common.scene import EntityNode, camera_components, sun_components

Vector = Sequence[float]
Color = tuple[float, float, float]

# Linear colours that go together; light and dark enough to be told apart under a sun.
PALETTE: Final[tuple[Color, ...]] = (
    (0.80, 0.18, 0.10),  # vermilion
    (0.90, 0.45, 0.06),  # amber
    (0.85, 0.70, 0.20),  # straw
    (0.22, 0.48, 0.16),  # moss
    (0.05, 0.36, 0.40),  # teal
    (0.10, 0.22, 0.58),  # cobalt
    (0.38, 0.14, 0.42),  # plum
    (0.82, 0.78, 0.70),  # chalk
)
STONE: Final[Color] = (0.36, 0.34, 0.31)
_DECIMALS: Final = 4


def group(name: str, children: list[EntityNode], *, position: Vector = (0.0, 0.0, 0.0)) -> EntityNode:
    """An entity that holds others together."""
    return EntityNode(name=name, components={"Transform": _transform(position)}, children=children)


def body(
    name: str,
    shape: Literal["box", "sphere", "cylinder"],
    *,
    size: Vector,
    position: Vector,
    rotation: Vector | None = None,
    color: Color = PALETTE[-1],
    density: float = 500.0,
    roughness: float = 0.6,
    metallic: float = 0.0,
    friction: float = 0.5,
    restitution: float = 0.0,
    velocity: Vector | None = None,
) -> EntityNode:
    """A dynamic body: `size` [m] are the edges of the box around it, `density` [kg/m3] gives the mass."""
    volume = math.prod(size) * {"box": 1.0, "sphere": math.pi / 6.0, "cylinder": math.pi / 4.0}[shape]
    rigid_body: dict[str, Any] = {"mass": float(f"{density * volume:.4g}")}
    if velocity is not None:
        rigid_body["linear_velocity"] = rounded(velocity)
    return EntityNode(
        name=name,
        components={
            # The unit mesh and the unit collider are scaled together.
            "Transform": _transform(position, rotation, size),
            "RigidBody": rigid_body,
            "Collider": {"shape": shape, "friction": friction, "restitution": restitution},
            "MeshRenderer": {"mesh": shape},
            "Material": material(color, roughness=roughness, metallic=metallic),
        },
    )


def joined(node: EntityNode, kind: str, other: str, **values: Any) -> EntityNode:
    """The entity, joined to another by name; `values` are those of a Joint."""
    node.components["Joint"] = {"kind": kind, "other": other, **values}
    return node


def obstacle(
    name: str, *, size: Vector, position: Vector, color: Color = STONE, roughness: float = 0.8, friction: float = 0.6
) -> EntityNode:
    """A box that never moves, `size` [m] along its axes."""
    return EntityNode(
        name=name,
        components={
            "Transform": _transform(position, None, size),
            "Collider": {"friction": friction},
            "MeshRenderer": {"mesh": "box"},
            "Material": material(color, roughness=roughness),
        },
    )


def ornament(
    name: str,
    mesh: str,
    *,
    size: Vector,
    position: Vector,
    rotation: Vector | None = None,
    color: Color = STONE,
    roughness: float = 0.6,
    metallic: float = 0.0,
    emissive: Color | None = None,
) -> EntityNode:
    """Something to look at that collides with nothing."""
    values = material(color, roughness=roughness, metallic=metallic)
    if emissive is not None:
        values["emissive"] = list(emissive)
    return EntityNode(
        name=name,
        components={
            "Transform": _transform(position, rotation, size),
            "MeshRenderer": {"mesh": mesh},
            "Material": values,
        },
    )


def sun(direction: Vector = (-0.45, -0.8, -0.4), *, intensity: float = 3.0) -> EntityNode:
    """Light from far away along `direction`."""
    return EntityNode(name="Sun", components=dict(sun_components(direction, intensity=intensity)))


def camera(eye: Vector, target: Vector, *, field_of_view: float = 0.9) -> EntityNode:
    """A camera at `eye` that looks at `target`; `field_of_view` is vertical [rad]."""
    return EntityNode(name="Camera", components=dict(camera_components(eye, target, field_of_view=field_of_view)))


def material(color: Color, *, roughness: float = 0.6, metallic: float = 0.0) -> dict[str, Any]:
    """A Material's values for a plain surface."""
    return {"base_color": list(color), "metallic": metallic, "roughness": roughness}


def rounded(vector: Vector | NDArray[np.float64]) -> list[float]:
    """A tenth of a millimetre is enough for a file that people read."""
    return [round(float(x), _DECIMALS) for x in vector]


def _transform(position: Vector, rotation: Vector | None = None, scale: Vector | None = None) -> dict[str, Any]:
    values: dict[str, Any] = {"position": rounded(position)}
    if rotation is not None:
        values["rotation"] = [round(float(x), 7) for x in rotation]
    if scale is not None:
        values["scale"] = rounded(scale)
    return values

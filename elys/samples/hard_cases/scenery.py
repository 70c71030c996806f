"""The pieces of hard cases: bodies with exact numbers, where the samples for the eye have rounded ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from elys.common.math import quaternion
from elys.common.scene import EntityNode, SceneDocument, SceneSettings
from elys.samples.entities import PALETTE, STONE, Color, Vector, camera, material, sun

Numbers = Vector | np.ndarray[Any, Any]

ABOUT_Z: Final = [0.0, 0.0, 1.0]
NO_TOUCH: Final = {"mask": 0}  # of a Collider that gives its body an inertia and meets nothing
G: Final = 9.81  # [m/s^2]
DARK: Final[Color] = (0.10, 0.11, 0.13)
IRON: Final[Color] = (0.30, 0.31, 0.33)
WOOD: Final[Color] = (0.52, 0.33, 0.16)
_GROUND: Final[Color] = (0.42, 0.40, 0.35)
_UNIT: Final = (1.0, 1.0, 1.0)


def about_z(angle: float) -> np.ndarray[Any, Any]:
    """The quaternion of a turn by `angle` about z [rad]."""
    return np.asarray(quaternion.from_axis_angle((0.0, 0.0, 1.0), angle))


def scene(
    name: str,
    entities: Sequence[EntityNode],
    *,
    eye: Vector,
    target: Vector,
    field_of_view: float = 0.7,
    **settings: Any,
) -> SceneDocument:
    """A document with a sun and a camera at `eye` that looks at `target` [m]."""
    view = camera(eye, target, field_of_view=field_of_view)
    lit = sun((-0.5, -0.75, -0.45), intensity=3.2)
    return SceneDocument(name=name, settings=SceneSettings(**settings), entities=[lit, view, *entities])


def solid(
    name: str,
    shape: str,
    *,
    size: Numbers = _UNIT,
    position: Numbers,
    rotation: Numbers | None = None,
    color: Color = PALETTE[0],
    friction: float = 0.5,
    restitution: float = 0.0,
    collider: Mapping[str, Any] | None = None,
    joint: Mapping[str, Any] | None = None,
    children: Sequence[EntityNode] = (),
    mesh: str = "",
    metallic: float = 0.0,
    roughness: float = 0.6,
    **rigid_body: Any,
) -> EntityNode:
    """A body, dynamic where nothing else is said: `size` [m] are the edges of the box around it.

    `collider` are further values of its Collider, `joint` those of its Joint, `rigid_body` those of its RigidBody (mass 1 kg).
    """
    components: dict[str, dict[str, Any] | None] = {
        # The unit mesh and the unit collider are scaled together.
        "Transform": transform(position, rotation, size),
        "RigidBody": {key: _plain(value) for key, value in rigid_body.items()},
        "Collider": {"shape": shape, "friction": friction, "restitution": restitution, **(collider or {})},
        "MeshRenderer": {"mesh": mesh or ("cone" if shape == "hull" else shape)},
        "Material": material(color, roughness=roughness, metallic=metallic),
    }
    if joint is not None:
        components["Joint"] = {key: _plain(value) for key, value in joint.items()}
    return EntityNode(name=name, components=components, children=list(children))


def fixture(
    name: str,
    *,
    size: Numbers = _UNIT,
    position: Numbers,
    rotation: Numbers | None = None,
    color: Color = STONE,
    friction: float = 0.5,
    restitution: float = 0.0,
    shape: str = "box",
    collider: Mapping[str, Any] | None = None,
) -> EntityNode:
    """Something that never moves."""
    return EntityNode(
        name=name,
        components={
            "Transform": transform(position, rotation, size),
            "Collider": {"shape": shape, "friction": friction, "restitution": restitution, **(collider or {})},
            "MeshRenderer": {"mesh": shape},
            "Material": material(color, roughness=0.85),
        },
    )


def ground(
    *, friction: float = 0.5, restitution: float = 0.0, width: float = 60.0, center: Vector = (0.0, 0.0)
) -> EntityNode:
    """A slab whose top is at y = 0."""
    return fixture(
        "Ground",
        size=(width, 1.0, width),
        position=(center[0], -0.5, center[1]),
        color=_GROUND,
        friction=friction,
        restitution=restitution,
    )


def part(
    name: str,
    *,
    size: Numbers,
    position: Numbers,
    rotation: Numbers | None = None,
    color: Color = STONE,
    friction: float = 0.5,
    density: float = 0.0,
    shape: str = "box",
) -> EntityNode:
    """One of several colliders of the body it stands below; `position` is in that body's space, which must not be stretched."""
    node = fixture(name, size=size, position=position, rotation=rotation, color=color, friction=friction, shape=shape)
    if density:
        node.components["Collider"] = {**(node.components["Collider"] or {}), "density": density}
    return node


def frame(
    name: str,
    *,
    position: Numbers,
    rotation: Numbers | None = None,
    children: Sequence[EntityNode],
    **rigid_body: Any,
) -> EntityNode:
    """A body that is made of the parts below it."""
    return EntityNode(
        name=name,
        components={
            "Transform": transform(position, rotation),
            "RigidBody": {key: _plain(value) for key, value in rigid_body.items()},
        },
        children=list(children),
    )


def transform(position: Numbers, rotation: Numbers | None = None, scale: Numbers | None = None) -> dict[str, Any]:
    """A Transform's values, as exact as they are given."""
    values: dict[str, Any] = {"position": _plain(position)}
    if rotation is not None:
        values["rotation"] = _plain(rotation)
    if scale is not None:
        values["scale"] = _plain(scale)
    return values


def _plain(value: Any) -> Any:
    """What a file can hold."""
    if isinstance(value, str | bool | int | float):
        return value
    return [float(x) for x in value]

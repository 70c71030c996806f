"""What the Add menu offers: records of new entities."""

from __future__ import annotations

from typing import Any, Final

from elys.common.scene import EntityRecord

_DYNAMIC: Final[dict[str, Any]] = {"RigidBody": {}, "Material": {}}
PRIMITIVES: Final[dict[str, dict[str, dict[str, Any]]]] = {
    "Empty": {"Transform": {}},
    "Box": {"Transform": {}, "MeshRenderer": {"mesh": "box"}, "Collider": {"shape": "box"}, **_DYNAMIC},
    "Sphere": {"Transform": {}, "MeshRenderer": {"mesh": "sphere"}, "Collider": {"shape": "sphere"}, **_DYNAMIC},
    "Light": {"Transform": {}, "Light": {"kind": "point", "intensity": 40.0}},
    "Camera": {"Transform": {}, "Camera": {}},
}


def primitive_record(kind: str, *, name: str, position: tuple[float, float, float]) -> EntityRecord:
    """A record for one of PRIMITIVES at `position` [m] in its parent's space; KeyError for another kind."""
    components = {component: dict(values) for component, values in PRIMITIVES[kind].items()}
    components["Transform"]["position"] = list(position)
    return EntityRecord(name=name, components=components)

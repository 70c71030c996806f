"""What an entity is at a glance: the kind that its icon, the sorting and the filter `t:` go by."""

from __future__ import annotations

from typing import Final, NamedTuple

from elys.bus.mirror import MirrorEntity
from elys.common.assets.primitives import PRIMITIVES

EMPTY: Final = "Empty"
# The first component that an entity has decides, so what is special stands before what many have.
_KINDS: Final = (
    ("Light", "Light"),
    ("Environment", "Environment"),
    ("Camera", "Camera"),
    ("Animation", "Animation"),
    ("Joint", "Joint"),
    ("MeshRenderer", "Mesh"),
    ("RigidBody", "Body"),
    ("Collider", "Collider"),
    ("Script", "Script"),
)
KIND_NAMES: Final = (*(name for _, name in _KINDS), EMPTY)
_LIGHT_KINDS: Final = ("directional", "point", "spot")
DETAILS: Final = (*PRIMITIVES, *_LIGHT_KINDS)  # of a kind: which mesh, which light


class EntityKind(NamedTuple):
    """`name` is one of KIND_NAMES; `detail` one of DETAILS, or empty."""

    name: str
    detail: str


_NOTHING: Final = EntityKind(EMPTY, "")


def kind_of(entity: MirrorEntity) -> EntityKind:
    """What an entity is, by its components."""
    components = entity.components
    for component, name in _KINDS:
        if component in components:
            if name == "Light":
                return EntityKind(name, getattr(components["Light"], "kind", ""))
            mesh = getattr(components.get("MeshRenderer"), "mesh", "")
            return EntityKind(name, mesh if mesh in PRIMITIVES else "")
    return _NOTHING

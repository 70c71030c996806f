"""What an entity is at a glance: the kind that its icon, the sorting and the filter `t:` go by."""

from __future__ import annotations

from typing import Final, NamedTuple

from elys.bus.messages.scene import ComponentRemoved, ComponentSet
from elys.bus.mirror import MirrorEntity, MirrorUpdate
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
    ("InputMap", "Input"),
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


class EntityKinds:
    """The kinds of entities, each worked out once. `follow` must hear of every change of the mirror that they are of."""

    def __init__(self) -> None:
        self._known: dict[int, EntityKind] = {}

    def of(self, entity: MirrorEntity) -> EntityKind:
        """What an entity is."""
        kind = self._known.get(entity.id)
        if kind is None:
            kind = self._known[entity.id] = kind_of(entity)
        return kind

    def follow(self, update: MirrorUpdate) -> None:
        """Hears of a change."""
        if update.reset:
            self._known.clear()
        for entity in update.removed:
            self._known.pop(entity, None)
        for change in update.changes:
            if isinstance(change, ComponentSet | ComponentRemoved):
                self._known.pop(change.entity, None)

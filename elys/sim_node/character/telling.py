"""What a tick writes into characters and rigs that their readers know: wishes, where they face, the size of a capsule.

Systems write straight into columns, which logs no change; few of these fields change in a tick, so they are compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import numpy as np

from elys.common.components import CameraRig, Character, Collider
from elys.common.components.declaration import Component, declaration_of
from elys.common.ids import Entity
from elys.sim_node.ecs.changes import WorldChanges
from elys.sim_node.ecs.world import World
from elys.sim_node.scene.edited_values import MOVED

_SIZE: Final = ("half_length", "offset")
_WRITTEN: Final[dict[type[Component], tuple[str, ...]]] = {
    kind: tuple(name for name in MOVED[kind.__name__] if not declaration_of(kind).field(name).is_memory)
    for kind in (Character, CameraRig)
} | {Collider: _SIZE}


@contextmanager
def told(world: World, changes: list[WorldChanges], *kinds: type[Component]) -> Iterator[None]:
    """Within it columns of these components are written: appends to `changes` whose told fields are others at its end."""
    before = {kind: [world.table(kind).column(name).copy() for name in _WRITTEN[kind]] for kind in kinds}
    yield
    found: list[tuple[Entity, str]] = []
    for kind, columns in before.items():
        table = world.table(kind)
        differs = np.zeros(table.count, np.bool_)
        for name, was in zip(_WRITTEN[kind], columns, strict=True):
            unlike = table.column(name) != was
            differs |= unlike if unlike.ndim == 1 else unlike.any(axis=1)
        found += [(Entity(entity), kind.__name__) for entity in table.entities[differs].tolist()]
    if found:
        changes.append(WorldChanges(set=tuple(found)))

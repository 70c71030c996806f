"""What a tick writes into characters and rigs that their readers know: wishes, where they face, the size of a capsule.

Systems write straight into columns, which logs no change; few of these fields change in a tick, so they are compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Final

import numpy as np

from elys.common.components import CameraRig, Character, Collider
from elys.common.components.columns import Column
from elys.common.components.declaration import Component, declaration_of
from elys.common.ids import Entity
from elys.sim_node.ecs.changes import WorldChanges
from elys.sim_node.ecs.columns import NO_ROW
from elys.sim_node.ecs.entities import Entities
from elys.sim_node.ecs.world import World
from elys.sim_node.scene.edited_values import MOVED

_WRITTEN: Final[dict[type[Component], tuple[str, ...]]] = {
    kind: tuple(name for name in MOVED[kind.__name__] if not declaration_of(kind).field(name).is_memory)
    for kind in (Character, CameraRig)
} | {Collider: ("half_length", "offset")}


@contextmanager
def told(
    world: World, changes: list[WorldChanges], kinds: Iterable[type[Component]] = tuple(_WRITTEN)
) -> Iterator[None]:
    """Within it characters, their capsules and rigs are written: appends to `changes` whose told fields are others at its end."""
    before = {kind: _values(world, kind) for kind in kinds}
    yield
    found: list[tuple[Entity, str]] = []
    for kind, (entities, were) in before.items():
        differs = np.zeros(len(entities), np.bool_)
        for was, now in zip(were, _values(world, kind)[1], strict=True):
            unlike = now != was
            differs |= unlike if unlike.ndim == 1 else unlike.any(axis=1)
        found += [(Entity(entity), kind.__name__) for entity in entities[differs].tolist()]
    if found:
        changes.append(WorldChanges(set=tuple(found)))


def _values(world: World, kind: type[Component]) -> tuple[Entities, list[Column]]:
    """Who has one, and copies of its told columns; of colliders those that characters have."""
    table = world.table(kind)
    owners = world.table(Character).entities if kind is Collider else table.entities
    rows = table.rows(owners)
    present = rows != NO_ROW
    return owners[present], [table.column(name)[rows[present]] for name in _WRITTEN[kind]]

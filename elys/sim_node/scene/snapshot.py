"""The whole world as one message, and a world from one: what a late joiner gets, a recording starts with and a test compares.

Columns are copied as they lie in memory. Restored, a world has the same ids, the same bits and the same order of rows, and its
next entities will get the ids that they would have got in the first one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from elys.bus.messages.scene import ComponentColumns, Snapshot
from elys.bus.snapshot_columns import component_columns, unpack_columns
from elys.common.components import declarations
from elys.common.components.columns import Column, StringTable
from elys.common.errors import ComponentError, EntityError, MessageError
from elys.common.scene_document import SceneSettings
from elys.sim_node.ecs.columns import ComponentTable
from elys.sim_node.ecs.entities import Entities, Indices
from elys.sim_node.ecs.world import SpawnBatch, World


def take_snapshot(
    world: World,
    *,
    epoch: int,
    tick: int,
    simulation_time: float,
    sequence: int,
    scene: str,
    settings: SceneSettings,
    revision: int = 0,
    content: int = 0,
    columns_of: Callable[[ComponentTable], dict[str, Column]] = ComponentTable.columns,
) -> Snapshot:
    """The world as it is, entities parents first and siblings in order; `columns_of` gives the columns of a component."""
    hierarchy, allocator = world.hierarchy, world.allocator
    indices = hierarchy.order.astype(np.intp)
    tables = (world.table(name) for name in declarations())
    return Snapshot(
        epoch=epoch,
        tick=tick,
        simulation_time=simulation_time,
        sequence=sequence,
        scene=scene,
        settings=settings,
        entities=_bytes(allocator.ids[indices]),
        free_entities=_bytes(allocator.free_ids()),
        parents=_bytes(allocator.ids[hierarchy.parent[indices]]),
        enabled=_bytes(hierarchy.enabled[indices]),
        names=tuple(hierarchy.names(indices)),
        prefabs=tuple(hierarchy.prefabs(indices)),
        strings=world.strings.texts,
        revision=revision,
        content=content,
        components=tuple(
            component_columns(table.declaration, table.entities, columns_of(table)) for table in tables if table.count
        ),
    )


def restore(world: World, snapshot: Snapshot) -> None:
    """Makes the world be what the snapshot says, and nothing else.

    Raises:
        MessageError: the snapshot contradicts itself or a component's declaration. The world is as it was.
    """
    count = len(snapshot.names)
    if len(snapshot.prefabs) != count:
        raise MessageError(f"a snapshot of {count} entities names {len(snapshot.prefabs)} prefabs")
    entities: Entities = _array(snapshot.entities, "<u4", count, "entities")
    free: Entities = _array(snapshot.free_entities, "<u4", len(snapshot.free_entities) // 4, "free entities")
    try:
        strings = StringTable(snapshot.strings)
        batch = SpawnBatch(
            names=snapshot.names,
            parents=_parents_of(snapshot, entities),
            enabled=_array(snapshot.enabled, "u1", count, "enabled").astype(np.bool_),
            components={columns.component: _members_of(columns, entities, strings) for columns in snapshot.components},
            prefabs={place: prefab for place, prefab in enumerate(snapshot.prefabs) if prefab},
        )
        world.replace_all(batch, entities, free=free, strings=strings)
    except (ComponentError, EntityError) as error:
        raise MessageError(f"the snapshot cannot be restored: {error}") from error


def _parents_of(snapshot: Snapshot, entities: Entities) -> Indices:
    """[N] the places of the parents within the snapshot, -1 for none; MessageError unless each stands before its child."""
    parents: Entities = _array(snapshot.parents, "<u4", len(entities), "parents")
    places = np.where(parents == 0, -1, _places_of(parents, entities, missing=len(entities)))
    misplaced = np.flatnonzero(places >= np.arange(len(entities)))
    if misplaced.size:
        raise MessageError(f"the snapshot's entity {entities[misplaced[0]]} has a parent that does not stand before it")
    return places


def _members_of(
    packed: ComponentColumns, entities: Entities, strings: StringTable
) -> tuple[Indices, dict[str, Column]]:
    """Which entities of the snapshot have a component, and its columns."""
    owners, columns = unpack_columns(packed, strings)
    members = _places_of(owners, entities, missing=-1)
    if np.any(members < 0) or len(np.unique(members)) != len(members):
        raise MessageError(f"the snapshot gives {packed.component} to an entity that it has not, or twice to one")
    return members, columns


def _places_of(wanted: Entities, entities: Entities, *, missing: int) -> Indices:
    """[M] where the wanted ids stand among [N] entities, `missing` where they do not."""
    if not len(entities):
        return np.full(len(wanted), missing)
    by_id = np.argsort(entities, kind="stable")
    found = by_id[np.minimum(np.searchsorted(entities[by_id], wanted), len(entities) - 1)]
    return np.where(entities[found] == wanted, found, missing)


def _bytes(array: NDArray[Any]) -> bytes:
    return array.astype(array.dtype.newbyteorder("<"), copy=False).tobytes()


def _array(data: bytes, dtype: DTypeLike, count: int, what: str) -> NDArray[Any]:
    if len(data) != count * np.dtype(dtype).itemsize:
        raise MessageError(f"the snapshot's {what} should have {count} x {dtype}, and has {len(data)} bytes")
    return np.frombuffer(data, dtype)

"""The scene on the bus: one snapshot for who joins, numbered deltas for who stays."""

from __future__ import annotations

from typing import Any

import msgspec

from elys.common.scene import EntityRecord, SceneSettings


class FieldColumn(msgspec.Struct, frozen=True, kw_only=True):
    """One field of one component for all its entities: raw little-endian rows of `width` elements of `dtype`."""

    name: str
    dtype: str
    width: int
    data: bytes


class ComponentColumns(msgspec.Struct, frozen=True, kw_only=True):
    """All entities that have one component: their u32 ids and a column per field, rows in the same order."""

    component: str
    entities: bytes
    fields: tuple[FieldColumn, ...]


class Snapshot(msgspec.Struct, frozen=True, kw_only=True):
    """The whole scene at one tick. Entities stand parents first and siblings in order.

    `entities` and `parents` are u32 (parent 0: none), `enabled` u8, all of one length with `names` and `prefabs`. Fields of
    kind TEXT and ASSET hold rows of `strings`. `sequence` is the last delta that is contained. `free_entities` are the u32 ids
    that will be given out next, so that who restores the scene spawns the same ids. `revision` counts the edits that it contains;
    `content` names what the edits have made of the scene: undoing one brings a former number back.
    """

    epoch: int
    tick: int
    simulation_time: float
    sequence: int
    scene: str
    settings: SceneSettings
    entities: bytes
    parents: bytes
    enabled: bytes
    names: tuple[str, ...]
    prefabs: tuple[str, ...]
    strings: tuple[str, ...]
    components: tuple[ComponentColumns, ...]
    free_entities: bytes = b""
    revision: int = 0
    content: int = 0


class SnapshotRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Asks the host for the scene as it is; `as_edited`: with bodies, animations and joints as they were edited, not moved."""

    as_edited: bool = False


class PrefabRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Asks the host what stands in a file that entities of the scene are instances of, if it is another than that of `known`."""

    path: str  # as the scene names it
    known: float = -1.0  # when what the asker has was changed last


class PrefabContent(msgspec.Struct, frozen=True, kw_only=True):
    """The entities of a prefab, its root first; none where the asker has them already."""

    modified: float  # [s since 1970] when the file was changed last
    records: tuple[EntityRecord, ...] | None


class Spawned(msgspec.Struct, frozen=True, kw_only=True, tag="spawned"):
    """An entity came to be, with these components and at the end of its parent's children."""

    entity: int
    name: str
    parent: int
    enabled: bool
    components: dict[str, dict[str, Any]]
    prefab: str = ""


class Despawned(msgspec.Struct, frozen=True, kw_only=True, tag="despawned"):
    """An entity is gone, and with it all below it."""

    entity: int


class ComponentSet(msgspec.Struct, frozen=True, kw_only=True, tag="component_set"):
    """A component was added or changed; `values` are all its fields."""

    entity: int
    component: str
    values: dict[str, Any]


class ComponentRemoved(msgspec.Struct, frozen=True, kw_only=True, tag="component_removed"):
    """An entity lost a component."""

    entity: int
    component: str


class Renamed(msgspec.Struct, frozen=True, kw_only=True, tag="renamed"):
    """An entity has another name."""

    entity: int
    name: str


class Reparented(msgspec.Struct, frozen=True, kw_only=True, tag="reparented"):
    """An entity stands at place `index` (from 0) among the children of `parent` (0: among the roots)."""

    entity: int
    parent: int
    index: int


class EnabledSet(msgspec.Struct, frozen=True, kw_only=True, tag="enabled_set"):
    """An entity's own switch changed."""

    entity: int
    enabled: bool


class SettingsSet(msgspec.Struct, frozen=True, kw_only=True, tag="settings_set"):
    """The scene's settings changed."""

    settings: SceneSettings


SceneChange = Spawned | Despawned | ComponentSet | ComponentRemoved | Renamed | Reparented | EnabledSet | SettingsSet


class SceneDelta(msgspec.Struct, frozen=True, kw_only=True):
    """What changed in the scene at one tick. Numbers rise by one; who sees a gap asks for the snapshot.

    `resync` says that too much changed to be told one by one (a load, a seek): ask for the snapshot.
    """

    epoch: int
    sequence: int
    tick: int
    changes: tuple[SceneChange, ...] = ()
    resync: bool = False
    revision: int = 0  # as in Snapshot
    content: int = 0

"""The scene as tables that array functions can work on: a row an entity, parents before children."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from elys.bus.mirror import SceneMirror
from elys.common.components import Camera, Component, Environment, Light, Material, MeshRenderer, Morph, Skin, Transform
from elys.common.math import quaternion
from elys.common.math.matrix import compose_affine, depth_levels, propagate_affine
from elys.common.scene import SceneSettings

Rows = NDArray[np.intp]
C = TypeVar("C", bound=Component)
_STILL: Final = Transform()


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneTables:
    """N entities as they stand in the scene. A `SceneReader` writes to the columns of those that it made.

    Attributes:
        entity: [N] u32. parent: [N] row of the parent, -1 for none. enabled: [N] switched on with all above.
        pose_sequence: [N] the scene delta that said where it stands: state frames made before it do not know.
        local: position [N, 3], rotation [N, 4] and scale [N, 3], relative to the parent.
        world_from_local: [N, 3, 4] f64. rotation: [N, 4] f64, the world's, without what scales shear.
        levels: the rows of each depth.
        names: [N], only where there are skins, which name their joints; else empty.
        meshes, materials, lights, cameras, environments, skins, morphs: row -> component, for rows that have one; in the order of
            the rows.
    """

    entity: NDArray[np.uint32]
    parent: Rows
    enabled: NDArray[np.bool_]
    pose_sequence: NDArray[np.int64]
    local: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
    world_from_local: NDArray[np.float64]
    rotation: NDArray[np.float64]
    levels: list[Rows]
    row_of: dict[int, int]
    meshes: dict[int, MeshRenderer]
    materials: dict[int, Material]
    lights: dict[int, Light]
    cameras: dict[int, Camera]
    environments: dict[int, Environment]
    skins: dict[int, Skin]
    morphs: dict[int, Morph]
    names: list[str]
    settings: SceneSettings

    def subtree(self, entities: Sequence[int]) -> NDArray[np.bool_]:
        """Which rows (N,) are these entities or below one of them; who is not there is passed over."""
        chosen = np.zeros(len(self.entity), np.bool_)
        chosen[[self.row_of[entity] for entity in entities if entity in self.row_of]] = True
        for rows in self.levels[1:]:
            chosen[rows] |= chosen[self.parent[rows]]
        return chosen


def tables_of_mirror(mirror: SceneMirror) -> SceneTables:
    """Tables of all that is in a mirror, children after their parents and siblings in order."""
    ordered = mirror.in_order()
    return tables_of(
        [entity.id for entity in ordered],
        [entity.parent for entity in ordered],
        [entity.components for entity in ordered],
        enabled=[entity.enabled for entity in ordered],
        pose_sequence=[entity.pose_sequence for entity in ordered],
        names=[entity.name for entity in ordered],
        settings=mirror.settings,
    )


def tables_of(
    entities: Sequence[int],
    parents: Sequence[int],
    components: Sequence[Mapping[str, Component]],
    *,
    enabled: Sequence[bool] | None = None,
    pose_sequence: Sequence[int] | None = None,
    names: Sequence[str] = (),
    settings: SceneSettings | None = None,
) -> SceneTables:
    """Tables from one value an entity: ids, parents' ids (0: none) and components by name; parents first."""
    count = len(entities)
    row_of = {entity: row for row, entity in enumerate(entities)}
    parent = np.array([row_of.get(entity, -1) for entity in parents], np.intp)
    levels = depth_levels(parent)
    switched_on = np.ones(count, np.bool_) if enabled is None else np.array(enabled, np.bool_)
    for rows in levels[1:]:
        switched_on[rows] &= switched_on[parent[rows]]
    transforms: list[Any] = [found.get("Transform", _STILL) for found in components]
    local = (
        _column([value.position for value in transforms], 3),
        _column([value.rotation for value in transforms], 4),
        _column([value.scale for value in transforms], 3),
    )
    world_from_local, rotation = _placed(parent, levels, local)
    skins = _having(components, Skin)
    return SceneTables(
        entity=np.array(entities, np.uint32),
        parent=parent,
        enabled=switched_on,
        pose_sequence=np.zeros(count, np.int64) if pose_sequence is None else np.array(pose_sequence, np.int64),
        local=local,
        world_from_local=world_from_local,
        rotation=rotation,
        levels=levels,
        row_of=row_of,
        meshes=_having(components, MeshRenderer),
        materials=_having(components, Material),
        lights=_having(components, Light),
        cameras=_having(components, Camera),
        environments=_having(components, Environment),
        skins=skins,
        morphs=_having(components, Morph),
        names=list(names) if skins else [],
        settings=settings or SceneSettings(),
    )


def _placed(
    parent: Rows, levels: list[Rows], local: tuple[NDArray[np.float64], ...]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    position, rotation, scale = local
    world_rotation = rotation.copy()
    for rows in levels[1:]:
        world_rotation[rows] = quaternion.multiply(world_rotation[parent[rows]], rotation[rows])
    world_from_local = propagate_affine(parent, compose_affine(position, rotation, scale), levels=levels)
    return np.asarray(world_from_local, np.float64), world_rotation


def _column(values: list[tuple[float, ...]], width: int) -> NDArray[np.float64]:
    return np.array(values, np.float64).reshape(len(values), width)


def _having(components: Sequence[Mapping[str, Component]], kind: type[C]) -> dict[int, C]:
    name = kind.__name__
    return {row: found[name] for row, found in enumerate(components) if name in found}  # type: ignore[misc]


def ranges(first: Rows, end: Rows) -> Rows:
    """The numbers from each of some (N,) up to another, one behind the other."""
    size = end - first
    return np.repeat(end - np.cumsum(size), size) + np.arange(int(size.sum()))


def places_in(table: Rows, wanted: Rows) -> tuple[Rows, NDArray[np.bool_]]:
    """Where in an ascending table those of some numbers stand that are in it, and which of them these are."""
    places = np.searchsorted(table, wanted)
    is_there = places < len(table)
    is_there[is_there] = table[places[is_there]] == wanted[is_there]
    return places[is_there], is_there

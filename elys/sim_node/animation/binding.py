"""Which entities the channels of a clip move, by the names that lead there from who plays it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from elys.common.assets.clip import Property
from elys.common.assets.clip_sampling import PROPERTIES, ClipSampler
from elys.common.components import Morph, RigidBody, Transform
from elys.common.ids import Entity
from elys.sim_node.animation.clip_library import ClipKey
from elys.sim_node.ecs.changes import EntityDespawned, EntityReparented, WorldChanges
from elys.sim_node.ecs.columns import NO_ROW
from elys.sim_node.ecs.entities import Indices
from elys.sim_node.ecs.world import World

NOWHERE: Final = -1
Path = tuple[str, ...]
_DECIDING: Final = frozenset(("Transform", "RigidBody", "Morph"))  # components that decide who is moved


class Binding:
    """What is known of the trees below those who play."""

    def __init__(self, world: World, tell: Callable[[int, str], None]) -> None:
        self._world = world
        self._tell = tell
        self._below: dict[int, dict[Path, int]] = {}
        self._bound: dict[tuple[int, ClipKey, str], dict[Property, Indices]] = {}
        self._watched: set[int] = set()

    def forget(self) -> None:
        """All trees may be other than they were."""
        self._below.clear()
        self._bound.clear()
        self._watched.clear()

    def is_touched(self, changes: WorldChanges) -> bool:
        """Whether a change may have another clip move another entity."""
        if changes.overflowed:
            return True
        watched = self._watched
        for change in changes.structure:
            parent = 0 if isinstance(change, EntityDespawned) else change.parent
            is_move = isinstance(change, EntityDespawned | EntityReparented)
            if parent in watched or (is_move and change.entity in watched):
                return True
        components = (*changes.added, *changes.removed)
        return any(entity in watched for entity in changes.renamed) or any(
            component in _DECIDING and entity in watched for entity, component in components
        )

    def places(self, root: int, key: ClipKey, sampler: ClipSampler, mask: str = "") -> dict[Property, Indices]:
        """[C] by property: the place that each channel moves of the entities below `root`, NOWHERE for none.

        A `mask` of names leaves those it names and all below them.
        """
        known = self._bound.get((root, key, mask))
        if known is not None:
            return known
        below = self.below(root)
        lost = {target for targets in sampler.targets.values() for target in targets if target not in below}
        if lost:
            some = ", ".join(sorted("'" + "/".join(target) + "'" for target in lost)[:4])
            self._tell(root, f"has nobody below it at {some}, which its clip moves")
        names = frozenset(filter(None, (name.strip() for name in mask.split(","))))
        if missing := names - {name for path in below for name in path}:
            self._tell(root, f"has nobody below it called '{min(missing)}', which a mask names")
        found: dict[Property, Indices] = {}
        for name in PROPERTIES:
            can = self._can_morph if name == "weights" else self._can_move
            column = [
                below[target] if target in below and (not names or names & set(target)) else NOWHERE
                for target in sampler.targets[name]
            ]
            found[name] = np.array([p if p != NOWHERE and can(p) else NOWHERE for p in column], np.intp)
        self._bound[root, key, mask] = found
        return found

    def below(self, root: int) -> dict[Path, int]:
        """The places of everybody below an entity, and itself, by the names that lead there; the first of equal ones."""
        if root in self._below:
            return self._below[root]
        hierarchy = self._world.hierarchy
        places = hierarchy.subtree_places(hierarchy.require(root))
        self._watched.update(self._world.allocator.ids[places].tolist())
        paths: dict[int, Path] = {int(places[0]): ()}
        found: dict[Path, int] = {(): int(places[0])}
        names, parents = hierarchy.names(places[1:]), hierarchy.parent[places[1:]].tolist()
        for place, name, parent in zip(places[1:].tolist(), names, parents, strict=True):
            paths[place] = (*paths[parent], name)
            found.setdefault(paths[place], place)
        self._below[root] = found
        return found

    def _can_move(self, place: int) -> bool:
        """Whether something says where the entity stands, and physics does not."""
        world = self._world
        return bool(world.table(Transform).row_of[place] != NO_ROW and world.table(RigidBody).row_of[place] == NO_ROW)

    def _can_morph(self, place: int) -> bool:
        return bool(self._world.table(Morph).row_of[place] != NO_ROW)


def parent_of(world: World, entity: int) -> int:
    """Who an entity stands under, 0 for none."""
    return int(world.hierarchy.parent_of(Entity(entity)))

"""The tree of entities: names, parents, ordered children, enabled switches.

Every entity stands under a parent or, as a root, under place 0, the ground. The tree is kept as links between places (first
and last child, previous and next sibling), so that moving an entity is cheap however many siblings it has, and a kernel
can walk it. From the links follow, when somebody asks and not before, the order from parents to children and the
enabled flags down the tree.

It only knows structure: World adds poses to keep, components to drop and changes to log.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from elys.common.errors import EntityError, HierarchyError
from elys.common.ids import MAX_ENTITIES, NO_ENTITY, Entity
from elys.sim_node.ecs.entities import Entities, EntityAllocator, Indices, grown, indices_of
from elys.sim_node.scene.kernels import Links, walk_tree

GROUND = 0  # the place under all roots
_FEW = 64  # up to so many children are walked through one by one
_LINKS = ("parent", "first_child", "last_child", "previous_sibling", "next_sibling", "child_count")


class Hierarchy:
    """Who stands under whom. Methods that take entities raise EntityError for those that do not live.

    Attributes:
        parent: [capacity] int32, the place of the parent; likewise the other links. For kernels; change nothing here.
        enabled: [capacity] each entity's own switch.
        version: rises when the tree changes. enabled_version: rises when that or a switch changes.
    """

    parent: NDArray[np.int32]
    first_child: NDArray[np.int32]
    last_child: NDArray[np.int32]
    previous_sibling: NDArray[np.int32]
    next_sibling: NDArray[np.int32]
    child_count: NDArray[np.int32]

    def __init__(self, allocator: EntityAllocator) -> None:
        self._allocator = allocator
        self.version = 0
        self.enabled_version = 0
        self._walked_version = -1
        self.clear()

    def clear(self) -> None:
        """Takes everything out of the tree."""
        capacity = self._allocator.capacity
        for link in _LINKS:
            setattr(self, link, np.zeros(capacity, np.int32))
        self.enabled = np.ones(capacity, np.bool_)
        self._enabled_in_hierarchy = np.ones(capacity, np.bool_)
        self._order = np.zeros(capacity, np.int32)
        self._count = 0
        self._names = [""] * capacity
        self._prefabs: dict[int, str] = {}
        self._note_structure()

    # What is asked by entity

    def require(self, entity: int) -> int:
        """The place of a living entity; EntityError says what is wrong with any other."""
        if self._allocator.is_alive(entity):
            return entity & MAX_ENTITIES
        raise EntityError(self._absence_of(entity))

    def require_parent(self, parent: int) -> int:
        """The place of a living entity, or the ground for NO_ENTITY."""
        return GROUND if parent == NO_ENTITY else self.require(parent)

    def require_parents(self, parents: Entities) -> Indices:
        """`require_parent` of each of [N]."""
        known = self._allocator.are_alive(parents) | (parents == NO_ENTITY)
        if not known.all():
            self.require(int(parents[np.argmin(known)]))
        return indices_of(parents)

    def describe(self, entity: int) -> str:
        """An entity as sentences name it: its id and, if it has one, its name."""
        index = self.require(entity)
        return f"entity {entity} '{self._names[index]}'" if self._names[index] else f"entity {entity}"

    def name_of(self, entity: Entity) -> str:
        """The entity's name; need not be unique."""
        return self._names[self.require(entity)]

    def prefab_of(self, entity: Entity) -> str:
        """The prefab whose instance the entity is the root of; empty for none."""
        return self._prefabs.get(self.require(entity), "")

    def parent_of(self, entity: Entity) -> Entity:
        """The parent, NO_ENTITY for a root."""
        return self._entity_at(int(self.parent[self.require(entity)]))

    def children_of(self, entity: Entity) -> list[Entity]:
        """The children in order; of NO_ENTITY the roots."""
        return [self._entity_at(child) for child in self.child_places(self.require_parent(entity))]

    def child_count_of(self, entity: Entity) -> int:
        """How many children there are; of NO_ENTITY how many roots."""
        return int(self.child_count[self.require_parent(entity)])

    def sibling_index(self, entity: Entity) -> int:
        """At which place among its parent's children the entity stands, from 0."""
        index, position = self.require(entity), 0
        while (index := int(self.previous_sibling[index])) != GROUND:
            position += 1
        return position

    def subtree_of(self, entity: Entity) -> Entities:
        """[N] the entity and all below it, parents before children and siblings in order."""
        return self._allocator.ids[self.subtree_places(self.require(entity))]

    def is_enabled(self, entity: Entity) -> bool:
        """The entity's own switch."""
        return bool(self.enabled[self.require(entity)])

    def is_enabled_in_hierarchy(self, entity: Entity) -> bool:
        """Whether the entity and all its ancestors are enabled."""
        return bool(self.enabled_in_hierarchy[self.require(entity)])

    def find(self, path: str) -> Entity:
        """The first entity at a path of names from the roots, as "Robot/Arm/Hand"; EntityError if there is none."""
        places = [GROUND]
        for name in path.split("/"):
            places = [child for place in places for child in self.child_places(place) if self._names[child] == name]
        if not places:
            raise EntityError(f"there is no entity at '{path}'")
        return self._entity_at(places[0])

    # What is asked for all at once, by place

    @property
    def order(self) -> NDArray[np.int32]:
        """[N] all places in the tree, parents before children and siblings in order."""
        self._walk()
        return self._order[: self._count]

    @property
    def enabled_in_hierarchy(self) -> NDArray[np.bool_]:
        """[capacity] whether the entity at each place and all its ancestors are enabled."""
        self._walk()
        return self._enabled_in_hierarchy

    def names(self, indices: Indices) -> list[str]:
        """The names of the entities at [N] places."""
        return [self._names[index] for index in indices.tolist()]

    def has_instance_of(self, prefab: str) -> bool:
        """Whether an entity is the root of an instance of a prefab."""
        return prefab in self._prefabs.values()

    def prefabs(self, indices: Indices) -> list[str]:
        """The prefabs of the entities at [N] places."""
        return [self._prefabs.get(index, "") for index in indices.tolist()]

    def child_places(self, index: int) -> Iterator[int]:
        """The places of the children of a place, in order."""
        child = int(self.first_child[index])
        while child != GROUND:
            yield child
            child = int(self.next_sibling[child])

    def children_in_order(self, index: int) -> list[int]:
        """The places of the children of a place, in order: for many of them faster than `child_places`."""
        if self.child_count[index] <= _FEW:
            return list(self.child_places(index))
        order = self.order
        found: list[int] = order[self.parent[order] == index].tolist()
        return found

    def subtree_places(self, index: int) -> Indices:
        """[N] a place and all below it, parents before children and siblings in order."""
        places, pending = [], [index]
        while pending:
            place = pending.pop()
            places.append(place)
            if self.first_child[place] != GROUND:
                pending.extend(reversed(list(self.child_places(place))))
        return np.array(places, np.intp)

    # Changes

    def insert(self, indices: Indices, parents: Indices, names: Sequence[str], enabled: NDArray[np.bool_]) -> None:
        """Puts [N] new places, each last among the children of its parent so far, into the tree."""
        self._reserve(self._allocator.capacity)
        for index, name in zip(indices.tolist(), names, strict=True):
            self._names[index] = name
        self.enabled[indices] = enabled
        self.first_child[indices] = self.last_child[indices] = GROUND
        self.child_count[indices] = 0
        if len(indices) == 1:
            self._link(int(indices[0]), int(parents[0]), -1)
        else:
            self._append(indices, parents)
        self._note_structure()

    def set_prefab(self, index: int, prefab: str) -> None:
        """Notes which prefab the entity at a place is an instance of."""
        self._prefabs[index] = prefab

    def arrange(self, children: Mapping[int, Sequence[int]]) -> None:
        """Makes places the children of parents, in this order; who stood under one of the parents and is named nowhere is out."""
        owners = np.fromiter(children, np.intp, len(children))
        self.first_child[owners] = self.last_child[owners] = GROUND
        self.child_count[owners] = 0
        counts = [len(places) for places in children.values()]
        indices = np.fromiter((place for places in children.values() for place in places), np.intp, sum(counts))
        if len(indices):
            self._append(indices, np.repeat(owners, counts))
        self._note_structure()

    def forget(self, places: Indices) -> None:
        """Lets go of what is kept of [N] places that are out of the tree."""
        if self._prefabs:
            for index in places.tolist():
                self._prefabs.pop(index, None)
        self._note_structure()

    def remove(self, places: Indices) -> None:
        """Takes a whole subtree, its root first, out of the tree."""
        self._unlink(int(places[0]))
        self.forget(places)

    def move(self, entity: Entity, parent: Entity, *, index: int = -1) -> int:
        """Puts an entity at `index` among the children of `parent` (-1 or beyond their end: last); returns that index.

        Raises:
            HierarchyError: `parent` is the entity itself or below it.
        """
        place, target = self.require(entity), self.require_parent(parent)
        if target == place:
            raise HierarchyError(f"{self.describe(entity)} cannot stand under itself; choose another parent")
        above = target
        while above != GROUND:
            if above == place:
                raise HierarchyError(
                    f"{self.describe(entity)} cannot stand under {self.describe(parent)}, which is below it; "
                    "move the latter out first"
                )
            above = int(self.parent[above])
        self._unlink(place)
        position = self._link(place, target, index)
        self._note_structure()
        return position

    def rename(self, entity: Entity, name: str) -> None:
        """Gives an entity another name."""
        self._names[self.require(entity)] = name

    def set_enabled(self, entity: Entity, enabled: bool) -> None:
        """Sets an entity's own switch."""
        self.enabled[self.require(entity)] = enabled
        self.enabled_version += 1

    def outdate(self) -> None:
        """The whole tree is another than before."""
        self._note_structure()

    # Links

    def _append(self, indices: Indices, parents: Indices) -> None:
        """Links many places at once: those of one parent become neighbours, the first of them that of its last child so far."""
        by_parent = np.argsort(parents, kind="stable")
        indices, parents = indices[by_parent], parents[by_parent]
        self.parent[indices] = parents
        self.next_sibling[indices] = GROUND
        is_first = np.ones(len(indices), np.bool_)
        is_first[1:] = parents[1:] != parents[:-1]
        is_last = np.append(is_first[1:], np.ones(min(1, len(indices)), np.bool_))
        heads, tails, owners = indices[is_first], indices[is_last], parents[is_first]
        leaders, followers = indices[~is_last], indices[~is_first]
        self.previous_sibling[followers] = leaders
        self.next_sibling[leaders] = followers
        before = self.last_child[owners]
        self.previous_sibling[heads] = before
        has_children = before != GROUND
        self.next_sibling[before[has_children]] = heads[has_children]
        self.first_child[owners[~has_children]] = heads[~has_children]
        self.last_child[owners] = tails
        np.add.at(self.child_count, parents, 1)

    def _link(self, place: int, parent: int, position: int) -> int:
        count = int(self.child_count[parent])
        position = count if position < 0 else min(position, count)
        before, after = int(self.last_child[parent]), GROUND
        if position < count:
            before, after = GROUND, int(self.first_child[parent])
            for _ in range(position):
                before, after = after, int(self.next_sibling[after])
        self.parent[place], self.previous_sibling[place], self.next_sibling[place] = parent, before, after
        self._join(parent, before, place)
        self._join(parent, place, after)
        self.child_count[parent] += 1
        return position

    def _unlink(self, place: int) -> None:
        parent = int(self.parent[place])
        self._join(parent, int(self.previous_sibling[place]), int(self.next_sibling[place]))
        self.child_count[parent] -= 1

    def _join(self, parent: int, before: int, after: int) -> None:
        """Makes two children of a parent neighbours; the ground stands for the ends of the row."""
        if before == GROUND:
            self.first_child[parent] = after
        else:
            self.next_sibling[before] = after
        if after == GROUND:
            self.last_child[parent] = before
        else:
            self.previous_sibling[after] = before

    def _note_structure(self) -> None:
        self.version += 1
        self.enabled_version += 1

    def _walk(self) -> None:
        if self._walked_version != self.enabled_version:
            links = Links(self.parent, self.first_child, self.next_sibling)
            self._count = walk_tree(links, self.enabled, self._order, self._enabled_in_hierarchy)
            self._walked_version = self.enabled_version

    def _reserve(self, capacity: int) -> None:
        if capacity <= len(self.parent):
            return
        for link in _LINKS:
            setattr(self, link, grown(getattr(self, link), capacity))
        self.enabled = grown(self.enabled, capacity, fill=1)
        self._enabled_in_hierarchy = grown(self._enabled_in_hierarchy, capacity, fill=1)
        self._order = grown(self._order, capacity)
        self._names.extend([""] * (capacity - len(self._names)))

    def _entity_at(self, index: int) -> Entity:
        return Entity(int(self._allocator.ids[index]))

    def _absence_of(self, entity: int) -> str:
        index = entity & MAX_ENTITIES
        if entity == NO_ENTITY:
            return "entity 0 is nobody; give the id of an entity that exists"
        if index >= self._allocator.capacity or (successor := self._entity_at(index)) == NO_ENTITY:
            return f"entity {entity} does not exist (any more)"
        return f"entity {entity} does not exist any more; its place belongs to {self.describe(successor)} now"


def places_of(entities: Entities) -> NDArray[np.int32]:
    """The places of [N] entities as kernels take them."""
    return np.ascontiguousarray(indices_of(entities), np.int32)

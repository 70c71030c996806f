"""Entity ids given out, recycled late and recognised when they are stale.

An id is a place in the tables and the count of that place's former uses (see elys.common.ids). Places of ended entities
wait in a first-in-first-out pool, and the pool is kept long, so that one place is not used twice in quick succession: a stale
id then keeps being recognised for a million spawns.
"""

from __future__ import annotations

from collections import deque
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from elys.common.errors import EntityError
from elys.common.ids import GENERATION_COUNT, INDEX_BITS, MAX_ENTITIES, NO_ENTITY, Entity

Entities = NDArray[np.uint32]
Indices = NDArray[np.intp]

MINIMUM_POOL: Final = 1024  # places that rest before the first of them is used again


def indices_of(entities: Entities) -> Indices:
    """The places in the tables that ids name, as an array to index with."""
    return (entities & np.uint32(MAX_ENTITIES)).astype(np.intp)


def grown(array: NDArray[Any], capacity: int, *, fill: int = 0) -> NDArray[Any]:
    """`array` with `capacity` rows; the new ones hold `fill`."""
    larger = np.full((capacity, *array.shape[1:]), fill, array.dtype)
    larger[: len(array)] = array
    return larger


def _next_users(entities: Entities) -> Entities:
    """What those are called that use the places of [N] entities after them."""
    generations = ((entities >> np.uint32(INDEX_BITS)) + np.uint32(1)) % np.uint32(GENERATION_COUNT)
    return np.asarray((generations << np.uint32(INDEX_BITS)) | (entities & np.uint32(MAX_ENTITIES)), np.uint32)


class EntityAllocator:
    """Who exists. Places count from 1; place 0 is nobody's.

    Attributes:
        ids: [capacity] the entity living at each place, 0 where none is.
        count: how many entities live.
    """

    def __init__(self, capacity: int = 1024) -> None:
        self.ids: Entities = np.zeros(max(capacity, 2), np.uint32)
        self.count = 0
        self._next_ids: Entities = np.arange(len(self.ids), dtype=np.uint32)  # what a place's next user is called
        self._free: deque[int] = deque()
        self._untouched = 1  # places from here on were never used

    @property
    def capacity(self) -> int:
        """How many places the tables have now, place 0 included; doubles when they are all in use."""
        return len(self.ids)

    def is_alive(self, entity: int) -> bool:
        """Whether this very entity lives: not a former or later user of its place."""
        index = entity & MAX_ENTITIES
        return index < len(self.ids) and index != 0 and int(self.ids[index]) == entity

    def are_alive(self, entities: Entities) -> NDArray[np.bool_]:
        """`is_alive` for each of [N] entities."""
        indices = indices_of(entities)
        known = (indices > 0) & (indices < len(self.ids))
        return np.asarray(known & (self.ids[np.where(known, indices, 0)] == entities))

    def allocate(self) -> Entity:
        """One new entity; EntityError when every id is taken."""
        return Entity(int(self.allocate_many(1)[0]))

    def allocate_many(self, count: int) -> Entities:
        """`count` new entities: rested places first, then untouched ones; EntityError when there are not so many ids."""
        indices = self._take_places(count)
        entities = self._next_ids[indices]
        self.ids[indices] = entities
        self.count += count
        return entities

    def can_revive(self, entities: Entities) -> bool:
        """Whether each of [N] entities was the last to use its place, and the place rests."""
        indices = indices_of(entities)
        if len(np.unique(indices)) != len(indices) or np.any((indices == 0) | (indices >= self._untouched)):
            return False
        return bool(np.all(self.ids[indices] == NO_ENTITY) and np.all(self._next_ids[indices] == _next_users(entities)))

    def revive(self, entities: Entities) -> None:
        """Makes [N] ended entities live again; only where `can_revive`."""
        indices = indices_of(entities)
        revived = set(indices.tolist())
        # An undo brings back first who ended last: thousands of them one by one would look through thousands each.
        while self._free and self._free[-1] in revived:
            revived.discard(self._free.pop())
        if revived:
            self._free = deque(index for index in self._free if index not in revived)
        self.ids[indices] = entities
        self.count += len(entities)

    def resting(self) -> tuple[deque[int], int]:
        """Which places rest, and from where on none was used, for `take_back`."""
        return self._free.copy(), self._untouched

    def take_back(self, resting: tuple[deque[int], int], spawned: Entities) -> None:
        """Gives out next what it would have when `resting` was asked; all that was `spawned` since has ended."""
        free, self._untouched = resting
        self._free = free.copy()
        self._next_ids[indices_of(spawned)] = spawned

    def free(self, entity: int) -> None:
        """Ends an entity; EntityError if it does not live."""
        self.free_many(np.array([entity], np.uint32))

    def free_many(self, entities: Entities) -> None:
        """Ends [N] different entities; their places rest in this order. EntityError, and nothing happens, if one is dead."""
        alive = self.are_alive(entities)
        if not alive.all():
            raise EntityError(
                f"entity {int(entities[np.argmin(alive)])} does not exist any more, so it cannot be ended"
            )
        indices = indices_of(entities)
        self.ids[indices] = NO_ENTITY
        self._next_ids[indices] = _next_users(entities)
        self._free.extend(indices.tolist())
        self.count -= len(entities)

    def free_ids(self) -> Entities:
        """The ids of the resting places' next users, in the order in which they will be given out."""
        return self._next_ids[np.fromiter(self._free, np.intp, len(self._free))]

    def restore(self, alive: Entities, free: Entities) -> None:
        """Makes exactly `alive` live and `free` be what `free_ids` said: the next spawns get the ids they would have got.

        Raises:
            EntityError: two of the ids name one place, or one names place 0.
        """
        both = np.concatenate([alive, free])
        indices = indices_of(both)
        if len(np.unique(indices)) != len(indices) or np.any(indices == 0):
            raise EntityError("a set of entity ids names one place twice, or the place 0, which is nobody's")
        self._untouched = int(indices.max(initial=0)) + 1
        self._reserve(self._untouched)
        self.ids[:] = NO_ENTITY
        self.ids[indices[: len(alive)]] = alive
        self._next_ids = np.arange(len(self.ids), dtype=np.uint32)
        self._next_ids[indices] = both
        self._free = deque(indices[len(alive) :].tolist())
        self.count = len(alive)
        # A place that neither lives nor rests below the highest was never said to have been used: it rests behind all others.
        unsaid = np.setdiff1d(np.arange(1, self._untouched), indices)
        self._free.extend(unsaid.tolist())

    def _take_places(self, count: int) -> Indices:
        untouched_count = MAX_ENTITIES + 1 - self._untouched
        if count > len(self._free) + untouched_count:
            raise EntityError(f"{count} more entities are too many: there can be {MAX_ENTITIES} at once")
        rested_count = min(count, max(len(self._free) - MINIMUM_POOL, count - untouched_count, 0))
        rested = [self._free.popleft() for _ in range(rested_count)]
        first, self._untouched = self._untouched, self._untouched + count - rested_count
        self._reserve(self._untouched)
        return np.concatenate([np.array(rested, np.intp), np.arange(first, self._untouched, dtype=np.intp)])

    def _reserve(self, needed: int) -> None:
        capacity = len(self.ids)
        if needed <= capacity:
            return
        while capacity < needed:
            capacity *= 2
        self.ids = grown(self.ids, capacity)
        first = len(self._next_ids)
        self._next_ids = np.concatenate([self._next_ids, np.arange(first, capacity, dtype=np.uint32)])

"""Entity ids: a uint32 of 22 bits of index and 10 bits of generation; 0 is nobody.

The index says where the entity stands in the tables, the generation how often that place was used before, so that an id
kept from a despawned entity is recognised as stale instead of naming a stranger.
"""

from __future__ import annotations

from typing import NewType

Entity = NewType("Entity", int)

INDEX_BITS = 22
GENERATION_BITS = 10
MAX_ENTITIES = (1 << INDEX_BITS) - 1
GENERATION_COUNT = 1 << GENERATION_BITS
NO_ENTITY = Entity(0)


def entity_of(index: int, generation: int) -> Entity:
    """The id of table place `index` (from 1) in its `generation`-th use (from 0)."""
    return Entity((generation << INDEX_BITS) | index)


def index_of(entity: int) -> int:
    """The place in the tables that an id names."""
    return entity & MAX_ENTITIES


def generation_of(entity: int) -> int:
    """How often the place was used before this entity."""
    return entity >> INDEX_BITS

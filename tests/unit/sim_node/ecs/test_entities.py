from __future__ import annotations

import numpy as np
import pytest

from elys.common.errors import EntityError
from elys.common.ids import GENERATION_COUNT, MAX_ENTITIES, entity_of, index_of
from elys.sim_node.ecs.entities import MINIMUM_POOL, EntityAllocator


def test_ids_count_from_one_and_grow_the_tables():
    allocator = EntityAllocator(capacity=2)
    assert allocator.allocate() == 1
    assert allocator.allocate_many(6).tolist() == [2, 3, 4, 5, 6, 7]
    assert allocator.capacity == 8 and allocator.count == 7
    assert allocator.allocate() == 8
    assert allocator.capacity == 16


def test_places_rest_until_the_pool_is_full_and_come_back_in_order_with_new_generations():
    allocator = EntityAllocator()
    first = allocator.allocate_many(MINIMUM_POOL + 2)
    allocator.free_many(first)
    assert [index_of(e) for e in allocator.allocate_many(3).tolist()] == [1, 2, MINIMUM_POOL + 3]
    assert allocator.is_alive(entity_of(1, 1)) and not allocator.is_alive(entity_of(1, 0))


def test_generations_wrap():
    allocator = EntityAllocator()
    last = entity_of(1, GENERATION_COUNT - 1)
    allocator.restore(np.array([last], np.uint32), np.zeros(0, np.uint32))
    allocator.free(last)
    assert allocator.free_ids().tolist() == [entity_of(1, 0)]


def test_dead_and_unknown_ids_are_not_alive():
    allocator = EntityAllocator()
    entity = allocator.allocate()
    allocator.free(entity)
    for other in (0, entity, 77, 10**6, 2**32 - 1, entity_of(1, 5)):
        assert not allocator.is_alive(other)
        assert not allocator.are_alive(np.array([other], np.uint32))[0]
    with pytest.raises(EntityError, match="entity 1 does not exist any more"):
        allocator.free(entity)


def test_bulk_freeing_is_all_or_nothing():
    allocator = EntityAllocator()
    living = allocator.allocate_many(3)
    with pytest.raises(EntityError, match="entity 99"):
        allocator.free_many(np.array([1, 99, 2], np.uint32))
    assert allocator.are_alive(living).all() and allocator.count == 3


def test_too_many_entities_are_refused_with_a_sentence():
    with pytest.raises(EntityError, match=f"there can be {MAX_ENTITIES} at once"):
        EntityAllocator().allocate_many(MAX_ENTITIES + 1)


def test_a_restored_allocator_gives_the_ids_that_the_first_would_have_given():
    first = EntityAllocator()
    living = first.allocate_many(MINIMUM_POOL + 50)
    first.free_many(living[10 : MINIMUM_POOL + 30])
    second = EntityAllocator(capacity=2)
    second.restore(first.ids[first.ids != 0], first.free_ids())
    assert second.count == first.count
    np.testing.assert_array_equal(second.free_ids(), first.free_ids())
    for count in (1, 25, 7):
        np.testing.assert_array_equal(second.allocate_many(count), first.allocate_many(count))


@pytest.mark.parametrize("alive", [[1, 1], [1, entity_of(1, 3)], [0]])
def test_restoring_refuses_what_cannot_be(alive):
    with pytest.raises(EntityError, match="one place twice"):
        EntityAllocator().restore(np.array(alive, np.uint32), np.zeros(0, np.uint32))

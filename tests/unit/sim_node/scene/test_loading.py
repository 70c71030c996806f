from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.common.components import Light, Transform, component_from
from elys.common.errors import ComponentError, EntityError, SceneError
from elys.common.scene import EntityRecord
from elys.sim_node.ecs.world import World
from elys.sim_node.scene.loading import load_records, records_of

RECORDS = [
    EntityRecord(name="Lamp", components={"Transform": {"position": [0.1, -0.0, 1e-300]}, "Light": {}}, prefab="lamp"),
    EntityRecord(name="Bulb", parent=0, enabled=False, components={"Light": {"kind": "point", "intensity": 12}}),
    EntityRecord(name="Bare", parent=1),
    EntityRecord(name="Box", components={"RigidBody": {"mass": 0.1}, "MeshRenderer": {"mesh": "sphere"}}),
]


def test_records_become_entities_and_records_again():
    world = World()
    entities = load_records(world, RECORDS)
    assert world.get(entities[1], Light) == Light(kind="point", intensity=12.0)
    assert world.hierarchy.parent_of(entities[2]) == entities[1]
    assert not world.hierarchy.is_enabled(entities[1])
    again = records_of(world)
    assert [record.components.get("Light") for record in again] == [
        {},
        {"kind": "point", "intensity": 12.0},
        None,
        None,
    ]
    assert str(again[0].components["Transform"]["position"]) == "(0.1, -0.0, 1e-300)"
    assert [(r.name, r.parent, r.enabled, r.prefab) for r in again] == [
        (r.name, r.parent, r.enabled, r.prefab) for r in RECORDS
    ]
    other = World()
    load_records(other, again)
    assert records_of(other) == again


def test_a_subtree_is_copied_below_another_parent_at_an_index():
    world = World()
    entities = load_records(world, RECORDS)
    copy = load_records(world, records_of(world, entities[1]), parent=entities[0], index=0)
    assert [record.parent for record in records_of(world, entities[1])] == [-1, 0]
    assert world.hierarchy.children_of(entities[0]) == [copy[0], entities[1]]
    assert world.components_of(copy[0]) == world.components_of(entities[1])


@pytest.mark.parametrize(
    ("record", "error", "sentence"),
    [
        (EntityRecord(name="X", parent=1), SceneError, "record 1 'X' names record 1 as its parent"),
        (EntityRecord(name="X", parent=-2), SceneError, "record 1 'X' names record -2"),
        (EntityRecord(name="X", components={"Spring": {}}), ComponentError, "there is no component 'Spring'"),
        (
            EntityRecord(name="X", components={"Light": {"watts": 3}}),
            ComponentError,
            "record 1 'X': Light has no field 'watts'",
        ),
        (
            EntityRecord(name="X", components={"Light": {"range": -1.0}}),
            ComponentError,
            "record 1 'X': Light.range must be at least 0 m, not -1",
        ),
    ],
)
def test_a_wrong_record_is_named_and_nothing_is_loaded(record, error, sentence):
    world = World()
    with pytest.raises(error, match=sentence):
        load_records(world, [EntityRecord(name="Fine", components={"Light": {"range": 1.0}}), record])
    assert world.entity_count == 0


def test_a_parent_must_live():
    with pytest.raises(EntityError, match="entity 5 does not exist"):
        load_records(World(), RECORDS, parent=5)


@given(st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), min_size=3, max_size=3))
def test_bulk_loading_is_the_same_as_adding_one_by_one(numbers):
    values = {"position": numbers, "scale": numbers}
    world = World(capacity=2)
    (loaded,) = load_records(world, [EntityRecord(name="", components={"Transform": values})])
    added = world.spawn([component_from("Transform", values)])
    assert world.get(loaded, Transform) == world.get(added, Transform)
    first, second = records_of(world)
    assert first == second

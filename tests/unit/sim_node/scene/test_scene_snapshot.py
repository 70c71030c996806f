from __future__ import annotations

import msgspec
import numpy as np
import pytest

from elys.bus.messages.scene import Snapshot
from elys.bus.mirror import SceneMirror
from elys.common.components import Light, MeshRenderer, RigidBody, Transform
from elys.common.errors import MessageError
from elys.common.scene import SceneSettings
from elys.sim_node.ecs.entities import MINIMUM_POOL
from elys.sim_node.ecs.world import World
from elys.sim_node.scene.snapshot import restore, take_snapshot


def snapshot_of(world: World) -> Snapshot:
    return take_snapshot(
        world, epoch=3, tick=7, simulation_time=0.1, sequence=9, scene="yard", settings=SceneSettings(substeps=2)
    )


@pytest.fixture
def world() -> World:
    """A world with a past: places were used again, rows were moved, siblings changed places."""
    world = World(capacity=2)
    world.spawn_many(MINIMUM_POOL + 40, {RigidBody: {}, MeshRenderer: {"mesh": "sphere"}}, names="Old")
    for entity in world.entities().tolist()[::-2]:
        world.despawn(entity)
    for entity in world.entities().tolist()[:-20]:
        world.despawn(entity)
    lamp = world.spawn([Transform(position=(0.1, 0.2, 0.3)), Light()], name="Lamp", prefab="lamp", enabled=False)
    world.spawn_many(30, {Transform: {"position": np.random.default_rng(0).normal(size=(30, 3))}}, parent=lamp)
    world.set_sibling_index(lamp, 2)
    return world


def test_restored_worlds_are_the_same_to_the_bit_and_go_on_alike(world):
    snapshot = snapshot_of(world)
    other = World(capacity=2)
    other.spawn([Light()], name="To be forgotten")
    restore(other, snapshot)
    assert snapshot_of(other) == snapshot
    for _ in range(2):
        assert other.spawn_many(40, {}).tolist() == world.spawn_many(40, {}).tolist()
    for entity in world.entities().tolist()[:5]:
        assert other.components_of(entity) == world.components_of(entity)
        assert other.transforms.world_pose(entity) == world.transforms.world_pose(entity)


def test_a_snapshot_is_what_mirrors_read(world):
    mirror = SceneMirror()
    mirror.apply_snapshot(snapshot_of(world))
    assert list(mirror.entities) == world.entities().tolist()
    for entity, seen in mirror.entities.items():
        assert tuple(seen.components.values()) == tuple(
            sorted(world.components_of(entity), key=lambda value: list(seen.components).index(type(value).__name__))
        )
        assert seen.children == world.hierarchy.children_of(entity)


def test_what_a_mirror_made_can_be_restored(world):
    mirror = SceneMirror()
    mirror.apply_snapshot(snapshot_of(world))
    other = World()
    restore(other, mirror.to_snapshot())
    assert other.entities().tolist() == world.entities().tolist()
    for entity in world.entities().tolist():
        assert set(other.components_of(entity)) == set(world.components_of(entity))


def test_empty_worlds_too():
    world = World()
    restore(world, snapshot_of(World()))
    assert world.entity_count == 0 and world.spawn() == 1


def wrongs(snapshot: Snapshot) -> dict[str, Snapshot]:
    light = next(columns for columns in snapshot.components if columns.component == "Light")
    first = snapshot.entities[:4]

    def with_light(**changes: object) -> Snapshot:
        return msgspec.structs.replace(snapshot, components=(msgspec.structs.replace(light, **changes),))

    def with_field(**changes: object) -> Snapshot:
        return with_light(fields=(msgspec.structs.replace(light.fields[0], **changes), *light.fields[1:]))

    change = msgspec.structs.replace
    return {
        "entities should have": change(snapshot, entities=snapshot.entities[:-1]),
        "enabled should have": change(snapshot, enabled=b""),
        "prefabs": change(snapshot, prefabs=()),
        "does not stand before it": change(snapshot, parents=first + snapshot.parents[4:]),
        "one place twice": change(snapshot, free_entities=first),
        "string table starts with": change(snapshot, strings=("a",)),
        "there is no component 'Spring'": with_light(component="Spring"),
        "to an entity that it has not": with_light(entities=b"\xff" * 4),
        "Light.kind should be 1 rows of 1 u1, not 1 bytes of 1 f4": with_field(dtype="f4"),
        "Light.kind should be 1 rows of 1 u1, not 0 bytes": with_field(data=b""),
        "Light.kind must be an array of rows from 0 to 2": with_field(data=b"\x07"),
    }


@pytest.mark.parametrize("place", range(11))
def test_snapshots_that_contradict_themselves_are_refused_and_change_nothing(world, place):
    before = snapshot_of(world)
    sentence, wrong = list(wrongs(before).items())[place]
    with pytest.raises(MessageError, match=sentence):
        restore(world, wrong)
    assert snapshot_of(world) == before

from __future__ import annotations

import re

import numpy as np
import pytest

from elys.common.components import Collider, Light, MeshRenderer, RigidBody, Transform
from elys.common.errors import ComponentError, EntityError, HierarchyError
from elys.common.ids import NO_ENTITY
from elys.sim_node.ecs.changes import CHANGE_LIMIT, ChangeLog, EntityDespawned, EntityReparented, EntitySpawned
from elys.sim_node.ecs.schedule import run
from elys.sim_node.ecs.world import World


@pytest.fixture
def world() -> World:
    return World()


def test_values_come_back_as_they_went_in(world):
    body = RigidBody(mass=0.1, linear_velocity=(0.1, -0.0, 1e-20), motion="kinematic")
    entity = world.spawn([body, MeshRenderer(mesh="blake2b:12")], name="Box")
    assert world.get(entity, RigidBody) == body
    assert world.get(entity, "MeshRenderer") == MeshRenderer(mesh="blake2b:12")
    assert world.try_get(entity, Light) is None
    assert world.components_of(entity) == (body, MeshRenderer(mesh="blake2b:12"))


def test_spawn_many_takes_arrays_lists_and_single_values(world):
    positions = np.arange(9.0).reshape(3, 3)
    parent = world.spawn(name="All")
    entities = world.spawn_many(
        3,
        {
            Transform: {"position": positions},
            "RigidBody": {"mass": np.float32([1, 2, 3]), "motion": ["static", "dynamic", "kinematic"]},
            MeshRenderer: {"mesh": "sphere", "visible": np.array([True, False, True])},
        },
        names="Ball",
        parent=parent,
    )
    last = entities.tolist()[2]
    assert world.hierarchy.children_of(parent) == entities.tolist()
    assert world.hierarchy.name_of(last) == "Ball 3"
    assert world.get(last, Transform).position == (6.0, 7.0, 8.0)
    assert world.get(last, RigidBody) == RigidBody(mass=3.0, motion="kinematic")
    assert world.get(entities.tolist()[1], MeshRenderer) == MeshRenderer(mesh="sphere", visible=False)


@pytest.mark.parametrize(
    ("columns", "names", "sentence"),
    [
        ({RigidBody: {"mass": np.zeros(2)}}, "", "RigidBody.mass must be an array of finite numbers in its range"),
        ({RigidBody: {"mass": np.ones(3)}}, "", r"RigidBody.mass must be an array of shape \(2,\), not \(3,\)"),
        ({RigidBody: {"weight": 1.0}}, "", "RigidBody has no field 'weight'"),
        ({"Spring": {}}, "", "there is no component 'Spring'"),
        ({}, ["one"], "2 new entities were given 1 names"),
    ],
)
def test_spawn_many_refuses_what_is_wrong_and_changes_nothing(world, columns, names, sentence):
    with pytest.raises(ComponentError, match=sentence):
        world.spawn_many(2, columns, names=names)
    assert world.entity_count == 0 and not world.drain_changes()


def test_spawn_refuses_wrong_values_and_parents_and_changes_nothing(world):
    with pytest.raises(ComponentError, match=r"RigidBody\.mass must be a number"):
        world.spawn([Transform(), RigidBody(mass="much")])
    with pytest.raises(ComponentError, match="a new entity 'Box' was given two Transform"):
        world.spawn([Transform(), Transform()], name="Box")
    with pytest.raises(EntityError, match="entity 9 does not exist"):
        world.spawn(parent=9)
    assert world.entity_count == 0 and not world.drain_changes()


def test_errors_name_the_entity_and_the_remedy(world):
    box = world.spawn([Transform()], name="Box")
    for sentence, act in (
        ("entity 1 'Box' has no RigidBody; add one first", lambda: world.get(box, RigidBody)),
        ("entity 1 'Box' has no RigidBody; add one first", lambda: world.set(box, RigidBody())),
        ("entity 1 'Box' has no RigidBody; add one first", lambda: world.remove(box, RigidBody)),
        ("entity 1 'Box' has a Transform already; set it instead", lambda: world.add(box, Transform())),
        ("there is no component 'Spring'; known are Transform,", lambda: world.has(box, "Spring")),
    ):
        with pytest.raises(ComponentError, match=re.escape(sentence)):
            act()
    world.despawn(box)
    for act in (world.components_of, world.despawn, world.unparent, world.describe, world.hierarchy.children_of):
        with pytest.raises(EntityError, match="entity 1 does not exist"):
            act(box)
    with pytest.raises(EntityError, match="entity 0 is nobody"):
        world.despawn(NO_ENTITY)


def test_despawn_takes_all_below(world):
    root = world.spawn([Transform()])
    parent = root
    for _ in range(20):
        parent = world.spawn([Transform(), RigidBody()], parent=parent)
    other = world.spawn([RigidBody(mass=7.0)])
    world.despawn(root)
    assert world.entities().tolist() == [other]
    assert world.table(RigidBody).column("mass").tolist() == [7.0]
    assert world.table(Transform).count == 0


def test_queries_follow_the_world_and_say_when(world):
    bodies = world.query(RigidBody, Transform, excluding=(Light,), enabled_only=True)
    assert world.query(Transform, RigidBody, excluding=[Light], enabled_only=True) is bodies
    parent = world.spawn()
    box = world.spawn([Transform(), RigidBody(mass=2.0)], parent=parent)
    assert bodies.entities.tolist() == [box] and len(bodies) == 1
    version = bodies.version
    world.set(box, RigidBody(mass=3.0))
    assert bodies.version == version and bodies.values(RigidBody, "mass").tolist() == [3.0]
    bodies.write(RigidBody, "linear_velocity", np.array([[1.0, 2.0, 3.0]]))
    assert world.get(box, RigidBody).linear_velocity == (1.0, 2.0, 3.0)
    world.set_enabled(parent, False)
    assert not len(bodies) and bodies.version > version
    world.set_enabled(parent, True)
    world.add(box, Light())
    assert not len(bodies)
    with pytest.raises(ComponentError, match="looks for RigidBody, Transform, so it has no rows of Collider"):
        bodies.rows(Collider)
    with pytest.raises(ComponentError, match="at least one component"):
        world.query()


def test_reparenting_keeps_the_pose_unless_told_otherwise(world):
    parent = world.spawn([Transform(position=(10.0, 0.0, 0.0), rotation=(0.0, 0.6, 0.0, 0.8))])
    child = world.spawn([Transform(position=(1.0, 2.0, 3.0))])
    world.drain_changes()
    world.set_parent(child, parent)
    assert world.transforms.world_pose(child)[0] == pytest.approx((1.0, 2.0, 3.0))
    assert world.get(child, Transform).position != (1.0, 2.0, 3.0)
    changes = world.drain_changes()
    assert changes.structure == (EntityReparented(child, parent, 0),) and changes.set == ((child, "Transform"),)
    before = world.get(child, Transform)
    world.set_parent(child, NO_ENTITY, keep_world_pose=False)
    assert world.get(child, Transform) == before
    with pytest.raises(HierarchyError, match="cannot stand under"):
        world.set_parent(parent, parent)


def test_changes_are_told_once_and_only_as_they_are_now(world):
    parent = world.spawn([Transform()])
    old = world.spawn([Transform(), RigidBody(), Light()])
    doomed = world.spawn([Transform()], parent=parent)
    world.drain_changes()
    world.set(old, RigidBody(mass=2.0))
    world.set(old, RigidBody(mass=3.0))
    world.add(old, Collider())
    world.set(old, Collider(radius=2.0))
    world.remove(old, Light)
    world.add(old, MeshRenderer())
    world.remove(old, MeshRenderer)
    world.remove(old, Transform)
    world.add(old, Transform())
    world.rename(old, "Old")
    world.set_enabled(old, False)
    world.set(doomed, Transform(position=(1.0, 0.0, 0.0)))
    world.despawn(parent)
    new = world.spawn([Light()])
    world.rename(new, "New")
    world.set(new, Light(intensity=4.0))
    world.set_sibling_index(new, 0)
    changes = world.drain_changes()
    assert changes.structure == (
        EntityDespawned(parent),
        EntitySpawned(new, NO_ENTITY),
        EntityReparented(new, NO_ENTITY, 0),
    )
    assert (changes.spawned, changes.despawned, changes.reparented) == ((new,), (parent,), (new,))
    assert changes.set == ((old, "RigidBody"), (old, "Transform"))
    assert changes.added == ((old, "Collider"),) and changes.removed == ((old, "Light"),)
    assert (changes.renamed, changes.switched, changes.overflowed) == ((old,), (old,), False)
    assert not world.drain_changes()


def test_too_many_changes_ask_for_a_snapshot(world):
    world.spawn_many(CHANGE_LIMIT + 1, {})
    world.spawn()
    changes = world.drain_changes()
    assert changes and changes.overflowed and not changes.structure
    assert not world.drain_changes()
    log = ChangeLog(limit=2)
    for entity in (1, 2, 3):
        log.log_renamed(entity)
    assert log.drain(lambda entity: True, lambda entity, name: True).overflowed


def test_what_systems_write_is_not_logged(world):
    entities = world.spawn_many(4, {Transform: {}, RigidBody: {}})
    world.drain_changes()
    world.transforms.set_world_poses(entities, np.ones((4, 3)), np.tile(np.float32([0, 0, 0, 1]), (4, 1)))
    world.table(RigidBody).column("linear_velocity")[:] = 1.0
    assert not world.drain_changes()
    assert world.get(entities.tolist()[0], Transform).position == (1.0, 1.0, 1.0)


def test_systems_run_in_order_and_their_commands_after_each(world):
    seen = []

    def breed(world: World) -> None:
        parent = world.spawn([Transform()], name="Parent")
        world.commands.spawn([Light()], name="Child", parent=parent)
        world.commands.set_enabled(parent, False)
        world.commands.add(parent, RigidBody())
        assert len(world.commands) == 3 and not world.hierarchy.children_of(parent)

    def prune(world: World) -> None:
        parent = world.hierarchy.find("Parent")
        child = world.hierarchy.find("Parent/Child")
        assert world.has(parent, RigidBody) and not world.hierarchy.is_enabled_in_hierarchy(child)
        world.commands.set_parent(child, NO_ENTITY)
        world.commands.remove(parent, RigidBody)
        world.commands.despawn(parent)
        world.commands.despawn(parent)  # asked for by two: void the second time
        world.commands.spawn(parent=parent)  # under what is gone by then: void

    def look(world: World) -> None:
        seen.extend(world.hierarchy.names(world.hierarchy.order))

    profile: dict[str, float] = {"look": 1.0}
    run(world, (breed, prune, look), profile)
    assert seen == ["Child"]
    assert list(profile) == ["look", "breed", "prune"] and min(profile.values()) >= 0.0 and profile["look"] > 1.0

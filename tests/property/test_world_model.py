"""The world against a dictionary of dictionaries, under any sequence of edits; and a mirror that only hears the deltas."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from elys.bus.messages.scene import SceneDelta
from elys.bus.mirror import SceneMirror
from elys.common.components import Collider, Component, MeshRenderer, RigidBody, Transform
from elys.common.errors import ComponentError, EntityError, HierarchyError
from elys.common.ids import NO_ENTITY
from elys.common.scene import SceneSettings
from elys.sim_node.ecs.world import World
from elys.sim_node.scene.delta import scene_changes
from elys.sim_node.scene.loading import load_records, records_of
from elys.sim_node.scene.snapshot import restore, take_snapshot

TYPES: tuple[type[Component], ...] = (Transform, RigidBody, Collider, MeshRenderer)

numbers = st.floats(-100, 100, width=32).map(lambda value: round(value, 3))
vectors = st.tuples(numbers, numbers, numbers)
components = st.one_of(
    st.builds(Transform, position=vectors, rotation=st.sampled_from([(0.0, 0.0, 0.0, 1.0), (0.0, 0.6, 0.0, 0.8)])),
    st.builds(RigidBody, mass=st.sampled_from([0.1, 2.5]), motion=st.sampled_from(["dynamic", "static"])),
    st.builds(Collider, shape=st.sampled_from(["box", "sphere"]), offset=vectors),
    st.builds(MeshRenderer, mesh=st.sampled_from(["box", "sphere", "a mesh"]), visible=st.booleans()),
)
names = st.sampled_from(["", "Box", "Wheel", "Ümläut"])
picks = st.integers(0, 10_000)


@dataclass
class Node:
    """What the model knows of an entity."""

    name: str
    parent: int
    enabled: bool
    components: dict[type[Component], Component]
    children: list[int] = field(default_factory=list)


class WorldModel(RuleBasedStateMachine):
    """Does everything twice, in the world and in dictionaries."""

    @initialize()
    def start(self) -> None:
        self.world = World(capacity=2)
        self.nodes: dict[int, Node] = {NO_ENTITY: Node("", -1, True, {})}
        self.gone: list[int] = []
        self.sequence = 0
        self.mirror = SceneMirror()
        self.mirror.apply_snapshot(self.snapshot())

    # Edits

    @rule(values=st.lists(components, max_size=4, unique_by=type), name=names, above=picks, enabled=st.booleans())
    def spawn(self, values: list[Component], name: str, above: int, enabled: bool) -> None:
        parent = self.pick(above, or_ground=True)
        entity = self.world.spawn(values, name=name, parent=parent, enabled=enabled)
        self.insert(entity, Node(name, parent, enabled, {type(value): value for value in values}))

    @rule(count=st.integers(0, 5), value=components, above=picks)
    def spawn_many(self, count: int, value: Component, above: int) -> None:
        parent = self.pick(above, or_ground=True)
        columns = {type(value): {name: getattr(value, name) for name in value.__struct_fields__}}
        for number, entity in enumerate(self.world.spawn_many(count, columns, names="Many", parent=parent).tolist()):
            self.insert(entity, Node(f"Many {number + 1}", parent, True, {type(value): value}))

    @precondition(lambda self: len(self.nodes) > 1)
    @rule(which=picks)
    def despawn(self, which: int) -> None:
        entity = self.pick(which)
        self.world.despawn(entity)
        self.nodes[self.nodes[entity].parent].children.remove(entity)
        for below in self.subtree(entity):
            del self.nodes[below]
            self.gone.append(below)

    @precondition(lambda self: len(self.nodes) > 1)
    @rule(which=picks, value=components)
    def add_or_set(self, which: int, value: Component) -> None:
        entity = self.pick(which)
        if type(value) in self.nodes[entity].components:
            with pytest.raises(ComponentError):
                self.world.add(entity, value)
            self.world.set(entity, value)
        else:
            with pytest.raises(ComponentError):
                self.world.set(entity, value)
            self.world.add(entity, value)
        self.nodes[entity].components[type(value)] = value

    @precondition(lambda self: len(self.nodes) > 1)
    @rule(which=picks, component=st.sampled_from(TYPES))
    def remove(self, which: int, component: type[Component]) -> None:
        entity = self.pick(which)
        if component in self.nodes[entity].components:
            self.world.remove(entity, component)
            del self.nodes[entity].components[component]
        else:
            with pytest.raises(ComponentError):
                self.world.remove(entity, component)

    @precondition(lambda self: len(self.nodes) > 1)
    @rule(which=picks, above=picks, index=st.integers(-1, 4))
    def reparent(self, which: int, above: int, index: int) -> None:
        entity, parent = self.pick(which), self.pick(above, or_ground=True)
        if parent in self.subtree(entity):
            with pytest.raises(HierarchyError):
                self.world.set_parent(entity, parent)
            return
        self.world.set_parent(entity, parent, index=index, keep_world_pose=False)
        self.nodes[self.nodes[entity].parent].children.remove(entity)
        siblings = self.nodes[parent].children
        siblings.insert(len(siblings) if index < 0 else index, entity)
        self.nodes[entity].parent = parent

    @precondition(lambda self: len(self.nodes) > 1)
    @rule(which=picks, name=names, enabled=st.booleans())
    def rename_and_switch(self, which: int, name: str, enabled: bool) -> None:
        entity = self.pick(which)
        self.world.rename(entity, name)
        self.world.set_enabled(entity, enabled)
        self.nodes[entity].name, self.nodes[entity].enabled = name, enabled

    @precondition(lambda self: len(self.nodes) > 1)
    @rule(which=picks)
    def duplicate(self, which: int) -> None:
        entity = self.pick(which)
        originals = self.subtree(entity)
        copies = load_records(self.world, records_of(self.world, entity), parent=self.nodes[entity].parent)
        copy_of = dict(zip(originals, copies, strict=True))
        for original, copy in copy_of.items():
            node = self.nodes[original]
            parent = copy_of.get(node.parent, node.parent)
            self.insert(copy, Node(node.name, parent, node.enabled, dict(node.components)))

    @rule()
    def move_to_another_world(self) -> None:
        changes = self.world.drain_changes()
        self.tell_mirror(changes)
        snapshot = self.snapshot()
        self.world = World(capacity=2)
        restore(self.world, snapshot)
        assert self.snapshot() == snapshot
        assert self.world.drain_changes().overflowed

    # What must hold

    @invariant()
    def entities_agree(self) -> None:
        world, tree = self.world, self.world.hierarchy
        assert world.entities().tolist() == self.subtree(NO_ENTITY)[1:]
        assert world.entity_count == len(self.nodes) - 1
        for entity, node in self.nodes.items():
            assert tree.children_of(entity) == node.children
            if entity != NO_ENTITY:
                assert (tree.name_of(entity), tree.parent_of(entity)) == (node.name, node.parent)
                assert tree.is_enabled(entity) == node.enabled
                assert tree.is_enabled_in_hierarchy(entity) == self.is_enabled(entity)
                assert tree.sibling_index(entity) == self.nodes[node.parent].children.index(entity)

    @invariant()
    def components_agree(self) -> None:
        for entity, node in list(self.nodes.items())[1:]:
            assert {type(value): value for value in self.world.components_of(entity)} == node.components
            for component in TYPES:
                assert self.world.has(entity, component) == (component in node.components)
                assert self.world.try_get(entity, component) == node.components.get(component)

    @invariant()
    def queries_agree(self) -> None:
        query = self.world.query(Transform, RigidBody, excluding=(Collider,), enabled_only=True)
        expected = sorted(
            (
                entity
                for entity, node in self.nodes.items()
                if {Transform, RigidBody} <= node.components.keys()
                and Collider not in node.components
                and self.is_enabled(entity)
            ),
            key=lambda entity: entity & 0x3FFFFF,
        )
        assert query.entities.tolist() == expected
        masses = [self.nodes[entity].components[RigidBody].mass for entity in expected]
        np.testing.assert_array_equal(query.values(RigidBody, "mass"), np.array(masses, np.float32))

    @invariant()
    def stale_ids_are_refused(self) -> None:
        for entity in self.gone[-3:]:
            assert not self.world.is_alive(entity)
            with pytest.raises(EntityError, match=str(entity)):
                self.world.despawn(entity)

    @rule()
    def mirror_follows(self) -> None:
        self.tell_mirror(self.world.drain_changes())
        world, mirror = self.world, self.mirror
        assert mirror.roots == self.nodes[NO_ENTITY].children
        assert mirror.entities.keys() == self.nodes.keys() - {NO_ENTITY}
        for entity, seen in mirror.entities.items():
            node = self.nodes[entity]
            assert (seen.name, seen.parent, seen.enabled, seen.children) == (
                node.name,
                node.parent,
                node.enabled,
                node.children,
            )
            assert seen.components == {type(value).__name__: value for value in world.components_of(entity)}

    def teardown(self) -> None:
        if hasattr(self, "world"):
            self.mirror_follows()

    # The model

    def tell_mirror(self, changes) -> None:  # type: ignore[no-untyped-def]
        if changes.overflowed:
            self.mirror.apply_snapshot(self.snapshot())
            return
        self.sequence += 1
        told = scene_changes(self.world, [changes])
        self.mirror.apply_delta(SceneDelta(epoch=1, sequence=self.sequence, tick=0, changes=told))

    def snapshot(self):  # type: ignore[no-untyped-def]
        return take_snapshot(
            self.world,
            epoch=1,
            tick=0,
            simulation_time=0.0,
            sequence=self.sequence,
            scene="model",
            settings=SceneSettings(),
        )

    def pick(self, number: int, *, or_ground: bool = False) -> int:
        candidates = list(self.nodes)[0 if or_ground else 1 :]
        return candidates[number % len(candidates)]

    def insert(self, entity: int, node: Node) -> None:
        assert entity not in self.nodes and entity not in self.gone
        self.nodes[entity] = node
        self.nodes[node.parent].children.append(entity)

    def subtree(self, entity: int) -> list[int]:
        found = [entity]
        for child in self.nodes[entity].children:
            found += self.subtree(child)
        return found

    def is_enabled(self, entity: int) -> bool:
        node = self.nodes[entity]
        return node.enabled and (node.parent < 0 or self.is_enabled(node.parent))


WorldModel.TestCase.settings = settings(max_examples=40, stateful_step_count=30, deadline=None)
TestWorldModel = WorldModel.TestCase

from __future__ import annotations

import re

import pytest

from elys.common.errors import EntityError, HierarchyError
from elys.common.ids import NO_ENTITY
from elys.sim_node.ecs.world import World


@pytest.fixture
def world() -> World:
    """A(B(D, E), C) and F."""
    world = World(capacity=2)
    a = world.spawn(name="A")
    b, _ = world.spawn(name="B", parent=a), world.spawn(name="C", parent=a)
    for name in "DE":
        world.spawn(name=name, parent=b)
    world.spawn(name="F", prefab="lamp.prefab.json")
    return world


def drawn(world: World, entity: int = NO_ENTITY) -> str:
    """The tree in brackets."""
    tree = world.hierarchy
    parts = [tree.name_of(child) + drawn(world, child) for child in tree.children_of(entity)]
    return f"({' '.join(parts)})" if parts else ""


def test_the_order_is_parents_first_and_siblings_in_order(world):
    assert drawn(world) == "(A(B(D E) C) F)"
    assert "".join(world.hierarchy.names(world.hierarchy.order)) == "ABDECF"
    b = world.hierarchy.find("A/B")
    assert [world.hierarchy.name_of(e) for e in world.hierarchy.subtree_of(b).tolist()] == ["B", "D", "E"]


@pytest.mark.parametrize(
    ("entity", "parent", "index", "expected"),
    [
        ("A/B/D", "", -1, "(A(B(E) C) F D)"),
        ("A/B/D", "", 0, "(D A(B(E) C) F)"),
        ("A/B/D", "A", 1, "(A(B(E) D C) F)"),
        ("A/B/D", "A/B", 1, "(A(B(E D) C) F)"),
        ("A/B/D", "A/B", 99, "(A(B(E D) C) F)"),
        ("A/C", "A", 0, "(A(C B(D E)) F)"),
        ("F", "A/C", 0, "(A(B(D E) C(F)))"),
        ("A", "F", -1, "(F(A(B(D E) C)))"),
    ],
)
def test_moving(world, entity, parent, index, expected):
    tree = world.hierarchy
    moved, target = tree.find(entity), tree.find(parent) if parent else NO_ENTITY
    world.set_parent(moved, target, index=index)
    assert drawn(world) == expected
    assert tree.children_of(target)[tree.sibling_index(moved)] == moved
    assert tree.parent_of(moved) == target


def test_cycles_are_refused_with_both_names(world):
    tree = world.hierarchy
    sentence = "entity 1 'A' cannot stand under entity 4 'D', which is below it; move the latter out first"
    with pytest.raises(HierarchyError, match=re.escape(sentence)):
        world.set_parent(tree.find("A"), tree.find("A/B/D"))
    with pytest.raises(HierarchyError, match="'B' cannot stand under itself"):
        world.set_parent(tree.find("A/B"), tree.find("A/B"))
    assert drawn(world) == "(A(B(D E) C) F)"


def test_enabled_is_inherited(world):
    tree = world.hierarchy
    a, d, f = tree.find("A"), tree.find("A/B/D"), tree.find("F")
    world.set_enabled(a, False)
    assert tree.is_enabled(d) and not tree.is_enabled_in_hierarchy(d) and tree.is_enabled_in_hierarchy(f)
    world.unparent(d)
    assert tree.is_enabled_in_hierarchy(d)
    world.set_parent(f, a)
    assert not tree.is_enabled_in_hierarchy(f)


def test_removed_places_come_back_clean(world):
    world.despawn(world.hierarchy.find("F"))
    for _ in range(3):
        world.despawn(world.spawn(name="X", parent=world.hierarchy.find("A"), enabled=False, prefab="x"))
    assert drawn(world) == "(A(B(D E) C))"
    fresh = world.spawn(parent=world.hierarchy.find("A"))
    tree = world.hierarchy
    assert (tree.name_of(fresh), tree.is_enabled(fresh), tree.prefab_of(fresh)) == ("", True, "")
    assert tree.describe(fresh) == f"entity {fresh}"


def test_finding_by_path(world):
    assert world.hierarchy.name_of(world.hierarchy.find("A/B/E")) == "E"
    assert world.hierarchy.prefab_of(world.hierarchy.find("F")) == "lamp.prefab.json"
    with pytest.raises(EntityError, match="there is no entity at 'A/E'"):
        world.hierarchy.find("A/E")

"""Rows that follow deltas are those that a plain walk through the tree would give, whatever happens to it."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from elys.bus.messages import scene as s
from elys.bus.mirror import SceneMirror
from elys.bus.tree.filter import EVERYTHING, EntityFilter, parse_filter
from elys.bus.tree.rows import OPEN_AT_FIRST, TreeRows
from elys.editor_node.entity_marks import EntityMarks
from elys.editor_node.selection import Selection
from elys.editor_node.tree_walk import TreeWalk


class Tree:
    """A mirror whose rows hear of its changes."""

    def __init__(self) -> None:
        self.mirror = SceneMirror()
        self.mirror.sequence = 0
        self.rows = TreeRows(self.mirror, is_marked=self.is_marked)
        self.marks = EntityMarks(self.mirror, on_change=self.rows.marks_changed)
        self.mirror.listen(self.rows.follow)
        self.count = 0

    def is_marked(self, mark: str, entity: int) -> bool:
        return self.marks.is_marked(mark, entity)

    def apply(self, *changes: s.SceneChange) -> None:
        self.mirror.apply_delta(s.SceneDelta(epoch=0, sequence=self.mirror.sequence + 1, tick=0, changes=changes))

    def spawn(self, name: str = "", parent: int = 0, **components) -> s.Spawned:
        self.count += 1
        return s.Spawned(
            entity=self.count, name=name or f"Thing {self.count}", parent=parent, enabled=True, components=components
        )

    def add(self, name: str = "", parent: int = 0, **components) -> int:
        self.apply(self.spawn(name, parent, **components))
        return self.count


def plain_rows(tree: Tree, wanted: EntityFilter, sort: Callable[[int], object] | None) -> list[tuple[int, int]]:
    """Entity and depth of each line, by recursion."""
    mirror, rows = tree.mirror, tree.rows
    found = {i for i, e in mirror.entities.items() if wanted.lets_through(e, mirror, tree.marks.is_marked)}

    def is_seen(entity: int) -> bool:
        return entity in found or any(is_seen(child) for child in mirror.children_of(entity))

    def below(parent: int, depth: int) -> list[tuple[int, int]]:
        lines = []
        children = mirror.children_of(parent)
        for child in children if sort is None else sorted(children, key=sort):
            if wanted is EVERYTHING or is_seen(child):
                lines.append((child, depth))
                if wanted is not EVERYTHING or rows.is_open(child):
                    lines += below(child, depth + 1)
        return lines

    return below(0, 0)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(
    ("search", "order"), [("", "scene"), ("", "name"), ("thing 1 enabled", "scene"), ("!locked", "kind")]
)
def test_rows_after_random_changes_are_those_of_a_plain_walk(seed, search, order):
    chance, tree = random.Random(seed), Tree()
    wanted = parse_filter(search)

    def some(*, root: bool = False) -> int:
        return chance.choice([*([0] if root else []), *tree.mirror.entities])

    def change() -> s.SceneChange:
        kind = chance.random()
        if not tree.mirror.entities or kind < 0.4:
            return tree.spawn(f"thing {chance.randrange(30)}", some(root=True), **chance.choice([{}, {"Light": {}}]))
        if kind < 0.5:
            return s.Despawned(entity=some())
        if kind < 0.7:
            moved, parent = some(), some(root=True)
            if parent in tree.mirror.descendants(moved):
                parent = 0
            return s.Reparented(entity=moved, parent=parent, index=chance.randrange(-1, 4))
        if kind < 0.8:
            return s.EnabledSet(entity=some(), enabled=chance.random() < 0.5)
        if kind < 0.9:
            return s.Renamed(entity=some(), name=f"thing {chance.randrange(30)}")
        return s.ComponentSet(entity=some(), component="Camera", values={})

    def sort(entity: int) -> object:
        found = tree.mirror.entities[entity]
        stem, _, number = found.name.partition(" ")
        kind = next((name for name in ("Light", "Camera") if name in found.components), "Empty")
        return (kind if order == "kind" else "", stem, int(number))

    for step in range(150):
        if step % 3:
            tree.apply(change())
        else:  # several in one delta, each about what the ones before it left
            before = tree.mirror.sequence
            listeners = tree.mirror._listeners
            tree.mirror._listeners = []
            updates: list = []
            tree.mirror.listen(updates.append)
            for _ in range(chance.randrange(1, 30)):
                tree.apply(change())
            tree.mirror._listeners = listeners
            changes = tuple(c for update in updates for c in update.changes)
            removed = tuple(entity for update in updates for entity in update.removed)
            assert tree.mirror.sequence > before
            tree.rows.follow(type(updates[0])(reset=False, changes=changes, removed=removed))
        if tree.mirror.entities and chance.random() < 0.4:
            tree.rows.set_open(some(), chance.random() < 0.6)
        if tree.mirror.entities and chance.random() < 0.2:
            tree.marks.set("locked", [some()], chance.random() < 0.6)
        rows = tree.rows.show(wanted, order)
        expected = plain_rows(tree, wanted, None if order == "scene" else sort)
        assert [(row.entity, row.depth) for row in rows] == expected
        assert all(rows.place_of(entity) == place for place, (entity, _) in enumerate(expected))
        assert len({entity for entity in tree.mirror.entities if entity in rows}) == len(rows)


def test_few_changes_of_a_large_scene_are_spliced():
    tree = Tree()
    tree.apply(*(tree.spawn() for _ in range(1000)))
    rows = tree.rows.show()
    made = rows._make
    rows._make = lambda: pytest.fail("the rows were made anew")
    tree.apply(s.Despawned(entity=500), tree.spawn("Last"))
    tree.apply(s.Reparented(entity=3, parent=0, index=700))
    child = tree.add("Child", 10)
    assert child in rows.show()
    rows.set_open(10, False)
    assert len(rows.show()) == 1000
    rows._make = made
    tree.apply(*(s.Despawned(entity=entity) for entity in range(100, 200)))
    assert len(rows.show()) == 900


def test_a_large_family_stays_closed_and_what_was_opened_stays_open():
    tree = Tree()
    few, many = tree.add(), tree.add()
    tree.apply(*(tree.spawn(parent=few) for _ in range(OPEN_AT_FIRST)))
    tree.apply(*(tree.spawn(parent=many) for _ in range(OPEN_AT_FIRST + 1)))
    assert len(tree.rows.show()) == 2 + OPEN_AT_FIRST
    tree.add(parent=few)  # one more does not make it shut under the hand
    assert len(tree.rows.show()) == 3 + OPEN_AT_FIRST
    tree.rows.set_all_open(True)
    assert len(tree.rows.show()) == len(tree.mirror.entities)
    tree.rows.set_all_open(False, [few])
    assert len(tree.rows.show()) == 2 + OPEN_AT_FIRST + 1
    assert tree.rows.show()[-1].depth == 1
    assert tree.rows.show()[0] == (few, 0, True, False)


def test_marks_are_passed_on_and_follow_who_comes_back():
    tree = Tree()
    parent = tree.add()
    child = tree.add(parent=parent)
    tree.marks.set("locked", [parent, 99], True)
    assert tree.marks.own("locked") == (parent,)
    assert tree.marks.is_marked("locked", child) and not tree.marks.has("locked", child)
    assert not tree.marks.is_marked("hidden", child)
    tree.marks.remap({parent: 70})
    assert tree.marks.own("locked") == (70,)


def test_walking_with_keys_and_typing_names():
    now = [0.0]
    tree, selection = Tree(), Selection()
    house = tree.add("House")
    door, window = tree.add("Door", house), tree.add("Window", house)
    hut, dog = tree.add("Hut"), tree.add("dog")
    tree.rows.show()
    walk = TreeWalk(tree.mirror, tree.rows, selection, clock=lambda: now[0])
    walk.step(1)
    assert selection.entities == (house,)
    walk.step(-1)
    assert selection.entities == (house,)
    walk.step(2)
    walk.step(2, extends=True)
    assert selection.entities == (window, hut, dog)
    walk.step(-1, extends=True)
    assert selection.entities == (window, hut)
    walk.go_to(-1)
    assert selection.entities == (dog,)
    walk.go_to(0, extends=True)
    assert len(selection) == 5 and selection.primary == house
    selection.replace([window])
    walk.go_out()
    assert selection.entities == (house,)
    walk.go_out()
    assert door not in tree.rows
    walk.go_in()
    walk.go_in()
    assert selection.entities == (door,)

    for letter, expected in (("h", hut), ("o", house), ("x", house)):
        walk.type(letter)
        assert selection.entities == (expected,)
    now[0] += 2.0
    for expected in (hut, house, hut):  # the same letter goes round
        walk.type("H")
        assert selection.entities == (expected,)
    now[0] += 2.0
    walk.type("D")
    assert selection.entities == (dog,)


def test_selection_goes_back_and_forward():
    selection = Selection()
    for chosen in ((1,), (2,), (2, 3)):
        selection.replace(chosen)
    selection.toggle(4)
    selection.go_back(bool)
    assert selection.entities == (2, 3)
    selection.go_back(lambda entity: entity != 2)  # it is gone: not a place to go to
    assert selection.entities == (1,)
    assert selection.has_future
    selection.go_forward(bool)
    assert selection.entities == (2, 3)
    selection.replace((9,))
    assert not selection.has_future
    selection.remap({1: 11})
    selection.go_back(bool)
    selection.go_back(bool)
    assert selection.entities == (11,)

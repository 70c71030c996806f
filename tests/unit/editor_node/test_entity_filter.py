"""The language of the hierarchy's search: what it finds, and what it says of a search that means nothing."""

from __future__ import annotations

import pytest

from elys.bus.messages.scene import SceneDelta, Spawned
from elys.bus.mirror import SceneMirror
from elys.bus.tree.filter import EVERYTHING, EXAMPLES, FilterError, parse_filter
from elys.bus.tree.kinds import kind_of

SCENE = (
    Spawned(entity=1, name="Big crate", parent=0, enabled=True, components={"RigidBody": {}, "MeshRenderer": {}}),
    Spawned(entity=2, name="crate big", parent=0, enabled=False, components={"MeshRenderer": {"mesh": "sphere"}}),
    Spawned(entity=3, name="Lamp", parent=2, enabled=True, components={"Light": {"kind": "spot"}}),
    Spawned(entity=4, name="Straße: t:Light", parent=0, enabled=True, components={"Light": {}, "MeshRenderer": {}}),
    Spawned(entity=5, name="enabled", parent=0, enabled=True, components={}, prefab="/scenes/Lamp.prefab.json"),
    Spawned(entity=6, name="日本語 \N{WAVE DASH}", parent=5, enabled=True, components={"Camera": {}}),
)


@pytest.fixture
def mirror():
    mirror = SceneMirror()
    mirror.sequence = 0
    mirror.apply_delta(SceneDelta(epoch=0, sequence=1, tick=0, changes=SCENE))
    return mirror


def found(mirror: SceneMirror, search: str) -> list[int]:
    marks = {"locked": {2, 3}, "hidden": {6}}  # as one that passes them on to those below would say
    wanted = parse_filter(search)
    return [i for i, e in mirror.entities.items() if wanted.lets_through(e, mirror, lambda mark, i: i in marks[mark])]


@pytest.mark.parametrize(
    ("search", "expected"),
    [
        ("", [1, 2, 3, 4, 5, 6]),
        ("crate", [1, 2]),
        ("big CRATE", [1, 2]),
        ('"big crate"', [1]),
        ("!crate", [3, 4, 5, 6]),
        ('!"big crate" crate', [2]),
        ("!!crate", [1, 2]),
        ("strasse", [4]),
        ("語", [6]),
        ("t:Light", [3, 4]),
        ("t:li", [3, 4]),
        ("T:LIGHT !t:spot", [4]),
        ("t:sphere", [2]),
        ("t:mesh", [1, 2]),
        ("t:empty", [5]),
        ("c:RigidBody", [1]),
        ("has:mesh", [1, 2, 4]),
        ("c:MeshRenderer !c:RigidBody", [2, 4]),
        ("p:lamp", [5]),
        ("p:*", [5]),
        ("p:scenes", []),
        ("enabled", [1, 4, 5, 6]),
        ("!enabled", [2, 3]),
        ('"enabled"', [5]),
        ("n:enabled", [5]),
        ('n:"Straße: t:Light"', [4]),
        ('"t:Light"', [4]),
        ("locked", [2, 3]),
        ("!locked !hidden", [1, 4, 5]),
        ("  lamp   t:light ", [3]),
    ],
)
def test_searches_find(mirror, search, expected):
    assert found(mirror, search) == expected


@pytest.mark.parametrize(
    ("search", "problem"),
    [
        ("!", "'!' wants something behind it"),
        ("crate ! ", "'!' wants something behind it"),
        ("t:", "t: wants a kind behind it"),
        ("c:", "as c:RigidBody"),
        ("p:", "a part of a file's name"),
        ("t:Lihgt", "did you mean Light?"),
        ("c:rigidbdy", "did you mean RigidBody?"),
        ("c:zzzz", "there are Transform, RigidBody"),
        ("x:crate", "there is no filter x:"),
        (":crate", "':' wants t, c, p or n before it"),
        ('"big crate', 'the quote is not closed: "big crate'),
    ],
)
def test_a_search_that_means_nothing_says_why(search, problem):
    with pytest.raises(FilterError) as caught:
        parse_filter(search)
    assert problem in str(caught.value)
    assert caught.value.problem.format(**caught.value.values) == str(caught.value)  # so it can be translated


def test_examples_are_searches():
    assert all(parse_filter(search) is not EVERYTHING for search, _ in EXAMPLES)


def test_kinds_go_by_what_is_special(mirror):
    assert [kind_of(entity) for entity in mirror.entities.values()] == [
        ("Mesh", "box"),
        ("Mesh", "sphere"),
        ("Light", "spot"),
        ("Light", "directional"),
        ("Empty", ""),
        ("Camera", ""),
    ]

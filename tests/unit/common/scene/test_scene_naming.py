"""Entities of a file call one another by name: in it, in prefabs, and back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.common.assets import AssetStore
from elys.common.errors import SceneError
from elys.common.scene import EntityRecord, SceneSettings, collapse, expand, format_scene, open_scene, parse_scene
from elys.common.scene_naming import Names

HOUSES = Names([("House", -1), ("Door", 0), ("House 2", -1), ("Door", 2), ("Key", 3), ("Roof", 2), ("Key", -1)])


@pytest.mark.parametrize(
    ("text", "row"),
    [
        ("House", 0),
        ("Roof", 5),
        ("House/Door", 1),
        ("House 2/Door", 3),
        ("Door/Key", 4),
        ("House 2/Door/Key", 4),
        ("Key", 6),
    ],
)
def test_a_name_or_the_end_of_a_path_names_one(text: str, row: int) -> None:
    assert HOUSES.find(text) == row


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("Door", "2 entities are called 'Door'; name the way to one, as 'House/Door'"),
        ("Rof", "nobody here is called 'Rof'; did you mean 'Roof'?"),
        ("Garden/Door", "nobody here is called 'Garden/Door'"),
        ("/Door", "nobody here is called '/Door'"),
        ("oor", "nobody here is called 'oor'"),
    ],
)
def test_what_names_nobody_or_several_is_refused(text: str, sentence: str) -> None:
    with pytest.raises(SceneError, match=sentence.replace("?", r"\?")):
        HOUSES.find(text)


NAMES = st.sampled_from(["A", "B", "A/B", "", "/"])


@given(st.lists(st.tuples(NAMES, st.integers(-1, 8)), max_size=9))
def test_the_name_that_is_written_finds_whom_it_was_written_for(entities: list[tuple[str, int]]) -> None:
    rows = [(name, min(parent, row - 1)) for row, (name, parent) in enumerate(entities)]
    names = Names(rows)
    for row in range(len(rows)):
        try:
            text = names.name_of(row)
        except SceneError:
            continue
        assert names.find(text) == row


def test_names_are_as_short_as_they_can_be() -> None:
    assert [HOUSES.name_of(row) for row in range(7)] == [
        "House",
        "House/Door",
        "House 2",
        "House 2/Door",
        "Door/Key",
        "Roof",
        "Key",
    ]
    with pytest.raises(SceneError, match="several entities have the path 'A'; give siblings different names"):
        Names([("A", -1), ("A", -1)]).name_of(1)


# ---------------------------------------------------------------- files


def scene(*entities: dict[str, Any]) -> str:
    return json.dumps({"elys_scene": 1, "entities": list(entities)})


def joined(name: str, other: Any, **more: Any) -> dict[str, Any]:
    return {"name": name, "components": {"Joint": {"other": other}}, **more}


def test_references_become_places_in_the_list(tmp_path: Path) -> None:
    document = parse_scene(scene(joined("A", "B"), joined("B", ""), joined("C", 0, children=[joined("D", "C")])))
    records = expand(document, directory=tmp_path, assets=AssetStore())
    assert [record.references for record in records] == [{"Joint.other": 1}, {}, {}, {"Joint.other": 2}]
    assert all("other" not in record.components["Joint"] for record in records)


@pytest.mark.parametrize(
    ("other", "sentence"),
    [
        ("Nobody", r"entities\[0\].components.Joint.other: nobody here is called 'Nobody'"),
        ("Twin", r"entities\[0\].components.Joint.other: 2 entities are called 'Twin'"),
        (3, r"entities\[0\].components.Joint.other: must be the name of an entity, as \"Door\""),
        (None, r"Joint.other: must be the name of an entity"),
        (False, r"Joint.other: must be the name of an entity"),
    ],
)
def test_what_is_no_name_here_is_refused_with_its_place(tmp_path: Path, other: Any, sentence: str) -> None:
    path = tmp_path / "x.scene.json"
    path.write_text(scene(joined("A", other), {"name": "Twin"}, {"name": "Twin"}))
    with pytest.raises(SceneError, match=sentence):
        open_scene(path, AssetStore())


@pytest.fixture
def cart(tmp_path: Path) -> Path:
    """A prefab whose wheel is joined to its root, and whose trailer's wheel to the trailer."""
    trailer = {"name": "Trailer", "children": [joined("Wheel", "Trailer")]}
    path = tmp_path / "cart.prefab.json"
    path.write_text(
        scene({"name": "Cart", "children": [joined("Wheel", "Cart"), trailer, joined("Hitch", "Trailer/Wheel")]})
    )
    return path


def test_a_prefab_means_its_own_entities_whatever_they_are_called_outside(tmp_path: Path, cart: Path) -> None:
    text = scene(
        {"name": "First", "prefab": "cart.prefab.json"},
        {
            "name": "Second",
            "prefab": "cart.prefab.json",
            "overrides": {"Hitch": {"Joint": {"other": "First/Trailer"}}, "Wheel": {"Joint": None}},
        },
    )
    records = expand(parse_scene(text), directory=tmp_path, assets=AssetStore())
    named = {f"{row} {record.name}": record.references.get("Joint.other") for row, record in enumerate(records)}
    assert named == {
        "0 First": None,
        "1 Wheel": 0,
        "2 Trailer": None,
        "3 Wheel": 2,
        "4 Hitch": 3,
        "5 Second": None,
        "6 Wheel": None,
        "7 Trailer": None,
        "8 Wheel": 7,
        "9 Hitch": 2,
    }
    assert saved(tmp_path, records) == format_scene(parse_scene(text))


def saved(directory: Path, records: list[EntityRecord]) -> str:
    return format_scene(collapse(records, name="", settings=SceneSettings(), directory=directory, assets=AssetStore()))


def test_a_joint_of_a_prefab_that_holds_nothing_any_more_is_written_so(tmp_path: Path, cart: Path) -> None:
    text = scene({"prefab": "cart.prefab.json", "overrides": {"Wheel": {"Joint": {"other": ""}}}})
    records = expand(parse_scene(text), directory=tmp_path, assets=AssetStore())
    assert records[1].references == {}
    again = expand(parse_scene(saved(tmp_path, records)), directory=tmp_path, assets=AssetStore())
    assert again == records


def test_what_cannot_be_named_in_a_file_is_said(tmp_path: Path) -> None:
    twins = [EntityRecord(name="Twin"), EntityRecord(name="Twin")]
    record = EntityRecord(name="A", components={"Joint": {}}, references={"Joint.other": 2})
    with pytest.raises(
        SceneError, match=r"'A' cannot be saved, whose Joint.other is 'Twin': several entities have the path"
    ):
        saved(tmp_path, [record, *twins])
    stale = EntityRecord(name="A", components={"Joint": {"other": 77}})
    with pytest.raises(
        SceneError, match=r"'A' cannot be saved: its Joint.other is an entity that is not there any more"
    ):
        saved(tmp_path, [stale])


def test_attractors_stand_in_the_settings(tmp_path: Path) -> None:
    settings = {"attractors": [{"position": [0, 1, 0], "strength": 2.5, "softening": 0.0}]}
    text = json.dumps({"elys_scene": 1, "settings": settings, "entities": []})
    document = parse_scene(text)
    assert document.settings.attractors[0].strength == 2.5
    assert parse_scene(format_scene(document)) == document
    for wrong, sentence in (
        ({"strenght": 1}, r"settings.attractors\[0\]: .*strenght"),
        ({"softening": -1}, r"settings.attractors\[0\].softening"),
    ):
        with pytest.raises(SceneError, match=sentence):
            parse_scene(json.dumps({"elys_scene": 1, "settings": {"attractors": [wrong]}}))

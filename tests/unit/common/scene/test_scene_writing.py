"""The canonical form of scene files: exact, stable, readable."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.common.components import component_from, declarations, values_of
from elys.common.errors import SceneError
from elys.common.scene import (
    EntityNode,
    SceneDocument,
    SceneSettings,
    format_scene,
    parse_scene,
    read_scene,
    write_scene,
)

CANONICAL = """\
{
  "elys_scene": 1,
  "name": "Canonical – Größe",
  "settings": {"gravity": [0, -1.62, 0], "substeps": 12},
  "entities": [
    {"name": "Group", "enabled": false},
    {
      "name": "Ball",
      "components": {
        "Transform": {"position": [0.1, -0.0, 1e-07]},
        "RigidBody": {},
        "Material": {"base_color": [1, 0.5, 0], "metallic": 1, "alpha_mode": "mask"}
      },
      "children": [
        {"name": "Inner"},
        {
          "prefab": "models/Arm \\"A\\".gltf",
          "components": {
            "Transform": {"position": [0, 0, 0]},
            "Camera": null
          },
          "overrides": {
            "Hand": {"Light": null},
            "Hand/Finger": {
              "Material": {"roughness": 0.6}
            }
          }
        }
      ]
    }
  ]
}
"""


def test_a_canonical_file_is_written_back_byte_by_byte(tmp_path: Path) -> None:
    path, copy = tmp_path / "a.scene.json", tmp_path / "b.scene.json"
    path.write_text(CANONICAL, encoding="utf-8")
    write_scene(read_scene(path), copy)
    assert copy.read_bytes() == path.read_bytes()


def test_what_equals_its_default_is_left_out_except_over_a_prefab() -> None:
    plain = EntityNode(name="A", components={"RigidBody": {"mass": 1.0, "motion": "dynamic", "gravity_scale": 0.5}})
    instance = EntityNode(prefab="a.gltf", components={"RigidBody": {"mass": 1.0}})
    text = format_scene(SceneDocument(settings=SceneSettings(tick_rate=60), entities=[plain, instance]))
    assert '"RigidBody": {"gravity_scale": 0.5}' in text
    assert '"RigidBody": {"mass": 1}' in text
    assert "settings" not in text


def test_keys_stand_in_the_order_of_the_declarations() -> None:
    components = {
        "Material": {"roughness": 0.1, "metallic": 0.2},
        "Transform": {"scale": (2, 2, 2), "position": (1, 1, 1)},
    }
    text = format_scene(SceneDocument(entities=[EntityNode(components=components)]))
    places = [
        text.index(f'"{word}"') for word in ("Transform", "position", "scale", "Material", "metallic", "roughness")
    ]
    assert places == sorted(places)


def test_a_long_component_is_broken_into_a_line_a_field() -> None:
    texture = "blake2b:" + "0" * 32
    components = {"Material": {"base_color_texture": texture, "normal_texture": texture, "metallic": 0.5}}
    text = format_scene(SceneDocument(entities=[EntityNode(components=components)]))
    assert '\n          "metallic": 0.5,\n' in text
    assert max(map(len, text.splitlines())) <= 120


FLOATS = st.floats(allow_nan=False, allow_infinity=False)


@given(st.tuples(FLOATS, FLOATS, FLOATS))
def test_floats_come_back_to_the_bit(position: tuple[float, float, float]) -> None:
    text = format_scene(SceneDocument(entities=[EntityNode(components={"Transform": {"position": position}})]))
    values = parse_scene(text).entities[0].components["Transform"]
    read = component_from("Transform", values or {}).position
    assert [x.hex() for x in read] == [float(x).hex() for x in position]


def values_for(name: str) -> st.SearchStrategy[dict[str, Any]]:
    """Some fields of a component with values from all over their ranges."""
    strategies: dict[str, st.SearchStrategy[Any]] = {}
    for field in declarations()[name].fields:
        low = -1e6 if field.minimum is None else field.minimum
        high = 1e6 if field.maximum is None else field.maximum
        number = st.floats(low, high)
        match field.kind.value:
            case "float":
                strategies[field.name] = number
            case "int":
                least = -(2**31) if field.minimum is None else field.minimum
                most = 2**31 - 1 if field.maximum is None else field.maximum
                strategies[field.name] = st.integers(int(least), int(most))
            case "bool":
                strategies[field.name] = st.booleans()
            case "choice":
                strategies[field.name] = st.sampled_from(field.choices)
            case "text" | "asset":
                strategies[field.name] = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
            case "vec3" | "color":
                strategies[field.name] = st.tuples(number, number, number)
            case "quat":
                quat = st.tuples(*[st.floats(-1, 1)] * 4)
                strategies[field.name] = quat.filter(lambda q: math.hypot(*q) > 0.01)
    return st.fixed_dictionaries({}, optional=strategies)


COMPONENTS = st.fixed_dictionaries({}, optional={name: values_for(name) for name in declarations()})
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
NODES = st.recursive(
    st.builds(EntityNode, name=TEXTS, enabled=st.booleans(), components=COMPONENTS),
    lambda inner: st.builds(EntityNode, name=TEXTS, components=COMPONENTS, children=st.lists(inner, max_size=3)),
    max_leaves=5,
)


@given(st.builds(SceneDocument, name=TEXTS, entities=st.lists(NODES, max_size=3)))
def test_what_is_written_reads_back_the_same(document: SceneDocument) -> None:
    text = format_scene(document)
    again = parse_scene(text)
    assert format_scene(again) == text
    waiting = list(zip(document.entities, again.entities, strict=True))
    assert again.name == document.name
    for a, b in waiting:
        assert (a.name, a.enabled) == (b.name, b.enabled)
        assert {n: values_of(component_from(n, v or {})) for n, v in a.components.items()} == {
            n: values_of(component_from(n, v or {})) for n, v in b.components.items()
        }
        waiting.extend(zip(a.children, b.children, strict=True))


@pytest.mark.parametrize("value", [math.nan, math.inf, object(), {1, 2}])
def test_what_json_cannot_hold_is_refused(value: Any) -> None:
    document = SceneDocument(entities=[EntityNode(components={"RigidBody": {"mass": value}})])
    with pytest.raises(SceneError, match="cannot be written"):
        format_scene(document)


def test_an_unknown_component_is_refused_not_lost() -> None:
    with pytest.raises(SceneError, match="no component 'Zebra'"):
        format_scene(SceneDocument(entities=[EntityNode(components={"Zebra": {}})]))


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.scene.json"
    write_scene(SceneDocument(name="old"), path)

    def full_disk(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(SceneError, match=r"a\.scene\.json cannot be written: No space left on device"):
        write_scene(SceneDocument(name="new"), path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.scene.json"]
    assert read_scene(path).name == "old"


def test_writing_into_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="cannot be written: No such file or directory"):
        write_scene(SceneDocument(), tmp_path / "nowhere" / "a.scene.json")


def test_a_written_file_may_be_read_by_whom_the_umask_lets(tmp_path: Path) -> None:
    path = tmp_path / "a.scene.json"
    write_scene(SceneDocument(), path)
    path.chmod(0o640)
    write_scene(SceneDocument(name="x"), path)
    assert path.stat().st_mode & 0o777 == 0o640

"""Bad scene files: each is one sentence with file, place and remedy, and nothing but a SceneError comes out."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.common.errors import ElysError, SceneError
from elys.common.scene import format_scene, parse_scene, read_scene


def scene(**fields: Any) -> str:
    return json.dumps({"elys_scene": 1, **fields})


def entity(**fields: Any) -> str:
    return scene(entities=[{"name": "A"}, fields])


def component(name: str, **fields: Any) -> str:
    return entity(components={name: fields})


def raw(components: str) -> str:
    return f'{{"elys_scene": 1, "entities": [{{"components": {{{components}}}}}]}}'


BAD = {
    "empty": ("", "1:1: not JSON: the file is empty"),
    "cut off": ('{"elys_scene": 1,\n  "entities": [', "2:16: not JSON: expecting value"),
    "missing comma": ('{"elys_scene": 1\n "name": "x"}', "2:2: not JSON: expecting ',' delimiter"),
    "trailing": ("{} {}", "1:4: not JSON: extra data"),
    "not a number": ('{"elys_scene": NaN}', "NaN is not a number that JSON knows"),
    "infinity": ('{"elys_scene": 1, "settings": {"gravity": [0, -Infinity, 0]}}', "-Infinity is not a number"),
    "twice": ('{"elys_scene": 1, "name": "a", "name": "b"}', 'the key "name" stands twice'),
    "a list": ("[]", "must be an object {...}, not a list [...]"),
    "no version": ("{}", 'not a scene of ELYS: it has no "elys_scene": 1'),
    "old style": ('{"entities": []}', "not a scene of ELYS"),
    "newer": ('{"elys_scene": 2}', "elys_scene: scene version 2 is newer than this ELYS reads (1); update ELYS"),
    "version of text": ('{"elys_scene": "1"}', 'elys_scene: must be 1, not "1"'),
    "version zero": ('{"elys_scene": 0}', "elys_scene: must be 1, not 0"),
    "unknown key": (scene(entites=[]), "entites: a scene has no such field; did you mean 'entities'?"),
    "entities": (scene(entities={}), "entities: must be a list [...], not an object {...}"),
    "entity": (scene(entities=[1]), "entities[0]: must be an object {...}, not 1"),
    "entity key": (
        entity(componets={}),
        "entities[1].componets: an entity has no such field; did you mean 'components'?",
    ),
    "name": (entity(name=3), "entities[1].name: must be a text, not 3"),
    "enabled": (entity(enabled="yes"), 'entities[1].enabled: must be true or false, not "yes"'),
    "children": (entity(children=[{"children": [7]}]), "entities[1].children[0].children[0]: must be an object"),
    "component": (
        component("Rigidbody"),
        "components.Rigidbody: there is no such component; did you mean 'RigidBody'?",
    ),
    "strange component": (component("Zebra"), "components.Zebra: there is no such component; known are Transform"),
    "field": (component("RigidBody", mas=1), "RigidBody.mas: RigidBody has no such field; did you mean 'mass'?"),
    "value": (
        component("RigidBody", mass="heavy"),
        "entities[1].components.RigidBody.mass: must be a number, not 'heavy'",
    ),
    "range": (
        component("RigidBody", mass=-1),
        "entities[1].components.RigidBody.mass: must be at least 1e-06 kg, not -1",
    ),
    "choice": (component("Collider", shape="cow"), "Collider.shape: must be one of box, sphere"),
    "too large to store": (
        component("Transform", scale=[1, 1e39, 1]),
        "Transform.scale: must fit 32 bits (3.4e38), not 1e+39",
    ),
    "vector": (component("Transform", position=[1, 2]), "Transform.position: must be 3 numbers, not [1, 2]"),
    "rotation": (component("Transform", rotation=[0, 0, 0, 0]), "Transform.rotation: must be a rotation"),
    "huge": (raw('"Camera": {"priority": 1%s}' % ("0" * 4000)), "Camera.priority: must fit 32 bits"),
    "too long": (raw('"Camera": {"priority": 1%s}' % ("0" * 5000)), "not JSON"),
    "huge float": (raw('"RigidBody": {"mass": 1e999}'), "RigidBody.mass: must be a finite number"),
    "huge setting": ('{"elys_scene": 1, "settings": {"tick_rate": 1%s}}' % ("0" * 400), "settings"),
    "setting": (
        scene(settings={"gravty": 1}),
        "settings.gravty: the settings of a scene has no such field; did you mean 'gravity'?",
    ),
    "setting value": (scene(settings={"tick_rate": 0}), "settings.tick_rate: expected `int` >= 1"),
    "setting vector": (scene(settings={"gravity": [0, 1]}), "settings.gravity: expected `array` of length 3"),
    "setting in vector": (scene(settings={"gravity": [0, "x", 0]}), "settings.gravity[1]: expected `float`, got `str`"),
    "overrides alone": (
        entity(overrides={"A": {}}),
        "entities[1].overrides: only an entity with a prefab has overrides",
    ),
    "override": (
        entity(prefab="x.gltf", overrides={"A/B": {"Light": {"kind": "torch"}}}),
        'overrides["A/B"].Light.kind: must be one of',
    ),
    "null component": (entity(components={"Light": None}), "entities[1].components.Light: must be an object"),
    "empty prefab": (entity(prefab=""), "entities[1].prefab: must name a file"),
    "surrogate": ('{"elys_scene": 1, "name": "\\ud800"}', "name: holds half of a surrogate pair"),
    "surrogate value": (raw('"Script": {"source": "\\udc00"}'), "Script.source: holds half"),
    "nested brackets": ("[" * 100_000, "brackets are nested too deeply"),
}


@pytest.mark.parametrize("text, expected", BAD.values(), ids=BAD.keys())
def test_each_mistake_is_one_sentence_with_its_place(text: str, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.scene.json"
    path.write_text(text)
    with pytest.raises(SceneError) as caught:
        read_scene(path)
    message = str(caught.value)
    assert message.startswith(f"{path}:")
    assert expected in message
    assert "\n" not in message
    assert len(message) < 400 + len(str(path))


def test_entities_nested_deeper_than_allowed() -> None:
    node: dict[str, Any] = {}
    for _ in range(200):
        node = {"children": [node]}
    with pytest.raises(SceneError, match="nested more than 128 deep"):
        parse_scene(scene(entities=[node]))


def test_a_missing_file_names_those_that_are_near(tmp_path: Path) -> None:
    (tmp_path / "yard.scene.json").write_text(scene())
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(
        SceneError, match=r"there is no scene file .*yrad\.scene\.json; did you mean yard\.scene\.json\?"
    ):
        read_scene(tmp_path / "yrad.scene.json")
    with pytest.raises(SceneError, match="there is no scene file"):
        read_scene(tmp_path / "nowhere" / "yard.scene.json")


def test_a_directory_and_an_unreadable_path(tmp_path: Path) -> None:
    (tmp_path / "a.scene.json").write_text(scene())
    with pytest.raises(SceneError, match=r"is a directory, not a scene file; there is a\.scene\.json in it"):
        read_scene(tmp_path)
    with pytest.raises(SceneError, match=r"cannot be read|is not a path"):
        read_scene("a\0b.scene.json")
    with pytest.raises(SceneError, match="cannot be read"):
        read_scene(tmp_path / ("x" * 5000))


def test_binary_garbage_says_where(tmp_path: Path) -> None:
    path = tmp_path / "x.scene.json"
    path.write_bytes(b"{\n\x80\xff")
    with pytest.raises(SceneError, match=r"JSON in UTF-8, byte 2 in line 2 is not"):
        read_scene(path)


def test_a_byte_order_mark_is_no_mistake(tmp_path: Path) -> None:
    path = tmp_path / "x.scene.json"
    path.write_bytes(b"\xef\xbb\xbf" + scene(name="B").encode())
    assert read_scene(path).name == "B"


def test_a_prefab_has_one_root(tmp_path: Path) -> None:
    path = tmp_path / "x.prefab.json"
    path.write_text(scene(entities=[{"name": "A"}, {"name": "B"}]))
    with pytest.raises(SceneError, match="exactly one root entity, this one 2"):
        read_scene(path)


@given(st.binary(max_size=200))
def test_any_bytes_give_a_document_or_a_scene_error(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzz.scene.json"
    path.write_bytes(data)
    with contextlib.suppress(ElysError):
        read_scene(path)


KEYS = "name enabled prefab components overrides children Transform Collider position size mesh".split()  # noqa: SIM905
JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(KEYS) | st.text(max_size=4),
            inner,
            max_size=4,
        )
    ),
    max_leaves=25,
)


@given(JSON_VALUES, JSON_VALUES)
def test_any_json_gives_a_document_that_can_be_written_or_a_scene_error(settings: Any, entities: Any) -> None:
    for fields in (
        {"entities": [entities]},
        {"entities": entities},
        {"settings": settings},
        {"entities": [{"components": entities}]},
    ):
        try:
            document = parse_scene(scene(**fields))
        except ElysError:
            continue
        text = format_scene(document)
        assert format_scene(parse_scene(text)) == text

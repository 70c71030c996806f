"""`elys input` and `elys view --bindings`: what is listed, written, told of conflicts, and refused in one sentence."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from elys.common.input_bindings import load_bindings, user_file

SCENE = {
    "elys_scene": 1,
    "entities": [
        {"name": "Off", "enabled": False, "components": {"InputMap": {"actions": {"sing": "e"}}}},
        {
            "name": "Input",
            "components": {"InputMap": {"actions": {"boost": "space"}, "axes": {"steer": "a/d"}, "vectors": {}}},
        },
    ],
}


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "config"))
    (tmp_path / "track.scene.json").write_text(json.dumps(SCENE))
    return tmp_path / "config" / "bindings.toml"


def test_what_is_bound_is_listed_and_given_back(elys, mine: Path) -> None:
    assert "jump     action  space, pad_a" in elys("input", "list").out
    assert not mine.exists()
    told = elys("input", "bind", "jump", "k, pad_b")
    assert "jump is bound to k, pad_b" in told.out and "Conflict: pad_b does jump and crouch." in told.out
    elys("input", "bind", "move", "i/j/k/l", "--player", "2")
    assert mine == user_file() and load_bindings().of(2) == {"jump": "k, pad_b", "move": "i/j/k/l"}
    listed = json.loads(elys("input", "list", "--json", "--player", "2").out)
    whose = {entry["name"]: (entry["controls"], entry["whose"]) for entry in listed["inputs"]}
    assert whose["move"] == ("i/j/k/l", "own") and whose["run"][1] == "the scene's"
    assert {"control": "k", "names": ["jump", "move"]} in listed["shared"]
    assert elys("input", "reset", "jump").status == 0
    assert load_bindings().of(1) == {}
    assert elys("input", "reset", "--player", "2").status == 0
    assert load_bindings().of(2) == {}


def test_names_are_those_of_the_scene(elys, mine: Path, tmp_path: Path) -> None:
    out = elys("input", "bind", "boost", "e", "--scene", "track.scene.json", "--file", "other.toml").out
    assert "boost is bound to e, in other.toml" in out and "Conflict" not in out
    assert not mine.exists()
    (tmp_path / "other.toml").write_text('[bindings]\nboost = "a"\nfly = "f"\n')
    out = elys("input", "list", "--scene", "track.scene.json", "--file", "other.toml").out
    assert "The scene has no fly" in out and "Conflict: a does boost and steer." in out and "sing" not in out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("bind", "jump", "a/d"), "'a/d' is no control of an action"),
        (("bind", "jump!", "k"), "'jump!' is no name"),
        (("bind", "fly", "spaec"), "'spaec' is no control"),
        (("bind", "jump", "k", "--scene", "track.scene.json"), "has no 'jump': there are boost, steer"),
        (("bind", "jump", "k", "--player", "17"), "less than or equal to 16"),
        (("reset", "jump"), "jump is bound to nothing of your own: nothing is bound"),
        (("list", "--file", "wrong.toml"), "wrong.toml:2: jump: 'a/d/s' is no control"),
        (("list", "--file", "sort.toml"), "jump, which is an action here: 'a/d' is no control"),
        (("bind", "run", "k", "--file", "wrong.toml"), "wrong.toml:2: jump"),
    ],
)
def test_mistakes_are_one_sentence_and_write_nothing(elys, mine: Path, tmp_path: Path, words, said: str) -> None:
    (tmp_path / "wrong.toml").write_text('[bindings]\njump = "a/d/s"\n')
    (tmp_path / "sort.toml").write_text('[bindings]\njump = "a/d"\n')
    assert said in elys("input", *words).sentence
    assert not mine.exists()
    assert (tmp_path / "wrong.toml").read_text() == '[bindings]\njump = "a/d/s"\n'


@pytest.mark.parametrize("thin", [(), ("--thin",)])
def test_a_viewer_with_a_wrong_file_says_so_before_it_opens(elys, mine: Path, tmp_path: Path, thin) -> None:
    (tmp_path / "wrong.toml").write_text("[bindings]\njump = 3\n")
    assert "wrong.toml:2: jump is bound to a text" in elys("view", *thin, "--bindings", "wrong.toml").sentence
    assert "none.toml cannot be read" in elys("view", *thin, "--bindings", "none.toml").sentence
    assert "less than or equal to 16" in elys("view", *thin, "--player", "17").sentence

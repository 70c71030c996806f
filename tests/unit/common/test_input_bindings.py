"""Files of bindings: what is read and written, and where in a file something is wrong."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from elys.common.errors import InputError
from elys.common.input_bindings import (
    BindingsFile,
    FollowedBindings,
    load_bindings,
    save_bindings,
    shared_controls,
    user_file,
)
from elys.common.input_controls import controls_of


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    file = BindingsFile(
        {"jump": "k, pad_b", "move": "i/j/k/l, pad_left dead=0.25"}, {2: {"jump": "kp_0"}, 11: {"run": ""}}
    )
    path = save_bindings(file, tmp_path / "deep" / "bindings.toml")
    assert load_bindings(path) == file
    assert tomllib.loads(path.read_text())["player"]["2"] == {"jump": "kp_0"}
    assert file.of(1) == dict(file.everybody)
    assert file.of(2) == {"jump": "kp_0", "move": file.everybody["move"]}
    assert file.with_told(2, {}).players == {11: {"run": ""}}


def test_the_users_own_need_not_be_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path))
    assert user_file() == tmp_path / "bindings.toml"
    assert load_bindings() == BindingsFile()
    followed = FollowedBindings()
    user_file().write_text('[bindings]\nmove = ["i/j/k/l", "pad_left"]\n')
    assert followed(3) == {"move": "i/j/k/l, pad_left"}
    user_file().write_text("[bindings\n")
    assert followed(1) == {"move": "i/j/k/l, pad_left"}  # what it said before
    with pytest.raises(InputError):
        FollowedBindings()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[bindings]\njump = "k\n', r"b.toml are no TOML: .*line 2, column 10"),
        ("[bindings]\n\njump = 3\n", r"b.toml:3: jump is bound to a text"),
        ('[bindings]\njump = ["k", 3]\n', r"b.toml:2: jump is bound to a text"),
        ('[bindings]\nrun = "e"\njump = "spaec"\n', r"b.toml:3: jump: 'spaec' is no control of an action"),
        ('[player.2]\nrun = "e"\n[bindings]\nrun = "q/"\n', r"b.toml:4: run: 'q/' is no control"),
        ('[bindings]\n"wheel_y" = "e"\n', r"b.toml:2: wheel_y: wheel_y is what a device is called"),
        ('\n[keys]\njump = "k"\n', r"b.toml:2: there is no table \[keys\] of bindings"),
        ('[player.17]\njump = "k"\n', r"b.toml:1: there is no player '17': they are numbered from 1 to 16"),
        ('player = "me"\n', r"bindings of one player stand in a table"),
        ("bindings = 3\n", r"\[bindings\] is a table of names, not int"),
        ("[bindings]\n" + "".join(f'n{n} = "k"\n' for n in range(65)), "a player may bind 64 names, not 65"),
        ("#" * (1 << 19), "are larger than 256 KiB"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "b.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as told:
        load_bindings(path)
    assert "\n" not in str(told.value)


def test_files_that_are_no_files(tmp_path: Path) -> None:
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(InputError, match="cannot be read"):
            load_bindings(path)
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="are no TOML"):
        load_bindings(tmp_path / "bytes.toml")
    with pytest.raises(InputError, match="cannot be written"):
        save_bindings(BindingsFile(), tmp_path / "bytes.toml" / "x")


def test_controls_that_do_several_things() -> None:
    controls = {
        "jump": controls_of("action", "space, pad_a"),
        "use": controls_of("action", "e, pad_a"),
        "move": controls_of("vector", "a/d/s/w, pad_left"),
        "lean": controls_of("axis", "q/e, pad_left_x"),
    }
    assert shared_controls(controls) == [
        ("pad_a", ("jump", "use")),
        ("e", ("use", "lean")),
        ("pad_left_x", ("move", "lean")),
    ]

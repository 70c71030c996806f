"""How controls are written: what each form means, and what is refused with which words."""

from __future__ import annotations

import pytest

from elys.common.components import InputMap, component_from
from elys.common.errors import ComponentError, InputError
from elys.common.input_controls import Control, check_name, controls_of, sorts_taking


def test_each_form_of_a_control() -> None:
    assert controls_of("action", "space, pad_a") == (
        Control(form="button", names=("space",)),
        Control(form="button", names=("pad_a",)),
    )
    assert controls_of("action", "-pad_left_y, +wheel_y, pad_left_trigger") == (
        Control(form="axis", names=("pad_left_y",), sign=-1.0),
        Control(form="motion", names=("wheel_y",)),
        Control(form="axis", names=("pad_left_trigger",)),
    )
    assert controls_of("axis", "a/d, w, -s, -pad_left_x dead=0.2 curve=0.5 scale=2") == (
        Control(form="pair", names=("a", "d")),
        Control(form="button", names=("w",)),
        Control(form="button", names=("s",), sign=-1.0),
        Control(form="axis", names=("pad_left_x",), sign=-1.0, dead_zone=0.2, curve=0.5, scale=2.0),
    )
    cross, dpad, stick, pointer = controls_of("vector", "a/d/s/w,pad_dpad,pad_right flip=y,pointer flip=xy scale=-1")
    assert (cross.form, cross.names) == ("cross", ("a", "d", "s", "w"))
    assert (dpad.form, dpad.names[0], dpad.names[3]) == ("cross", "pad_dpad_left", "pad_dpad_up")
    assert (stick.form, stick.names, stick.flip_x, stick.flip_y) == (
        "stick",
        ("pad_right_x", "pad_right_y"),
        False,
        True,
    )
    assert pointer.is_motion and pointer.flip_x and pointer.flip_y and pointer.scale == -1.0
    assert controls_of("action", " ") == ()


def test_a_text_says_what_it_could_be_for() -> None:
    assert sorts_taking("space") == ("action", "axis")
    assert sorts_taking("a/d") == ("axis",)
    assert sorts_taking("pointer") == ("vector",)
    with pytest.raises(InputError, match="'spaec' is no control of an action"):
        sorts_taking("spaec")
    with pytest.raises(InputError, match="'a/d/s/ww' is no control of a vector"):
        sorts_taking("a/d/s/ww")


@pytest.mark.parametrize(
    ("sort", "text", "words"),
    [
        ("action", "a/d", "'a/d' is no control of an action: name a key or button"),
        ("action", "+space", r"'\+space' is no control of an action"),
        ("action", "space,", "between two commas stands no control"),
        ("action", "space scale=2", "'scale=2' is no option: controls of an action take no options"),
        ("axis", "a/d/s", "is no control of an axis: name two keys"),
        ("axis", "a/d dead=0.1", "a/d has no dead: only sticks and triggers have"),
        ("axis", "pad_left_x dead=1", "dead is a number from 0 to 0.95, not '1'"),
        ("axis", "pad_left_x curve=nan", "curve is a number from 0 to 1, not 'nan'"),
        ("axis", "pad_left_x curve=0 curve=1", "pad_left_x has the option curve twice"),
        ("axis", "pad_left_x flip=y", "'flip=y' is no option: controls of an axis take dead=, curve= and scale="),
        ("vector", "pad_left flip=z", "flip is x, y or xy, not 'z'"),
        ("vector", "pad_left fast", "'fast' is no option"),
        ("vector", "pointer scale=1e9", "scale is a number from -100 to 100, not '1e9'"),
        ("vector", "q" * 200, r"'q{40}\.\.\.' is no control of a vector"),
        ("vector", ", ".join(["pad_left"] * 17), "at most 16 controls do one thing, not 17"),
        ("vector", "p" * 301, "controls are told in at most 300 characters, not 301"),
    ],
)
def test_what_is_refused(sort, text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        controls_of(sort, text)


@pytest.mark.parametrize("name", ["", "2nd", "jump!", "x" * 61, "pad_left_x", "wheel_y"])
def test_names_that_are_none(name: str) -> None:
    with pytest.raises(InputError):
        check_name(name)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"actions": {"jump": 3}}, "InputMap.actions.jump must be a text of controls"),
        ({"actions": {"jump": "spaec"}}, "InputMap.actions.jump: 'spaec' is no control of an action"),
        ({"axes": {"wheel_x": "a/d"}}, "InputMap.axes.wheel_x: wheel_x is what a device is called"),
        ({"vectors": {"move": "a/d"}}, "InputMap.vectors.move: 'a/d' is no control of a vector"),
        ({"vectors": {f"v{n}": "" for n in range(65)}}, "InputMap.vectors may have 64 names, not 65"),
        ({"vectors": ["move"]}, "InputMap.vectors must be an object of named values"),
        ({"curve": 2.0}, "InputMap.curve must be at most 1"),
    ],
)
def test_a_map_that_is_none_is_refused(values, words: str) -> None:
    with pytest.raises(ComponentError, match=words):
        component_from("InputMap", values)


def test_the_usual_map_is_a_map() -> None:
    usual = InputMap()
    assert component_from("InputMap", {"actions": usual.actions, "axes": usual.axes, "vectors": usual.vectors}) == usual
    assert [*usual.actions, *usual.vectors] == ["jump", "run", "crouch", "use", "pause", "restart", "move", "look"]

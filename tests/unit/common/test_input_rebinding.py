"""Controls that are chosen by using them: what is heard is what `controls_of` reads, and means what was done."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.common.errors import InputError
from elys.common.input_controls import SORTS, Sort, controls_of
from elys.common.input_names import AXES, BUTTONS, KEY_NAMES, MOTIONS
from elys.common.input_rebinding import (
    DEVICES,
    Rebinding,
    conflicts_of,
    controls_at,
    told_controls,
    told_name,
    with_control,
)


def heard(sort: Sort, *done: tuple[str, float] | str, pushed: tuple[str, ...] = ()) -> str:
    """What comes of keys (their names), sticks and motions (names and how far)."""
    listening = Rebinding(sort, pushed=pushed)
    for one in done:
        if isinstance(one, str):
            listening.press(one)
        elif one[0] in AXES:
            listening.push(*one)
        else:
            listening.move(*one)
    return listening.heard


@pytest.mark.parametrize(
    ("sort", "done", "control"),
    [
        ("action", ["k"], "k"),
        ("action", ["mouse_left"], "mouse_left"),
        ("action", ["pad_b"], "pad_b"),
        ("action", [("pad_right_trigger", 0.9)], "+pad_right_trigger"),
        ("action", [("pad_left_y", -0.8)], "-pad_left_y"),
        ("action", [("wheel_y", 1.0)], "+wheel_y"),
        ("axis", ["a", "d"], "a/d"),
        ("axis", ["pad_left_bumper", "pad_right_bumper"], "pad_left_bumper/pad_right_bumper"),
        ("axis", [("pad_left_x", -0.7)], "pad_left_x"),  # less is where it already is less
        ("axis", [("pad_left_y", 0.7)], "-pad_left_y"),
        ("axis", [("pad_left_trigger", 1.0), ("pad_right_trigger", 1.0)], "-pad_left_trigger, pad_right_trigger"),
        ("axis", [("wheel_y", -2.0)], "wheel_y"),
        ("vector", ["j", "l", "k", "i"], "j/l/k/i"),
        ("vector", ["pad_dpad_left"], "pad_dpad"),
        ("vector", [("pad_right_y", 0.9)], "pad_right"),
        ("vector", [("pointer_x", 200.0), ("pointer_y", -60.0)], "pointer"),
    ],
)
def test_what_is_done_is_what_is_written(sort: Sort, done: list[str | tuple[str, float]], control: str) -> None:
    assert heard(sort, *done) == control
    controls_of(sort, control)


@pytest.mark.parametrize(
    ("sort", "done"),
    [
        ("action", [("pad_left_x", 0.5)]),  # not far enough to be meant
        ("action", [("pointer_x", 500.0)]),
        ("action", ["no_key"]),
        ("axis", ["a", "a"]),
        ("axis", ["a", "pad_b"]),  # two devices
        ("axis", ["a", ("pad_left_x", 1.0)]),
        ("axis", [("pad_left_trigger", 1.0), ("pad_left_trigger", 1.0), "d"]),
        ("vector", ["a", "d", "s", ("pad_left_x", 1.0), "pad_dpad_up", ("pointer_x", 900.0)]),
        ("vector", [("pointer_x", 100.0), ("wheel_y", 5.0)]),
    ],
)
def test_what_is_not_meant_is_passed_over(sort: Sort, done: list[str | tuple[str, float]]) -> None:
    assert heard(sort, *done) == ""


def test_a_stick_that_hangs_counts_when_it_was_let_go_of() -> None:
    assert heard("action", ("pad_left_x", 0.9), pushed=("pad_left_x",)) == ""
    assert heard("action", ("pad_left_x", 0.9), ("pad_left_x", 0.1), ("pad_left_x", -0.9), pushed=("pad_left_x",)) == (
        "-pad_left_x"
    )


def test_it_says_what_it_waits_for() -> None:
    listening = Rebinding("vector")
    asked = []
    for key in ("a", "d", "s", "w"):
        asked.append(listening.asked)
        listening.press(key)
    assert (asked, listening.asked) == (["left", "right", "down", "up"], "")


def test_one_takes_the_place_of_those_at_its_own_device() -> None:
    assert with_control("action", "space, mouse_left, pad_a", "k") == "k, pad_a"
    assert with_control("action", "pad_a, space", "+pad_right_trigger") == "space, +pad_right_trigger"
    assert with_control("action", "", "k") == "k"
    assert with_control("axis", "a/d, pad_left_x dead=0.2 curve=0.5", "-pad_right_y") == (
        "a/d, -pad_right_y dead=0.2 curve=0.5"
    )
    assert with_control("axis", "pad_left_x curve=1", "-pad_left_trigger, pad_right_trigger") == (
        "-pad_left_trigger curve=1, pad_right_trigger curve=1"
    )
    assert with_control("vector", "a/d/s/w, pointer scale=2, pad_right", "pointer") == "pointer scale=2, pad_right"
    assert with_control("vector", "a/d/s/w scale=0.5, pad_right flip=y", "pad_dpad") == "a/d/s/w scale=0.5, pad_dpad"
    with pytest.raises(InputError, match="'nothing' is no control"):
        with_control("action", "nothing", "k")


def test_controls_are_told_as_people_call_them() -> None:
    text = "a/d/s/w, left/right/down/up, pointer scale=1.5, pad_left, pad_dpad"
    assert told_controls("vector", text, "hands") == "W A S D, arrows, mouse"
    assert told_controls("vector", text, "pad") == "left stick, cross"
    actions = "+wheel_y, -wheel_y, kp_0, left_shift, mouse_left, +pad_left_y, -pad_left_x, +pad_right_trigger, pad_a"
    assert told_controls("action", actions, "hands") == "wheel up, wheel down, keypad 0, left shift, mouse left"
    assert told_controls("action", actions, "pad") == "left stick down, left stick left, right trigger, A"
    assert told_controls("axis", "a/d, -pad_left_y", "hands") == "A D"
    assert told_controls("axis", "a/d, -pad_left_y", "pad") == "left stick, down (turned round)"
    assert told_controls("action", "", "pad") == ""
    assert (told_name("high_jump"), told_name("x")) == ("High jump", "X")


def test_what_is_shared_is_said() -> None:
    controls = {"jump": controls_of("action", "e, pad_a"), "use": controls_of("action", "e"), "run": ()}
    assert conflicts_of("jump", controls) == "E does Use as well"
    assert conflicts_of("run", controls) == ""


_ANYTHING = st.one_of(
    st.sampled_from(sorted({*BUTTONS, *KEY_NAMES.values()})),
    st.tuples(st.sampled_from(sorted(AXES | MOTIONS)), st.floats(-400.0, 400.0)),
)


@given(st.sampled_from(SORTS), st.lists(_ANYTHING, max_size=12))
def test_whatever_is_heard_can_be_bound_and_bound_again(sort: Sort, done: list[str | tuple[str, float]]) -> None:
    chosen = heard(sort, *done)
    if not chosen:
        return
    usual = {"action": "space, pad_a", "axis": "a/d, pad_left_x curve=0.5", "vector": "pointer, pad_right flip=y"}[sort]
    bound = with_control(sort, usual, chosen)
    controls_of(sort, bound)
    device = next(device for device in DEVICES if controls_at(sort, chosen, device))
    other = next(one for one in DEVICES if one != device)
    assert [word.split()[0] for word in controls_at(sort, bound, device)] == chosen.split(", ")
    assert controls_at(sort, bound, other) == controls_at(sort, usual, other)
    assert with_control(sort, bound, chosen) == bound
    assert told_controls(sort, bound, device)

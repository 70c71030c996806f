"""The card of controls: keys and a gamepad work it, what is bound is kept, and what cannot be is said on it."""

from __future__ import annotations

from collections.abc import Mapping

from elys.common.components import InputMap
from elys.common.errors import InputError
from elys.render_node.controls_card import ALL, SHOWN, ControlsCard

MAP = InputMap(
    actions={"jump": "space, pad_a", "use": "e, pad_x"},
    axes={"steer": "a/d, pad_left_x"},
    vectors={"move": "a/d/s/w, pad_left"},
)  # rows: move, jump, use, steer, and all


def card_with(bindings: Mapping[str, str] = {}) -> tuple[ControlsCard, list[dict[str, str]]]:
    kept: list[dict[str, str]] = []
    return ControlsCard(MAP, bindings, lambda bound: kept.append(dict(bound))), kept


def press(card: ControlsCard, *names: str) -> None:
    for name in names:
        card.press(name)
        card.let_go(name)


def words(card: ControlsCard) -> list[str]:
    return [node.text.text for node in card.nodes() if node.text is not None]


def test_a_key_that_is_pressed_is_bound_beside_the_pads_own() -> None:
    card, kept = card_with({"elsewhere": "k"})
    press(card, "down", "enter")
    assert "Jump: press the key or button for it, push a stick or turn the wheel" in words(card)
    press(card, "j")
    assert kept == [{"elsewhere": "k", "jump": "j, pad_a"}] and card.bindings == kept[0]
    assert {"J", "A"} <= set(words(card))
    press(card, "enter", "pad_b")
    assert kept[-1]["jump"] == "j, pad_b"


def test_four_keys_are_a_direction_and_a_gamepad_works_it_too() -> None:
    card, kept = card_with()
    press(card, "pad_a", "left", "right", "down", "up")
    assert kept == [{"move": "left/right/down/up, pad_left"}]
    card.set_axis("pad_left_y", 0.9)  # one step, however long it leans
    card.set_axis("pad_left_y", 1.0)
    card.set_axis("pad_left_y", 0.0)
    assert card.chosen == 1
    press(card, "pad_a")
    card.set_axis("pad_right_trigger", 1.0)
    assert kept[-1]["jump"] == "space, +pad_right_trigger"


def test_the_stick_that_chose_the_row_is_not_what_is_bound() -> None:
    card, kept = card_with()
    card.set_axis("pad_left_y", 1.0)
    press(card, "pad_a")
    card.set_axis("pad_left_y", 0.9)
    assert kept == []
    card.set_axis("pad_left_y", 0.0)
    card.set_axis("pad_left_y", -1.0)
    assert kept == [{"jump": "space, -pad_left_y"}]


def test_the_scenes_own_come_back_for_one_or_for_all() -> None:
    card, kept = card_with({"jump": "j", "use": "k", "elsewhere": "q"})
    press(card, "down", "backspace")
    assert kept == [{"use": "k", "elsewhere": "q"}]
    press(card, "up", "up", "enter")
    assert card.chosen == 4 and ALL in words(card)
    assert kept[-1] == {"elsewhere": "q"}  # of another scene
    press(card, "enter")
    assert len(kept) == 2  # nothing was another


def test_escape_takes_back_the_choice_and_then_the_card() -> None:
    card, kept = card_with()
    press(card, "enter", "left", "escape")
    assert card.is_open and kept == []
    press(card, "f1")
    assert not card.is_open


def test_f1_can_do_nothing_else() -> None:
    card, kept = card_with()
    press(card, "down", "enter", "f1")
    assert card.is_open and kept == []
    press(card, "f2")
    assert kept == [{"jump": "f2, pad_a"}]


def test_what_is_shared_and_what_cannot_be_kept_is_said_on_it() -> None:
    card, _ = card_with()
    press(card, "down", "enter", "e")
    assert "E does Use as well" in words(card)

    def refuse(bound: Mapping[str, str]) -> None:
        raise InputError("the bindings /x/{y} cannot be written: no space")

    card = ControlsCard(MAP, {}, refuse)
    press(card, "down", "enter", "e")
    assert "the bindings /x/(y) cannot be written: no space" in words(card)
    assert card.bindings == {} and "space" in words(card)


def test_what_was_bound_in_another_scene_and_means_nothing_here_is_the_scenes_own() -> None:
    card, kept = card_with({"jump": "a/d/s/w"})
    assert "space" in words(card)
    press(card, "down", "enter", "j")
    assert kept == [{"jump": "j, pad_a"}]


def test_a_scene_of_many_actions_is_scrolled() -> None:
    card = ControlsCard(InputMap(actions={f"act_{n}": "k" for n in range(40)}, vectors={}), {}, lambda bound: None)
    assert "Act 0" in words(card) and "Act 20" not in words(card) and f"{41 - SHOWN} more" in words(card)
    for _ in range(20):
        press(card, "down")
    assert "Act 20" in words(card) and "Act 0" not in words(card)
    press(card, *["up"] * 21)
    assert card.chosen == 40 and ALL in words(card)


def test_a_scene_with_nothing_to_do_has_a_card_too() -> None:
    card = ControlsCard(InputMap(actions={}, vectors={}), {}, lambda bound: None)
    press(card, "enter", "backspace", "down")
    assert ALL in words(card)


def test_it_says_when_it_looks_otherwise() -> None:
    card, _ = card_with()
    before = card.version
    card.move("pointer_x", 3.0)
    card.set_axis("pad_left_x", 0.1)
    assert card.version == before
    press(card, "down")
    assert card.version > before

"""Actions, the keys they have, and what a person wants of every editor."""

from __future__ import annotations

import json

import pytest

from elys.editor_node.actions import Action, Actions
from elys.editor_node.events import KeyPressed, Modifiers
from elys.editor_node.key_bindings import Chord, KeyBindings
from elys.editor_node.keys import Key
from elys.editor_node.language import LANGUAGES, tr, tr_label, translations, use_language
from elys.editor_node.preferences import RECENT_LIMIT, Preferences, load_preferences, remember, save_preferences
from elys.editor_node.shortcuts import ShortcutLayer


def actions_that_note(done: list[str]) -> Actions:
    actions = Actions()
    actions.add(
        Action(name="a.first", label="First", keys=("Ctrl+S", "F5"), run=lambda: done.append("first")),
        Action(name="a.second", label="Second", keys=("Delete",), run=lambda: done.append("second"), repeats=True),
        Action(name="a.never", label="Never", keys=("N",), run=lambda: done.append("never"), is_possible=lambda: False),
    )
    return actions


@pytest.mark.parametrize("text", ["Ctrl+S", "Ctrl+Shift+Z", "Delete", "F12", ".", "Alt+Left Arrow", "Ctrl+-", "Ctrl+="])
def test_chords_are_read_as_they_are_written(text):
    assert str(Chord.parse(text)) == text
    assert Chord.parse(text.lower()) == Chord.parse(text)


@pytest.mark.parametrize("text", ["", "Ctrl+", "Hyper+S", "Ctrl+Ö", "+", "S+Ctrl"])
def test_what_is_no_chord_is_refused(text):
    with pytest.raises(ValueError, match=r"no (key|modifier)"):
        Chord.parse(text)


def test_the_command_key_is_ctrl_and_a_modifier_alone_is_no_chord():
    assert Chord.of(KeyPressed(Key.S, Modifiers.SUPER)) == Chord.parse("Ctrl+S")
    assert Chord.of(KeyPressed(Key.LEFT_CTRL, Modifiers.CTRL)) is None
    assert Chord.of(KeyPressed(12345)) is None


def test_keys_do_actions_and_can_be_chosen_anew():
    done: list[str] = []
    actions = actions_that_note(done)
    keys = KeyBindings(actions)
    layer = ShortcutLayer(actions, keys)
    assert layer.on_event(KeyPressed(Key.S, Modifiers.CTRL))
    assert not layer.on_event(KeyPressed(Key.S, Modifiers.CTRL, repeated=True))
    assert layer.on_event(KeyPressed(Key.DELETE, repeated=True))
    assert layer.on_event(KeyPressed(Key.N))  # known, though impossible now: nobody below is to take it
    assert not layer.on_event(KeyPressed(Key.M))
    assert done == ["first", "second"]

    assert keys.bind("a.first", Chord.parse("Delete")) == "a.second"
    assert keys.chosen == {"a.first": ("Delete",), "a.second": ()}
    assert layer.on_event(KeyPressed(Key.DELETE))
    assert not layer.on_event(KeyPressed(Key.F5))
    assert done[-1] == "first"
    again = KeyBindings(actions, keys.chosen)
    assert again.label_of("a.first") == "Delete"
    assert again.label_of("a.second") == ""
    keys.reset("a.second")
    assert keys.label_of("a.second") == "Delete"


def test_unreadable_keys_are_left_out(caplog):
    keys = KeyBindings(actions_that_note([]), {"a.first": ["Hyper+Q"], "a.second": ["F9"], "gone": ["F8"]})
    assert keys.label_of("a.first") == "Ctrl+S"
    assert keys.label_of("a.second") == "F9"
    assert "Hyper" in caplog.text


def test_an_action_has_one_name():
    actions = actions_that_note([])
    with pytest.raises(ValueError, match=r"a\.first"):
        actions.add(Action(name="a.first", label="", run=list))


def test_preferences_come_back_and_a_broken_file_is_put_aside(tmp_path, caplog):
    path = tmp_path / "deep" / "editor.json"
    assert load_preferences(path) == Preferences()
    wanted = Preferences(theme="light", language="fr", keys={"edit.undo": ("F3",)}, font_scale=1.5)
    save_preferences(wanted, path)
    assert load_preferences(path) == wanted
    path.write_text(json.dumps({"theme": "dark", "from_tomorrow": [1]}), encoding="utf-8")
    assert load_preferences(path) == Preferences()
    for bad in ("", "{", '{"theme": "pink"}', '{"keys": 3}'):
        path.write_text(bad, encoding="utf-8")
        assert load_preferences(path) == Preferences()
        assert (tmp_path / "deep" / "editor.broken").read_text(encoding="utf-8") == bad
    assert "cannot be read" in caplog.text


def test_a_place_that_cannot_be_written_harms_nothing(tmp_path, caplog):
    (tmp_path / "file").write_text("", encoding="utf-8")
    save_preferences(Preferences(), tmp_path / "file" / "editor.json")
    assert "not saved" in caplog.text


def test_the_newest_of_the_recent_is_first():
    recent: list[str] = []
    for place in [*range(20), 15]:
        remember(recent, str(place))
    assert recent[:3] == ["15", "19", "18"]
    assert len(recent) == RECENT_LIMIT


def test_every_language_translates_with_the_same_places():
    try:
        for code in LANGUAGES:
            use_language(code)
            for english, translated in translations(code).items():
                assert translated, english
                assert {part.split("}")[0] for part in english.split("{")[1:]} == {
                    part.split("}")[0] for part in translated.split("{")[1:]
                }, english
            assert tr_label("File").endswith("###File")
            assert tr("{count} of these", count=3) == "3 of these"
    finally:
        use_language("en")

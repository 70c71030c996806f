"""The command palette: what it finds and in which order, and doing things with the keyboard alone."""

from __future__ import annotations

import time

import pytest

from elys.bus.mirror import SceneMirror
from elys.common.scene import EntityRecord
from elys.editor_node.actions import Action, Actions
from elys.editor_node.events import KeyPressed, KeyReleased
from elys.editor_node.key_bindings import KeyBindings
from elys.editor_node.keys import Key
from elys.editor_node.language import use_language
from elys.editor_node.palette import PaletteEntry, action_entries, choose, closeness, folded, matching
from tests.unit.editor_node.person import CTRL


def entries(*labels: str, done: list[str] | None = None) -> list[PaletteEntry]:
    return [
        PaletteEntry(
            key=label, kind="action", label=label, words=(label,), run=lambda label=label: (done or []).append(label)
        )
        for label in labels
    ]


def labels(found: list[PaletteEntry]) -> list[str]:
    return [entry.label for entry in found]


def test_nearer_matches_come_first():
    all_of_them = entries("Select all", "Reset layout", "Save layout as...", "Layout", "Play or pause", "Relay out")
    assert labels(matching("layout", all_of_them, [])) == ["Layout", "Save layout as...", "Reset layout", "Relay out"]
    assert labels(matching("sel", all_of_them, []))[0] == "Select all"
    assert labels(matching("sa la", all_of_them, []))[0] == "Save layout as..."
    assert labels(matching("pop", all_of_them, [])) == ["Play or pause"]
    assert matching("xyz", all_of_them, []) == []


@pytest.mark.parametrize(
    ("query", "text", "is_found"),
    [("rst", "reset layout", True), ("tsr", "reset layout", False), ("a", "", False), ("ll", "select all", True)],
)
def test_letters_in_order_are_enough(query, text, is_found):
    assert (closeness(query, text) >= 0) == is_found


def test_case_and_accents_do_not_count():
    assert folded("Éclairé, ŒUVRE") == "eclaire, œuvre"
    assert labels(matching("PREFERENCES", entries("Préférences"), [])) == ["Préférences"]


def test_the_last_used_come_first_among_equals():
    all_of_them = entries("Show shaded", "Show depth", "Show normals", "Grid")
    recent = ["Grid", "Show normals"]
    assert labels(matching("", all_of_them, recent)) == ["Grid", "Show normals", "Show shaded", "Show depth"]
    assert labels(matching("show", all_of_them, recent))[0] == "Show normals"
    assert labels(matching("show d", all_of_them, recent))[0] == "Show depth"


def test_actions_are_found_in_both_languages_and_the_impossible_do_nothing():
    done: list[str] = []
    actions = Actions()
    actions.add(
        Action(name="edit.undo", label="Undo", keys=("Ctrl+Z",), run=lambda: done.append("undo")),
        Action(name="edit.delete", label="Delete", run=lambda: done.append("delete"), is_possible=lambda: False),
        Action(name="view.quiet", label="Quiet", run=lambda: done.append("quiet"), needs_session=False),
    )
    recent: list[str] = []
    use_language("fr")
    try:
        undo, delete, quiet = action_entries(actions, KeyBindings(actions))
        assert undo.label == "Annuler"
        assert undo.keys == "Ctrl+Z"
        for query in ("annul", "undo", "edit.undo"):
            assert matching(query, [undo, delete, quiet], [])[0] == undo
    finally:
        use_language("en")
    choose(delete, recent)
    choose(undo, recent)
    assert (done, recent) == (["undo"], ["action:edit.undo"])
    actions.has_session = lambda: False
    undo, _, quiet = action_entries(actions, KeyBindings(actions))
    assert (undo.is_possible, quiet.is_possible) == (False, True)


def test_names_of_a_large_scene_are_searched_at_once():
    from elys.editor_node.palette import SHOWN, EntityNames

    class Scene:
        structure_version = 1
        mirror = SceneMirror()

        def name_of(self, entity: int) -> str:
            return self.mirror.entities[entity].name

    scene, shown = Scene(), []
    from elys.bus.messages.scene import SceneDelta, Spawned

    scene.mirror.epoch, scene.mirror.sequence = 1, 0
    changes = tuple(Spawned(entity=n, name=f"Bœuf {n}", parent=0, enabled=True, components={}) for n in range(1, 5001))
    scene.mirror.apply_delta(SceneDelta(epoch=1, sequence=1, tick=0, changes=changes))
    names = EntityNames(scene, shown.append)
    assert names.entries("") == []
    found = matching("bœuf 4321", names.entries("bœuf 4321"), [])
    assert labels(found) == ["Bœuf 4321"]
    found[0].run()
    assert shown == [4321]
    assert len(matching("b", names.entries("b"), [])) == SHOWN


@pytest.mark.gl
def test_everything_is_done_with_the_keyboard_alone(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor = person.editor
        await person.press(Key.P, CTRL)
        await person.frames(2)
        await person.type("grid")
        editor.screenshot(screenshot_directory / "palette.png")
        assert editor.panel.look.shows_grid
        await person.press(Key.ENTER)
        await person.frames(2)
        assert not editor.panel.look.shows_grid
        assert editor.preferences.recent_actions == ["action:view.grid"]

        await person.press(Key.P, CTRL)  # what was used last stands first
        await person.frames(2)
        await person.press(Key.ENTER)
        await person.frames(2)
        assert editor.panel.look.shows_grid

        await person.press(Key.P, CTRL)
        await person.frames(2)
        await person.type("scale")
        await person.press(Key.ESCAPE)
        await person.frames(2)
        assert editor.ui.tools.tool == "move"

        await person.press(Key.P, CTRL)
        await person.frames(2)
        await person.press(Key.DOWN_ARROW)
        await person.press(Key.DOWN_ARROW)
        await person.press(Key.UP_ARROW)
        assert editor.workspace.palette._place == 1

        person.application.offer(KeyPressed(Key.DOWN_ARROW))
        await person.frames(1)
        time.sleep(0.5)  # a frame that takes long is no hand that holds a key
        await person.frames(1)
        await person.do(KeyReleased(Key.DOWN_ARROW))
        assert editor.workspace.palette._place == 2
        await person.press(Key.ESCAPE)

    at_the_editor(scenario)


@pytest.mark.gl
def test_an_entity_is_selected_and_looked_at(at_the_editor):
    async def scenario(person):
        editor = person.editor
        await person.click("menu/palette")
        await person.frames(2)
        await person.type("box 17")
        await person.press(Key.ENTER)
        await person.frames(2)
        box = person.stage.named("Box 17")
        assert editor.model.selection.entities == (box,)
        assert editor.panel.camera.target.tolist() == pytest.approx([17.0, 1.0, 0.0])

        await person.press(Key.P, CTRL)
        await person.frames(2)
        await person.type("redo")  # nothing to redo: grey, and Enter leaves the palette open
        await person.press(Key.ENTER)
        await person.frames(2)
        assert "palette/action:edit.redo" in editor.ui.landmarks.rectangles
        assert editor.preferences.recent_actions == ["entity:Box 17"]
        await person.press(Key.ESCAPE)

    records = [EntityRecord(name=f"Box {n}", components={"Transform": {"position": [n, 1, 0]}}) for n in range(1, 40)]
    at_the_editor(scenario, records)

"""What is locked, hidden and drawn over the picture belongs to the scene: there again in the next run, and in no other scene."""

from __future__ import annotations

import asyncio

import pytest

from elys.bus.messages import commands as c
from elys.bus.session import Session
from elys.common.scene import EntityRecord
from elys.editor_node.keys import Key
from elys.editor_node.preferences import SceneLook, load_preferences
from tests.unit.editor_node.person import CTRL, SHIFT, person_at
from tests.unit.editor_node.stage import open_stage, yard_records

pytestmark = pytest.mark.gl

YARD, GARDEN = "/scenes/yard.scene.json", "/scenes/garden.scene.json"


def at_the_desk(directory, scenario, *, path=YARD, records=None) -> None:
    """One run of a simulation, and an editor on it that remembers in `directory`."""
    from elys.editor_node.node import Editor

    async def main() -> None:
        async with open_stage(records) as stage:
            stage.host.path = path
            session = await Session.join(stage.broker.connect(), kind="editor")
            with Editor(session, null_platform=True, directory=directory) as editor:
                editor.preferences.has_seen_tour = True
                editor.workspace.tour.step = None
                async with person_at(editor, stage) as person:
                    await person.until(lambda: editor.model.scene.is_known and editor.model.history.is_attached)
                    await person.frames(4)
                    await scenario(person)
            await session.close()

    asyncio.run(main())


def marked(person, mark: str) -> list[str]:
    scene = person.editor.model.scene
    return [scene.name_of(entity) for entity in scene.marks.own(mark)]


async def mark_by_hand(person) -> None:
    await person.click("hierarchy/Crate")
    await person.press(Key.L, CTRL)
    await person.click("hierarchy/Box 2")
    await person.press(Key.H, CTRL)
    await person.click("menu/view")
    await person.click("menu/debug")
    await person.click("menu/debug.contacts")
    await person.press(Key.ESCAPE)
    await person.press(Key.ESCAPE)
    await person.frames(2)


def test_marks_and_debug_lines_are_there_in_the_next_run(tmp_path):
    async def rename(person) -> None:
        await mark_by_hand(person)
        await person.editor.model.edit.rename(person.stage.named("Box 2"), "Böx ✦")
        await person.frames(2)

    at_the_desk(tmp_path, rename)
    (kept,) = load_preferences(tmp_path / "editor.json").scenes.values()
    assert kept == SceneLook(locked=(("Crate",),), hidden=(("Böx ✦",),), debug=("contacts",))

    async def find(person) -> None:
        assert marked(person, "locked") == ["Crate"] and marked(person, "hidden") == ["Böx ✦"]
        assert person.editor.panel.look.debug == ("contacts",)
        await person.press(Key.L, CTRL | SHIFT)
        await person.frames(2)

    # Other ids than before: somebody stands in front.
    renamed = [EntityRecord(name="Newcomer"), *yard_records()]
    renamed = [
        EntityRecord(
            name=record.name.replace("Box 2", "Böx ✦"),
            parent=record.parent + 1 if record.parent >= 0 else -1,
            components=record.components,
        )
        for record in renamed
    ]
    at_the_desk(tmp_path, find, records=renamed)
    (kept,) = load_preferences(tmp_path / "editor.json").scenes.values()
    assert kept.locked == () and kept.hidden == (("Böx ✦",),)

    async def find_nothing(person) -> None:
        assert marked(person, "locked") == marked(person, "hidden") == []

    at_the_desk(tmp_path, find_nothing, path=GARDEN)


def test_each_scene_of_a_session_has_its_own(tmp_path):
    async def scenario(person) -> None:
        editor, stage = person.editor, person.stage
        await mark_by_hand(person)

        async def open_scene(path: str) -> None:
            records = tuple(yard_records())
            await editor.model._ask_plainly(c.LoadScene(name="scene", records=records, path=path))
            await person.until(lambda: editor.model.history.is_attached and editor.model.file.origin.endswith(path))
            await person.frames(4)

        await open_scene(GARDEN)
        assert marked(person, "locked") == marked(person, "hidden") == []
        await person.click("hierarchy/Sun")
        await person.press(Key.L, CTRL)
        await open_scene(YARD)
        assert marked(person, "locked") == ["Crate"] and marked(person, "hidden") == ["Box 2"]
        await open_scene(GARDEN)
        assert marked(person, "locked") == ["Sun"] and marked(person, "hidden") == []

        # Who was ended and comes back is marked still, and the name is not forgotten meanwhile.
        await person.click("hierarchy/Sun")
        await person.press(Key.DELETE)
        await person.until(lambda: "Sun" not in [e.name for e in editor.model.scene.mirror.entities.values()])
        await person.frames(2)
        assert any(look.locked == (("Sun",),) for look in editor.preferences.scenes.values())
        await editor.model.history.undo()
        await person.frames(2)
        assert editor.model.scene.marks.is_marked("locked", stage.named("Sun"))

        # Saved under another name it is the same scene.
        content = editor.model.scene.mirror.content
        await editor.model._ask_plainly(c.NoteSaved(path="/scenes/copy.scene.json", content=content))
        await person.until(lambda: editor.model.file.origin.endswith("copy.scene.json"))
        await person.frames(3)
        assert marked(person, "locked") == ["Sun"]
        assert sum(look.locked == (("Sun",),) for look in editor.preferences.scenes.values()) == 2

    at_the_desk(tmp_path, scenario)

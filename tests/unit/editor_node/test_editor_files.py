"""Files and history by hand: the real widgets on a window without a display."""

from __future__ import annotations

import asyncio
import os
import shutil
import subprocess
import sys

import msgspec
import pytest

from elys.bus.messages import commands as c
from elys.common.assets import AssetStore
from elys.common.scene import EntityNode, SceneDocument, open_scene, write_scene
from elys.editor_node.keys import Key
from elys.editor_node.recovery import Kept, Recovery
from tests.unit.editor_node.person import CTRL, SHIFT

pytestmark = pytest.mark.gl


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """The editor works in a folder with two scenes, one of them broken."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path / "cache"))
    pot = EntityNode(name="Pot", components={"Transform": {"position": [0.0, 1.0, 0.0]}, "RigidBody": {}})
    write_scene(SceneDocument(name="Kitchen", entities=[pot]), tmp_path / "kitchen.scene.json")
    (tmp_path / "broken.scene.json").write_text("{")
    (tmp_path / "more").mkdir()


def mass_of(person) -> float:
    return person.stage.host.mirror.entities[person.stage.named("Crate")].components["RigidBody"].mass


def shown(person) -> dict[str, tuple[float, float, float, float]]:
    """The widgets of the frames from now on."""
    person.editor.ui.landmarks.rectangles.clear()
    return person.editor.ui.landmarks.rectangles


async def until(person, condition) -> None:
    """As `person.until`, for as long as a dialog's first pictures take on a busy machine without a graphics card."""
    async with asyncio.timeout(60.0):
        while not condition():
            person.application.keep_awake(1.0)
            await asyncio.sleep(0.005)


async def click(person, name: str) -> None:
    """Clicks something once it stands still: a dialog finds its size and place in its first frames."""
    shown(person)
    await until(person, lambda: name in person.editor.ui.landmarks.rectangles)
    await person.frames(3)
    await person.click(name)


def test_the_history_is_clicked_along(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor, model = person.editor, person.editor.model
        crate = person.stage.named("Crate")
        for mass in (6.0, 7.0, 8.0):
            await model.edit.set_fields([crate], "RigidBody", {"mass": mass}, stroke=object())
        await model.save("yard.scene.json")
        await model.edit.rename(crate, "Treasure")
        await model.history.undo()
        editor.ui.actions.run("edit.history")
        await person.frames(4)
        assert {f"history/{place}" for place in range(5)} <= editor.ui.landmarks.rectangles.keys()
        editor.screenshot(screenshot_directory / "editor-history.png")
        await click(person, "history/1")
        await until(person, lambda: mass_of(person) == 6.0 and not model.history.is_busy)
        assert model.file.is_dirty
        await click(person, "history/3")
        await until(person, lambda: mass_of(person) == 8.0 and not model.history.is_busy)
        assert not model.file.is_dirty  # the file has just this
        await click(person, "history/0")
        await until(person, lambda: mass_of(person) == 5.0 and not model.history.undo_label)
        await click(person, "history/4")
        await until(person, lambda: person.stage.host.mirror.entities[crate].name == "Treasure")

    at_the_editor(scenario)


def test_an_undo_over_somebody_elses_edit_is_refused_and_may_be_forced_by_hand(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor, model, host = person.editor, person.editor.model, person.stage.host
        crate = person.stage.named("Crate")
        await model.edit.set_fields([crate], "RigidBody", {"mass": 7.0})
        theirs = c.SetComponent(entity=crate, component="RigidBody", values={"mass": 20.0})
        await host._take(c.CommandRequest(origin="robot", author="Ada", command=theirs), "")
        await person.press(Key.Z, CTRL)
        await until(person, lambda: "Crate's RigidBody was changed by Ada meanwhile" in model.error)
        assert mass_of(person) == 20.0
        editor.ui.actions.run("edit.history")
        await person.frames(4)
        editor.screenshot(screenshot_directory / "editor-conflict.png")
        await click(person, "history/force")
        await until(person, lambda: mass_of(person) == 5.0)
        await until(person, lambda: model.history.conflict is None)

    at_the_editor(scenario)


def test_another_scene_is_opened_by_hand_after_the_question_what_becomes_of_edits(
    at_the_editor, tmp_path, screenshot_directory
):
    async def scenario(person):
        editor, model, host = person.editor, person.editor.model, person.stage.host
        await model.edit.rename(person.stage.named("Crate"), "Treasure")
        await person.press(Key.O, CTRL)
        await click(person, "lose/cancel")
        await person.press(Key.O, CTRL)
        await click(person, "lose/lose")
        await click(person, "open/broken.scene.json")
        await click(person, "open/open")
        await until(person, lambda: "broken.scene.json:1:2: not JSON" in model.error)
        assert any(entity.name == "Treasure" for entity in host.mirror.entities.values())  # nothing happened
        await person.frames(2)
        editor.screenshot(screenshot_directory / "editor-open.png")
        await click(person, "open/more")
        await click(person, "open/..")
        await click(person, "open/kitchen.scene.json")
        await click(person, "open/open")
        await until(person, lambda: [entity.name for entity in host.mirror.entities.values()] == ["Pot"])
        await until(person, lambda: model.file.path == tmp_path / "kitchen.scene.json" and not model.file.is_dirty)
        assert editor.preferences.recent_scenes == [str(tmp_path / "kitchen.scene.json")]
        await until(person, lambda: f"Opened {tmp_path / 'kitchen.scene.json'}" in model.notice)
        # It is the first of those opened lately, a click away.
        rectangles = shown(person)
        await person.frames(2)
        assert "open/open" not in rectangles
        await model.edit.rename(person.stage.named("Pot"), "Pan")
        await person.press(Key.S, CTRL)
        await until(person, lambda: not model.file.is_dirty)
        await person.press(Key.O, CTRL)
        await click(person, "open/recent/kitchen.scene.json")
        await until(person, lambda: not model.history.undo_label and model.history.is_attached)
        await until(person, lambda: [entity.name for entity in host.mirror.entities.values()] == ["Pan"])

    at_the_editor(scenario)


def test_revert_goes_back_to_the_file_and_changes_are_listed_before(at_the_editor, tmp_path, screenshot_directory):
    async def scenario(person):
        editor, model, host = person.editor, person.editor.model, person.stage.host
        await model.documents.open(tmp_path / "kitchen.scene.json")
        await until(person, lambda: model.history.is_attached and model.file.path is not None)
        pot = person.stage.named("Pot")
        await model.edit.set_fields([pot], "Transform", {"position": (0.0, 3.0, 0.0)})
        await model.edit.add_component([pot], "Light")
        editor.ui.actions.run("file.changes")
        await until(person, lambda: len(editor.workspace.changes.lines) == 2)
        await person.frames(3)
        assert "changes/1" in editor.ui.landmarks.rectangles
        editor.screenshot(screenshot_directory / "editor-changes.png")
        editor.ui.actions.run("file.revert")
        await click(person, "lose/lose")
        await until(person, lambda: "opened" in model.notice.lower() and not model.file.is_dirty)
        await until(
            person, lambda: host.mirror.entities[person.stage.named("Pot")].components.keys().isdisjoint({"Light"})
        )
        await until(person, lambda: editor.workspace.changes.lines == [])

    at_the_editor(scenario)


def test_the_running_state_is_saved_beside_the_scene(at_the_editor, tmp_path, screenshot_directory):
    async def scenario(person):
        editor, model = person.editor, person.editor.model
        crate = person.stage.named("Crate")
        await model.edit.rename(crate, "Treasure")
        person.stage.host.publish_frame({crate: (4.0, 5.0, 6.0)})
        await until(person, lambda: model.scene.frame is not None)
        editor.ui.actions.run("file.save_running")
        await person.frames(3)
        editor.screenshot(screenshot_directory / "editor-save-running.png")
        await click(person, "save/save")
        path = tmp_path / "yard-running.scene.json"
        await until(person, lambda: path.is_file() and "yard-running" in model.notice)
        assert model.file.is_dirty and model.file.path is None
        await person.press(Key.S, CTRL | SHIFT)
        await person.frames(3)
        await click(person, "save/save")
        await until(person, lambda: not model.file.is_dirty)

    at_the_editor(scenario)
    record = next(
        r for r in open_scene(tmp_path / "yard-running.scene.json", AssetStore()).records if r.name == "Treasure"
    )
    assert record.components["Transform"]["position"] == [4, 5, 6]


def test_a_full_disk_is_said_where_it_was_saved(at_the_editor, tmp_path, monkeypatch):
    def fail(path, data, *, durable=True):
        descriptor = os.open("/dev/full", os.O_WRONLY)
        try:
            os.write(descriptor, data)
        finally:
            os.close(descriptor)

    async def scenario(person):
        model = person.editor.model
        await model.edit.rename(person.stage.named("Crate"), "Treasure")
        await person.press(Key.S, CTRL)
        await person.frames(3)
        with monkeypatch.context() as patch:
            patch.setattr("elys.common.scene_writing.replace_file", fail)
            await click(person, "save/save")
            await until(person, lambda: "cannot be written: No space left on device" in model.error)
        assert model.file.is_dirty and not (tmp_path / "yard.scene.json").exists()
        await click(person, "save/save")  # the question is still there
        await until(person, lambda: not model.file.is_dirty)
        assert (tmp_path / "yard.scene.json").is_file()

    at_the_editor(scenario)


def test_a_scene_that_is_not_there_any_more_is_said_and_saved_anew(at_the_editor, tmp_path):
    """Its file is gone, then its whole folder: nothing that was edited is lost."""
    folder = tmp_path / "house"
    folder.mkdir()
    path = folder / "kitchen.scene.json"
    path.write_bytes((tmp_path / "kitchen.scene.json").read_bytes())

    async def scenario(person):
        editor, model, host = person.editor, person.editor.model, person.stage.host
        await model.documents.open(path)
        await until(person, lambda: model.history.is_attached and model.file.path == path)
        await model.edit.rename(person.stage.named("Pot"), "Pan")
        path.unlink()
        editor.ui.actions.run("file.changes")
        await until(person, lambda: "kitchen.scene.json" in editor.workspace.changes._error)
        editor.ui.actions.run("file.revert")
        await click(person, "lose/lose")
        await until(person, lambda: "there is no scene file" in model.error)
        assert [entity.name for entity in host.mirror.entities.values()] == ["Pan"] and model.file.is_dirty
        await person.press(Key.ESCAPE)
        await person.press(Key.ESCAPE)
        await person.frames(2)
        await person.press(Key.S, CTRL)
        await until(person, lambda: not model.file.is_dirty)
        assert [record.name for record in open_scene(path, AssetStore()).records] == ["Pan"]

        await model.edit.rename(person.stage.named("Pan"), "Lid")
        shutil.rmtree(folder)
        await person.press(Key.S, CTRL)
        await until(person, lambda: "cannot be written: No such file or directory" in model.error)
        assert model.file.is_dirty and [entity.name for entity in host.mirror.entities.values()] == ["Lid"]
        folder.mkdir()
        await click(person, "save/save")  # the question is still there
        await until(person, lambda: not model.file.is_dirty)
        assert [record.name for record in open_scene(path, AssetStore()).records] == ["Lid"]

    at_the_editor(scenario)


def test_what_a_crash_has_left_is_offered_and_opened_by_hand(at_the_editor, tmp_path, screenshot_directory):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    folder = tmp_path / "state" / "recovery"
    folder.mkdir(parents=True)
    scene = folder / f"{dead.pid}-7.scene.json"
    write_scene(SceneDocument(name="yard", entities=[EntityNode(name="Plum")]), scene)
    kept = Kept(scene=str(scene), path="", name="yard", epoch=7, process=dead.pid, process_started="1", time=1.7e9)
    (folder / f"{dead.pid}-7.json").write_bytes(msgspec.json.encode(kept))

    async def scenario(person):
        editor, model, host = person.editor, person.editor.model, person.stage.host
        host.mirror.scene = "yard"
        model.scene.mirror.scene = "yard"
        model.documents.recovery = Recovery(tmp_path / "state")
        model.documents.look_for_left_behind()
        await person.frames(4)
        editor.screenshot(screenshot_directory / "editor-recover.png")
        await click(person, "recover/later")
        await person.frames(2)
        model.documents.left_behind = None
        editor.workspace.save_dialog._asked_recovery = ""
        model.documents.look_for_left_behind()
        await click(person, "recover/open")
        await until(person, lambda: [entity.name for entity in host.mirror.entities.values()] == ["Plum"])
        await until(person, lambda: model.file.is_dirty and not scene.exists())

    at_the_editor(scenario)

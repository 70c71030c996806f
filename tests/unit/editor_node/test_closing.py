"""What becomes of edits that no file has when the window is closed, asked for and answered by hand."""

from __future__ import annotations

import asyncio

import pytest

from elys.common.assets import AssetStore
from elys.common.scene import open_scene
from elys.editor_node.events import MouseButton, MousePressed, MouseReleased
from elys.editor_node.keys import Key
from tests.unit.editor_node.person import CTRL

pytestmark = pytest.mark.gl


class Leaver:
    """Somebody who edited something, and closes the window."""

    def __init__(self, person, folder) -> None:
        self.person = person
        self.path = folder / "yard.scene.json"
        self.file = person.editor.model.file

    @property
    def has_gone(self) -> bool:
        return self.person.application.is_closing

    @property
    def saved_name(self) -> str:
        """What the second entity of the file is called."""
        return open_scene(self.path, AssetStore()).records[1].name

    async def rename(self, name: str, new: str) -> None:
        await self.person.editor.model.edit.rename(self.person.stage.named(name), new)
        await self.person.editor.model.history.settle()
        assert self.file.is_dirty

    async def save_first(self) -> None:
        """So that the scene has a file, which is older than the edits that follow."""
        await self.rename("Crate", "Treasure")
        await self.person.press(Key.S, CTRL)
        await self.person.click("save/save")
        await self.person.until(lambda: not self.file.is_dirty)
        await self.person.frames(3)

    async def close_window(self) -> None:
        """Until the question is there."""
        self.person.editor.ui.landmarks.rectangles.pop("close/cancel", None)
        self.person.editor.window.request_close()
        await self.person.until(lambda: "close/cancel" in self.person.editor.ui.landmarks.rectangles)
        await self.person.frames(2)
        assert not self.has_gone

    async def leave_by(self, name: str) -> None:
        """By a button after which there are no more frames to wait for."""
        await self.person.point(name)
        await self.person.do(MousePressed(MouseButton.LEFT))
        self.person.application.offer(MouseReleased(MouseButton.LEFT))
        await self.person.until(lambda: self.has_gone)

    async def stays(self) -> None:
        await self.person.frames(4)
        assert not self.has_gone
        assert self.file.is_dirty


@pytest.fixture
def leaving(at_the_editor, tmp_path, monkeypatch):
    """Runs `await scenario(leaver)` where files are saved in a folder of the test's own."""
    monkeypatch.chdir(tmp_path)

    def play(scenario) -> None:
        at_the_editor(lambda person: scenario(Leaver(person, tmp_path)))

    return play


def test_save_and_close_saves_before_it_closes(leaving):
    async def scenario(leaver):
        await leaver.save_first()
        await leaver.rename("Treasure", "Chest")
        await leaver.close_window()
        await leaver.leave_by("close/save")
        assert not leaver.file.is_dirty
        assert leaver.saved_name == "Chest"

    leaving(scenario)


def test_save_and_close_asks_where_if_there_is_no_file_yet(leaving):
    async def scenario(leaver):
        await leaver.rename("Crate", "Chest")
        await leaver.close_window()
        await leaver.person.click("close/save")
        await leaver.person.point("save/save")
        await leaver.stays()
        await leaver.leave_by("save/save")
        assert leaver.saved_name == "Chest"

    leaving(scenario)


def test_close_without_saving_leaves_the_file_as_it_was(leaving):
    async def scenario(leaver):
        await leaver.save_first()
        await leaver.rename("Treasure", "Chest")
        await leaver.close_window()
        await leaver.leave_by("close/close")
        assert leaver.file.is_dirty
        assert leaver.saved_name == "Treasure"

    leaving(scenario)


@pytest.mark.parametrize("way", ["button", "escape"])
def test_cancel_neither_saves_nor_closes(leaving, way):
    async def scenario(leaver):
        await leaver.save_first()
        await leaver.rename("Treasure", "Chest")
        await leaver.close_window()
        if way == "button":
            await leaver.person.click("close/cancel")
        else:
            await leaver.person.press(Key.ESCAPE)
        await leaver.stays()
        assert leaver.saved_name == "Treasure"
        # And a later wish to save is that alone.
        await leaver.person.press(Key.S, CTRL)
        await leaver.person.until(lambda: not leaver.file.is_dirty)
        await leaver.person.frames(3)
        assert not leaver.has_gone
        assert leaver.saved_name == "Chest"

    leaving(scenario)


@pytest.mark.parametrize("way", ["cancelled", "asked for again"])
def test_a_wish_to_close_that_came_to_nothing_is_forgotten(leaving, way):
    """Saving later on, for another reason, must not close the window under somebody's hands."""

    async def scenario(leaver):
        person = leaver.person
        await leaver.rename("Crate", "Chest")
        await leaver.close_window()
        await person.click("close/save")
        await person.point("save/save")
        if way == "cancelled":
            await person.press(Key.ESCAPE)
        else:  # the cross of the window, while it is asked where to save
            await leaver.close_window()
            await person.click("close/cancel")
        await leaver.stays()
        assert not leaver.path.exists()
        person.editor.ui.landmarks.rectangles.pop("save/save", None)
        await person.press(Key.S, CTRL)
        await person.click("save/save")
        await person.until(lambda: not leaver.file.is_dirty)
        await person.frames(4)
        assert not leaver.has_gone

    leaving(scenario)


def test_what_cannot_be_saved_keeps_the_window_open(leaving):
    async def scenario(leaver):
        await leaver.save_first()
        await leaver.rename("Treasure", "Chest")
        leaver.path.unlink()
        leaver.path.mkdir()  # where nobody can write a file
        await leaver.close_window()
        await leaver.person.click("close/save")
        await leaver.person.until(lambda: bool(leaver.person.editor.model.error))
        await leaver.stays()
        leaver.path.rmdir()
        await leaver.person.press(Key.ESCAPE)
        await leaver.close_window()
        await leaver.leave_by("close/save")
        assert leaver.saved_name == "Chest"

    leaving(scenario)


def test_the_end_of_an_older_save_does_not_close_the_window(leaving, monkeypatch):
    """What it writes is older than the edits that are to be saved."""

    async def scenario(leaver):
        await leaver.save_first()
        model, may_go_on = leaver.person.editor.model, asyncio.Event()
        save = model.save

        async def save_slowly(path, **how):
            await may_go_on.wait()
            await save(path, **how)

        monkeypatch.setattr(model, "save", save_slowly)
        await leaver.rename("Treasure", "Chest")
        await leaver.person.press(Key.S, CTRL)
        await leaver.close_window()
        await leaver.person.click("close/save")
        may_go_on.set()
        await leaver.person.until(lambda: not leaver.file.is_dirty)
        await leaver.person.frames(4)
        assert not leaver.has_gone

    leaving(scenario)

"""Widgets beside the ways that everybody takes: buttons for what keys do, and choices of how much is shown."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import msgspec
import pytest
from imgui_bundle import implot

from elys.common.scene import EntityNode, SceneDocument, write_scene
from elys.editor_node.events import CharacterTyped
from elys.editor_node.keys import Key
from elys.editor_node.recovery import Kept, Recovery
from tests.unit.editor_node.asset_files import write_image
from tests.unit.editor_node.person import CTRL, Person
from tests.unit.editor_node.test_assets_panel import at_the_browser as at_the_browser  # a fixture: to be found here
from tests.unit.editor_node.test_editor_attach import A, B, at_a_lonely_editor
from tests.unit.editor_node.test_editor_files import click, shown, until
from tests.unit.editor_node.test_editor_timeline import opened
from tests.unit.editor_node.test_instrument_panels import fall, show

pytestmark = pytest.mark.gl


async def write(person: Person, text: str | Path) -> None:
    """All letters of a long text at once, as they come when something is pasted."""
    for letter in str(text):
        person.application.offer(CharacterTyped(ord(letter)))
    await person.frames(3)


async def set_slider(person: Person, name: str, text: str) -> None:
    """By typing, which Ctrl allows."""
    await person.click(name, held=CTRL)
    await person.press(Key.A, CTRL)
    await person.type(text)
    await person.press(Key.ENTER)
    await person.frames(3)


def test_undo_and_redo_have_buttons(at_the_editor):
    async def scenario(person):
        host, history = person.stage.host, person.editor.model.history
        crate = person.stage.named("Crate")
        for name in ("Chest", "Treasure"):
            await person.editor.model.edit.rename(crate, name)
        for button, name in (("undo", "Chest"), ("undo", "Crate"), ("redo", "Chest"), ("redo", "Treasure")):
            await person.click(f"toolbar/{button}")
            await history.settle()
            assert host.mirror.entities[crate].name == name
        received = len(host.received)
        await person.click("toolbar/redo")  # there is nothing more
        await history.settle()
        assert len(host.received) == received

    at_the_editor(scenario)


def test_the_inspector_switches_what_is_selected_off_and_on_as_one_edit(at_the_editor):
    async def scenario(person):
        entities, history = person.stage.host.mirror.entities, person.editor.model.history
        crate, box = person.stage.named("Crate"), person.stage.named("Box 2")
        await person.click("hierarchy/Crate")
        await person.click("inspector/enabled")
        await history.settle()
        assert not entities[crate].enabled
        await person.click("hierarchy/Box 2", held=CTRL)
        await person.click("inspector/enabled")  # says what the last one is
        await history.settle()
        assert (entities[crate].enabled, entities[box].enabled) == (False, False)
        await person.click("inspector/enabled")
        await history.settle()
        assert (entities[crate].enabled, entities[box].enabled) == (True, True)
        await person.press(Key.Z, CTRL)
        await history.settle()
        assert (entities[crate].enabled, entities[box].enabled) == (False, False)

    at_the_editor(scenario)


def test_a_file_is_imported_by_the_button_and_its_path(at_the_browser, tmp_path):
    write_image(tmp_path / "sand.png", (200, 200, 90))

    async def scenario(browser):
        person = browser.person
        await person.click("assets/import")
        await person.frames(3)
        await write(person, tmp_path / "mud.png")
        await person.press(Key.ENTER)
        assert "mud.png" in browser.panel.dialogs._error
        await person.frames(2)
        await person.press(Key.A, CTRL)
        await write(person, tmp_path / "sand.png")
        await person.click("assets/do")
        await person.until(lambda: "assets/sand.png" in browser.landmarks.rectangles)
        assert (browser.folder / "sand.png").read_bytes() == (tmp_path / "sand.png").read_bytes()

    at_the_browser(scenario)


def test_assets_are_put_in_order_and_shown_larger_or_as_a_list(at_the_browser):
    async def scenario(browser):
        person = browser.person
        await person.until(
            lambda: all(browser.content(file.name) is not None for file in browser.library.listing.files)
        )

        async def tiles() -> list[tuple[str, tuple[float, float, float, float]]]:
            found = await browser.shown()
            files = [file.name for file in browser.library.listing.files if f"assets/{file.name}" in found]
            places = {name: browser.landmarks.rectangles[f"assets/{name}"] for name in files}
            return sorted(places.items(), key=lambda item: (item[1][1], item[1][0]))

        async def in_order(order: str) -> list[str]:
            await person.click("assets/order")
            await person.click(f"assets/order/{order}")
            await person.frames(2)
            return [name for name, _ in await tiles()]

        by_size = await in_order("size")
        sizes = [(browser.folder / name).stat().st_size for name in by_size]
        assert len(by_size) > 3
        assert sizes in (sorted(sizes), sorted(sizes, reverse=True))
        assert await in_order("name") == sorted(by_size, key=str.casefold) != by_size

        widths = []
        for size in ("64", "150"):
            await set_slider(person, "assets/size", size)
            (_, (left, _, right, _)), *_ = await tiles()
            widths.append(right - left)
        assert widths[1] / widths[0] == pytest.approx(150 / 64, rel=0.2)
        await set_slider(person, "assets/size", "24")  # a list: one below the other
        lefts = {left for _, (left, _, _, _) in await tiles()}
        assert len(lefts) == 1

    at_the_browser(scenario)


@pytest.mark.parametrize("way", ["enter", "button"])
def test_a_scene_is_opened_by_its_path(at_the_editor, tmp_path, monkeypatch, way):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "far away").mkdir()
    path = tmp_path / "far away" / "kitchen.scene.json"
    write_scene(SceneDocument(name="Kitchen", entities=[EntityNode(name="Pot")]), path)

    async def scenario(person):
        model, host = person.editor.model, person.stage.host
        await person.press(Key.O, CTRL)
        await click(person, "open/path")
        await write(person, path.with_name("kitchem.scene.json"))
        await person.press(Key.ENTER)
        await until(person, lambda: "did you mean kitchen" in model.error)
        await click(person, "open/path")
        await person.press(Key.A, CTRL)
        await write(person, path)
        await (person.press(Key.ENTER) if way == "enter" else click(person, "open/open"))
        await until(person, lambda: [entity.name for entity in host.mirror.entities.values()] == ["Pot"])
        await until(person, lambda: model.file.path == path)
        rectangles = shown(person)
        await person.frames(3)
        assert "open/path" not in rectangles

    at_the_editor(scenario)


def test_what_a_crash_has_left_is_thrown_away_by_hand(at_the_editor, tmp_path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    folder = tmp_path / "recovery"
    folder.mkdir()
    scene = folder / f"{dead.pid}-7.scene.json"
    write_scene(SceneDocument(name="yard", entities=[EntityNode(name="Plum")]), scene)
    kept = Kept(scene=str(scene), path="", name="yard", epoch=7, process=dead.pid, process_started="1", time=1.7e9)
    (folder / f"{dead.pid}-7.json").write_bytes(msgspec.json.encode(kept))

    async def scenario(person):
        model, host = person.editor.model, person.stage.host
        model.scene.mirror.scene = "yard"
        model.documents.recovery = Recovery(tmp_path)
        model.documents.look_for_left_behind()
        names = [entity.name for entity in host.mirror.entities.values()]
        await click(person, "recover/discard")
        await until(person, lambda: not list(folder.iterdir()))
        assert model.documents.left_behind is None
        rectangles = shown(person)
        await person.frames(3)
        assert "recover/discard" not in rectangles
        model.documents.look_for_left_behind()
        assert model.documents.left_behind is None
        assert [entity.name for entity in host.mirror.entities.values()] == names
        assert not model.file.is_dirty

    at_the_editor(scenario)


def test_plots_show_the_span_that_is_chosen_and_forget_what_was_read(at_the_editor, monkeypatch):
    limits: list[tuple[float, float]] = []
    set_limits = implot.setup_axis_limits

    def note_limits(axis, low, high, *more):
        if axis == implot.ImAxis_.x1.value:
            limits.append((low, high))
        return set_limits(axis, low, high, *more)

    monkeypatch.setattr(implot, "setup_axis_limits", note_limits)

    async def scenario(person):
        panel, table = person.editor.workspace.plots, person.editor.workspace.instruments.plots.table
        await show(person, "Plots")
        assert panel.plot("Crate.Transform.position.y")
        await fall(person, ticks=10)
        for span in (30.0, 2.0):
            await person.click("plots/span")
            await person.click(f"plots/span/{span:g}")
            await person.frames(2)
            assert limits[-1][1] - limits[-1][0] == pytest.approx(span)
        assert len(table) >= 10
        await person.click("plots/clear")
        assert len(table) == 0
        assert [series.path for series in table.series] == ["Crate.Transform.position.y"]
        await fall(person, ticks=3)  # and it goes on
        assert len(table) == 3

    at_the_editor(scenario)


def test_weak_collisions_are_left_out_of_the_timeline(at_the_editor):
    async def scenario(person):
        await opened(person, now=4.0)  # an error, and a collision of 50 N s
        line = person.editor.model.timeline
        assert [marker.kind for marker in line.markers] == ["error", "collision"]
        await person.click("timeline/markers")
        await set_slider(person, "timeline/impulse", "60")
        assert [marker.kind for marker in line.markers] == ["error"]
        await set_slider(person, "timeline/impulse", "40")
        assert [marker.kind for marker in line.markers] == ["error", "collision"]

    at_the_editor(scenario)


def test_the_start_page_offers_where_one_was_lately():
    async def scenario(person, town):
        attachments, preferences = person.editor.attachments, person.editor.preferences
        await town.host(A, name="yard")
        await town.host(B, name="meadow")
        preferences.recent_endpoints[:] = [A, B]
        await person.frames(3)
        await person.click("start/recent endpoint/1")
        await person.until(lambda: person.editor.model.scene.is_known)
        assert (person.editor.seat.name, attachments.endpoint) == ("meadow", B)
        assert preferences.recent_endpoints == [B, A]
        attachments.detach()
        await person.frames(3)
        await town.kill(A)
        await person.click("start/recent endpoint/1")
        await person.until(lambda: "nobody answers" in attachments.error)
        assert not attachments.is_attached

    at_a_lonely_editor(scenario)

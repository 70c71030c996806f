"""Drives the real editor on GLFW's null platform, with no display server: events in, the host's scene out."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from elys.common.assets import AssetStore
from elys.common.components import component_from
from elys.common.scene import open_scene
from elys.editor_node.keys import Key
from elys.editor_node.scene_file import scene_records
from tests.unit.editor_node.person import CTRL, SHIFT

pytestmark = pytest.mark.gl


def test_select_type_undo_play(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        crate = person.stage.named("Crate")
        await person.click("hierarchy/Crate")
        assert editor.model.selection.entities == (crate,)

        await person.click("inspector/RigidBody/mass", times=2)
        await person.press(Key.A, CTRL)
        await person.type("42.5")
        await person.press(Key.ENTER)
        await person.until(lambda: host.mirror.entities[crate].components["RigidBody"].mass == 42.5)
        await editor.model.history.settle()
        editor.screenshot(screenshot_directory / "editor-edited.png")

        await person.press(Key.Z, CTRL)
        await person.until(lambda: host.mirror.entities[crate].components["RigidBody"].mass == 5.0)
        await person.press(Key.Y, CTRL)
        await person.until(lambda: host.mirror.entities[crate].components["RigidBody"].mass == 42.5)

        await person.click("toolbar/play")
        await person.until(lambda: host.playing)
        await person.until(lambda: editor.model.is_playing)
        await person.press(Key.SPACE)
        await person.until(lambda: not host.playing)
        await person.click("toolbar/step")
        await person.until(lambda: host.tick == 1)

    at_the_editor(scenario)


def test_dragging_a_field_is_one_undo(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        crate = person.stage.named("Crate")
        await person.click("hierarchy/Crate")
        await person.drag("inspector/Transform/position/1", 120.0, 0.0)
        await editor.model.history.settle()
        position = host.mirror.entities[crate].components["Transform"].position
        assert position[0] == 1.0 and position[2] == 3.0
        assert position[1] > 2.5
        await person.press(Key.Z, CTRL)
        await editor.model.history.settle()
        assert host.mirror.entities[crate].components["Transform"].position == (1.0, 2.0, 3.0)
        assert not editor.model.history.undo_label

    at_the_editor(scenario)


def test_several_are_edited_together_and_keep_what_was_not_touched(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        await person.click("hierarchy/Box 2")
        await person.click("hierarchy/Box 4", held=SHIFT)
        boxes = [person.stage.named(f"Box {number}") for number in (2, 3, 4)]
        assert editor.model.selection.entities == tuple(boxes)
        await person.click("hierarchy/Box 3", held=CTRL)
        assert editor.model.selection.entities == (boxes[0], boxes[2])
        await person.click("inspector/Transform/position/1", times=2)
        await person.press(Key.A, CTRL)
        await person.type("8")
        await person.press(Key.ENTER)
        await editor.model.history.settle()
        editor.screenshot(screenshot_directory / "editor-several.png")
        assert host.mirror.entities[boxes[0]].components["Transform"].position == (2.0, 8.0, 0.0)
        assert host.mirror.entities[boxes[1]].components["Transform"].position == (3.0, 1.0, 0.0)
        assert host.mirror.entities[boxes[2]].components["Transform"].position == (4.0, 8.0, 0.0)

    at_the_editor(scenario)


def test_the_hierarchy_renames_searches_switches_moves_and_deletes(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        entities = host.mirror.entities
        crate, sun, box = (person.stage.named(name) for name in ("Crate", "Sun", "Box 1"))
        await person.click("hierarchy/Crate")
        await person.press(Key.F2)
        await person.frames(3)
        await person.type("Treasure")
        await person.press(Key.ENTER)
        await person.until(lambda: entities[crate].name == "Treasure")

        await person.click("hierarchy/Sun/switch")
        await person.until(lambda: not entities[sun].enabled)

        await person.point("hierarchy/Treasure")
        target = editor.ui.landmarks.center("hierarchy/Treasure")
        start = editor.ui.landmarks.center("hierarchy/Box 1")
        await person.drag("hierarchy/Box 1", 0.0, target[1] - start[1])
        await person.until(lambda: entities[box].parent == crate)
        # It stands where it stood: now relative to its new parent.
        assert entities[box].components["Transform"].position == (0.0, -1.0, -3.0)

        await person.click("hierarchy/search")
        await person.type("box 5")
        await person.frames(2)
        assert [editor.model.scene.name_of(row.entity) for row in editor.model.scene.rows("box 5")] == ["Box 5"]
        await person.press(Key.A, CTRL)
        await person.press(Key.DELETE)  # in the text field: no entity
        await person.press(Key.ESCAPE)
        assert len(entities) == 11

        await person.click("hierarchy/Treasure")
        await person.press(Key.DELETE)
        await person.until(lambda: crate not in entities)
        await person.press(Key.Z, CTRL)
        await person.until(lambda: "Handle" in [entity.name for entity in entities.values()])

    at_the_editor(scenario)


def test_components_are_added_and_removed(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        sun = person.stage.named("Sun")
        await person.click("hierarchy/Sun")
        await person.click("inspector/add")
        await person.frames(3)
        editor.screenshot(screenshot_directory / "editor-add-component.png")
        await person.type("cam")
        await person.click("component/Camera")
        await person.until(lambda: "Camera" in host.mirror.entities[sun].components)
        await person.frames(3)
        await person.click("inspector/Light/menu")
        await person.frames(3)
        await person.click("component/remove")
        await person.until(lambda: "Light" not in host.mirror.entities[sun].components)

    at_the_editor(scenario)


def test_choices_switches_and_colours(at_the_editor):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        sun, crate = person.stage.named("Sun"), person.stage.named("Crate")
        await person.click("hierarchy/Sun")
        await person.click("inspector/Light/kind")
        await person.frames(3)
        await person.click("inspector/Light/kind/spot")
        await person.until(lambda: host.mirror.entities[sun].components["Light"].kind == "spot")
        await person.click("inspector/Light/cast_shadows")
        await person.until(lambda: not host.mirror.entities[sun].components["Light"].cast_shadows)
        await person.click("hierarchy/Crate")
        await person.click("inspector/Collider")  # folds it, so that what is below comes into sight
        await person.click("inspector/Material/base_color/1", times=2)
        await person.press(Key.A, CTRL)
        await person.type("0.25")
        await person.press(Key.ENTER)
        await editor.model.history.settle()
        color = host.mirror.entities[crate].components["Material"].base_color
        assert color == pytest.approx((0.8, 0.25, 0.8))
        await person.click("inspector/Transform/rotation/1", times=2)
        await person.press(Key.A, CTRL)
        await person.type("90")
        await person.press(Key.ENTER)
        await editor.model.history.settle()
        rotation = host.mirror.entities[crate].components["Transform"].rotation
        assert rotation == pytest.approx((0.0, 0.5**0.5, 0.0, 0.5**0.5))

    at_the_editor(scenario)


def test_a_lost_simulation_is_said_at_once(at_the_editor, screenshot_directory):
    async def scenario(person):
        await person.stage.host.session.close()
        await person.until(lambda: not person.editor.model.connected)
        await person.frames(2)
        person.editor.screenshot(screenshot_directory / "editor-lost.png")
        pixels = np.asarray(Image.open(screenshot_directory / "editor-lost.png"))
        left, top, right, bottom = (int(edge) for edge in person.editor.ui.landmarks.rectangles["viewport/picture"])
        picture = pixels[top:bottom, left:right].astype(int)
        reddish = (picture[..., 0] > 180) & (picture[..., 1] < 140)
        assert reddish.sum() > 100  # the notice over the viewport

    at_the_editor(scenario)


def test_saving_and_closing_with_edits_that_were_not(at_the_editor, tmp_path, monkeypatch, screenshot_directory):
    monkeypatch.chdir(tmp_path)

    async def scenario(person):
        editor, file = person.editor, person.editor.model.file
        assert not file.is_dirty
        await editor.model.edit.rename(person.stage.named("Crate"), "Treasure")
        assert file.is_dirty
        await person.press(Key.S, CTRL)
        await person.frames(3)
        editor.screenshot(screenshot_directory / "editor-save.png")
        await person.click("save/save")
        await person.until(lambda: not file.is_dirty)
        opened = open_scene(tmp_path / "yard.scene.json", AssetStore())
        assert [record.name for record in opened.records][:4] == ["Ground", "Treasure", "Lid", "Handle"]

        def meaning(records):
            return [
                (r.name, r.parent, r.enabled, {name: component_from(name, v) for name, v in r.components.items()})
                for r in records
            ]

        assert meaning(opened.records) == meaning(scene_records(editor.model.scene))

        await editor.model.edit.rename(person.stage.named("Treasure"), "Crate")
        editor.window.request_close()
        await person.frames(4)
        editor.screenshot(screenshot_directory / "editor-close.png")
        assert not editor.application.is_closing
        await person.press(Key.ESCAPE)
        await person.press(Key.S, CTRL)
        await person.until(lambda: not file.is_dirty)
        editor.window.request_close()
        await person.until(lambda: editor.application.is_closing)

    at_the_editor(scenario)


def test_pictures_are_exposed_and_fogged_in_the_inspector(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        before = host.mirror.settings.picture
        await person.click("inspector/settings/picture/exposure", times=2)  # nothing is selected: the scene's settings
        await person.press(Key.A, CTRL)
        await person.type("1.5")
        await person.press(Key.ENTER)
        await person.until(lambda: host.mirror.settings.picture.exposure == 1.5)
        await person.click("inspector/settings/picture/bloom", times=2)
        await person.press(Key.A, CTRL)
        await person.type("0.25")
        await person.press(Key.ENTER)
        await person.until(lambda: host.mirror.settings.picture.bloom == 0.25)
        assert host.mirror.settings.picture.exposure == 1.5
        await editor.model.history.settle()
        editor.screenshot(screenshot_directory / "editor-picture-settings.png")
        await person.press(Key.Z, CTRL)
        await person.press(Key.Z, CTRL)
        await person.until(lambda: host.mirror.settings.picture == before)

    at_the_editor(scenario)

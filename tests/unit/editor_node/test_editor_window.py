"""Drives the real editor on GLFW's null platform, with no display server: events in, the host's scene out."""

from __future__ import annotations

import asyncio
import contextlib

import numpy as np
import pytest
from PIL import Image

from elys.bus.session import Session
from elys.common.assets import AssetStore
from elys.common.components import component_from
from elys.common.scene import open_scene
from elys.editor_node.camera import project
from elys.editor_node.events import (
    CharacterTyped,
    CursorEntered,
    KeyPressed,
    KeyReleased,
    Modifiers,
    MouseButton,
    MouseMoved,
    MousePressed,
    MouseReleased,
    MouseScrolled,
)
from elys.editor_node.keys import Key
from elys.editor_node.node import Editor
from elys.editor_node.scene_file import scene_records

pytestmark = pytest.mark.gl
CTRL, SHIFT, ALT = Modifiers.CTRL, Modifiers.SHIFT, Modifiers.ALT
_KEY_OF = {CTRL: Key.LEFT_CTRL, SHIFT: Key.LEFT_SHIFT, ALT: Key.LEFT_ALT}


class Person:
    """Does with the editor what a person does, and waits until it was drawn."""

    def __init__(self, editor: Editor, stage) -> None:
        self.editor = editor
        self.stage = stage
        self.application = editor.application
        editor.ui.landmarks.is_wanted = True

    async def frames(self, count: int = 2) -> None:
        goal = self.application.frame_count + count
        self.application.keep_awake(5.0)
        async with asyncio.timeout(20.0):
            while self.application.frame_count < goal:
                await asyncio.sleep(0.001)

    async def until(self, condition) -> None:
        self.application.keep_awake(5.0)
        await self.stage.until(condition)

    async def do(self, *events) -> None:
        for event in events:
            self.application.offer(event)
            await self.frames(1)
        await self.frames(1)

    async def point(self, name: str) -> None:
        await self.until(lambda: name in self.editor.ui.landmarks.rectangles)
        await self.do(MouseMoved(*self.editor.ui.landmarks.center(name)))

    async def click(self, name: str, *, times: int = 1, held: Modifiers = Modifiers.NONE) -> None:
        await self.point(name)
        if held:
            await self.do(KeyPressed(_KEY_OF[held], held))
        for _ in range(times):
            await self.do(MousePressed(MouseButton.LEFT, held), MouseReleased(MouseButton.LEFT, held))
        if held:
            await self.do(KeyReleased(_KEY_OF[held]))

    async def press(self, key: int, held: Modifiers = Modifiers.NONE) -> None:
        keys = [_KEY_OF[modifier] for modifier in held]
        await self.do(*(KeyPressed(k) for k in keys), KeyPressed(key, held), KeyReleased(key, held))
        await self.do(*(KeyReleased(k) for k in keys))

    async def type(self, text: str) -> None:
        await self.do(*(CharacterTyped(ord(letter)) for letter in text))

    async def drag(self, name: str, x: float, y: float, *, steps: int = 6, held: Modifiers = Modifiers.NONE) -> None:
        await self.point(name)
        start_x, start_y = self.editor.ui.landmarks.center(name)
        await self.do(MousePressed(MouseButton.LEFT, held))
        for step in range(1, steps + 1):
            await self.do(MouseMoved(start_x + x * step / steps, start_y + y * step / steps))
        await self.do(MouseReleased(MouseButton.LEFT, held))


@pytest.fixture
def at_the_editor(on_stage):
    """Runs `await scenario(person)` at an editor that shows the yard."""

    def play(scenario, records=None) -> None:
        async def with_editor(stage):
            session = await Session.join(stage.broker.connect(), kind="editor")
            try:
                with Editor(session, null_platform=True, size=(1600, 900)) as editor:
                    running = asyncio.create_task(editor.run())
                    person = Person(editor, stage)
                    await person.do(CursorEntered(True))
                    await person.until(lambda: editor.model.scene.is_known)
                    stage.host.publish_status()
                    await person.frames(3)
                    try:
                        await scenario(person)
                    finally:
                        editor.application.close()
                        await running
            finally:
                await session.close()

        on_stage(with_editor, records)

    return play


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

        await person.click("hierarchy/Sun/eye")
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


def test_the_camera_moves_and_widgets_keep_their_clicks(at_the_editor):
    async def scenario(person):
        camera = person.editor.panel.camera
        await person.point("viewport/picture")
        distance, yaw = camera.distance, camera.yaw
        await person.do(MouseScrolled(0.0, 2.0))
        assert camera.distance < distance
        await person.drag("viewport/picture", 60.0, 0.0, held=ALT)
        assert camera.yaw != yaw
        position = camera.position.copy()
        await person.do(MousePressed(MouseButton.RIGHT), KeyPressed(Key.W))
        await person.frames(3)
        await person.do(KeyReleased(Key.W), MouseReleased(MouseButton.RIGHT))
        moved = camera.position - position
        assert np.dot(moved, -camera.backward) > 0.0
        assert person.editor.ui.tools.tool == "move"
        await person.press(Key.E)  # not flying any more: a tool again
        assert person.editor.ui.tools.tool == "rotate"
        distance = camera.distance
        await person.point("hierarchy/Sun")
        await person.do(MouseScrolled(0.0, 2.0))
        assert camera.distance == distance
        await person.click("hierarchy/Crate")
        await person.press(Key.F)
        assert camera.target == pytest.approx((1.0, 2.25, 3.0), abs=0.3)

    at_the_editor(scenario)


def test_an_idle_editor_draws_nothing(at_the_editor):
    async def scenario(person):
        application = person.application
        await person.frames(2)
        with contextlib.suppress(TimeoutError):
            # Input keeps it awake for a while; then there must come a quarter of a second without a frame.
            async with asyncio.timeout(10.0):
                while True:
                    before = application.frame_count
                    application._awake_until = 0.0
                    await asyncio.sleep(0.25)
                    if application.frame_count == before:
                        return
        pytest.fail("frames are drawn though nothing happens")

    at_the_editor(scenario)


def test_the_gizmo_moves_what_is_selected_in_one_undo(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor, host = person.editor, person.stage.host
        crate = person.stage.named("Crate")
        source = await person.stage.picture_source(entity=crate)
        await person.until(lambda: editor.stream.shown is not None)
        await person.click("hierarchy/Crate")
        await person.press(Key.F)
        await person.until(lambda: editor.stream.shown.camera == editor.panel.camera.view)
        await person.frames(3)
        # The arrow along x starts at the crate and points where x does in this picture.
        x, y, width, height = editor.panel.rectangle
        ends = [project(editor.stream.shown.camera, width / height, np.array(p)) for p in ((1, 2, 3), (1.5, 2, 3))]
        pixels = [np.array((x + (1 + e[0]) / 2 * width, y + (1 - e[1]) / 2 * height)) for e in ends]
        along = (pixels[1] - pixels[0]) / np.linalg.norm(pixels[1] - pixels[0])
        start = pixels[0] + 55.0 * along
        await person.do(MouseMoved(*start))
        await person.frames(2)
        assert editor.panel.gizmo.is_over
        await person.do(MousePressed(MouseButton.LEFT))
        for step in range(1, 9):
            await person.do(MouseMoved(*(start + 10.0 * step * along)))
        editor.screenshot(screenshot_directory / "editor-gizmo.png")
        await person.do(MouseReleased(MouseButton.LEFT))
        await editor.model.history.settle()
        position = host.mirror.entities[crate].components["Transform"].position
        assert position[0] > 1.2
        assert position[1:] == pytest.approx((2.0, 3.0), abs=1e-5)
        await person.press(Key.Z, CTRL)
        await editor.model.history.settle()
        assert host.mirror.entities[crate].components["Transform"].position == (1.0, 2.0, 3.0)
        await source.close()

    at_the_editor(scenario)


def test_a_click_selects_what_the_renderer_sees_there(at_the_editor):
    async def scenario(person):
        editor = person.editor
        sun = person.stage.named("Sun")
        source = await person.stage.picture_source(entity=sun)
        await person.until(lambda: editor.stream.shown is not None)
        await person.click("viewport/picture")
        await person.until(lambda: editor.model.selection.entities == (sun,))
        left, top, width, height = editor.panel.rectangle
        assert source.picks[-1].x == pytest.approx(source.picks[-1].width / 2, abs=2)
        source.entity = 0
        await person.do(MouseMoved(left + width / 4, top + height / 4))
        await person.do(MousePressed(MouseButton.LEFT), MouseReleased(MouseButton.LEFT))
        await person.until(lambda: not editor.model.selection)
        await source.close()
        await person.until(lambda: editor.stream.renderer is None)
        assert editor.stream.lost_renderer

    at_the_editor(scenario)


def test_the_picture_shown_is_the_one_that_was_sent(at_the_editor, screenshot_directory):
    async def scenario(person):
        editor = person.editor
        for is_sharing in (True, False):
            source = await person.stage.picture_source(entity=0, is_sharing=is_sharing)
            await person.until(
                lambda s=source: editor.stream.shown is not None and editor.stream.shown.sequence in s.sent
            )
            await person.frames(2)
            editor.screenshot(screenshot_directory / "editor-picture.png")
            pixels = np.asarray(Image.open(screenshot_directory / "editor-picture.png"))
            left, top, _, bottom = (int(edge) for edge in editor.ui.landmarks.rectangles["viewport/picture"])
            upper, lower = (pixels[row, left + 40].astype(int) for row in (top + 30, bottom - 30))
            assert upper == pytest.approx((200, 60, 30), abs=6)
            assert lower == pytest.approx((20, 60, 200), abs=6)
            await source.close()
            await person.until(lambda: editor.stream.renderer is None)

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

"""The viewport of the real editor: its camera, its gizmo, its pictures, and that it draws only when there is a reason."""

from __future__ import annotations

import asyncio
import contextlib

import numpy as np
import pytest
from PIL import Image

from elys.editor_node.camera import project
from elys.editor_node.events import (
    KeyPressed,
    KeyReleased,
    MouseButton,
    MouseMoved,
    MousePressed,
    MouseReleased,
    MouseScrolled,
)
from elys.editor_node.keys import Key
from tests.unit.editor_node.person import ALT, CTRL

pytestmark = pytest.mark.gl


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


def test_the_menu_chooses_what_pictures_show(at_the_editor):
    async def scenario(person):
        editor = person.editor
        source = await person.stage.picture_source(entity=0)
        await person.until(lambda: editor.stream.shown is not None)
        assert source.requests[-1].shows == "shaded"
        for view in ("depth", "shaded"):
            await person.click("menu/view")
            await person.frames(3)
            await person.click("menu/show")
            await person.frames(3)
            await person.click(f"show/{view}")
            await person.until(lambda view=view: source.requests[-1].shows == view)

    at_the_editor(scenario)

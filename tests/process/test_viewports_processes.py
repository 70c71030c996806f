"""Two viewports of the real editor at a real render node see different things; a hand there drags a body of a real simulation."""

from __future__ import annotations

import asyncio
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from elys.bus import topics
from elys.bus.messages.commands import Grab, Release
from elys.editor_node.camera import project
from elys.editor_node.events import (
    CursorEntered,
    KeyPressed,
    KeyReleased,
    Modifiers,
    MouseButton,
    MouseMoved,
    MousePressed,
    MouseReleased,
)
from elys.editor_node.keys import Key
from elys.editor_node.panels.viewport import ViewportPanel
from tests.process.test_editor_session import editor_at, named, until

ARROW = (60, 230, 225)  # of a hand's pull

pytestmark = [pytest.mark.process, pytest.mark.gl]


async def do(editor, *events) -> None:
    """Each event, and a frame after it."""
    for event in events:
        editor.application.offer(event)
        drawn = editor.application.frame_count
        await until(editor, lambda: editor.application.frame_count > drawn)  # noqa: B023


async def look_still(editor) -> None:
    """Until every picture is what its viewport's camera sees now, in its size."""

    def is_still(panel: ViewportPanel) -> bool:
        shown, (_, _, width, height) = panel.stream.shown, panel.rectangle
        is_whole = shown is not None and (shown.width, shown.height) == (int(width), int(height))
        return is_whole and not panel.camera.is_gliding and shown.camera == panel.camera.view

    await do(editor, CursorEntered(True))
    await until(editor, lambda: all(is_still(panel) for panel in editor.viewports if panel.is_seen))
    await do(editor, CursorEntered(True))


def pixels_of(editor, panel: ViewportPanel, path: Path) -> np.ndarray:
    """What a viewport shows, without its upper edge, where the cube is: [height, width, 3]."""
    editor.screenshot(path)
    x, y, width, height = (int(value) for value in panel.rectangle)
    return np.asarray(Image.open(path)).astype(float)[y + height // 2 : y + height - 4, x + 4 : x + width - 4]


def is_green(pixels: np.ndarray) -> bool:
    red, green, blue = np.median(pixels.reshape(-1, 3), axis=0)
    return bool(green > max(red, blue) + 60.0)


def shows_pull(editor, path: Path) -> bool:
    """Whether an arrow of the colour of hands is seen."""
    editor.screenshot(path)
    return int((np.abs(np.asarray(Image.open(path)).astype(int) - ARROW) < 12).all(axis=-1).sum()) > 20


def test_two_viewports_see_different_things(elys, free_port, tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    elys("run", "yard", "--headless", "--realtime", "--paused", "--listen", endpoint).wait_for("simulating")
    elys("node", "render", "--connect", endpoint).wait_for("drawing views")

    async def scenario() -> None:
        async with editor_at(endpoint) as editor:
            await until(editor, lambda: editor.model.scene.is_known and editor.application.frame_count > 3)
            await look_still(editor)
            held = Modifiers.CTRL | Modifiers.SHIFT
            await do(editor, KeyPressed(Key.V, held), KeyReleased(Key.V, held))
            await look_still(editor)
            first, second = editor.viewports
            same = [pixels_of(editor, panel, tmp_path / "same.png") for panel in (first, second)]
            width = min(part.shape[1] for part in same)
            height = min(part.shape[0] for part in same)
            assert np.abs(same[0][:height, :width] - same[1][:height, :width]).mean() < 12.0  # they begin alike

            middle = editor.ui.landmarks.center("viewport2/picture")
            await do(editor, MouseMoved(*middle), KeyPressed(Key.KEYPAD_7), KeyReleased(Key.KEYPAD_7))
            await look_still(editor)
            second.look.shows = "normals"
            # Normals of a ground that is seen from above are one colour, green; the yard from the side is many.
            await until(editor, lambda: is_green(pixels_of(editor, second, tmp_path / "other.png")))
            here, above = (pixels_of(editor, panel, tmp_path / "other.png") for panel in (first, second))
            assert second.stream.shown.camera.ortho_height > 0.0
            assert first.stream.shown.camera.ortho_height == 0.0
            green = np.abs(above - np.median(above.reshape(-1, 3), axis=0)).max(axis=-1) < 6.0
            assert green.mean() > 0.3
            assert np.abs(here - same[0]).mean() < 3.0  # the first one was left alone

            # What is edited is seen in both.
            sequences = [panel.stream.shown.sequence for panel in editor.viewports]
            await editor.model.edit.set_fields([named(editor, "Ground")], "Material", {"base_color": (0.9, 0.0, 0.0)})
            await until(
                editor,
                lambda: all(
                    panel.stream.shown.sequence > before
                    for panel, before in zip(editor.viewports, sequences, strict=True)
                ),
            )
            # One that is closed is asked for no more, and its view ends at the render node.
            editor.workspace.close_viewport(second)
            sequence = first.stream.shown.sequence
            first.camera.orbit(20.0, 0.0)
            await until(editor, lambda: first.stream.shown.sequence > sequence)
            assert second not in editor.viewports

    asyncio.run(scenario())


def test_a_hand_lifts_a_body_of_a_running_simulation(elys, free_port, tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    elys("run", "yard", "--headless", "--realtime", "--listen", endpoint).wait_for("simulating")
    elys("node", "render", "--connect", endpoint).wait_for("drawing views")

    async def scenario() -> None:
        async with editor_at(endpoint) as editor:
            done = []
            editor.seat.subscribe(topics.COMMANDS, lambda record, _: done.append(record))
            await until(editor, lambda: editor.model.scene.is_known and editor.model.status is not None)
            await until(editor, lambda: editor.model.status.simulation_time > 6.0)
            scene, panel = editor.model.scene, editor.panel
            bodies = [e for e in scene.mirror.entities if scene.echo_of(e, "RigidBody") is not None]
            highest = max(bodies, key=lambda e: scene.world_pose(e).position[1])  # nothing lies on it
            editor.model.selection.replace((highest,))
            await do(editor, KeyPressed(Key.F), KeyReleased(Key.F), KeyPressed(Key.G), KeyReleased(Key.G))
            panel.camera.pitch, panel.camera.distance = -0.6, 5.0
            await look_still(editor)
            start = scene.world_pose(highest).position
            x, y, width, height = panel.rectangle
            across, up = project(panel.stream.shown.camera, width / height, np.array(start))
            at = np.array((x + (1 + across) / 2 * width, y + (1 - up) / 2 * height))
            await do(editor, MouseMoved(*at), MousePressed(MouseButton.LEFT))
            await until(editor, lambda: any(isinstance(r.command, Grab) and r.accepted for r in done))
            held = next(record.command.entity for record in done if isinstance(record.command, Grab))
            before = scene.world_pose(held).position[1]
            for step in range(1, 5):
                await do(editor, MouseMoved(at[0], at[1] - step * height / 6.0))
            assert editor.navigation.hand.target[1] > before + 1.0
            # It hangs below the point where it is held, the lower the softer the spring is.
            await until(editor, lambda: scene.world_pose(held).position[1] > before + 0.3)
            # What pulls it is seen as an arrow, in the colour of hands, as long as it is held.
            await until(editor, lambda: shows_pull(editor, tmp_path / "held.png"))
            await do(editor, MouseReleased(MouseButton.LEFT))
            await until(editor, lambda: isinstance(done[-1].command, Release))
            top = scene.world_pose(held).position[1]
            await until(editor, lambda: scene.world_pose(held).position[1] < top - 0.1)  # it falls again
            await until(editor, lambda: not shows_pull(editor, tmp_path / "fell.png"))

    asyncio.run(scenario())

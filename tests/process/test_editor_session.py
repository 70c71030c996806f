"""The real editor at a real simulation with a real render node: it edits, sees its edit, and survives the death of both."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from elys.bus.discovery import join_session
from elys.editor_node.node import Editor

pytestmark = [pytest.mark.process, pytest.mark.gl]


@contextlib.asynccontextmanager
async def editor_at(endpoint: str, *, size: tuple[int, int] = (960, 600)) -> AsyncIterator[Editor]:
    session = await join_session(endpoint, kind="editor", timeout=30)
    try:
        with Editor(session, null_platform=True, size=size) as editor:
            editor.ui.landmarks.is_wanted = True
            running = asyncio.create_task(editor.run())
            try:
                yield editor
            finally:
                editor.application.close()
                await running
    finally:
        await session.close()


async def until(editor: Editor, condition, *, seconds: float = 40.0) -> None:
    async with asyncio.timeout(seconds):
        while not condition():
            editor.application.request_redraw(0.05)
            await asyncio.sleep(0.01)


async def picture(editor: Editor, path: Path) -> np.ndarray:
    """What the viewport shows, [height, width, 3] as floats."""
    editor.screenshot(path)
    pixels = np.asarray(Image.open(path)).astype(float)
    left, top, right, bottom = (int(edge) for edge in editor.ui.landmarks.rectangles["viewport/picture"])
    return pixels[top + 40 : bottom, left : right - 80]


async def picture_that(editor: Editor, path: Path, condition) -> None:
    """Waits for a picture of which the condition holds: the next one may have been on its way before the edit."""
    async with asyncio.timeout(40.0):
        while not condition(await picture(editor, path)):
            sequence = editor.stream.shown.sequence
            await until(editor, lambda: editor.stream.shown.sequence > sequence)  # noqa: B023


def shows_own_camera(editor: Editor) -> bool:
    return editor.stream.shown is not None and editor.stream.shown.camera == editor.panel.camera.view


def named(editor: Editor, name: str) -> int:
    return next(entity.id for entity in editor.model.scene.mirror.entities.values() if entity.name == name)


def test_an_edit_shows_in_the_simulation_and_in_the_picture(elys, free_port, tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    elys("run", "yard", "--headless", "--realtime", "--paused", "--listen", endpoint).wait_for("simulating")
    elys("node", "render", "--connect", endpoint).wait_for("drawing views")

    async def scenario() -> None:
        async with editor_at(endpoint) as editor:
            # The first picture may be one from before the scene said where its camera stands.
            await until(editor, lambda: editor.model.scene.is_known and editor.application.frame_count > 3)
            await until(editor, lambda: shows_own_camera(editor))
            before = await picture(editor, tmp_path / "before.png")
            assert before.std() > 10.0  # there is something to be seen
            ground = named(editor, "Ground")

            def is_redder(after: np.ndarray) -> bool:
                change = (after[..., 0] - after[..., 2]) - (before[..., 0] - before[..., 2])
                return bool((change > 40.0).mean() > 0.1)

            await editor.model.edit.set_fields([ground], "Material", {"base_color": (0.9, 0.0, 0.0)})
            await picture_that(editor, tmp_path / "after.png", is_redder)
            await editor.model.history.undo()
            await picture_that(editor, tmp_path / "again.png", lambda again: not is_redder(again))

    asyncio.run(scenario())


def test_the_death_of_renderer_and_simulation_is_shown_and_survived(elys, free_port):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    simulation = elys("run", "yard", "--headless", "--realtime", "--listen", endpoint)
    simulation.wait_for("simulating")
    renderer = elys("node", "render", "--connect", endpoint)
    renderer.wait_for("drawing views")

    async def scenario() -> None:
        async with editor_at(endpoint) as editor:
            model, stream = editor.model, editor.stream
            await until(editor, lambda: stream.shown is not None)
            renderer.kill()
            await until(editor, lambda: stream.lost_renderer, seconds=5.0)
            sequence = stream.shown.sequence
            second = await asyncio.to_thread(elys, "node", "render", "--connect", endpoint)
            await until(editor, lambda: stream.shown.sequence > sequence)
            assert second.process.poll() is None

            await model.edit.rename(named(editor, "Ground"), "Floor")
            start = time.monotonic()
            simulation.kill()
            await until(editor, lambda: not model.connected, seconds=5.0)
            assert time.monotonic() - start < 3.0  # told by the connection that ends, long before silence would tell
            epoch = model.scene.mirror.epoch
            again = elys("run", "yard", "--headless", "--realtime", "--listen", endpoint)
            await asyncio.to_thread(again.wait_for, "simulating")
            await until(editor, lambda: model.connected and model.scene.mirror.epoch != epoch)
            assert not model.history.undo_label
            assert named(editor, "Ground")  # the new run's scene, without the edit
            outcome = await model.edit.rename(named(editor, "Ground"), "Floor")
            assert outcome.accepted == 1
            sequence = stream.shown.sequence
            await until(editor, lambda: stream.shown.sequence > sequence)

    asyncio.run(scenario())

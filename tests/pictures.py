"""make pictures: draws the pictures of the docs anew, with the real nodes. Look at them before committing."""

from __future__ import annotations

import asyncio
import os
import sys
from pathlib import Path

from PIL import Image

from elys.bus import topics
from elys.bus.messages.commands import CommandRequest, StepTicks
from elys.verbs.nodes import joined
from tests.benchmarks.processes import environment, running

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
ENDPOINT = "tcp/127.0.0.1:17560"
TICK = 110  # much lies, much still falls


def main() -> None:
    os.environ["ELYS_NULL_PLATFORM"] = "1"
    PICTURES.mkdir(exist_ok=True)
    elys = (sys.executable, "-m", "elys")
    simulation = (*elys, "run", "yard", "--headless", "--paused", "--listen", ENDPOINT)
    render = (*elys, "node", "render", "--connect", ENDPOINT)
    with (
        environment() as env,
        running(simulation, env=env, wait_for="simulating"),
        running(render, env=env, wait_for="drawing views"),
    ):
        asyncio.run(draw_editor(PICTURES / "editor.png"))
        asyncio.run(draw_hierarchy(PICTURES / "editor-hierarchy.png"))


async def draw_editor(path: Path) -> None:
    """The editor's window on the yard, paused in its fall, with a box selected."""
    from elys.editor_node.node import Editor

    async with joined(ENDPOINT, kind="editor") as session:
        # It is paused already; to say so again would end the steps.
        await session.request(topics.COMMAND, CommandRequest(origin="pictures", command=StepTicks(count=TICK)))
        with Editor(session, null_platform=True, size=(1600, 900)) as editor:
            window = asyncio.create_task(editor.run())
            model = editor.model
            while not model.scene.is_known or model.status is None or model.status.tick < TICK:
                await asyncio.sleep(0.05)
            mirror = editor.model.scene.mirror
            editor.model.selection.replace([next(e.id for e in mirror.entities.values() if e.name == "Box 8")])
            for _ in range(60):  # the picture comes from another process: until it has, and has come to rest
                editor.application.keep_awake(1.0)
                await asyncio.sleep(0.1)
            editor.screenshot(path)
            editor.application.close()
            await window
    print(path)


async def draw_hierarchy(path: Path) -> None:
    """The hierarchy of the yard, with a search and its menu of others, and some that are locked, hidden and off."""
    from elys.editor_node.events import CursorEntered, MouseMoved, MousePressed, MouseReleased
    from elys.editor_node.node import Editor

    async with joined(ENDPOINT, kind="editor") as session:
        with Editor(session, null_platform=True, size=(1600, 900)) as editor:
            window = asyncio.create_task(editor.run())
            scene, panel = editor.model.scene, editor.workspace.hierarchy
            while not scene.is_known or editor.stream.shown is None:
                await asyncio.sleep(0.05)
            boxes = [e.id for e in scene.mirror.entities.values() if e.name.startswith("Box ")]
            scene.marks.set("locked", boxes[1:3], True)
            scene.marks.set("hidden", boxes[2:5], True)
            editor.model.selection.replace(boxes[5:8])
            panel.search_for("t:box !plank")
            editor.ui.landmarks.is_wanted = True
            for event in (CursorEntered(True), None, "hierarchy/filters", MousePressed(0), MouseReleased(0)):
                editor.application.keep_awake(2.0)
                await asyncio.sleep(0.5)
                if isinstance(event, str):
                    event = MouseMoved(*editor.ui.landmarks.center(event))
                if event is not None:
                    editor.application.offer(event)
            for _ in range(20):
                editor.application.keep_awake(1.0)
                await asyncio.sleep(0.1)
            editor.screenshot(path)
            crop(path, (0, 0, 760, 630))
            editor.application.close()
            await window
    print(path)


def crop(path: Path, box: tuple[int, int, int, int]) -> None:
    """Keeps a part (left, top, right, bottom) of a picture."""
    with Image.open(path) as picture:
        part = picture.crop(box)
    part.save(path, optimize=True)


if __name__ == "__main__":
    main()

"""How many frames of the editor an edit takes until the viewport shows it: real simulation, real render node, real editor.

What shows it is the picture itself: a plate before the camera changes from red to green and back, and the middle of its
texture is looked at after each frame. The editor draws sixty frames a second, as it does while somebody drags.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Final

import msgspec
import numpy as np

from elys.bus import topics
from elys.bus.messages.commands import CommandRequest, SetPlaying
from elys.common.scene import EntityNode, SceneDocument, write_scene
from elys.samples.pile import pile
from elys.verbs.nodes import joined
from tests.benchmarks.processes import environment, running

if TYPE_CHECKING:
    from elys.editor_node.node import Editor

EDITS: Final = 50
FRAMES_AT_MOST: Final = 600
_COLORS: Final = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
Row = tuple[str, str]


def measure() -> list[Row]:
    """Rows of the table."""
    rows = []
    before = os.environ.get("ELYS_NULL_PLATFORM")
    os.environ["ELYS_NULL_PLATFORM"] = "1"
    try:
        for count, plays, words in ((1, False, "while time stands"), (1000, True, "while 1000 bodies move")):
            frames = _measure(count, plays=plays)
            figure = f"{np.percentile(frames, 50):.0f} / {max(frames)}"
            rows.append((f"frames from an edit to the picture that shows it, {words}, p50 / worst of {EDITS}", figure))
    finally:
        if before is None:
            del os.environ["ELYS_NULL_PLATFORM"]
    return rows


def _measure(count: int, *, plays: bool) -> list[int]:
    endpoint = f"tcp/127.0.0.1:{17670 + plays}"
    elys = (sys.executable, "-m", "elys")
    with tempfile.TemporaryDirectory() as directory, contextlib.ExitStack() as stack:
        path = Path(directory) / "plate.scene.json"
        write_scene(scene(count), path)
        env = stack.enter_context(environment())
        words = (*elys, "run", str(path), "--headless", "--realtime", "--listen", endpoint)
        stack.enter_context(running(words, env=env, wait_for="simulating"))
        stack.enter_context(
            running((*elys, "node", "render", "--connect", endpoint), env=env, wait_for="drawing views")
        )
        return asyncio.run(_edit(endpoint, plays=plays))


def scene(count: int) -> SceneDocument:
    """So many bodies, and far away from them a plate that shines."""
    plate = EntityNode(
        name="Plate",
        components={
            "Transform": {"position": (0.0, 50.0, 0.0), "scale": (20.0, 20.0, 0.1)},
            "MeshRenderer": {"mesh": "box"},
            "Material": {"base_color": (0.0, 0.0, 0.0), "emissive": _COLORS[1]},
        },
    )
    document = pile(count)
    return msgspec.structs.replace(document, entities=[*document.entities, plate])


async def _edit(endpoint: str, *, plays: bool) -> list[int]:
    from elys.editor_node.node import Editor

    async with joined(endpoint, kind="editor") as session:
        with Editor(session, null_platform=True, size=(1280, 720)) as editor:
            running_editor = asyncio.create_task(editor.run())
            editor.application.keep_awake(3600.0)
            while not editor.model.scene.is_known or editor.stream.shown is None:
                await asyncio.sleep(0.01)
            request = CommandRequest(origin="bench", command=SetPlaying(playing=plays))
            await session.request(topics.COMMAND, request, timeout=20.0)
            frames = await _count(editor)
            editor.application.close()
            await running_editor
    return frames


async def _count(editor: Editor) -> list[int]:
    scene = editor.model.scene
    plate = next(entity.id for entity in scene.mirror.entities.values() if entity.name == "Plate")
    editor.navigation.is_placed = True
    editor.panel.camera.look_from((0.0, 50.0, 8.0), (0.0, 0.0, -1.0), 8.0)
    await _until_seen(editor, 1)
    counts = []
    for number in range(EDITS):
        shown, sent = number % 2, editor.application.frame_count
        editor.model.edit.set_fields((plate,), "Material", {"emissive": _COLORS[shown]})
        counts.append(await _until_seen(editor, shown) - sent)
        await asyncio.sleep(0.05 + 0.002 * number)  # so that edits meet ticks and frames at all phases
    return counts


def _middle(editor: Editor) -> tuple[int, int]:
    """Red and green in the middle of the texture that the viewport shows."""
    pixels = editor.viewports.first.picture.read()
    red, green = pixels[len(pixels) // 2, pixels.shape[1] // 2, :2].tolist()
    return red, green


async def _until_seen(editor: Editor, color: int) -> int:
    """The frame in which the middle of the picture first has a colour."""
    last, first = -1, editor.application.frame_count
    while True:
        frame = editor.application.frame_count
        if frame != last:
            last = frame
            red, green = _middle(editor)
            if abs(green - red) > 50 and (green > red) == bool(color):
                return frame
            assert frame - first < FRAMES_AT_MOST, "the picture never showed the edit"
        await asyncio.sleep(0.0)

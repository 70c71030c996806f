"""What an editor leaves behind when it is closed, and what it gathers while it is open: nothing that grows."""

from __future__ import annotations

import asyncio
import gc
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from elys.bus.session import Session
from tests.unit.editor_node.conftest import Stage, open_stage

pytestmark = pytest.mark.gl
PAGE = 4096  # [bytes]


def resident() -> int:
    """Bytes of this process that lie in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


async def open_and_close(stage: Stage, frames: int) -> weakref.ref[Any]:
    """An editor that draws so many frames and is closed; tells whether it lives."""
    from elys.editor_node.node import Editor

    session = await Session.join(stage.broker.connect(), kind="editor")
    with Editor(session, null_platform=True, size=(800, 500)) as editor:
        running = asyncio.create_task(editor.run())
        editor.application.keep_awake(60.0)
        await stage.until(lambda: editor.model.scene.is_known and editor.application.frame_count >= frames)
        editor.application.close()
        await running
    await session.close()
    return weakref.ref(editor)


def test_editors_that_are_closed_leave_nothing_behind():
    import moderngl

    async def main() -> None:
        async with open_stage() as stage:
            for number in range(30):
                left = await open_and_close(stage, 4)
                gc.collect()
                assert left() is None
                if number == 9:  # by then fonts, shaders and modules are loaded
                    level, objects = resident(), len(gc.get_objects())
            assert resident() - level < 30e6
            assert len(gc.get_objects()) - objects < 1000
            ours = (moderngl.Context, moderngl.Texture, moderngl.Framebuffer)
            assert not [found for found in gc.get_objects() if isinstance(found, ours)]

    asyncio.run(main())


def test_pictures_that_nobody_sees_are_not_gathered():
    """Without a display nothing ends a frame, and Mesa kept what each was to be drawn from."""
    from imgui_bundle import imgui

    from elys.editor_node.gpu import WindowContext
    from elys.editor_node.imgui_layer import ImGuiLayer
    from elys.editor_node.preferences import Preferences
    from elys.editor_node.window import Window

    window = Window("many pictures", (1600, 900), null_platform=True)
    context = WindowContext()
    textures = [context.texture_of(np.full((128, 128, 4), shade, np.uint8)) for shade in range(40)]

    def draw(elapsed: float) -> None:
        imgui.set_next_window_size((1500.0, 800.0))
        imgui.begin("pictures")
        for number, texture in enumerate(textures):
            imgui.image(imgui.ImTextureRef(texture.glo), (100.0, 100.0))
            if number % 12 < 11:
                imgui.same_line()
        imgui.end()

    widgets = ImGuiLayer(
        window, context, draw=draw, reserves=lambda event: False, layout_file=None, preferences=Preferences()
    )
    for frame in range(180):
        widgets.update(1 / 60)
        window.swap()
        if frame == 60:
            level = resident()
    grown = resident() - level
    widgets.close()
    for texture in textures:
        texture.release()
    context.release()
    window.close()
    assert grown < 50e6

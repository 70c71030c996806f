"""make pictures: draws the pictures of the docs anew, with the real nodes; or those that are named, as `timeline`.

Look at them before committing.
"""

from __future__ import annotations

import asyncio
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from elys.bus import topics
from elys.bus.messages.commands import CommandRequest, StepTicks
from elys.verbs.nodes import joined
from tests.benchmarks.processes import environment, running
from tests.editor_pictures import draw_editor_pictures
from tests.game_pictures import draw_controls, draw_game
from tests.instrument_pictures import main as draw_instrument_pictures
from tests.web_pictures import draw_web_pictures

if TYPE_CHECKING:
    from elys.editor_node.node import Editor

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
ENDPOINT = "tcp/127.0.0.1:17560"
TICK = 110  # much lies, much still falls


def main() -> None:
    os.environ["ELYS_NULL_PLATFORM"] = "1"
    os.environ["ELYS_STATE_DIR"] = tempfile.mkdtemp()  # no bookmark of a person's own is shown, or lost
    PICTURES.mkdir(exist_ok=True)
    elys = (sys.executable, "-m", "elys")
    simulation = (*elys, "run", "yard", "--headless", "--paused", "--listen", ENDPOINT)
    render = (*elys, "node", "render", "--connect", ENDPOINT)
    with (
        environment() as env,
        running(simulation, env=env, wait_for="simulating"),
        running(render, env=env, wait_for="drawing views"),
    ):
        os.environ["ELYS_RUNTIME_DIR"] = env["ELYS_RUNTIME_DIR"]  # of which sessions the start page is to tell
        drawn = {
            "editor": draw_editor,
            "editor-hierarchy": draw_hierarchy,
            "editor-viewport": draw_viewport,
            "editor-four-views": draw_four_views,
            "timeline": draw_timeline,
            "editor-assets": draw_assets,
        }
        for name, draw in drawn.items():
            if name in (sys.argv[1:] or [name]):
                asyncio.run(draw(PICTURES / f"{name}.png"))
        if "windows" in (sys.argv[1:] or ["windows"]):
            asyncio.run(draw_editor_pictures(PICTURES / "editor", ENDPOINT))
    if "instruments" in (sys.argv[1:] or ["instruments"]):
        draw_instrument_pictures()
    if "web" in (sys.argv[1:] or ["web"]):
        draw_web_pictures(PICTURES)
    if "game" in (sys.argv[1:] or ["game"]):
        draw_game(PICTURES)
    if "controls" in (sys.argv[1:] or ["controls"]):
        level = (*elys, "run", "meadow", "--headless", "--listen", ENDPOINT)
        with environment() as env, running(level, env=env, wait_for="simulating"):
            asyncio.run(draw_controls(PICTURES / "controls.png", ENDPOINT))
    if "editor-inspector" not in (sys.argv[1:] or ["editor-inspector"]):
        return
    table = (*elys, "run", "docs/examples/table.scene.json", "--headless", "--paused", "--listen", ENDPOINT)
    with environment() as env, running(table, env=env, wait_for="simulating"):
        asyncio.run(draw_inspector(PICTURES / "editor-inspector.png"))


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


async def draw_assets(path: Path) -> None:
    """The browser of assets on a small project, a prefab and a light of it put into the yard, a broken model pointed at."""
    from elys.editor_node.events import CursorEntered, MouseMoved
    from elys.editor_node.node import Editor

    with tempfile.TemporaryDirectory() as made:
        project = Path(made) / "project"
        _write_assets(project)
        async with joined(ENDPOINT, kind="editor") as session:
            with Editor(session, null_platform=True, size=(1600, 900)) as editor:
                window = asyncio.create_task(editor.run())
                library, panel = editor.assets, editor.workspace.assets
                while not editor.model.scene.is_known or editor.stream.shown is None:
                    await frames_of(editor, 5)
                editor.preferences.asset_size = 80.0
                library.open(project)
                while library.folder is None or not library.folder.is_known:
                    await frames_of(editor, 5)
                lamp = next(file for file in library.listing.files if file.name == "lamp.prefab.json")
                for x in (-4.0, 0.0, 4.0):
                    await library.placing.place(lamp, np.array((x, 0.0, 7.0)))
                panel.search()
                panel.browsing.selected = lamp.path
                drawn = [file for file in library.listing.files if file.name != "broken.glb"]
                while any(library.picture(file) is None for file in drawn):
                    await frames_of(editor, 5)
                editor.ui.landmarks.is_wanted = True
                await frames_of(editor, 20)
                editor.application.offer(CursorEntered(True))
                editor.application.offer(MouseMoved(*editor.ui.landmarks.center("assets/broken.glb")))
                for _ in range(20):
                    await frames_of(editor, 3)
                    await asyncio.sleep(0.05)
                editor.screenshot(path)
                editor.application.close()
                await window
    print(path)


def _write_assets(project: Path) -> None:
    """A project with something of every kind."""
    from tests.unit.editor_node.asset_files import write_light, write_model

    (project / "textures").mkdir(parents=True)
    for name in ("lamp.prefab.json", "table.scene.json"):
        shutil.copy(PICTURES.parent / "examples" / name, project / name)
    rows, columns = np.mgrid[0:256, 0:256]
    for name, (red, green, blue) in {"brick": (176, 84, 60), "moss": (70, 120, 60), "tiles": (190, 190, 182)}.items():
        joint = (rows % 64 < 4) | ((columns + 64 * (rows // 64 % 2)) % 128 < 4)
        shade = 0.85 + 0.15 * np.sin(rows * 0.7) * np.cos(columns * 0.31)
        pixels = np.where(joint[..., None], (120, 118, 112), shade[..., None] * (red, green, blue)).astype(np.uint8)
        Image.fromarray(pixels).save(project / f"{name}.png")
    write_model(project / "sign.gltf", color=(0.8, 0.25, 0.05))
    up, around = np.mgrid[1:0:64j, -1:1:128j]
    sun = 6.0 * np.exp(-((up - 0.62) ** 2 + (around - 0.4) ** 2) / 0.004)
    light = np.stack((0.5 - 0.3 * up + sun, 0.3 + 0.1 * up + sun, 0.2 + 0.7 * up + 0.6 * sun), axis=-1)
    write_light(project / "evening.hdr", light)
    (project / "broken.glb").write_bytes(b"half of a model")


async def draw_inspector(path: Path) -> None:
    """The inspector twice: on a ball that has fallen a while and is being given a wrong unit, and on a part of a prefab."""
    from imgui_bundle import imgui
    from PIL import Image

    from elys.editor_node.node import Editor

    async with joined(ENDPOINT, kind="editor") as session:
        with Editor(session, null_platform=True, size=(1600, 1000)) as editor:
            window = asyncio.create_task(editor.run())
            model, rows = editor.model, editor.workspace.inspector.rows
            while not model.scene.is_known:
                await asyncio.sleep(0.05)
            editor.preferences.folded[:] = ["Collider", "Material"]
            await session.request(topics.COMMAND, CommandRequest(origin="pictures", command=StepTicks(count=20)))

            async def picture_of(name: str) -> Image.Image:
                await frames_of(editor, 12)
                file = path.with_name(f"{path.stem}-{name}.png")
                editor.screenshot(file)
                left, _, right, _ = editor.ui.landmarks.rectangles["inspector/search"]
                with Image.open(file) as whole:
                    part = whole.crop((int(left) - 12, 56, int(right) + 12, 870)).convert("RGB")
                file.unlink()
                return part

            editor.ui.landmarks.is_wanted = True
            entities = {entity.name: entity.id for entity in model.scene.mirror.entities.values()}
            model.selection.replace([entities["Ball"]])
            await frames_of(editor, 12)
            field = "inspector/RigidBody/gravity_scale"
            rows._typing.start(field, "2 m/s")  # as a person's double click and keys would
            await frames_of(editor, 3)
            imgui.get_io().add_key_event(imgui.Key.enter, True)
            await frames_of(editor, 2)
            imgui.get_io().add_key_event(imgui.Key.enter, False)
            ball = await picture_of("ball")
            model.selection.replace([entities["Bulb"]])
            bulb = await picture_of("bulb")
            both = Image.new("RGB", (ball.width + 16 + bulb.width, ball.height), (19, 20, 23))
            both.paste(ball, (0, 0))
            both.paste(bulb, (ball.width + 16, 0))
            both.save(path)
            editor.application.close()
            await window
    print(path)


async def draw_timeline(path: Path) -> None:
    """The editor's window on the yard, four seconds in, rewound to the second, with a loop and two bookmarks."""
    from imgui_bundle import imgui

    from elys.editor_node.node import Editor
    from elys.editor_node.panels import timeline

    async with joined(ENDPOINT, kind="editor") as session:
        with Editor(session, null_platform=True, size=(1600, 900)) as editor:
            window = asyncio.create_task(editor.run())
            model, line = editor.model, editor.model.timeline
            while not model.scene.is_known or model.status is None:
                await asyncio.sleep(0.05)
            ticks = StepTicks(count=TICK + 240 - model.status.tick)
            await session.request(topics.COMMAND, CommandRequest(origin="pictures", command=ticks))
            while model.status.tick < TICK + 240:
                await asyncio.sleep(0.05)
            box = next(e.id for e in model.scene.mirror.entities.values() if e.name == "Box 8")
            model.edit.set_fields([box], "Material", {"roughness": 0.2})
            await model.history.settle()
            for name, at in (("first hits", 0.9), ("all lie", 4.6)):
                line.bookmarks.add(name, at)
            line.loop_start, line.loop_end, line.is_looping = 1.5, 3.5, True
            line.go_to(2.0)
            for _ in range(80):
                imgui.set_window_focus(timeline.TITLE)
                editor.application.keep_awake(1.0)
                await asyncio.sleep(0.1)
            editor.screenshot(path)
            for bookmark in line.bookmarks.all:
                line.bookmarks.remove(bookmark)
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


async def draw_viewport(path: Path) -> None:
    """The viewport on the yard in its fall, with lines drawn over it, while a rectangle is dragged."""
    from elys.editor_node.events import CursorEntered, MouseMoved, MousePressed
    from elys.editor_node.node import Editor

    async with joined(ENDPOINT, kind="editor") as session:
        await session.request(topics.COMMAND, CommandRequest(origin="pictures", command=StepTicks(count=TICK)))
        with Editor(session, null_platform=True, size=(1600, 900)) as editor:
            window = asyncio.create_task(editor.run())
            scene, panel = editor.model.scene, editor.panel
            while not scene.is_known or editor.stream.shown is None or editor.stream.shown.tick < TICK:
                await asyncio.sleep(0.05)
            boxes = [e.id for e in scene.mirror.entities.values() if e.name.startswith("Box ")]
            editor.model.selection.replace(boxes[5:8])
            editor.ui.tools.tool, panel.look.debug = "select", ("aabb", "velocity")
            await frames_of(editor, 4)
            x, y, width, height = panel.rectangle
            start, end = (x + 0.3 * width, y + 0.3 * height), (x + 0.62 * width, y + 0.75 * height)
            for event in (CursorEntered(True), MouseMoved(*start), MousePressed(0), MouseMoved(*end)):
                editor.application.offer(event)
                await frames_of(editor, 3)
            for _ in range(30):
                editor.application.keep_awake(1.0)
                await asyncio.sleep(0.1)
            editor.screenshot(path)
            crop(path, (int(x), int(y), int(x + width), int(y + height)))
            editor.application.close()
            await window
    print(path)


async def draw_four_views(path: Path) -> None:
    """Four views of the yard in its fall, one of them of another kind, with the handles of what is selected in each."""
    from elys.editor_node.events import CursorEntered, MouseMoved, MousePressed, MouseReleased
    from elys.editor_node.node import Editor

    async with joined(ENDPOINT, kind="editor") as session:
        await session.request(topics.COMMAND, CommandRequest(origin="pictures", command=StepTicks(count=TICK)))
        with Editor(session, null_platform=True, size=(1600, 900)) as editor:
            window = asyncio.create_task(editor.run())
            scene, viewports = editor.model.scene, editor.viewports
            while not scene.is_known or editor.stream.shown is None or editor.stream.shown.tick < TICK:
                await asyncio.sleep(0.05)
            box = next(e.id for e in scene.mirror.entities.values() if e.name == "Box 12")
            editor.model.selection.replace((box,))
            editor.ui.actions.run("view.four_views")
            await frames_of(editor, 6)
            for panel in viewports:
                panel.camera.target, panel.camera.distance = np.array((0.0, 1.5, 0.0)), 14.0
            list(viewports)[1].look.shows = "wireframe"
            x, y, width, height = list(viewports)[2].rectangle
            at = (x + 0.1 * width, y + 0.9 * height)
            for event in (CursorEntered(True), MouseMoved(*at), MousePressed(2), MouseReleased(2)):
                editor.application.offer(event)
                await frames_of(editor, 2)
            for _ in range(40):
                editor.application.keep_awake(1.0)
                await asyncio.sleep(0.1)
            editor.screenshot(path)
            editor.application.close()
            await window
    print(path)


async def frames_of(editor: Editor, count: int) -> None:
    """Waits until so many frames were drawn."""
    goal = editor.application.frame_count + count
    while editor.application.frame_count < goal:
        editor.application.keep_awake(1.0)
        await asyncio.sleep(0.01)


def crop(path: Path, box: tuple[int, int, int, int]) -> None:
    """Keeps a part (left, top, right, bottom) of a picture."""
    with Image.open(path) as picture:
        part = picture.crop(box)
    part.save(path, optimize=True)


if __name__ == "__main__":
    main()

"""The pictures of docs/editor-instruments.md: the lower panels of the editor at a running simulation, with its render node.

python -m tests.instrument_pictures
"""

from __future__ import annotations

import asyncio
import os
import sys
from pathlib import Path

from PIL import Image

from elys.editor_node.events import MouseMoved
from elys.editor_node.keys import Key
from elys.editor_node.language import use_language
from elys.verbs.openers import ChildProcesses
from tests.benchmarks.processes import environment, running
from tests.editor_pictures import editor_person
from tests.unit.editor_node.person import Person

PICTURES = Path(__file__).parents[1] / "docs" / "pictures" / "instruments"
ENDPOINT = "tcp/127.0.0.1:17562"
SIZE = (1440, 1080)  # so high that the lower panels show something


def main() -> None:
    os.environ["ELYS_NULL_PLATFORM"] = "1"
    PICTURES.mkdir(parents=True, exist_ok=True)
    elys = (sys.executable, "-m", "elys")
    with (
        environment() as env,
        running((*elys, "run", "yard", "--headless", "--paused", "--listen", ENDPOINT), env=env, wait_for="simulating"),
        running((*elys, "node", "render", "--connect", ENDPOINT), env=env, wait_for="drawing views"),
    ):
        os.environ["ELYS_RUNTIME_DIR"] = env["ELYS_RUNTIME_DIR"]
        asyncio.run(draw_pictures(PICTURES))


async def draw_pictures(directory: Path) -> None:
    """Draws them into `directory`."""
    Image.init()  # loads all formats, which takes so long that the link would be given up
    openers = ChildProcesses()
    try:
        async with editor_person(openers, size=SIZE) as person:
            editor = person.editor
            editor.attachments.connect(ENDPOINT)
            await person.until(lambda: editor.model.scene.is_known and editor.stream.shown is not None)
            await person.frames(10)
            await _plots(person, directory)
            await _profiler(person, directory)
            await _console(person, directory)
            await _show(person, "Topics")
            await _run(person, 3.0)
            await person.click("topics/profile")
            await person.click("topics/message/stages")
            await _shoot(person, directory / "topics.webp")
            await _show(person, "Plan")
            await _run(person, 2.0)
            await _shoot(person, directory / "plan.webp")
            editor.preferences.theme, editor.preferences.language = "light", "fr"
            use_language("fr")
            await _run(person, 1.0)
            await _shoot(person, directory / "plan-light-french.webp")
    finally:
        use_language("en")
        await openers.close()


async def _console(person: Person, directory: Path) -> None:
    console = person.editor.model.console
    console.clear()
    for number in range(1, 9):
        console.add("simulation", "info", f"Box {number} was placed", tick=10 * number)
    box = next(e.id for e in person.editor.model.scene.mirror.entities.values() if e.name == "Box 8")
    console.add("simulation", "warning", f"entity {box} 'Box 8' is deeper in the ground than 5 mm", tick=104)
    console.add("render", "error", "texture moss.png cannot be read: it ends in the middle")
    await _show(person, "Console")
    await person.point("console/line/8")
    await _run(person, 1.0)
    await _shoot(person, directory / "console.webp")
    await person.do(MouseMoved(5.0, 300.0))


async def _profiler(person: Person, directory: Path) -> None:
    await _show(person, "Profiler")
    await _run(person, 6.0)
    await person.click("profiler/worst")
    await person.do(MouseMoved(5.0, 300.0))
    await _shoot(person, directory / "profiler.webp")
    await person.click("profiler/hold")
    view = next(name for name in person.editor.workspace.instruments.tracks if name.startswith("view"))
    person.editor.workspace.profiler.shown = view
    await _run(person, 1.0)
    await _shoot(person, directory / "profiler-view.webp")


async def _plots(person: Person, directory: Path) -> None:
    workspace = person.editor.workspace
    await _show(person, "Plots")
    for path in (
        "Box 3.Transform.position.y",
        "Box 5.Transform.position.y",
        "Box 3.speed",
        "world.kinetic",
        "world.contacts",
    ):
        assert workspace.plots.plot(path), path
    person.editor.model.toggle_playing()
    await _run(person, 6.0)
    await _shoot(person, directory / "plots.webp")
    await person.click("plots/path")
    await person.type("Box 4.Transform.")
    await person.frames(3)
    await _shoot(person, directory / "plots-search.webp")
    await person.press(Key.ESCAPE)
    await person.press(Key.ESCAPE)


async def _show(person: Person, name: str) -> None:
    person.editor.workspace.show(f"###{name}")
    await person.frames(4)


async def _run(person: Person, seconds: float) -> None:
    """Lets the session go on for a while in which the editor draws."""
    end = asyncio.get_running_loop().time() + seconds
    while asyncio.get_running_loop().time() < end:
        person.application.keep_awake(1.0)
        await asyncio.sleep(0.1)


async def _shoot(person: Person, path: Path) -> None:
    await person.frames(4)
    person.editor.screenshot(path)
    print(path)


if __name__ == "__main__":
    main()

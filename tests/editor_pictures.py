"""The pictures of docs/editor.md: every window of the editor, on a real session, in both themes and languages."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
from collections.abc import AsyncIterator
from pathlib import Path

from PIL import Image

from elys.bus import topics
from elys.bus.discovery import join_session
from elys.bus.messages.commands import CommandRequest, StepTicks
from elys.editor_node.events import MouseMoved
from elys.editor_node.keys import Key
from elys.editor_node.language import use_language
from elys.editor_node.node import Editor
from elys.editor_node.panels import diagnostics
from elys.verbs.openers import ChildProcesses
from tests.unit.editor_node.person import CTRL, Person, person_at

SIZE = (1440, 810)
TICK = 110  # much lies, much still falls


class _Clock:
    """What `Person` waits with."""

    async def until(self, condition) -> None:
        async with asyncio.timeout(60.0):
            while not condition():
                await asyncio.sleep(0.01)


@contextlib.asynccontextmanager
async def editor_person(openers: ChildProcesses, *, size: tuple[int, int] = SIZE) -> AsyncIterator[Person]:
    """Somebody at an editor of its own, which begins with its start page."""
    with Editor(openers=openers, null_platform=True, size=size) as editor:
        try:
            async with person_at(editor, _Clock()) as person:
                yield person
        finally:
            use_language("en")


async def draw_editor_pictures(directory: Path, endpoint: str) -> None:
    """Draws them into `directory`; a simulation of the yard, paused, and a render node are at `endpoint`."""
    directory.mkdir(parents=True, exist_ok=True)
    Image.init()  # loads all formats, which takes so long that the link would be given up
    openers = ChildProcesses()
    try:
        async with editor_person(openers) as person:
            await _start_pages(person, directory)
            person.editor.attachments.connect(endpoint)
            await person.until(lambda: person.editor.model.scene.is_known)
            await _step(endpoint)
            await person.until(
                lambda: person.editor.stream.shown is not None and person.editor.stream.shown.tick >= TICK
            )
            for number in range(2):
                await _windows(person, directory, number)
            person.editor.preferences.theme, person.editor.preferences.language = "dark", "en"
            use_language("en")
            await _edits_and_files(person, directory)
            person.editor.model.console.clear()
            host = await openers.simulate("stack")
            person.editor.attachments.connect(host)
            await person.until(lambda: person.editor.attachments.endpoint == host)
            await person.until(lambda: person.editor.stream.shown is not None)
            await _settle(person)
            openers._children[0].kill()
            await person.until(lambda: person.editor.attachments.lost_for is not None)
            await asyncio.sleep(3.0)
            await _shoot(person, directory / "banner.webp")
    finally:
        await openers.close()


async def _step(endpoint: str) -> None:
    session = await join_session(endpoint, kind="tool")
    await session.request(topics.COMMAND, CommandRequest(origin="pictures", command=StepTicks(count=TICK)))
    await session.close()


async def _shoot(person: Person, path: Path) -> None:
    # Where software draws, a frame may take longer than a link may be silent: what the console says of it is of no use here.
    person.editor.model.console.clear()
    await person.frames(6)
    person.editor.screenshot(path)
    print(path)


async def _start_pages(person: Person, directory: Path) -> None:
    preferences = person.editor.preferences
    preferences.recent_scenes += ["/home/ada/scenes/quarry.scene.json", "bridge"]
    preferences.recent_recordings += ["/home/ada/runs/landslide.mcap"]
    await person.until(lambda: person.editor.attachments.sessions)
    await _shoot(person, directory / "start.webp")
    preferences.theme = "light"
    use_language("fr")
    await _shoot(person, directory / "start-light-french.webp")
    preferences.theme = "dark"
    use_language("en")


async def _windows(person: Person, directory: Path, number: int) -> None:
    """Dark and English first, then light and French."""
    editor = person.editor
    preferences, workspace = editor.preferences, editor.workspace
    kind = ("", "-light-french")[number]
    preferences.theme, preferences.language = (("dark", "en"), ("light", "fr"))[number]
    use_language(preferences.language)
    mirror = editor.model.scene.mirror
    editor.model.selection.replace([next(e.id for e in mirror.entities.values() if e.name == "Box 8")])
    await person.do(MouseMoved(5.0, 400.0))
    await _settle(person)
    await _shoot(person, directory / f"whole{kind}.webp")

    await person.press(Key.P, CTRL)
    await person.frames(3)
    await person.type("box 1" if number == 0 else "aff")
    await _shoot(person, directory / f"palette{kind}.webp")
    await person.press(Key.ESCAPE)

    await person.press(Key.COMMA, CTRL)
    await _shoot(person, directory / f"preferences{kind}.webp")
    await person.press(Key.COMMA, CTRL)

    workspace.link.is_open = True
    await person.until(lambda: editor.ui.meter.round_trip is not None)
    await _shoot(person, directory / f"link{kind}.webp")
    workspace.link.is_open = False

    workspace.tour.start()
    await person.frames(3)
    await person.click("tour/next")
    await person.click("tour/next")
    await _shoot(person, directory / f"tour{kind}.webp")
    await person.click("tour/skip")

    await person.click("menu/view")
    await person.click("menu/layout")
    await _shoot(person, directory / f"layout{kind}.webp")
    await person.press(Key.ESCAPE)

    for name in ("help.about", "help.keys", "file.connect"):
        editor.ui.actions.run(name)
        await _shoot(person, directory / f"{name.partition('.')[2]}{kind}.webp")
        await person.press(Key.ESCAPE)
        await person.frames(3)


async def _edits_and_files(person: Person, directory: Path) -> None:
    """What shows edits, files and diagnostics: a few edits are made for it, and undone."""
    editor = person.editor
    model, run = editor.model, editor.ui.actions.run
    shutil.rmtree("/tmp/scenes", ignore_errors=True)
    Path("/tmp/scenes").mkdir()
    await model.save("/tmp/scenes/yard.scene.json")
    named = {entity.name: entity.id for entity in model.scene.mirror.entities.values()}
    await model.edit.rename(named["Box 8"], "Anvil")
    model.selection.replace([named["Box 8"], named["Box 9"]])
    run("edit.duplicate")
    await _settle(person)
    run("edit.delete")
    await _settle(person)
    for action, name in (("edit.history", "history"), ("file.changes", "changes")):
        run(action)
        await _settle(person)
        await _shoot(person, directory / f"{name}.webp")
    for action, name in (("file.save_as", "save"), ("file.quit", "close")):
        run(action)
        await _shoot(person, directory / f"{name}.webp")
        await person.press(Key.ESCAPE)
        await person.frames(3)
    model.selection.clear()
    editor.workspace.show(diagnostics.TITLE)
    run("time.play")
    await _settle(person)
    run("time.play")
    await _settle(person)
    await _shoot(person, directory / "diagnostics.webp")
    for _ in range(3):
        run("edit.undo")
        await _settle(person)


async def _settle(person: Person) -> None:
    """Until the picture of this moment has come from the other process."""
    for _ in range(20):
        person.application.keep_awake(1.0)
        await asyncio.sleep(0.1)

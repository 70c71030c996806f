"""What the start page opens: real nodes, started for it, attached to over zenoh, and gone when the editor is."""

from __future__ import annotations

import asyncio
import contextlib
import os

import pytest

from elys.common.errors import ElysError
from elys.editor_node.node import Editor
from elys.verbs.openers import ChildProcesses

pytestmark = [pytest.mark.process, pytest.mark.gl]


async def until(editor: Editor, condition, *, seconds: float = 60.0) -> None:
    async with asyncio.timeout(seconds):
        while not condition():
            editor.application.request_redraw(0.05)
            await asyncio.sleep(0.01)


def is_alive(pid: int) -> bool:
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, 0)
        return True
    return False


@pytest.fixture
def own_runtime(tmp_path, monkeypatch):
    monkeypatch.setenv("ELYS_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.setenv("ELYS_NULL_PLATFORM", "1")


def test_a_sample_is_opened_seen_left_and_the_host_survives_a_kill(own_runtime):
    async def main() -> None:
        openers = ChildProcesses()
        with Editor(openers=openers, null_platform=True, size=(960, 600)) as editor:
            running = asyncio.create_task(editor.run())
            try:
                await until(editor, lambda: editor.application.frame_count > 2)
                editor.attachments.open_scene("stack")
                await until(editor, lambda: editor.model.scene.is_known and editor.model.status is not None)
                assert not editor.model.is_playing  # it waits for the person
                await until(editor, lambda: editor.stream.shown is not None)  # by a render node of its own
                names = {entity.name for entity in editor.model.scene.mirror.entities.values()}

                simulation, render = openers._children[:2]
                render.kill()
                shown = editor.stream.renderer
                await until(editor, lambda: editor.stream.renderer not in (None, shown))  # another one came
                simulation.kill()
                await until(editor, lambda: editor.attachments.lost_for is not None)
                drawn = editor.application.frame_count
                await until(editor, lambda: editor.application.frame_count > drawn + 3)
                assert {entity.name for entity in editor.model.scene.mirror.entities.values()} == names
                editor.attachments.detach()
                assert not editor.attachments.is_attached

                editor.attachments.open_scene("no-such-scene")
                await until(editor, lambda: not editor.attachments.is_busy)
                assert "there is no scene file and no sample called 'no-such-scene'" in editor.attachments.error
            finally:
                editor.application.close()
                await running
                await openers.close()
        assert not any(is_alive(child.pid) for child in openers._children)

    asyncio.run(main())


def test_what_cannot_be_opened_is_a_sentence(own_runtime, tmp_path):
    async def main() -> None:
        openers = ChildProcesses()
        assert ("stack", "A tower of ten cubes") in openers.samples
        (tmp_path / "it.mcap").write_text("no recording")
        for attempt in (openers.simulate("stak"), openers.play(str(tmp_path / "it.mcap")), openers.play("gone.mcap")):
            with pytest.raises(ElysError) as caught:
                await attempt
            assert "\n" not in str(caught.value)
        await openers.close()

    asyncio.run(main())


def test_an_editor_starts_alone(elys, monkeypatch):
    command = elys("node", "editor", "--alone", "--frames", "20", ELYS_NULL_PLATFORM="1")
    assert command.wait() == 0, command.output
    assert "rror" not in command.output

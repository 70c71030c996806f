"""Ghosts listed, tinted, shifted and taken away; forks of a recording begun, refused and left again."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from elys.bus import topics
from elys.bus.ghost_service import ALIGNED_NOW, GhostServer
from elys.bus.messages.commands import Seek
from elys.bus.messages.ghosts import GHOST_COLORS
from elys.bus.player import Player
from elys.bus.recording import Recording
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.errors import RecordingError
from elys.editor_node.ghost_list import SILENCE, GhostList
from elys.editor_node.panels.fork_dialog import free_name
from tests.unit.bus.told_recordings import write_told
from tests.unit.editor_node.person import Person, person_at
from tests.unit.editor_node.test_editor_attach import A, B, Town


class Replays(Town):
    """A town in which recordings are played, and shown as ghosts."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.file = write_told(folder / "run.mcap")
        self.other = write_told(folder / "other.mcap")
        self.asked: list[tuple[Any, ...]] = []
        self.ghosts: list[asyncio.Task[None]] = []
        self.players: list[tuple[Session, asyncio.Task[None], Recording]] = []

    async def replay(self, endpoint: str) -> None:
        broker = self.brokers[endpoint] = LoopbackBroker()
        session = await Session.host(broker.listen(), name="run", kind="replay", epoch=4)
        recording = Recording(self.file)
        player = Player(recording, session, playing=False)
        self.players.append((session, asyncio.create_task(player.run()), recording))
        self.hosts[endpoint] = self  # somebody listens there

    async def fork(self, recording: str, time: float, record: str) -> str:
        self.asked.append((recording, time, record))
        if record.endswith("wrong.mcap"):
            raise RecordingError("it comes out as something else: here is another build (numba 0.68.1)")
        if B not in self.hosts:
            await self.host(B, name="fork")
        return B

    async def show_ghost(self, recording: str, endpoint: str, color: tuple[int, int, int], starts_now: bool) -> None:
        if not Path(recording).exists():
            raise RecordingError(f"there is no {recording}")
        session, _, _ = self.players[0]
        offset = ALIGNED_NOW if starts_now else 0.0
        opened = Recording(Path(recording))
        self.ghosts.append(asyncio.create_task(GhostServer(opened, session, color=color, offset=offset).run()))

    async def close(self) -> None:
        for task in (*self.ghosts, *(task for _, task, _ in self.players)):
            task.cancel()
        await asyncio.gather(*self.ghosts, *(task for _, task, _ in self.players), return_exceptions=True)
        for session, _, recording in self.players:
            await session.close()
            recording.close()
        self.hosts = {endpoint: host for endpoint, host in self.hosts.items() if host is not self}
        await super().close()


def at_a_replay(folder: Path, scenario: Any) -> None:
    """Runs `await scenario(person, town)` at an editor that is attached to a recording."""
    from elys.editor_node.node import Editor

    async def main() -> None:
        town = Replays(folder)
        with Editor(
            openers=town, join=lambda endpoint: town.join(editor.seat, endpoint), null_platform=True, size=(1600, 900)
        ) as editor:
            try:
                async with person_at(editor, town) as person:
                    await town.replay(A)
                    editor.attachments.connect(A)
                    await person.until(lambda: editor.model.status is not None and editor.model.scene.is_known)
                    await person.frames(8)  # panels take their places
                    await scenario(person, town)
            finally:
                await town.close()

    asyncio.run(main())


@pytest.mark.gl
def test_another_run_is_shown_tinted_shifted_and_taken_away(tmp_path, screenshot_directory):
    async def scenario(person: Person, town: Replays) -> None:
        editor = person.editor
        ghosts: GhostList = editor.model.ghosts
        assert editor.model.status.recording == str(town.file)

        async def show(name: str, *, now: bool = False) -> None:
            editor.ui.actions.run("view.ghost")
            await person.frames(4)
            await person.click(f"ghost/{name}")
            if now:
                await person.click("ghost/now")
            await person.frames(2)
            editor.screenshot(screenshot_directory / "ghost-dialog.png")
            await person.click("ghost/show")

        await show("other.mcap")
        await person.until(lambda: len(ghosts.all) == 1)
        first = ghosts.all[0]
        assert (first.title, first.color, first.offset) == ("other", GHOST_COLORS[0], 0.0)
        await editor.model.command("Seek", Seek(time=1.5))
        await person.until(lambda: editor.model.status.simulation_time == 1.5)
        await show("run.mcap", now=True)
        await person.until(lambda: len(ghosts.all) == 2)
        assert (ghosts.all[1].color, ghosts.all[1].offset) == (GHOST_COLORS[1], -1.5)
        await person.frames(6)
        editor.screenshot(screenshot_directory / "ghosts.png")

        await person.click("ghosts/0/begin")
        await person.until(lambda: ghosts.all[0].offset == -1.5)
        await person.click("ghosts/0/along")
        await person.until(lambda: ghosts.all[0].offset == 0.0)
        ghosts.recolor(ghosts.all[0], (1, 2, 3))
        await person.until(lambda: ghosts.all[0].color == (1, 2, 3))
        await person.click("ghosts/0/remove")
        await person.until(lambda: len(ghosts.all) == 1 and town.ghosts[0].done())
        assert ghosts.all[0].title == "run"

    at_a_replay(tmp_path, scenario)


@pytest.mark.gl
def test_what_cannot_be_shown_is_said(tmp_path):
    async def scenario(person: Person, town: Replays) -> None:
        person.editor.attachments.show_ghost("nowhere.mcap", color=(1, 2, 3))
        await person.until(lambda: "there is no nowhere.mcap" in person.editor.model.error)
        assert not person.editor.model.ghosts.all
        assert not person.editor.attachments.doing_beside

    at_a_replay(tmp_path, scenario)


@pytest.mark.gl
def test_a_recording_is_gone_on_with_and_come_back_to(tmp_path, screenshot_directory):
    async def scenario(person: Person, town: Replays) -> None:
        editor = person.editor
        await editor.model.command("Seek", Seek(time=0.5))
        await person.until(lambda: editor.model.status.simulation_time == 0.5)
        editor.ui.actions.run("time.fork")
        await person.frames(4)
        await person.click("fork/records")
        person.editor.workspace.fork_dialog._path = str(tmp_path / "wrong.mcap")
        await person.click("fork/fork")
        await person.until(lambda: "another build" in editor.attachments.error)
        await person.frames(3)
        editor.screenshot(screenshot_directory / "fork-error.png")
        assert "fork/error" in editor.ui.landmarks.rectangles
        assert editor.attachments.endpoint == A

        person.editor.workspace.fork_dialog._path = str(free_name(town.file))
        await person.click("fork/fork")
        await person.until(lambda: editor.attachments.endpoint == B and editor.model.scene.is_known)
        assert town.asked[-1] == (str(town.file), 0.5, str(tmp_path / "run.fork1.mcap"))
        assert editor.attachments.forked_from == A
        town.hosts[B].publish_status()
        await person.until(lambda: editor.model.status is not None and editor.model.status.kind == "simulation")
        assert not editor.ui.actions["time.fork"].is_possible()
        await person.frames(6)
        editor.screenshot(screenshot_directory / "fork.png")
        await person.click("timeline/back")
        await person.until(lambda: editor.attachments.endpoint == A and editor.model.status is not None)
        await person.until(lambda: editor.model.is_replay)
        assert editor.model.status.simulation_time == 0.5
        assert not editor.attachments.forked_from
        assert not editor.ui.actions["time.back_to_recording"].is_possible()

    at_a_replay(tmp_path, scenario)


def test_a_ghost_that_says_nothing_any_more_is_not_listed(tmp_path):
    async def main() -> None:
        broker = LoopbackBroker()
        host = await Session.host(broker.listen(), name="run", kind="simulation", epoch=1)
        session = await Session.join(broker.connect(), kind="editor")
        now, said = [0.0], []
        ghosts = GhostList(session, say=said.append, clock=lambda: now[0])
        with Recording(write_told(tmp_path / "other.mcap")) as recording:
            told = GhostServer(recording, host).told
            host.publish(topics.GHOST, told, key=told.ghost)
            async with asyncio.timeout(5.0):
                while not ghosts.all:
                    await asyncio.sleep(0.001)
            assert ghosts.next_color == GHOST_COLORS[1]
            now[0] = SILENCE + 0.1
            assert not ghosts.all and ghosts.next_color == GHOST_COLORS[0]
            ghosts.remove(told)
            async with asyncio.timeout(10.0):
                while not said:
                    await asyncio.sleep(0.01)
            assert said[0].startswith("other cannot be changed")
        await session.close()
        await host.close()

    asyncio.run(main())


def test_a_fork_is_named_beside_its_parent(tmp_path):
    parent = tmp_path / "run.mcap"
    assert free_name(parent) == tmp_path / "run.fork1.mcap"
    (tmp_path / "run.fork1.mcap").touch()
    assert free_name(parent) == tmp_path / "run.fork2.mcap"

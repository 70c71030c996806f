"""Editors are killed with kill -9 in the middle of their edits: none is half made, none that was accepted is lost.

3 kills in the tests, 100 in `make soak`.
"""

from __future__ import annotations

import asyncio
import getpass
import random
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from elys.bus import topics
from elys.bus.messages.commands import CommandRequest, Undo
from elys.bus.messages.history import HistoryReply, HistoryRequest
from tests.process.clients import Client, client

pytestmark = pytest.mark.process
KILLS, SOAK_KILLS = 3, 100
PROGRAM = Path(__file__).parent / "programs" / "restless_editor.py"


class Restless:
    """A restless editor's process, and what it has said."""

    def __init__(self, endpoint: str, seed: int, environment: dict[str, str]) -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(PROGRAM), endpoint, str(seed)],
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )

    def read(self) -> list[str]:
        """What else it has said, after it was killed."""
        assert self.process.stdout is not None
        return self.process.stdout.read().splitlines()

    def line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()

    def end(self) -> None:
        self.process.kill()
        self.process.wait()


def assert_whole(watcher: Client) -> None:
    """What one edit changes together is the same everywhere."""
    boxes = [entity for entity in watcher.mirror.entities.values() if entity.name.startswith("Restless ")]
    assert len(boxes) in (0, 10)
    assert len({(box.components["RigidBody"].mass, box.enabled) for box in boxes}) <= 1


@pytest.mark.timeout(3600)
def test_killed_in_the_middle_of_edits(elys, free_port, environment, soak):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    simulation = elys("run", "stack", "--headless", "--realtime", "--listen", endpoint)
    simulation.wait_for("simulating")
    chance = random.Random(11)

    async def campaign() -> None:
        async with client(endpoint) as watcher:
            known = 0
            for number in range(SOAK_KILLS if soak else KILLS):
                editor = Restless(endpoint, number, environment)
                try:
                    known = await kill_in_the_middle(watcher, editor, known)
                finally:
                    editor.end()
            await undo_all(watcher)

    async def kill_in_the_middle(watcher: Client, editor: Restless, known: int) -> int:
        """Kills an editor that has begun; how many edits its author can undo then."""
        hello = await asyncio.to_thread(editor.line)
        match = re.fullmatch(r"attached (\S+) (\d+)", hello)
        assert match is not None, hello
        assert int(match[2]) == known  # it has found what the one before it has left
        for _ in range(chance.randrange(1, 30)):
            await asyncio.to_thread(editor.line)
        until = time.monotonic() + chance.uniform(0.0, 0.02)
        while time.monotonic() < until:  # to the millisecond anywhere within an edit
            pass
        editor.process.kill()
        said = await asyncio.to_thread(editor.read)
        assert not any("Traceback" in line for line in said)
        await watcher.until(lambda: not watcher.session.nodes_of("editor"), seconds=10)
        seen = len(watcher.frames)
        await watcher.until(
            lambda: len(watcher.frames) > seen + 3
        )  # the session goes on, and has done what it was told
        history = await history_of(watcher)
        accepted = [line for line in said if re.match(r"did .* 1?\d+ \d+ \[\]$", line)]
        if accepted:  # the last that was answered is there, and at most one more that was not
            count = int(accepted[-1].rsplit(" ", 2)[1])
            assert abs(len(history.undoable) - count) <= 1
        async with client(endpoint) as newcomer:
            assert_whole(newcomer)
            await watcher.until(lambda: watcher.mirror.sequence >= newcomer.mirror.sequence)
            assert_whole(watcher)
        watcher.frames[:-1] = []
        return len(history.undoable)

    async def history_of(watcher: Client) -> HistoryReply:
        """What the dead editor's author can undo: asked as a node of the same person that is gone at once."""
        asked = HistoryRequest(person=getpass.getuser(), node=f"looks-{len(watcher.frames)}-{time.monotonic_ns()}")
        return await watcher.session.request(topics.HISTORY, asked)

    async def undo_all(watcher: Client) -> None:
        history = await history_of(watcher)
        assert history.undoable
        request = CommandRequest(origin="test", command=Undo(), author=history.author)
        for _ in history.undoable:
            reply = await watcher.session.request(topics.COMMAND, request)
            assert reply.accepted, reply.reason
            await watcher.until(lambda sequence=reply.sequence: watcher.mirror.sequence >= sequence)
            assert_whole(watcher)
        assert len(history.undoable) == 500 or not [
            entity for entity in watcher.mirror.entities.values() if entity.name.startswith("Restless ")
        ]

    asyncio.run(campaign())
    assert simulation.process.poll() is None

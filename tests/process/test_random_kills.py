"""Random processes of a session are killed with kill -9 and started again; the session goes on, and nothing stays behind.

A few kills in the tests, many in `make soak`.
"""

from __future__ import annotations

import asyncio
import random
import re
from pathlib import Path

import pytest

from elys.bus.messages.commands import Rename
from elys.bus.recording import Recording
from elys.common.errors import RecordingError
from tests.process.clients import Client, client
from tests.process.conftest import wait_until

pytestmark = pytest.mark.process
KILLS, SOAK_KILLS = 4, 60


def shared_memory() -> set[str]:
    return {path.name for path in Path("/dev/shm").iterdir()}


@pytest.mark.timeout(3600)
def test_random_kills(elys, free_port, tmp_path, soak):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    before = shared_memory()
    commands = {
        "simulation": ("run", "stack", "--headless", "--listen", endpoint),
        "render": ("node", "render", "--connect", endpoint),
        "editor": ("node", "editor", "--connect", endpoint),
        # It waits for a simulation that takes longer to start than 5 s, as on a busy machine: by itself it would end.
        "recorder": ("record", "--connect", endpoint, "-o", tmp_path / "outside.mcap", "--patience", "90"),
    }
    running = {kind: elys(*words, ELYS_NULL_PLATFORM="1") for kind, words in commands.items()}
    chance = random.Random(7)

    async def campaign() -> None:
        async with client(endpoint) as watcher:
            await watcher.until(lambda: all(watcher.session.nodes_of(kind) for kind in commands), seconds=60)
            for number in range(SOAK_KILLS if soak else KILLS):
                # The first four kill one of each; then it is chance.
                kind = list(commands)[number] if number < len(commands) else chance.choice(list(commands))
                await kill_and_restart(watcher, kind, number)

    async def kill_and_restart(watcher: Client, kind: str, number: int) -> None:
        running[kind].kill()
        await watcher.until(lambda: not watcher.session.nodes_of(kind))
        running[kind] = elys(*commands[kind], ELYS_NULL_PLATFORM="1")
        await watcher.until(
            lambda: watcher.session.connected and all(watcher.session.nodes_of(other) for other in commands), seconds=90
        )
        seen = len(watcher.frames)
        await watcher.until(lambda: len(watcher.frames) > seen + 5)
        # Commands are answered, and the mirror that lived through it all is what a newcomer gets.
        await watcher.until(lambda: watcher.mirror.epoch == watcher.session.epoch)
        entity = watcher.entity("Camera") if number % 2 else watcher.mirror.roots[0]
        assert (await watcher.ask(Rename(entity=entity, name=watcher.mirror.entities[entity].name))).accepted
        async with client(endpoint) as newcomer:
            await watcher.until(lambda: watcher.mirror.sequence >= newcomer.mirror.sequence)
            assert newcomer.mirror.epoch == watcher.mirror.epoch
            names = {entity: known.name for entity, known in watcher.mirror.entities.items()}
            assert names == {entity: known.name for entity, known in newcomer.mirror.entities.items()}

    asyncio.run(campaign())
    wait_until(lambda: frames_in(newest(tmp_path)) > 0)
    for command in running.values():
        command.end()
    assert shared_memory() <= before
    files = list(tmp_path.glob("outside*.mcap"))
    assert len(files) > 1  # a recorder that was started again wrote over nothing
    # Each can be read, also one that was killed before there was any.
    assert 2 * sum(frames_in(path) > 0 for path in files) >= len(files)
    with Recording(newest(tmp_path)) as recording:
        assert not recording.reader.mended  # it was ended in peace


def newest(folder: Path) -> Path:
    return max(folder.glob("outside*.mcap"), key=lambda path: int(path.stem.rpartition("-")[2].replace("outside", "1")))


def frames_in(path: Path) -> int:
    """How many frames a file has; it opens, unless there is nothing in it."""
    try:
        with Recording(path) as recording:
            return len(recording)
    except RecordingError as error:
        assert re.search("is empty|holds nothing that can be read|holds no state frame|holds no scene", str(error)), (
            error
        )
        return 0

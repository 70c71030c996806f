"""Nonsense on every topic and query by a viewer, and at the port by a stranger: nothing crashes, nothing is changed or forged.

20,000 messages by the viewer and as many by strangers in the tests, 1,000,000 each in `make soak`. What the simulation does is
compared, tick by tick, with a run of the same scene in this process that nobody disturbs.
"""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap.reader import make_reader

from elys.bus import codec, topics
from elys.bus.access.keyring import required_keyring
from elys.bus.access.roles import Role, role_of_node
from elys.bus.messages.commands import CommandRecord
from elys.bus.messages.history import HistoryRequest
from elys.bus.messages.session import SessionStatus
from elys.bus.messages.state_frame import StateFrame
from elys.bus.session import HOST_KINDS, Node
from elys.common.assets.store import AssetStore
from elys.common.errors import ConnectionLost
from elys.sim_node.simulation import Simulation
from elys.verbs.scenes import open_scene_or_sample
from tests.process.clients import Client, client

pytestmark = pytest.mark.process
COUNT, SOAK_COUNT = 20_000, 1_000_000
PROGRAM = Path(__file__).parent / "programs" / "fuzzer.py"
ROOT = Path(__file__).parents[2]


class Watcher:
    """What an owner in the same session is told meanwhile, of which nothing may be the fuzzers'."""

    def __init__(self, joined: Client) -> None:
        self.client = joined
        self.frames: list[StateFrame] = []
        self.statuses: list[SessionStatus] = []
        self.commands: list[CommandRecord] = []
        self.nodes: list[tuple[Node, bool]] = []  # who came, True, and who went
        session = joined.session
        session.subscribe_payloads(topics.STATE, self._state_came, every=True)
        session.subscribe(topics.STATUS, lambda status, _: self.statuses.append(status))
        session.subscribe(topics.COMMANDS, lambda record, _: self.commands.append(record))
        session.on_nodes(lambda node, alive: self.nodes.append((node, alive)))

    def _state_came(self, key: str, payload: bytes) -> None:
        self.frames.append(codec.decode(payload, StateFrame, topics.STATE.encoding))  # what is none fails the test


def fuzz(endpoint: str, *words: object, credentials: str, environment: dict[str, str]) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, str(PROGRAM), endpoint, *map(str, words)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**environment, "PYTHONPATH": str(ROOT)},
        cwd=ROOT,
    )
    assert process.stdin is not None
    process.stdin.write(credentials + "\n")
    process.stdin.flush()
    return process


@pytest.fixture
def children() -> Iterator[list[subprocess.Popen[str]]]:
    started: list[subprocess.Popen[str]] = []
    yield started
    for process in started:
        if process.poll() is None:
            process.kill()
        process.wait()


@pytest.mark.timeout(1800)
def test_fuzzed_by_a_viewer_and_by_strangers(elys, free_port, environment, soak, tmp_path, children):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    count = SOAK_COUNT if soak else COUNT
    simulation = elys("run", "yard", "--headless", "--keep", "0", "--listen", endpoint, "--record", "run.mcap")
    simulation.wait_for("first tick")
    viewer = required_keyring().named("viewer")

    async def campaign() -> Watcher:
        async with client(endpoint) as joined:
            watcher = Watcher(joined)
            await joined.until(lambda: bool(watcher.statuses))
            before = (resident(simulation.process.pid), descriptors(simulation.process.pid))
            name = joined.session.name
            secret = f"{viewer.user}:{viewer.secret}"
            children.append(fuzz(endpoint, name, "render-1", 1, count, credentials=secret, environment=environment))
            children.append(fuzz(endpoint, "-", "-", 2, count, credentials="", environment=environment))
            while any(process.poll() is None for process in children):
                await answered(joined)
                await asyncio.sleep(0.05)
            for process in children:
                assert process.returncode == 0
                assert process.stdout is not None
                assert process.stdout.read().startswith(f"sent {count} answered ")
            heard = len(watcher.frames)
            await joined.until(lambda: len(watcher.frames) > heard + 30)
            after = (resident(simulation.process.pid), descriptors(simulation.process.pid))
            assert after[0] - before[0] < 200 << 20
            assert after[1] - before[1] < 20
            assert joined.session.refused == {}
            return watcher

    watcher = asyncio.run(campaign())
    assert simulation.process.poll() is None, simulation.output
    assert "Traceback" not in simulation.output and "panicked" not in simulation.output
    simulation.process.terminate()
    assert simulation.wait() == 0, simulation.output
    check_nothing_was_forged(watcher)
    check_nothing_was_changed(watcher)
    with (tmp_path / "run.mcap").open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count > len(watcher.frames)


async def answered(joined: Client) -> None:
    """Asks until there is an answer: where the machine is busy beyond zenoh's lease, a question may be lost."""
    async with asyncio.timeout(60.0):
        while True:
            try:
                request = HistoryRequest(person="watcher", node="watcher")
                await joined.session.request(topics.HISTORY, request, timeout=10.0)
                return
            except ConnectionLost:
                await asyncio.sleep(0.1)


def check_nothing_was_forged(watcher: Watcher) -> None:
    epoch = watcher.client.session.epoch
    assert {frame.epoch for frame in watcher.frames} == {epoch}
    ticks = [frame.tick for frame in watcher.frames]
    assert ticks == sorted(set(ticks))
    assert {(status.epoch, status.changes, status.playing) for status in watcher.statuses} == {(epoch, 0, True)}
    assert watcher.commands == []
    shown = [node for node, _ in watcher.nodes if node.id != watcher.client.session.node.id]
    assert shown, "the viewer showed itself as what it may be"
    helpers = (*HOST_KINDS, "recorder", "streamer")  # of the session's own
    assert [node for node in shown if node.kind not in helpers and role_of_node(node.id) is not Role.VIEWER] == []
    assert not [node for node in shown if node.kind in ("render", "stranger")]
    for kind in (*HOST_KINDS, "streamer"):  # viewers may record
        there: set[str] = set()
        for node, alive in watcher.nodes:  # one after another: who streams goes when nobody has asked for a minute
            if node.kind == kind:
                (there.add if alive else there.discard)(node.id)
                assert len(there) <= 1, there


def check_nothing_was_changed(watcher: Watcher) -> None:
    simulation = Simulation.load(open_scene_or_sample("yard", assets := AssetStore()), assets)
    hashes = {frame.tick: frame.state_hash for frame in watcher.frames}
    while simulation.tick < max(hashes):
        simulation.step()
        if (told := hashes.get(simulation.tick)) is not None:
            assert told == simulation.state_hash(), simulation.tick


def resident(pid: int) -> int:
    """Memory [bytes] of a process."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def descriptors(pid: int) -> int:
    """Files that a process has open."""
    return sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())

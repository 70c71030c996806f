"""A game that is played in the real editor: its keys reach a real simulation, and all of it can be gone through again."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from elys.bus.codec import decode_body
from elys.bus.messages.commands import CommandRecord, Input, Rewind
from elys.bus.recording import Recording
from elys.bus.topics import COMMANDS
from elys.editor_node.events import KeyPressed, KeyReleased, MouseMoved
from elys.editor_node.keys import Key
from elys.sim_node.systems.apply_edits import apply_again
from tests.process.clients import client
from tests.process.programs.game import ball_game
from tests.process.test_editor_session import editor_at, named, until

pytestmark = [pytest.mark.process, pytest.mark.gl]
GAME = Path(__file__).parent / "programs" / "game.py"


@pytest.fixture
def game(environment, free_port, tmp_path):
    """A game in a process of its own, paused at its beginning: its endpoint and its recording."""
    endpoint, recording = f"tcp/127.0.0.1:{free_port}", tmp_path / "game.mcap"
    with (tmp_path / "game.log").open("w") as log:
        process = subprocess.Popen(
            [sys.executable, str(GAME), endpoint, str(recording)],
            env=environment,
            cwd=Path(__file__).parents[2],
            stdout=log,
            stderr=subprocess.STDOUT,
        )
    try:
        yield endpoint, recording, process
    finally:
        process.kill()
        process.wait()


def test_keys_of_the_editor_move_a_body_and_the_same_ticks_come_again(game, tmp_path):
    endpoint, recording, process = game
    told: dict[int, int] = {}  # state hashes by tick, as they were first

    async def scenario() -> None:
        async with client(endpoint) as watcher, editor_at(endpoint) as editor:
            records: list[CommandRecord] = []
            watcher.session.subscribe(COMMANDS, lambda record, _: records.append(record))
            await until(editor, lambda: editor.model.scene.is_known and editor.application.frame_count > 3)
            ball = named(editor, "Ball")

            def place() -> tuple[float, float, float]:
                return editor.model.scene.world_pose(ball).position

            def offer(*events) -> None:
                for event in events:
                    editor.application.offer(event)

            await until(editor, lambda: editor.game.is_possible)  # the host has said what it is
            offer(KeyPressed(Key.F5), KeyReleased(Key.F5))
            assert editor.game.is_on
            offer(KeyPressed(Key.D))
            await until(editor, lambda: place()[0] > 0.5)
            offer(KeyReleased(Key.D), KeyPressed(Key.W))
            await until(editor, lambda: place()[2] < -0.5)
            before = place()[1]
            offer(KeyPressed(Key.SPACE), KeyReleased(Key.SPACE))  # within a frame: a tap is not lost
            await until(editor, lambda: place()[1] > before + 0.1)
            offer(MouseMoved(200.0, 200.0), MouseMoved(203.0, 200.0))
            await until(editor, lambda: any(r.command.moved for r in records if isinstance(r.command, Input)))
            offer(KeyPressed(Key.ESCAPE), KeyReleased(Key.ESCAPE))
            await until(editor, lambda: records[-1].command.lets_go)
            assert not records[-1].command.changes
            assert all(record.accepted for record in records)
            played = [record for record in records if isinstance(record.command, Input)]
            assert {record.origin for record in played} == {editor.seat.node.id}
            assert {(record.command.player, record.command.source) for record in played} == {(1, editor.seat.node.id)}
            numbers = [record.command.sequence for record in played]
            assert numbers == list(range(1, len(played) + 1))  # each came, in order
            assert [r.tick for r in played] == sorted(r.tick for r in played)
            assert abs(played[-1].command.done_at - time.time()) < 60.0  # one machine, one clock
            # An editor that dies with a key down lets go of it.
            offer(KeyPressed(Key.F5), KeyReleased(Key.F5), KeyPressed(Key.A))
            await until(editor, lambda: ("a", True) in records[-1].command.changes)
            last = records[-1].tick
            told.update({frame.tick: frame.state_hash for frame in watcher.frames})
        async with client(endpoint) as watcher:
            await watcher.until(lambda: bool(watcher.frames) and watcher.frames[-1].tick > last + 30)
            told.update({frame.tick: frame.state_hash for frame in watcher.frames})
            newest = max(told)
            assert (await watcher.ask(Rewind(tick=newest - 10))).accepted
            await watcher.until(lambda: watcher.frames[-1].tick == newest - 10)
            again = watcher.frames[-1].state_hash
            assert told.get(newest - 10, again) == again
            assert (await watcher.ask(Rewind(tick=newest))).accepted
            await watcher.until(lambda: watcher.frames[-1].tick == newest)
            assert watcher.frames[-1].state_hash == told[newest]

    asyncio.run(scenario())
    process.send_signal(signal.SIGTERM)
    process.wait(60)
    execute_again(recording, told)


def execute_again(recording: Path, told: dict[int, int]) -> None:
    """The recorded input makes the same bits in another process: in this one."""
    with Recording(recording) as recorded:
        commands = [
            decode_body(message.body, CommandRecord, COMMANDS.encoding)
            for message in recorded.reader.messages([COMMANDS.name])
        ]
    played = [record for record in commands if isinstance(record.command, Input) and record.accepted]
    assert len(played) >= 5
    assert played[-1].command.lets_go  # of the editor that was gone
    simulation, compared, farthest = ball_game(), 0, 0.0
    while simulation.tick < max(told):
        for record in played:
            if record.tick == simulation.tick:
                apply_again(simulation, record.command)
        simulation.step()
        farthest = max(farthest, simulation.moving_bodies().position[0][0])
        if simulation.tick in told:
            assert simulation.state_hash() == told[simulation.tick]
            compared += 1
    assert compared > 20
    assert (
        farthest > 0.5
    )  # it rolls back as long as the key of the dead editor is held: on a slow machine beyond where it began
    assert simulation.moving_bodies().position[0][2] < -0.5

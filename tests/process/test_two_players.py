"""Two processes play as players 1 and 2 in the simulation of a third; what they did is recorded and comes out the same."""

from __future__ import annotations

import asyncio
import json
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from elys.bus import topics
from elys.bus.messages.commands import CommandRecord, Input
from tests.process.clients import client
from tests.process.conftest import Command, Elys

pytestmark = pytest.mark.process
PLAYER = Path(__file__).parent / "programs" / "pad_player.py"
RUNNER = """
from elys.script import *

class Runner(Behaviour):
    number: int = 1

    def fixed_update(self, dt):
        player = self.world.input(self.number)
        right, ahead = player.vector("move")
        self.entity.apply_force((2.0 * right, 0.0, -2.0 * ahead))
        if player.action("jump").was_pressed:
            self.entity.apply_impulse((0.0, 4.0, 0.0))
        if player.axis("lean"):
            self.entity.apply_torque((0.0, player.axis("lean"), 0.0))
"""


def ball(number: int) -> dict[str, object]:
    return {
        "name": f"Ball {number}",
        "components": {
            "Transform": {"position": [3.0 * number, 0.5, 0.0]},
            "RigidBody": {"mass": 1.0},
            "Collider": {"shape": "sphere"},
            "Script": {"source": "runner.py#Runner", "values": {"number": number}},
        },
    }


SCENE = {
    "elys_scene": 1,
    "name": "race",
    "entities": [
        {"name": "Ground", "components": {"Transform": {"scale": [900.0, 0.2, 900.0]}, "Collider": {}}},
        {"name": "Input", "components": {"InputMap": {"axes": {"lean": "q/e, pad_right_x"}}}},
        ball(1),
        ball(2),
    ],
}


@pytest.fixture
def player(environment: dict[str, str], tmp_path: Path):
    """Starts processes that play."""
    started: list[Command] = []

    def start(endpoint: str, number: int, bindings: str) -> Command:
        words = (str(PLAYER), endpoint, str(number), bindings)
        started.append(Command(words, environment, tmp_path, prefix=(sys.executable,), hears=True))
        started[-1].wait_for("joined")
        return started[-1]

    yield start
    for command in started:
        command.end()


def do(player: Command, *lines: str) -> None:
    for line in lines:
        player.tell(line)
        player.wait_for(f"did {line}")


def test_two_play_bind_anew_and_are_verified(
    elys: Elys, free_port: int, tmp_path: Path, player: Callable[[str, int, str], Command]
) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    (tmp_path / "race.scene.json").write_text(json.dumps(SCENE))
    (tmp_path / "runner.py").write_text(RUNNER)
    (tmp_path / "one.toml").write_text('[bindings]\njump = "pad_x"\n')
    (tmp_path / "two.toml").write_text('[player.2]\njump = "+pad_right_trigger, pad_y"\n')
    options = ("--headless", "--realtime", "--trust", "--listen", endpoint, "--record", "race.mcap")
    host = elys("run", "race.scene.json", *options)
    host.wait_for("simulating")
    one, two = player(endpoint, 1, "one.toml"), player(endpoint, 2, "two.toml")

    async def race() -> None:
        async with client(endpoint) as there:
            heard: list[CommandRecord] = []
            there.session.subscribe(topics.COMMANDS, lambda record, _: heard.append(record))
            await there.until(lambda: bool(there.mirror.entities) and bool(there.frames))

            async def until(condition: Callable[[], bool]) -> None:
                await there.until(condition, seconds=100.0)  # time in the game goes slowly where much else is done

            def place(number: int) -> tuple[float, float, float]:
                return there.mirror.world_pose(there.entity(f"Ball {number}")).position

            await asyncio.to_thread(do, one, "play", "stick 0.9 0")
            await asyncio.to_thread(do, two, "play", "stick 0 -0.9")
            await until(lambda: place(1)[0] > 3.5 and place(2)[2] < -0.5)
            assert abs(place(1)[2]) < 0.1 and abs(place(2)[0] - 6.0) < 0.1  # each has his own
            await asyncio.to_thread(do, one, "press pad_a", "press pad_x")
            await until(lambda: place(1)[1] > 0.8)
            assert place(2)[1] < 0.7
            await asyncio.to_thread(do, two, "leave")
            (tmp_path / "two.toml").write_text('[player.2]\njump = "pad_b"\nmove = "pad_left flip=xy"\n')
            await asyncio.to_thread(do, two, "play", "press pad_b")
            await until(lambda: place(2)[1] > 0.8)
            farthest = [0.0]

            def comes_back() -> bool:
                farthest[0] = min(farthest[0], place(2)[2])
                return place(2)[2] > farthest[0] + 0.05

            await until(comes_back)
            two.process.kill()
            await until(lambda: heard[-1].command.lets_go and heard[-1].command.player == 2)
            played = [record for record in heard if isinstance(record.command, Input)]
            assert {record.command.player for record in played} == {1, 2}
            assert len({record.origin for record in played}) == 2
            assert all(record.accepted for record in played)
            bound = [record.command.bindings for record in played if record.command.bindings is not None]
            assert {"jump": "pad_x"} in bound and {"jump": "pad_b", "move": "pad_left flip=xy"} in bound
            end = there.frames[-1].tick + 20
            await until(lambda: there.frames[-1].tick > end)

    asyncio.run(race())
    host.process.send_signal(signal.SIGINT)
    assert host.wait() == 0
    verified = elys("verify", "race.mcap", "--trust")
    assert verified.wait() == 0, verified.output
    verified.wait_for(r"equal: \d+ ticks")

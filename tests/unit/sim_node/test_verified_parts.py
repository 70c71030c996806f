"""What else has to come out the same: players' inputs, and each file of a session that was recorded into many."""

from __future__ import annotations

import asyncio
import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from elys.bus import codec, topics
from elys.bus.following import follow_scene
from elys.bus.input_sender import InputSender
from elys.bus.messages.commands import CommandRecord, Input
from elys.bus.mirror import SceneMirror
from elys.bus.recording import Recording
from elys.bus.recording_parts import merge
from elys.bus.recording_plan import RecordingPlan, files_of
from elys.bus.topics import Encoding
from elys.bus.transports.mcap_reading import RecordedMessage
from elys.common.ids import Entity
from elys.sim_node.fork_point import fork_point
from elys.sim_node.simulation import Simulation
from elys.sim_node.verification import verify
from tests.recorded_sessions import Person, Stage, altered
from tests.unit.sim_node.test_verification import another_scene, edits_of_two, forks, record

# --- players -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def steered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every simulation has a system with which players push bodies."""
    begin = Simulation.__init__

    def with_steering(self: Simulation, *arguments: Any, **options: Any) -> None:
        begin(self, *arguments, **options)

        def steer(world: Any) -> None:
            bodies = self.moving_bodies().entity
            for player in (1, 2):
                done = self.inputs[player]
                push = 40.0 * done.vector("move").x
                force = np.array((push, 300.0 * done.action("jump").was_pressed, 2.0 * done.moved("pointer_x")))
                if force.any():
                    self.physics.apply_force([int(bodies[player])], force)

        self.systems = (steer, *self.systems)

    monkeypatch.setattr(Simulation, "__init__", with_steering)


async def sent_and_heard(person: Person, heard: list[CommandRecord], *senders: InputSender) -> None:
    """Steps until what players did is in the simulation: while time stands nobody plays."""
    before = sum(isinstance(told.command, Input) for told in heard)
    count = sum(sender.send() for sender in senders)
    async with asyncio.timeout(20.0):
        while sum(isinstance(told.command, Input) for told in heard) < before + count:
            await person.step(1)


async def a_game_of_two(stage: Stage) -> None:
    """Two players in nodes of their own, one of whom dies with a key held."""
    anna, bert = await stage.person("Anna"), await stage.person("Bert")
    one, two = InputSender(anna.session, player=1), InputSender(bert.session, player=2)
    heard: list[CommandRecord] = []
    anna.session.subscribe(topics.COMMANDS, lambda told, _: heard.append(told))

    async def applied(*senders: InputSender) -> None:
        await sent_and_heard(anna, heard, *senders)

    await anna.step(20)
    two.bind({"jump": "k, space", "move": "pad_left"})
    for number in range(12):
        if number == 6:
            two.bind({"jump": "space"})
            one.bind({"move": "a/d/s/w scale=0.5"})
        one.press("d" if number % 2 else "a")
        one.move("pointer_x", 0.25 * number)
        two.press("space")
        await applied(one, two)
        await anna.step(4)
        one.let_go("d" if number % 2 else "a")
        two.let_go("space")
        await applied(one, two)
        await anna.step(3)
    two.press("d")
    await applied(two)
    await anna.step(5)
    await bert.session.close()
    await anna.step(30)


def inputs_in(path: Path) -> list[CommandRecord]:
    with Recording(path) as recording:
        records = [
            codec.decode_body(message.body, CommandRecord, Encoding.JSON)
            for message in recording.reader.messages((topics.COMMANDS.name,))
        ]
    return [record for record in records if isinstance(record.command, Input)]


@pytest.mark.usefixtures("steered")
def test_what_players_did_comes_out_the_same(tmp_path: Path) -> None:
    for path in record(tmp_path, a_game_of_two):
        inputs = inputs_in(path)
        assert {told.command.player for told in inputs} == {1, 2} and len(inputs) >= 49  # type: ignore[union-attr]
        verdict = verify(path)
        assert (verdict.cause, verdict.difference, verdict.notes) == ("equal", None, []), verdict
        assert verdict.ticks > 150


async def a_walk(stage: Stage) -> None:
    """Somebody walks, runs, jumps and crouches about the playground, and looks around."""
    anna = await stage.person("Anna")
    walker = InputSender(anna.session, player=1)
    heard: list[CommandRecord] = []
    anna.session.subscribe(topics.COMMANDS, lambda told, _: heard.append(told))
    mirror, newcomer = SceneMirror(), SceneMirror()
    await follow_scene(anna.session, mirror)
    began = stage.simulation.world.transforms.world_pose(Entity(stage.named("Walker")))[0]
    for keys in (("w",), ("w", "left_shift"), ("w", "space"), ("a", "left_control"), ("s", "space"), ("f",), ("w",)):
        walker.move("pointer_x", 40.0)
        walker.move("pointer_y", -5.0)
        for key in keys:
            walker.press(key)
        await sent_and_heard(anna, heard, walker)
        await anna.step(25)
        for key in keys:
            walker.let_go(key)
        await sent_and_heard(anna, heard, walker)
    ended = stage.simulation.world.transforms.world_pose(Entity(stage.named("Walker")))[0]
    assert math.dist(began, ended) > 1.0
    async with asyncio.timeout(20.0):
        while mirror.sequence != stage.node.snapshot().sequence:
            await asyncio.sleep(0.001)
    newcomer.apply_snapshot(stage.node.snapshot())
    for entity, told in newcomer.entities.items():  # who was there all the time knows what who comes now is told
        for name in ("Character", "CameraRig", "Collider"):
            assert mirror.entities[entity].components.get(name) == told.components.get(name)


def test_where_a_character_went_comes_out_the_same(tmp_path: Path) -> None:
    for path in record(tmp_path, a_walk, scene="playground"):
        verdict = verify(path)
        assert (verdict.cause, verdict.difference, verdict.notes) == ("equal", None, []), verdict
        assert verdict.ticks > 150


@pytest.mark.usefixtures("steered")
@pytest.mark.parametrize("which", [20])
@pytest.mark.parametrize("how", ["another", "none"])
def test_one_input_that_was_altered_is_found_at_its_tick(tmp_path: Path, which: int, how: str) -> None:
    path, _ = record(tmp_path, a_game_of_two)
    victim = inputs_in(path)[which]

    def alter(message: RecordedMessage) -> bytes | None:
        if message.channel != topics.COMMANDS.name:
            return message.body
        told = codec.decode_body(message.body, CommandRecord, Encoding.JSON)
        if told != victim:
            return message.body
        if how == "none":
            return None
        assert isinstance(told.command, Input)
        other = msgspec.structs.replace(
            told.command, moved={"pointer_x": told.command.moved.get("pointer_x", 0) + 1e-3}
        )
        return codec.encode_body(msgspec.structs.replace(told, command=other), Encoding.JSON)

    verdict = verify(altered(path, tmp_path / "altered.mcap", alter))
    assert verdict.cause == "altered" and verdict.difference is not None, verdict
    assert verdict.difference.tick in (victim.tick, victim.tick + 1), (verdict.difference, victim)


# --- one file after the other ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("story", [edits_of_two, forks, another_scene])
def test_each_file_of_many_is_verified_alone(tmp_path: Path, story: Any) -> None:
    for path in record(tmp_path, story, plan=RecordingPlan(rotate_bytes=40_000)):
        files = files_of(path)
        assert len(files) >= 2, files
        for file in files:
            verdict = verify(file)
            assert (verdict.cause, verdict.difference, verdict.notes) == ("equal", None, []), (file, verdict)
            assert verdict.ticks > 0
        if story is edits_of_two:  # of others, what was left for another future is not put together
            whole = tmp_path / f"whole-{path.name}"
            merge(files, whole)
            verdict = verify(whole)
            assert (verdict.cause, verdict.difference) == ("equal", None), verdict


def test_what_happened_in_a_later_file_is_checked_there(tmp_path: Path) -> None:
    path, _ = record(tmp_path, edits_of_two, plan=RecordingPlan(rotate_bytes=40_000))
    last = files_of(path)[-1]
    with Recording(last) as recording:
        middle = len(recording) // 2
        tick = int(recording.tick[middle])

    def alter(message: RecordedMessage) -> bytes:
        if message.channel != topics.STATE.name:
            return message.body
        body = bytearray(message.body)
        if int.from_bytes(body[8:16], "little") == tick:
            body[60] ^= 1
        return bytes(body)

    verdict = verify(altered(last, tmp_path / "altered.mcap", alter))
    assert verdict.cause == "altered" and verdict.difference is not None
    assert verdict.difference.tick == tick


def test_a_later_file_is_gone_on_with(tmp_path: Path) -> None:
    path, _ = record(tmp_path, edits_of_two, plan=RecordingPlan(rotate_bytes=40_000))
    with Recording(files_of(path)[-1]) as recording:
        middle = len(recording) // 2
        found = fork_point(recording, float(recording.time[middle]))
        position = recording.position_at(float(recording.time[middle]))
        assert found.simulation.state_hash() == recording.frame(position).state_hash


def test_a_fork_of_what_comes_out_as_something_else_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, _ = record(tmp_path, edits_of_two, outside=False)
    with Recording(path) as recording:
        fork_point(recording, 1.0)
        monkeypatch.setattr(Simulation, "state_hash", lambda self: 1)
        with pytest.raises(Exception, match=r"comes out as something else by 1 s .* `elys verify` tells where"):
            fork_point(recording, 1.0)
        monkeypatch.setattr("elys.sim_node.fork_point.differences", lambda made, here: ["numba 0.67.0"])
        with pytest.raises(Exception, match=r"another build or kind of machine \(numba 0.67.0\)"):
            fork_point(recording, 1.0)

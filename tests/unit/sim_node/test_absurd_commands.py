"""Commands that can be read and cannot be meant: refused with a sentence, and the world is bit for bit what it was."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Any

import msgspec
import pytest

from elys.bus import codec, topics
from elys.bus.messages.commands import (
    AddComponent,
    Command,
    CommandReply,
    CommandRequest,
    Despawn,
    RemoveComponent,
    Rename,
    Reparent,
    Rewind,
    SetComponent,
    SetEnabled,
    SetLoop,
    SetPlaying,
    SetRate,
    SetSettings,
    Spawn,
    StepTicks,
)
from elys.bus.messages.scene import Snapshot
from elys.bus.session import Session
from elys.bus.topics import Encoding
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.errors import RequestError
from elys.common.scene import EntityRecord, SceneSettings, open_scene
from elys.samples.registry import write_sample
from elys.sim_node.node import SimulationNode
from elys.sim_node.simulation import Simulation

GROUND, STACK, CUBE = 3, 4, 5  # entities of the sample "stack"
NOBODIES = (0, 999, 2**32 - 1, 2**32, 2**64 + CUBE, -1)
NUMBERS = (float("nan"), float("inf"), 1e308, -1e39, 10**400, "1", None, True, [], {})
RECORD = EntityRecord(name="new")


class Bench:
    """A paused simulation and somebody who asks it."""

    def __init__(self, node: SimulationNode, client: Session) -> None:
        self.node = node
        self.client = client

    async def ask(self, command: Command) -> str:
        """The refusal; "" if it was accepted."""
        return await self.ask_raw(msgspec.json.encode(CommandRequest(origin="test", command=command)))

    async def ask_raw(self, body: bytes) -> str:
        future: asyncio.Future[tuple[bytes | None, str]] = asyncio.get_running_loop().create_future()
        self.client.transport.request(
            topics.asked_key(self.client.name, topics.COMMAND, asker=self.client.node.id),
            codec.with_prefix(body, Encoding.JSON),
            10.0,
            lambda answer, reason: self.client.call_soon(future.set_result, (answer, reason)),
        )
        answer, reason = await future
        if answer is None:
            return reason
        reply = codec.decode(answer, CommandReply, Encoding.JSON)
        assert reply.accepted == (reply.reason == "")
        return reply.reason

    def state(self) -> tuple[int, Snapshot]:
        """Everything there is to tell: the hash of what physics holds, and the scene without its numbering."""
        return self.node.simulation.physics.state_hash(), msgspec.structs.replace(self.node.snapshot(), strings=())

    async def refuses(self, *commands: Command) -> list[str]:
        before, sentences = self.state(), []
        for command in commands:
            sentence = await self.ask(command)
            assert sentence, command
            assert len(sentence) <= 500
            assert "ELYS failed" not in sentence
            sentences.append(sentence)
        assert self.state() == before
        return sentences


Work = Callable[[Bench], Awaitable[Any]]


@pytest.fixture
def bench(tmp_path) -> Callable[[Work], None]:
    """Runs work on a bench; what gets out of the node, and any error it logs, fails the test."""

    async def run(work: Work) -> None:
        assets = AssetStore()
        write_sample("stack", tmp_path / "it.scene.json")
        simulation = Simulation.load(open_scene(tmp_path / "it.scene.json", assets), assets)
        broker = LoopbackBroker()
        host = await Session.host(broker.listen(), name="it", kind="simulation", epoch=1)
        node = SimulationNode(simulation, host, playing=False)
        async with asyncio.TaskGroup() as group:
            serving = group.create_task(node.run())
            await asyncio.sleep(0)
            client = await Session.join(broker.connect(), kind="tool")
            assert simulation.world.describe(CUBE) == "entity 5 'Cube 1'"
            await work(Bench(node, client))
            serving.cancel()
        await client.close()
        await host.close()

    return lambda work: asyncio.run(run(work))


@pytest.mark.parametrize("entity", NOBODIES)
def test_nobody(bench, entity: int) -> None:
    async def work(it: Bench) -> None:
        sentences = await it.refuses(
            Despawn(entity=entity),
            Rename(entity=entity, name="x"),
            SetEnabled(entity=entity, enabled=False),
            SetComponent(entity=entity, component="Transform", values={}),
            AddComponent(entity=entity, component="Light"),
            RemoveComponent(entity=entity, component="Transform"),
            Reparent(entity=entity, parent=GROUND),
        )
        if entity:  # 0 is the root there
            sentences += await it.refuses(
                Reparent(entity=GROUND, parent=entity), Spawn(records=(RECORD,), parent=entity)
            )
        assert all(f"entity {entity} " in sentence for sentence in sentences)

    bench(work)


@pytest.mark.parametrize("number", NUMBERS, ids=lambda number: str(number)[:8])
def test_numbers_that_are_none(bench, number: Any) -> None:
    places = {
        "Transform": {"position": [number, 0, 0], "rotation": [number, 0, 0, 1], "scale": [1, number, 1]},
        "RigidBody": {"mass": number, "linear_velocity": [0, 0, number], "motion": number},
        "Collider": {"size": [number, 1, 1], "friction": number},
    }
    commands = [
        make(component, {field: value})
        for component, fields in places.items()
        for field, value in fields.items()
        for make in (
            lambda component, values: SetComponent(entity=CUBE, component=component, values=values),
            lambda component, values: Spawn(records=(RECORD, EntityRecord(name="x", components={component: values}))),
        )
    ]

    async def work(it: Bench) -> None:
        for sentence, command in zip(await it.refuses(*commands), commands, strict=True):
            name = command.component if isinstance(command, SetComponent) else next(iter(command.records[1].components))
            assert name in sentence

    bench(work)


ABSURD: dict[str, Command] = {
    "there is no component 'Boddy'": SetComponent(entity=CUBE, component="Boddy", values={}),
    "RigidBody has no field 'mas'": SetComponent(entity=CUBE, component="RigidBody", values={"mas": 1}),
    "has a RigidBody already": AddComponent(entity=CUBE, component="RigidBody"),
    "has no Light": RemoveComponent(entity=CUBE, component="Light"),
    "cannot stand under itself": Reparent(entity=STACK, parent=STACK),
    "which is below it": Reparent(entity=STACK, parent=CUBE),
    "200 characters, not 10000000": Rename(entity=CUBE, name="x" * 10_000_000),
    "200 characters, not 300": Spawn(records=(EntityRecord(name="x" * 300),)),
    "prefab may have 4096": Spawn(records=(EntityRecord(name="x", prefab="x" * 5000),)),
    "MeshRenderer.mesh may have 4096": SetComponent(
        entity=CUBE, component="MeshRenderer", values={"mesh": "x" * 10**6}
    ),
    "there is no component 'xxx": AddComponent(entity=CUBE, component="x" * 10**6),
    "may spawn 100000 entities, not 1000000": Spawn(records=(RECORD,) * 1_000_000),
    "names record 5 as its parent": Spawn(records=(EntityRecord(name="x", parent=5),)),
    "names record 0 as its parent": Spawn(records=(EntityRecord(name="x", parent=0),)),
    "names record -7 as its parent": Spawn(records=(EntityRecord(name="x", parent=-7),)),
    f"names record {10**30} as its parent": Spawn(records=(EntityRecord(name="x", parent=10**30),)),
    "at least one tick, on or back": StepTicks(count=0),
    "at most 1000000 ticks": StepTicks(count=10**30),
    "not 1e+09": SetRate(rate=1e9),
    "not -1": SetRate(rate=-1.0),
    "Expected `float`": SetRate(rate=float("nan")),
    "settings.tick_rate": SetSettings(settings=SceneSettings(tick_rate=0)),
    "<= 10000": SetSettings(settings=SceneSettings(tick_rate=10**30)),
    "settings.substeps": SetSettings(settings=SceneSettings(substeps=0)),
    "settings.gravity[0]": SetSettings(settings=SceneSettings(gravity=(1e300, 0.0, 0.0))),
    "tick 100000 is not kept: the flight recorder has ticks": Rewind(tick=10**5),
    "cannot SetLoop: that is for replays": SetLoop(loop=True),
}


@pytest.mark.parametrize("expected", ABSURD)
def test_what_nobody_means(bench, expected: str) -> None:
    async def work(it: Bench) -> None:
        (sentence,) = await it.refuses(ABSURD[expected])
        assert expected in sentence

    bench(work)


@pytest.mark.parametrize(
    "body",
    [
        b'{"origin":"x","command":{"type":"rename","entity":5,"name":"\\ud800"}}',
        b'{"origin":"x","command":{"type":"rename","entity":5,"name":"\xed\xa0\x80"}}',
        b'{"origin":"x","command":{"type":"rename","entity":5.5,"name":"x"}}',
        b'{"origin":"x","command":{"type":"rename","entity":' + b"9" * 5000 + b',"name":"x"}}',
        b'{"origin":"x","command":{"type":"set_component","entity":5,"component":"RigidBody","values":{"mass":'
        + b"9" * 5000
        + b"}}}",
        b'{"origin":"x","command":{"type":"set_component","entity":5,"component":"Camera","values":{"priority":'
        + b"9" * 5000
        + b"}}}",
        b'{"origin":"x","command":{"type":"set_component","entity":5,"component":"RigidBody","values":{"mass":'
        + b"[" * 50_000
        + b"]" * 50_000
        + b"}}}",
        b'{"origin":"x","command":{"type":"no_such_command"}}',
        b'{"origin":"x","command":{"entity":5}}',
        b'{"origin":"x"}',
        b"null",
        b"",
        b"\xff" * 100,
    ],
    ids=lambda body: body[35:70].decode(errors="replace") or str(len(body)),
)
def test_bytes_that_are_no_command(bench, body: bytes) -> None:
    async def work(it: Bench) -> None:
        before = it.state()
        sentence = await it.ask_raw(body)
        assert sentence
        assert len(sentence) < 1000
        assert it.state() == before

    bench(work)


def test_who_asked_for_too_many_steps_can_stop_them(bench) -> None:
    async def work(it: Bench) -> None:
        assert await it.ask(StepTicks(count=1_000_000)) == ""
        assert await it.ask(SetPlaying(playing=False)) == ""
        tick = it.node.simulation.tick
        await it.ask(Rename(entity=CUBE, name="still here"))
        assert it.node.simulation.tick == tick < 1000

    bench(work)


@pytest.mark.parametrize(
    "command",
    [
        SetComponent(entity=CUBE, component="Transform", values={"scale": [0, 0, 0]}),
        SetComponent(entity=STACK, component="Transform", values={"scale": [1, 0, 1]}),
        SetComponent(entity=CUBE, component="Transform", values={"scale": [1e9, 1e9, 1e9]}),
        SetComponent(entity=CUBE, component="Transform", values={"position": [1e9, 1e9, -1e9]}),
        SetComponent(entity=CUBE, component="RigidBody", values={"angular_velocity": [1e9, -1e9, 1e9]}),
        SetComponent(entity=CUBE, component="Collider", values={"offset": [1e9, 0, 0], "size": [1e9, 1e9, 1e9]}),
        RemoveComponent(entity=CUBE, component="Transform"),
        RemoveComponent(entity=STACK, component="Transform"),
        RemoveComponent(entity=GROUND, component="Transform"),
    ],
    ids=str,
)
def test_what_physics_cannot_work_with_does_not_end_the_simulation(bench, command: Command) -> None:
    """It is somebody's next drag in an editor: legal, and at worst told as an event."""

    async def work(it: Bench) -> None:
        assert await it.ask(command) == ""
        assert await it.ask(StepTicks(count=60)) == ""
        while it.node.simulation.tick < 60:
            await asyncio.sleep(0)
        assert await it.ask(Rename(entity=GROUND, name="still here")) == ""

    bench(work)


def test_a_fault_of_elys_itself_is_told_and_costs_one_command_alone(bench, monkeypatch, caplog) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("in a place nobody thought of")

    monkeypatch.setattr("elys.sim_node.ecs.world.World.rename", fail)

    async def work(it: Bench) -> None:
        before = it.state()
        assert "ELYS failed: ZeroDivisionError" in await it.ask(Rename(entity=CUBE, name="x"))
        assert it.state() == before
        assert await it.ask(SetEnabled(entity=CUBE, enabled=True)) == ""

    with caplog.at_level(logging.ERROR):
        bench(work)
    assert "ZeroDivisionError" in caplog.text


def test_the_smallest_values_of_a_field_do_not_lock_newcomers_out(bench) -> None:
    """1e-4 in 32 bits is less than 1e-4; a snapshot that holds it must be taken all the same."""
    from elys.bus.mirror import SceneMirror

    async def work(it: Bench) -> None:
        assert await it.ask(SetComponent(entity=CUBE, component="Collider", values={"size": [1e-4, 1, 1]})) == ""
        assert await it.ask(SetComponent(entity=CUBE, component="RigidBody", values={"mass": 1e-6})) == ""
        mirror = SceneMirror()
        mirror.apply_snapshot(it.node.snapshot())
        assert mirror.entities[CUBE].components["Collider"].size == (1e-4, 1.0, 1.0)

    bench(work)


def test_a_refusal_is_an_error_for_who_asks(bench) -> None:
    async def work(it: Bench) -> None:
        request = CommandRequest(origin="test", command=SetSettings(settings=SceneSettings(tick_rate=0)))
        with pytest.raises(RequestError, match="tick_rate"):
            await it.client.request(topics.COMMAND, request)

    bench(work)

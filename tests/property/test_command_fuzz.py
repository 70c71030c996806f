"""Random commands, sensible and absurd, to a real simulation node: nothing gets out of it, and a mirror follows it exactly."""

from __future__ import annotations

import asyncio
import logging
import math
import random
from typing import Any

import pytest

from elys.bus import topics
from elys.bus.following import follow_scene, follow_state
from elys.bus.messages.commands import (
    AddComponent,
    Command,
    CommandReply,
    CommandRequest,
    Despawn,
    RemoveComponent,
    Rename,
    Reparent,
    Resume,
    Rewind,
    Seek,
    SetComponent,
    SetEnabled,
    SetLoop,
    SetPlaying,
    SetRate,
    SetSettings,
    Spawn,
    StepTicks,
    Tell,
)
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import MirrorEntity, SceneMirror
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.components import Kind, declaration_of, declarations
from elys.common.errors import RequestError
from elys.common.scene import EntityRecord, OpenedScene, SceneSettings, expand
from elys.samples.registry import sample
from elys.sim_node.node import SimulationNode
from elys.sim_node.simulation import Simulation

ABSURD: tuple[Any, ...] = (
    math.nan,
    math.inf,
    1e308,
    -1e39,
    10**400,
    2**63,
    -1,
    "1",
    None,
    True,
    [],
    {},
    [[1]],
    "x" * 5000,
    "\x00",
)
SIZE_LIMIT = 150  # entities, above which more are ended than made


class CommandMaker:
    """Makes commands at random: most could be meant, some could not."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.alive: list[int] = []
        self.gone: list[int] = [0, 2**32 - 1, 2**32, -1, 10**30]

    def burst(self, mirror: SceneMirror) -> list[Command]:
        """What is asked at once."""
        self.gone = (self.gone + [entity for entity in self.alive if entity not in mirror.entities])[-200:]
        self.alive = list(mirror.entities)
        return [self.command() for _ in range(self.random.randrange(1, 20))]

    def command(self) -> Command:
        pick, is_full = self.random.random(), len(self.alive) > SIZE_LIMIT
        entity, component = self.entity(), self.component()
        if pick < 0.3:
            return SetComponent(entity=entity, component=component, values=self.values(component))
        if pick < 0.4:
            return AddComponent(entity=entity, component=component, values=self.values(component))
        if pick < 0.47:
            return RemoveComponent(entity=entity, component=component)
        if pick < (0.5 if is_full else 0.6):
            return self.spawn()
        if pick < (0.65 if is_full else 0.63):
            return Despawn(entity=entity)
        if pick < 0.75:
            return Reparent(
                entity=entity,
                parent=self.random.choice((0, self.entity())),
                index=self.random.choice((-1, 0, 1, 5, 10**30, -(10**30))),
                keep_world_pose=self.random.random() < 0.5,
            )
        if pick < 0.85:
            return SetEnabled(entity=entity, enabled=self.random.random() < 0.6)
        return self.of_another_kind(entity)

    def of_another_kind(self, entity: int) -> Command:
        choose = self.random.choice
        return choose(
            (
                Rename(entity=entity, name=choose(("", "Kiste", "\x00", "x" * 300, "日本"))),
                SetSettings(
                    settings=SceneSettings(gravity=choose(((0.0, -9.81, 0.0), (0.0, 3.0, 0.0), (1e6, 0.0, 0.0))))
                ),
                SetSettings(settings=SceneSettings(tick_rate=choose((1, 60, 240, 10_000, 0)))),
                SetPlaying(playing=choose((True, False))),
                StepTicks(count=choose((1, 2, 3, 0, -5, 10**30))),
                SetRate(rate=choose((0.0, 1.0, 100.0, -1.0, 1e9, math.nan))),
                Seek(time=choose((0.0, 0.05, 1.0, 1e308))),
                Rewind(tick=choose((0, 1, 5, 10**30, -1))),
                Resume(),
                SetLoop(loop=True),
                Tell(
                    kind=choose(("door", "script", "", "\x00", "x" * 300)),
                    entity=choose((0, entity)),
                    values={"a": choose(ABSURD), "b": [choose(ABSURD)]},
                ),
            )
        )

    def entity(self) -> int:
        return self.random.choice(self.alive if self.alive and self.random.random() < 0.9 else self.gone)

    def component(self) -> str:
        return self.random.choice((*declarations(), "Transform", "RigidBody", "Collider", "RigidBody", "Nope"))

    def spawn(self) -> Spawn:
        count = self.random.randrange(0, 6)
        records = []
        for place in range(count):
            names = {self.component() for _ in range(self.random.randrange(0, 5))}
            parent = self.random.choice((-1, place - 1, place - 1, self.random.randrange(-2, place + 2)))
            records.append(
                EntityRecord(
                    name=f"new {place}",
                    parent=parent if self.random.random() < 0.99 else 10**30,
                    enabled=self.random.random() < 0.9,
                    components={name: self.values(name) for name in sorted(names) if name != "Nope" or place == 4},
                )
            )
        return Spawn(
            records=tuple(records), parent=self.random.choice((0, self.entity())), index=self.random.choice((-1, 0, 3))
        )

    def values(self, component: str) -> dict[str, Any]:
        if component not in declarations():
            return {}
        fields = declaration_of(component).fields
        chosen = self.random.sample(fields, self.random.randrange(0, min(3, len(fields)) + 1))
        return {field.name: self.value(field) for field in chosen}

    def value(self, field: Any) -> Any:
        if self.random.random() < 0.04:
            return self.random.choice(ABSURD)
        match field.kind:
            case Kind.BOOL:
                return self.random.random() < 0.5
            case Kind.CHOICE:
                return self.random.choice(field.choices)
            case Kind.INT:
                return self.random.randrange(-3, 4)
            case Kind.TEXT | Kind.ASSET:
                return self.random.choice(("", "box", "sphere", "nowhere"))
            case Kind.ENTITY:
                return self.entity()
            case Kind.QUAT:
                return [self.random.gauss(0.0, 1.0) for _ in range(4)]
        numbers = [self.number(field) for _ in range(field.width)]
        return numbers if field.width > 1 else numbers[0]

    def number(self, field: Any) -> float:
        low = field.minimum if field.minimum is not None else -10.0
        high = field.maximum if field.maximum is not None else 10.0
        extreme = self.random.choice((0.0, 1e-30, 1e9, -1e9, low, high))
        return extreme if self.random.random() < 0.03 else self.random.uniform(low, min(high, low + 20.0))


class Bench:
    """A node and a client with a mirror, in one process."""

    def __init__(self, node: SimulationNode, client: Session) -> None:
        self.node = node
        self.client = client
        self.mirror = SceneMirror()
        self.frames: list[StateFrame] = []

    async def ask(self, command: Command) -> CommandReply | RequestError:
        request = CommandRequest(origin="fuzz", command=command)
        try:
            return await self.client.request(topics.COMMAND, request, timeout=30.0)
        except RequestError as error:  # refused at the border, as a number out of its range is
            return error

    async def come_to_rest(self) -> None:
        """Pauses, and waits until the mirror has heard all there is."""
        await self.ask(SetPlaying(playing=False))
        while self.mirror.sequence != self.node.snapshot().sequence:
            await asyncio.sleep(0.001)
        await self.ask(StepTicks(count=1))
        while (
            self.frames[-1].tick != self.node.simulation.tick or self.mirror.sequence != self.node.snapshot().sequence
        ):
            await asyncio.sleep(0.001)


def load(name: str) -> Simulation:
    assets = AssetStore()
    document = sample(name).build()
    records = expand(document, directory=".", assets=assets)
    opened = OpenedScene(name=name, path=None, settings=document.settings, records=records)  # type: ignore[arg-type]
    return Simulation.load(opened, assets)


async def run(seed: int, command_count: int) -> tuple[int, int]:
    """Sends so many commands; how many were accepted and refused."""
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="fuzz", kind="simulation", epoch=seed + 1)
    node = SimulationNode(load("stack"), host, realtime=False, playing=False)
    async with asyncio.TaskGroup() as group:  # what gets out of the node ends the test
        serving = group.create_task(node.run())
        await asyncio.sleep(0)
        client = await Session.join(broker.connect(), kind="tool")
        bench = Bench(node, client)
        await follow_scene(client, bench.mirror)
        follow_state(client, bench.mirror, bench.frames.append)
        counts = await send_bursts(bench, CommandMaker(seed), command_count)
        serving.cancel()
    await client.close()
    await host.close()
    return counts


async def send_bursts(bench: Bench, maker: CommandMaker, command_count: int) -> tuple[int, int]:
    accepted = refused = 0
    while accepted + refused < command_count:
        for reply in await asyncio.gather(*map(bench.ask, maker.burst(bench.mirror))):
            if isinstance(reply, CommandReply) and reply.accepted:
                accepted += 1
            else:
                refused += 1
                assert reply.reason if isinstance(reply, CommandReply) else str(reply)
        if maker.random.random() < 0.3:
            await bench.come_to_rest()
            assert_mirrored(bench)
        bench.frames[:-1] = []
    return accepted, refused


def assert_mirrored(bench: Bench) -> None:
    """The mirror fed by deltas and frames is what a newcomer gets."""
    fresh = SceneMirror()
    fresh.apply_snapshot(bench.node.snapshot())
    frame = bench.frames[-1]
    fresh.keep_frame(frame)
    mirror = bench.mirror
    assert (mirror.roots, mirror.settings, mirror.scene) == (fresh.roots, fresh.settings, fresh.scene)
    assert mirror.entities.keys() == fresh.entities.keys()
    moving, aimed = set(frame.entity.tolist()), set(frame.local_entity.tolist())
    assert moving | aimed <= mirror.entities.keys()
    for entity, truth in fresh.entities.items():
        by_frames = {"Transform", "RigidBody"} if entity in moving else {"Transform"} if entity in aimed else set()
        assert described(mirror.entities[entity], by_frames) == described(truth, by_frames)
        assert mirror.world_pose(entity) == fresh.world_pose(entity)


def described(entity: MirrorEntity, by_frames: set[str]) -> tuple[Any, ...]:
    components = {name: value for name, value in entity.components.items() if name not in by_frames}
    return (
        entity.name,
        entity.parent,
        entity.enabled,
        entity.prefab,
        entity.children,
        entity.components.keys(),
        components,
    )


@pytest.mark.parametrize("seed", range(4))
def test_no_command_harms_the_node_and_the_mirror_follows(
    seed: int, soak: bool, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.ERROR)
    accepted, refused = asyncio.run(run(seed, 20_000 if soak else 1000))
    assert accepted > 300
    assert refused > 100
    assert [record.getMessage() for record in caplog.records if "failed" in record.getMessage()] == []

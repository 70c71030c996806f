"""Contacts of entities as curves: what the editor counts is what physics has, at each tick, whoever joins when."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import math

import pytest

from elys.bus import topics
from elys.bus.messages.physics import ContactBatch, Meetings, Touches, Touching
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.scene import OpenedScene, expand
from elys.editor_node.contact_counts import ContactCounts
from elys.editor_node.instruments import Instruments
from elys.editor_node.keys import Key
from elys.editor_node.model import EditorModel
from elys.samples.registry import sample
from elys.sim_node.node import SimulationNode
from elys.sim_node.simulation import Simulation


def loaded(name: str) -> Simulation:
    assets = AssetStore()
    document = sample(name).build()
    records = expand(document, directory=".", assets=assets)
    opened = OpenedScene(name=name, path=None, settings=document.settings, records=records)  # type: ignore[arg-type]
    return Simulation.load(opened, assets)


def counted(simulation: Simulation) -> dict[int, int]:
    """The contacts of each entity by what physics tells of a step, without what the bus carries."""
    contacts = simulation.physics.events.contacts
    found: dict[int, int] = {}
    for rows in (contacts.begun, contacts.persisting):
        for row in zip(
            *(getattr(rows, name).tolist() for name in ("entity_a", "entity_b", "body_a", "body_b")), strict=True
        ):
            for entity in set(row):
                found[entity] = found.get(entity, 0) + 1
    return found


def test_counts_are_those_of_physics_at_every_tick():
    async def main() -> None:
        simulation = loaded("stack")
        broker = LoopbackBroker()
        host = await Session.host(broker.listen(), name="s", kind="simulation", epoch=1)
        node = SimulationNode(simulation, host, realtime=False, playing=False)
        serving = asyncio.create_task(node.run())
        await asyncio.sleep(0)
        session = await Session.join(broker.connect(), kind="editor")
        model = EditorModel(session)
        running = asyncio.create_task(model.run())

        async def until(condition) -> None:
            async with asyncio.timeout(30.0):
                while not condition():
                    await asyncio.sleep(0.001)

        try:
            await until(lambda: model.scene.is_known)
            for _ in range(12):  # some have touched before anybody counts
                simulation.step()
            cubes = [e.id for e in model.scene.mirror.entities.values() if "RigidBody" in e.components][:6]
            plots = Instruments(model).plots
            series = {cube: plots.add(f"#{cube}.contacts") for cube in cubes}
            await until(lambda: not math.isnan(plots.paths.read(plots.paths.resolve(f"#{cubes[0]}.contacts"))))
            expected: dict[int, dict[int, int]] = {}
            for _ in range(25):
                goal = simulation.tick + 1
                model.step()
                await until(lambda goal=goal: simulation.tick >= goal and plots.table.ticks[-1:].tolist() == [goal])
                expected[goal] = counted(simulation)
            await asyncio.sleep(0)
            assert max(max(found.values(), default=0) for found in expected.values()) >= 2
            for cube in cubes:
                values = dict(zip(plots.table.ticks.tolist(), plots.table.values(series[cube]).tolist(), strict=True))
                assert {tick: values[tick] for tick in expected} == {
                    tick: found.get(cube, 0) for tick, found in expected.items()
                }
            # Nobody counts, nobody listens.
            for curve in series.values():
                plots.remove(curve)
            await until(lambda: not host.has_listener(topics.CONTACTS))
            assert math.isnan(plots.paths.read(plots.paths.resolve(f"#{cubes[0]}.contacts")))
        finally:
            for task in (running, serving):
                task.cancel()
            await asyncio.gather(running, serving, return_exceptions=True)
            await session.close()
            await host.close()

    asyncio.run(main())


def on_loop(test):
    @functools.wraps(test)
    def run() -> None:
        asyncio.run(test())

    return run


class Host:
    """Tells what a test says."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.asked = 0
        self.told = Touching(epoch=1, tick=10, contacts=Meetings())
        self.may_answer = asyncio.Event()
        session.serve(topics.TOUCHING, self._answer)

    async def _answer(self, request, key):
        self.asked += 1
        await self.may_answer.wait()
        return self.told


@contextlib.asynccontextmanager
async def counting():
    broker = LoopbackBroker()
    host = Host(await Session.host(broker.listen(), name="s", kind="simulation", epoch=1))
    session = await Session.join(broker.connect(), kind="editor")
    refusals: list[str] = []
    counts = ContactCounts(session, on_refusal=refusals.append)
    take = []
    stop = counts.start(lambda topic, heard: take.append(heard) or (lambda: None))
    try:
        yield host, counts, take[0], stop, refusals
    finally:
        await session.close()
        await host.session.close()


def batch(tick: int, *, begun=(), ended=()) -> ContactBatch:
    def columns(pairs):
        return {
            "entity_a": tuple(a for a, _ in pairs),
            "entity_b": tuple(b for _, b in pairs),
            "body_a": tuple(a for a, _ in pairs),
            "body_b": tuple(b for _, b in pairs),
        }

    return ContactBatch(epoch=1, tick=tick, begun=Touches(**columns(begun)), ended=Meetings(**columns(ended)))


async def until(condition) -> None:
    async with asyncio.timeout(5.0):
        while not condition():
            await asyncio.sleep(0.001)


@on_loop
async def test_what_came_before_the_answer_counts_once() -> None:
    async with counting() as (host, counts, take, stop, _):
        await until(lambda: host.asked == 1)
        assert math.isnan(counts.count(1))
        host.told = Touching(
            epoch=1,
            tick=10,
            contacts=Meetings(entity_a=(1, 2), entity_b=(2, 3), body_a=(1, 2), body_b=(2, 3)),
        )
        take(batch(10, begun=[(2, 3)]))  # is in the answer
        take(batch(11, begun=[(1, 3)], ended=[(1, 2)]))  # is not
        host.may_answer.set()
        await until(lambda: not math.isnan(counts.count(1)))
        assert [counts.count(entity) for entity in (1, 2, 3, 4)] == [1.0, 1.0, 2.0, 0.0]
        take(batch(12, ended=[(1, 3), (2, 3), (7, 8)]))
        assert [counts.count(entity) for entity in (1, 2, 3, 7)] == [0.0, 0.0, 0.0, 0.0]
        stop()
        assert math.isnan(counts.count(1))


@on_loop
async def test_an_answer_of_before_is_nobodys() -> None:
    async with counting() as (host, counts, _, stop, refusals):
        await until(lambda: host.asked == 1)
        stop()
        host.may_answer.set()
        await asyncio.sleep(0)
        await until(lambda: host.asked == 1)
        assert math.isnan(counts.count(1)) and refusals == []


@on_loop
async def test_who_does_not_tell_is_said() -> None:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="s", kind="replay", epoch=1)
    from elys.bus.player import Player

    host.serve(topics.TOUCHING, lambda request, key: Player._refuse_touching(None, request, key))  # type: ignore[arg-type]
    session = await Session.join(broker.connect(), kind="editor")
    refusals: list[str] = []
    counts = ContactCounts(session, on_refusal=refusals.append)
    counts.start(lambda topic, heard: lambda: None)
    await until(lambda: bool(refusals))
    assert "a recording is played" in refusals[0] and math.isnan(counts.count(1))
    await session.close()
    await host.close()


def test_who_goes_back_in_time_asks_again(on_stage):
    """What touched then is not what touches now."""

    async def scenario(stage):
        asked = []

        async def answer(request, key):
            asked.append(stage.host.tick)
            return Touching(epoch=1, tick=stage.host.tick, contacts=Meetings())

        stage.host.session.serve(topics.TOUCHING, answer)
        plots = Instruments(stage.model).plots
        crate = stage.named("Crate")
        plots.add("Crate.contacts")
        for tick, count in ((5, 1), (6, 1), (3, 2), (4, 2)):
            stage.host.tick = tick
            stage.host.publish_frame({crate: (0.0, 1.0, 0.0)})
            await stage.until(lambda tick=tick: plots.table.ticks[-1:].tolist() == [tick])
            await stage.until(lambda count=count: len(asked) == count)

    on_stage(scenario)


@pytest.mark.gl
def test_contacts_are_offered_and_plotted_by_hand(at_the_editor):
    async def scenario(person):
        editor = person.editor

        async def answer(request, key):
            crate, ground = person.stage.named("Crate"), person.stage.named("Ground")
            rows = {"entity_a": (ground,), "entity_b": (crate,), "body_a": (ground,), "body_b": (crate,)}
            return Touching(epoch=1, tick=0, contacts=Meetings(**rows))

        person.stage.host.session.serve(topics.TOUCHING, answer)
        editor.ui.actions.run("plots.add")
        await person.frames(4)
        await person.click("plots/path")
        await person.type("Crate.con")
        await person.frames(2)
        assert "Crate.contacts" in editor.workspace.instruments.plots.paths.suggestions("Crate.con")
        await person.type("tacts")
        await person.press(Key.ENTER)
        await person.frames(2)
        plots = editor.workspace.instruments.plots
        assert [series.path for series in plots.table.series] == ["Crate.contacts"]
        person.stage.host.tick = 1
        person.stage.host.publish_frame({person.stage.named("Crate"): (0.0, 1.0, 0.0)})
        await person.until(lambda: plots.newest(plots.table.series[0]) == 1.0)

    at_the_editor(scenario)

"""What begins and ends between bodies reaches the bus, once a tick and only when there is something; lines where one listens."""

from __future__ import annotations

import asyncio
import contextlib
import functools
from collections.abc import AsyncIterator, Callable, Coroutine
from typing import Any

import numpy as np
import pytest

from elys.bus import topics
from elys.bus.messages.physics import ContactBatch, DebugLines
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.components import Collider, RigidBody, Transform
from elys.common.ids import Entity
from elys.sim_node.node import SimulationNode
from elys.sim_node.simulation import Simulation


@pytest.fixture
def simulation() -> Simulation:
    """A ball that falls through a zone onto a floor."""
    simulation = Simulation()
    spawn = simulation.world.spawn
    spawn([Transform(scale=(20.0, 1.0, 20.0)), Collider()], name="Floor")
    spawn([Transform(position=(0.0, 2.0, 0.0)), Collider(is_trigger=True)], name="Zone")
    spawn([Transform(position=(0.0, 3.2, 0.0)), RigidBody(), Collider(shape="sphere", radius=0.25)], name="Ball")
    return simulation


def run_in_loop(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    @functools.wraps(test)
    def run(**fixtures: Any) -> None:
        asyncio.run(test(**fixtures))

    return run


@contextlib.asynccontextmanager
async def hosted() -> AsyncIterator[Session]:
    session = await Session.host(LoopbackBroker().listen(), name="s", kind="simulation", epoch=7)
    yield session
    await session.close()


def found(simulation: Simulation, name: str) -> Entity:
    return simulation.world.hierarchy.find(name)


@run_in_loop
async def test_a_ball_that_falls_through_a_zone_onto_a_floor_says_four_things(simulation) -> None:
    async with hosted() as host:
        batches: list[ContactBatch] = []
        host.subscribe(topics.CONTACTS, lambda batch, _: batches.append(batch))
        node = SimulationNode(simulation, host)
        for _ in range(120):
            node.tick()
            await asyncio.sleep(0)
        floor, zone, ball = (found(simulation, name) for name in ("Floor", "Zone", "Ball"))
        entered, exited, begun = batches
        assert entered.entered.trigger == (zone,) and entered.entered.entity == (ball,)
        assert exited.exited.trigger == (zone,) and exited.exited.trigger_body == (zone,)
        touches = begun.begun
        assert {touches.entity_a[0], touches.entity_b[0]} == {floor, ball}
        assert len(touches.point) == len(touches.normal) == len(touches.normal_impulse) == 1
        # It fell from 3.2 m onto 0.75 m.
        assert touches.speed[0] == pytest.approx(np.sqrt(2 * 9.81 * 2.45), rel=2e-3)
        assert [batch.epoch for batch in batches] == [7, 7, 7]
        assert entered.tick < exited.tick < begun.tick


@run_in_loop
async def test_a_trigger_can_be_made_of_a_floor_while_something_lies_on_it(simulation) -> None:
    async with hosted() as host:
        batches: list[ContactBatch] = []
        node = SimulationNode(simulation, host)
        for _ in range(120):
            node.tick()
        host.subscribe(topics.CONTACTS, lambda batch, _: batches.append(batch))
        floor, ball = found(simulation, "Floor"), found(simulation, "Ball")
        assert simulation.events.contacts.persisting.entity_a.tolist() == [floor]
        simulation.world.set(floor, Collider(is_trigger=True))
        node.tick()
        await asyncio.sleep(0)
        (batch,) = batches
        assert batch.ended.entity_a == (floor,) and batch.ended.entity_b == (ball,)
        simulation.world.set(floor, Collider(is_trigger=False))
        simulation.world.despawn(ball)
        for _ in range(3):
            node.tick()
        await asyncio.sleep(0)
        ended = [pair for batch in batches[1:] for pair in zip(batch.exited.trigger, batch.exited.entity, strict=True)]
        entered = [pair for batch in batches for pair in zip(batch.entered.trigger, batch.entered.entity, strict=True)]
        assert ended == entered  # whatever was in it when it stopped to be one


@run_in_loop
async def test_a_body_that_is_edited_where_it_lies_begins_and_ends_nothing(simulation) -> None:
    async with hosted() as host:
        node = SimulationNode(simulation, host)
        for _ in range(120):
            node.tick()
        batches: list[ContactBatch] = []
        host.subscribe(topics.CONTACTS, lambda batch, _: batches.append(batch))
        simulation.world.set(found(simulation, "Ball"), Collider(shape="sphere", radius=0.25, friction=0.9))
        for _ in range(3):
            node.tick()
        await asyncio.sleep(0)
        assert batches == []


@run_in_loop
async def test_debug_lines_are_made_of_what_somebody_listens_to(simulation, monkeypatch) -> None:
    async with hosted() as host:
        made: list[str] = []
        lines = simulation.physics.debug_lines
        monkeypatch.setattr(simulation.physics, "debug_lines", lambda kind: made.append(kind) or lines(kind))
        node = SimulationNode(simulation, host)
        node.tick()
        assert made == []
        heard: list[tuple[str, DebugLines]] = []
        close = host.subscribe(topics.DEBUG_LINES, lambda message, key: heard.append((key, message)), key="boxes")
        node.tick()
        await asyncio.sleep(0)
        assert made == ["boxes"]
        ((key, message),) = heard
        assert (key, message.tick) == ("boxes", 2)
        positions = np.frombuffer(message.positions, "<f4").reshape(-1, 2, 3)
        assert len(positions) == len(message.colors) == 3 * 12
        np.testing.assert_allclose(positions.reshape(3, 24, 3)[0].max(0), [10, 0.5, 10])
        close()
        node.tick()
        assert made == ["boxes"]


@run_in_loop
async def test_states_and_profiles_are_made_for_those_who_listen_or_record(simulation) -> None:
    async with hosted() as host:
        made: list[str] = []
        publish = host.publish
        host.publish = lambda topic, *given, **named: (made.append(topic.name), publish(topic, *given, **named))[1]
        node = SimulationNode(simulation, host)
        node.tick()
        assert not {"state", "profile"} & set(made)
        frames = []
        stop = host.subscribe(topics.STATE, lambda frame, _: frames.append(frame.tick))
        node.tick()
        await asyncio.sleep(0)
        assert frames == [2] and "profile" not in made
        stop()
        made.clear()
        node.tick()
        assert "state" not in made
        host.taps.append(lambda *given: None)
        node.tick()
        assert {"state", "profile"} <= set(made)

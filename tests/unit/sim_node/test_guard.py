"""The guard: silent over every sample, outspoken about what sinks and what comes apart, and its file plays."""

from __future__ import annotations

import asyncio
from pathlib import Path

import numpy as np
import pytest

from elys.bus import topics
from elys.bus.last_seconds import LastSeconds
from elys.bus.messages.commands import CommandRequest, KeepLast
from elys.bus.recording import Recording
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.components import Collider, Joint, RigidBody, Transform
from elys.common.scene import open_scene
from elys.samples.registry import SAMPLES, write_sample
from elys.sim_node.guard import MOST_FILES, Guard
from elys.sim_node.node import SimulationNode
from elys.sim_node.simulation import Simulation
from elys.sim_node.verification import verify


def run_guarded(simulation, folder: Path, ticks: int, on_tick=None):
    """Ticks a node with a guard in a session; returns the paths of its files and all that was published, by topic."""
    said: dict[str, list] = {"events": [], "diagnostics": []}

    async def run():
        session = await Session.host(LoopbackBroker().listen(), name="s", kind="simulation", epoch=7)
        for topic in (topics.EVENTS, topics.DIAGNOSTICS):
            session.subscribe_payloads(topic, lambda *_: None)
        node = SimulationNode(simulation, session, realtime=False)
        last = LastSeconds(session, take_snapshot=node.snapshot, assets=simulation.assets, exact=node.chronicle)
        node.guard = guard = Guard(simulation, last, lambda tick: folder / f"problem-{tick}.mcap")
        look = guard.look
        guard.look = lambda found: (said["diagnostics"].append(found), look(found))[1]
        end = guard.end_tick
        guard.end_tick = lambda events: (said["events"].extend(events), end(events))[1]
        for tick in range(ticks):
            if on_tick is not None:
                on_tick(tick)
            node.tick()
        await asyncio.to_thread(guard.close)
        await session.close()
        return guard.paths

    return asyncio.run(run()), said


@pytest.mark.parametrize("name", SAMPLES)
def test_no_sample_alarms_the_guard_in_ten_seconds(name, tmp_path):
    path, assets = tmp_path / f"{name}.scene.json", AssetStore()
    write_sample(name, path)
    simulation = Simulation.load(open_scene(path, assets), assets)
    paths, said = run_guarded(simulation, tmp_path, round(10 * simulation.settings.tick_rate))
    assert len(said["diagnostics"]) == 10 * simulation.settings.tick_rate
    assert paths == [] and [event for event in said["events"] if event.kind == "physics"] == []


def small_world():
    simulation = Simulation()
    spawn = simulation.world.spawn
    spawn([Transform(position=(0.0, -0.5, 0.0), scale=(20.0, 1.0, 20.0)), Collider()], name="Floor")
    crate = spawn([Transform(position=(0.0, 0.5, 0.0)), RigidBody(), Collider()], name="Crate")
    simulation.settle()
    return simulation, crate


def causes(said):
    return [(event.values["cause"], event.entity) for event in said["events"] if event.kind == "physics"]


def test_what_is_pressed_into_the_ground_is_named_and_can_be_looked_at(tmp_path):
    simulation, crate = small_world()
    press = simulation.world.spawn(
        [
            Transform(position=(0.0, 1.6, 0.0)),
            RigidBody(motion="kinematic", linear_velocity=(0.0, -0.5, 0.0)),
            Collider(),
        ]
    )
    simulation.settle()

    def stop(tick):
        if tick == 150:
            simulation.world.set(press, RigidBody(motion="kinematic"))

    paths, said = run_guarded(simulation, tmp_path, 400, stop)
    assert causes(said)[0][0] == "sunk" and len(paths) == 1
    named = next(event for event in said["events"] if event.kind == "physics")
    assert crate in (named.entity, named.other)
    assert f"entity {crate} 'Crate'" in named.values["text"] and f"entity {press}" in named.values["text"]
    with Recording(paths[0]) as kept:
        ticks = np.unique(kept.tick)
        assert f"problem-{ticks[-1]}.mcap" == paths[0].name
        assert len(ticks) == min(ticks[-1], 301)
        assert kept.mirror_at(0).entities[crate].name == "Crate"
        heights = [kept.frame(k).position[kept.frame(k).entity == press][0, 1] for k in range(len(kept))]
    assert heights[0] - heights[-1] > 0.5


def test_what_a_step_finds_is_named_as_people_call_it(tmp_path):
    simulation, crate = small_world()
    simulation.world.set(crate, RigidBody(linear_velocity=(0.0, 1e5, 0.0)))
    _, said = run_guarded(simulation, tmp_path, 2)
    texts = [event.values["text"] for event in said["events"] if event.kind == "physics"]
    assert texts and texts[0].startswith(f"entity {crate} 'Crate' became faster than max_linear_speed")


def test_files_are_few_and_hold_different_seconds(tmp_path):
    simulation, crate = small_world()

    def shoot(tick):
        if tick % 100 == 50:
            position = Transform(position=(0.0, 5.0, 0.0))
            simulation.world.set(crate, position)
            simulation.world.set(crate, RigidBody(linear_velocity=(0.0, 1e5, 0.0)))
        elif tick % 100 == 60:
            simulation.world.set(crate, Transform(position=(0.0, 0.5, 0.0)))
            simulation.world.set(crate, RigidBody())

    paths, said = run_guarded(simulation, tmp_path, 2000, shoot)
    assert len(causes(said)) >= 10 and set(causes(said)) == {("too_fast", crate)}
    assert len(paths) == MOST_FILES and all(path.is_file() for path in paths)
    ends = []
    for path in paths:
        with Recording(path) as kept:
            ends.append(int(kept.tick[-1]))
    assert np.diff(ends).min() >= 300


def test_a_joint_that_is_torn_apart_is_named(tmp_path):
    simulation = Simulation()
    spawn = simulation.world.spawn
    crate = spawn([Transform(), RigidBody(), Collider(), Joint(kind="ball")], name="Crate")
    away = RigidBody(motion="kinematic", linear_velocity=(2.0, 0.0, 0.0))
    puller = spawn([Transform(position=(2.0, 0.0, 0.0)), away, Joint(kind="ball", other=crate)], name="Puller")
    simulation.settle()
    paths, said = run_guarded(simulation, tmp_path, 300)
    cause, joint = causes(said)[0]
    assert cause == "joint_apart" and joint in (crate, puller)
    told = next(event for event in said["events"] if event.kind == "physics")
    assert told.values["text"].startswith(
        f"the joint of entity {joint} '{'Crate' if joint == crate else 'Puller'}' is "
    )
    assert said["diagnostics"][-1].joint_error > 1.0
    assert paths and paths[0].is_file()
    verdict = verify(paths[0])
    assert verdict.cause == "equal" and verdict.ticks > 30


def test_a_body_whose_numbers_end_is_named_and_its_last_seconds_are_kept(tmp_path):
    simulation, crate = small_world()

    def spoil(tick):
        if tick == 200:
            simulation.physics.set_velocities([crate], linear=[1.7e308, 1.7e308, 0.0])

    paths, said = run_guarded(simulation, tmp_path, 260, spoil)
    assert causes(said) == [("not_finite", crate)]
    (path,) = paths
    with Recording(path) as kept:
        assert [int(tick) for tick in (kept.tick[0], kept.tick[-1])] == [1, 201]
        frames = [kept.frame(k) for k in range(len(kept))]
        assert all(np.isfinite(frame.position).all() for frame in frames)
        texts = [m.body for m in kept.reader.messages((topics.EVENTS.name,))]
    assert any(b"not_finite" in text for text in texts)


def test_the_last_seconds_are_written_when_somebody_asks(tmp_path):
    simulation, _ = small_world()

    async def run():
        broker = LoopbackBroker()
        session = await Session.host(broker.listen(), name="s", kind="simulation", epoch=7)
        node = SimulationNode(simulation, session, realtime=False, step_limit=100)
        running = asyncio.create_task(node.run())
        await running
        client = await Session.join(broker.connect(), kind="editor")
        told = []
        client.subscribe(topics.EVENTS, lambda batch, _: told.extend(batch.events))

        async def keep():
            reply = asyncio.create_task(
                client.request(topics.COMMAND, CommandRequest(origin=client.node.id, command=KeepLast()))
            )
            while not reply.done():
                node.tick()
                await asyncio.sleep(0)
            return reply.result()

        refused = await keep()
        last = LastSeconds(session, take_snapshot=node.snapshot, assets=simulation.assets, exact=node.chronicle)
        node.guard = guard = Guard(simulation, last, lambda tick: tmp_path / f"moment-{tick}.mcap")
        for _ in range(60):
            node.tick()
        kept = [await keep()]
        again = await keep()
        while not again.accepted:
            assert "being written already" in again.reason
            again = await keep()
        kept.append(again)
        await asyncio.to_thread(guard.close)
        await asyncio.sleep(0)
        await client.close()
        await session.close()
        return refused, kept, guard.paths, [event.values["path"] for event in told if event.kind == "kept"]

    refused, kept, paths, told = asyncio.run(run())
    assert not refused.accepted and "--no-guard" in refused.reason
    assert all(reply.accepted for reply in kept)
    assert len(set(paths)) == 2 and [str(path) for path in paths] == told
    assert [verify(path).cause for path in paths] == ["equal", "equal"]


def test_less_than_was_asked_for_is_said(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr("elys.bus.last_seconds.ROOM", 100_000)
    simulation, _ = small_world()
    with caplog.at_level("INFO", logger="elys"):
        run_guarded(simulation, tmp_path, 300)
    said = [record.message for record in caplog.records if "s are kept, not 5" in record.message]
    assert len(said) == 1, caplog.text

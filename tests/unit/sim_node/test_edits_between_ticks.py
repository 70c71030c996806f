"""While time goes on an edit is made at once, and not at the next step; it can be gone back to and done again all the same."""

from __future__ import annotations

import asyncio

from elys.bus import topics
from elys.bus.messages.commands import (
    CommandReply,
    CommandRequest,
    Edit,
    Input,
    Rewind,
    SetComponent,
    SetPlaying,
    SetRate,
    Spawn,
    Undo,
)
from elys.bus.messages.scene import SceneDelta
from elys.bus.messages.state_frame import StateFrame
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.scene import EntityRecord
from elys.sim_node.node import SimulationNode
from elys.sim_node.scene.loading import records_of
from elys.sim_node.simulation import Simulation
from elys.verbs.scenes import open_scene_or_sample

BOX = EntityRecord(
    name="Late", components={"Transform": {"position": [0.1, 9.0, 0.0]}, "RigidBody": {}, "Collider": {}}
)


def stack() -> Simulation:
    assets = AssetStore()
    return Simulation.load(open_scene_or_sample("stack", assets), assets)


def moved(entity: int, height: float) -> SetComponent:
    return SetComponent(entity=entity, component="Transform", values={"position": [0.0, height, 0.0]})


def test_the_first_edit_after_a_step_does_not_wait_for_the_next_one() -> None:
    async def scenario() -> None:
        broker = LoopbackBroker()
        host = await Session.host(broker.listen(), name="between", kind="simulation", epoch=1)
        node = SimulationNode(stack(), host)
        client = await Session.join(broker.connect(), kind="editor")
        deltas: list[SceneDelta] = []
        frames: list[StateFrame] = []
        client.subscribe(topics.DELTA, lambda delta, _: deltas.append(delta))
        client.subscribe(topics.STATE, lambda frame, _: frames.append(frame))
        running = asyncio.create_task(node.run())
        await asyncio.sleep(0)

        async def ask(command: Edit | SetRate | SetPlaying | Input) -> CommandReply:
            return await client.request(topics.COMMAND, CommandRequest(origin="test", command=command), timeout=30.0)

        assert (await ask(SetRate(rate=1e-4))).accepted  # from here on the next step is minutes away
        done, told = node.steps_done, len(frames)
        made = await ask(Spawn(records=(BOX,)))
        assert made.accepted and node.steps_done == done
        assert deltas[-1].sequence == made.sequence and deltas[-1].changes
        assert len(frames) == told  # nothing has moved
        (second,) = (asyncio.create_task(ask(moved(made.entities[0], 5.0))),)
        for _ in range(200):  # one in each interval: a flood of edits must not become a flood of instants
            await asyncio.sleep(0)
        assert not second.done() and node.steps_done == done
        second.cancel()
        running.cancel()
        await asyncio.gather(running, second, return_exceptions=True)
        await client.close()
        await host.close()

    asyncio.run(scenario())


def test_what_was_edited_between_steps_comes_out_the_same_when_done_again() -> None:
    async def scenario() -> None:
        broker = LoopbackBroker()
        host = await Session.host(broker.listen(), name="between", kind="simulation", epoch=1)
        node = SimulationNode(stack(), host)
        author = node.history.attach("somebody", "test", alive=("test",))

        def between(*commands: Edit | Undo) -> list[CommandReply]:
            asked = [node.put(CommandRequest(origin="test", author=author, command=command)) for command in commands]
            node._edit_between()
            assert all(reply.result().accepted for reply in asked)
            return [reply.result() for reply in asked]

        states = []

        def steps(count: int) -> None:
            for _ in range(count):
                node.tick()
                states.append((node.simulation.tick, node.simulation.state_hash(), records_of(node.simulation.world)))

        steps(10)
        (made,) = between(Spawn(records=(BOX,)))
        steps(10)
        between(moved(made.entities[0], 3.0))
        steps(10)
        between(Undo())
        steps(5)
        between(moved(made.entities[0], 4.0), Undo())  # what is edited and undone in one interval was never there
        steps(10)
        for tick, state_hash, records in (states[4], states[15], states[-1], states[25]):
            asked = node.put(CommandRequest(origin="test", command=Rewind(tick=tick)))
            node.tick()
            assert asked.result().accepted
            assert node.simulation.state_hash() == state_hash
            assert records_of(node.simulation.world) == records
        await host.close()

    asyncio.run(scenario())

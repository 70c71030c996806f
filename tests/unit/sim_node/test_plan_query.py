"""Who asks the host hears the plan that the world tells itself, as it stands after the last step."""

from __future__ import annotations

import asyncio

import pytest

from elys.bus import topics
from elys.bus.messages.plan import PlanRequest
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import AssetStore
from elys.common.scene import open_scene
from elys.samples.registry import write_sample
from elys.sim_node.node import SimulationNode
from elys.sim_node.simulation import Simulation


@pytest.fixture
def simulation(tmp_path) -> Simulation:
    assets = AssetStore()
    write_sample("stack", tmp_path / "it.scene.json")
    return Simulation.load(open_scene(tmp_path / "it.scene.json", assets), assets)


def test_the_plan_is_told_on_the_bus(simulation):
    async def main():
        broker = LoopbackBroker()
        host = await Session.host(broker.listen(), name="it", kind="simulation", epoch=1)
        node = SimulationNode(simulation, host, playing=False)
        serving = asyncio.create_task(node.run())
        client = await Session.join(broker.connect(), kind="tool")
        try:
            before = await client.request(topics.PLAN, PlanRequest())
            for _ in range(3):
                simulation.step()
            after = await client.request(topics.PLAN, PlanRequest())
        finally:
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)
            await client.close()
            await host.close()
        return before, after

    before, after = asyncio.run(main())
    told = [(stage.name, stage.is_on, stage.why, stage.is_forced) for stage in after.stages]
    assert told == [tuple(stage) for stage in simulation.physics.plan()]
    assert (before.tick, after.tick) == (0, 3)
    assert (after.bodies, after.contacts) == (simulation.physics.body_count, simulation.physics.touching_count)
    assert after.contacts > 0
    assert {stage.name: stage.is_on for stage in after.stages}["solver"]  # a stack stands on contacts
    assert not {stage.name: stage.is_on for stage in before.stages}["solver"]  # before the first step none is known

"""A simulation whose settled bodies never sleep, so that each tick costs the same; tells its processor time when asked.

python -m tests.benchmarks.viewer_host ENDPOINT SCENE

Says "hosting" when it ticks. Each line on stdin is answered by one of JSON: ticks so far, processor time of the thread that ticks
and of the whole process [s], how many state frames were sent. "touch"
changes something in the scene as well; "snapshot" makes one and tells what that took [s].
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
import time
from functools import partial

import msgspec

from elys.bus import codec, topics
from elys.bus.access.listening import LOOPBACK, access_of
from elys.bus.messages.commands import CommandRequest, SetComponent
from elys.bus.session import Session
from elys.bus.transports.zenoh import ZenohTransport
from elys.common.assets.store import AssetStore
from elys.sim_node.node import SimulationNode
from elys.sim_node.simulation import Simulation
from elys.verbs.kernels import compile_with_progress
from elys.verbs.scenes import open_scene_or_sample

SETTLING = 300  # ticks


async def host(endpoint: str, scene: str) -> None:
    opened = open_scene_or_sample(scene)
    compile_with_progress(opened)
    simulation = Simulation.load(opened, AssetStore())
    simulation.physics.settings = msgspec.structs.replace(simulation.physics.settings, sleeping=False)
    for _ in range(SETTLING):
        simulation.step()
    access = access_of(LOOPBACK)  # it asks who comes, as sessions do
    transport = await asyncio.to_thread(partial(ZenohTransport.listen, endpoint, access=access))
    session = await Session.host(transport, name="bench", kind="simulation", epoch=time.time_ns())
    node = SimulationNode(simulation, session, keep=0.0)
    loop = asyncio.get_running_loop()
    running = asyncio.ensure_future(node.run())
    loop.add_reader(sys.stdin.fileno(), lambda: tell(node, session, running))
    print("hosting", flush=True)
    with contextlib.suppress(asyncio.CancelledError):
        await running
    await session.close()


def tell(node: SimulationNode, session: Session, running: asyncio.Future[None]) -> None:
    line = sys.stdin.readline()
    if not line:
        running.cancel()
        return
    if line.strip() == "touch":
        entity = int(node.simulation.moving_bodies().entity[0])
        values = {"base_color": [0.5, 0.5, (node.steps_done % 100) / 100.0]}
        command = SetComponent(entity=entity, component="Material", values=values)
        node.put(CommandRequest(origin="bench", command=command))
    began = time.thread_time()
    if line.strip() == "snapshot":
        codec.encode(node.snapshot(), topics.SNAPSHOT.reply_encoding)
    sent = session.traffic.sent().get(topics.STATE.name)
    facts = {
        "ticks": node.steps_done,
        "thread": time.thread_time(),
        "process": time.process_time(),
        "snapshot": time.thread_time() - began,
        "states": sent.messages if sent is not None else 0,
    }
    print(json.dumps(facts), flush=True)


if __name__ == "__main__":
    asyncio.run(host(sys.argv[1], sys.argv[2]))

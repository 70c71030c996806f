"""A host of a scene of bodies, for tests that kill it: `bus_host.py ENDPOINT EPOCH [PIPE]`. Prints a line once it is open.

Positions are a function of the tick, so that whoever sees a frame can tell whether it is right: every coordinate is tick + body.
"""

from __future__ import annotations

import asyncio
import sys
import time

import numpy as np

from elys.bus import topics
from elys.bus.messages.scene import ComponentSet, SceneDelta, Snapshot, SnapshotRequest, Spawned
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.bus.session import Session
from elys.bus.tap import RecordingTap
from elys.bus.transports.zenoh import ZenohTransport
from elys.common.assets.store import AssetStore

BODY_COUNT = 1000
TICK_RATE = 240.0


def frame_at(tick: int, *, epoch: int, sequence: int) -> StateFrame:
    bodies = np.arange(1, BODY_COUNT + 1)
    return StateFrame(
        epoch=epoch,
        tick=tick,
        simulation_time=tick / TICK_RATE,
        published_at=time.time_ns(),
        delta_sequence=sequence,
        state_hash=tick,
        playing=True,
        position=np.repeat((tick + bodies)[:, None], 3, axis=1).astype(np.float64),
        rotation=np.tile(np.array((0, 0, 0, 1), np.float32), (BODY_COUNT, 1)),
        linear_velocity=np.full((BODY_COUNT, 3), tick, np.float32),
        angular_velocity=np.zeros((BODY_COUNT, 3), np.float32),
        entity=bodies.astype(np.uint32),
    )


async def run(endpoint: str, epoch: int, pipe: int | None) -> None:
    session = await Session.host(ZenohTransport.listen(endpoint), name="yard", kind="simulation", epoch=epoch)
    mirror = SceneMirror()
    mirror.epoch, mirror.sequence, mirror.scene = epoch, 0, "Yard"
    spawned = tuple(
        Spawned(entity=e, name=f"body {e}", parent=0, enabled=True, components={"RigidBody": {}})
        for e in range(1, BODY_COUNT + 1)
    )
    mirror.apply_delta(SceneDelta(epoch=epoch, sequence=1, tick=0, changes=spawned))

    async def give_snapshot(request: SnapshotRequest, key: str) -> Snapshot:
        return mirror.to_snapshot()

    session.serve(topics.SNAPSHOT, give_snapshot)
    tap = None
    if pipe is not None:
        tap = RecordingTap(session, pipe, take_snapshot=mirror.to_snapshot, assets=AssetStore(), lossless=True)
    print("open", flush=True)
    started = time.monotonic()
    tick = 0
    while True:
        tick += 1
        mirror.tick = tick
        if tick % 20 == 0:
            change = ComponentSet(entity=1 + tick % BODY_COUNT, component="RigidBody", values={"mass": float(tick)})
            delta = SceneDelta(epoch=epoch, sequence=mirror.sequence + 1, tick=tick, changes=(change,))
            mirror.apply_delta(delta)
            session.publish(topics.DELTA, delta)
        session.publish(topics.STATE, frame_at(tick, epoch=epoch, sequence=mirror.sequence))
        if tick % 60 == 0:
            alive = tap is not None and tap.alive
            print(
                f"tick {tick} late {(time.monotonic() - started) - tick / TICK_RATE:.3f} recorder {alive}", flush=True
            )
        await asyncio.sleep(max(0.0, started + tick / TICK_RATE - time.monotonic()))


if __name__ == "__main__":
    asyncio.run(run(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else None))

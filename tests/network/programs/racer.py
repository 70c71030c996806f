"""Somebody who races far away: `racer.py ENDPOINT LEVEL PLAYER`. He sees what states tell, and steers with a stick.

It says `begun`, then `gate NUMBER TIME` for each of his gates, and `finished TIME` at the end.
"""

from __future__ import annotations

import asyncio
import math
import sys
from typing import Any

import msgspec

from elys.bus import topics
from elys.bus.discovery import join_session
from elys.bus.following import follow_scene, follow_state
from elys.bus.mirror import SceneMirror
from elys.common.assets.store import AssetStore
from elys.game.driver import Driver
from elys.samples.game.levels import LEVELS


def say(*words: object) -> None:
    print(*words, flush=True)


async def main(endpoint: str, level: str, player: int) -> None:
    _, layout = LEVELS[level].open(AssetStore(), players=2)
    driver = Driver(layout.line, ferries=layout.ferries, player=player)
    session = await join_session(endpoint, kind="viewer", timeout=20.0)
    mirror, at_the_goal = SceneMirror(), asyncio.Event()
    sequence = 0

    def heard(batch: Any, _: str) -> None:
        for event in batch.events:
            if event.values.get("player") == player and event.kind == "race_gate":
                say("gate", event.values["number"], event.values["time"])
            if event.values.get("player") == player and event.kind == "race_finished":
                say("finished", event.values["time"])
                at_the_goal.set()

    def steer(frame: Any) -> None:
        nonlocal sequence
        entities = {entity.name: number for number, entity in mirror.entities.items()}
        ball, camera = entities.get(f"Ball {player}"), entities.get(f"Camera {player}")
        if ball is None or camera is None or (row := mirror.frame_row(ball)) < 0:
            return
        x, y, z, w = mirror.world_pose(camera).rotation
        heading = math.atan2(2.0 * (x * z + w * y), 1.0 - 2.0 * (x * x + y * y))
        ferries = {ferry.name: mirror.world_pose(entities[ferry.name]).position for ferry in layout.ferries}
        command = driver.input(frame.position[row], frame.linear_velocity[row], heading, ferries=ferries)
        sequence += 1
        session.publish(topics.INPUT, msgspec.structs.replace(command, sequence=sequence), key=session.node.id)

    session.subscribe(topics.EVENTS, heard)
    await follow_scene(session, mirror)
    follow_state(session, mirror, steer)
    say("begun")
    await at_the_goal.wait()
    await session.close()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], sys.argv[2], int(sys.argv[3])))

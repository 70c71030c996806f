"""A viewer without a picture: follows the scene and every state frame, and at the end tells how old the frames were.

python -m tests.benchmarks.watcher      says "watching", prints a JSON list of ages [ms] when the session ends
"""

from __future__ import annotations

import asyncio
import json
import time

from elys.bus.following import follow_scene, follow_state
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.verbs.nodes import joined


async def watch() -> None:
    ages: list[float] = []
    ended = asyncio.Event()

    def heard(frame: StateFrame) -> None:
        ages.append((time.time_ns() - frame.published_at) / 1e6)

    async with joined(None, kind="tool") as session:
        session.on_link(lambda connected: None if connected else ended.set())
        mirror = SceneMirror()
        await follow_scene(session, mirror)
        follow_state(session, mirror, heard)
        print("watching", flush=True)
        await ended.wait()
    print(json.dumps(ages))


if __name__ == "__main__":
    asyncio.run(watch())

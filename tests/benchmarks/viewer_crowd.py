"""Many viewers without pictures in one process, each with a connection and a session of its own.

python -m tests.benchmarks.viewer_crowd ENDPOINT COUNT

Says "watching" when all have the scene. A line on stdin begins the count anew; the next is answered by one line of JSON with what
came meanwhile: for each viewer its states and deltas, those missed of either, and the ages [ms] of all states; and the processor
time [s] that all took together. It ends with its stdin.
"""

from __future__ import annotations

import asyncio
import json
import struct
import sys
import time
from collections.abc import Callable

from elys.bus import codec, topics
from elys.bus.discovery import join_session
from elys.bus.following import follow_scene
from elys.bus.messages.scene import SceneDelta
from elys.bus.mirror import SceneMirror
from elys.bus.session import Session

_STATE_HEAD = struct.Struct("<QQdQ")


class Viewer:
    """What one viewer heard since the count began."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.mirror = SceneMirror()
        self.last_tick = self.last_delta = -1
        self.begin()

    def begin(self) -> None:
        self.states = self.size = self.missed_states = self.deltas = self.missed_deltas = 0
        self.ages: list[float] = []

    async def watch(self) -> None:
        await follow_scene(self.session, self.mirror)
        # As they arrive: of a viewer that is a process by itself nobody else is in the way.
        transport, name = self.session.transport, self.session.name
        transport.subscribe(topics.key_of(name, topics.STATE), self._take_state)
        transport.subscribe(topics.key_of(name, topics.DELTA), self._take_delta)

    def _take_state(self, key: str, payload: bytes) -> None:
        _, tick, _, published_at = _STATE_HEAD.unpack_from(payload, 8)
        self.ages.append((time.time_ns() - published_at) / 1e6)
        self.states += 1
        self.size += len(payload)
        if self.last_tick >= 0:
            self.missed_states += max(tick - self.last_tick - 1, 0)
        self.last_tick = tick

    def _take_delta(self, key: str, payload: bytes) -> None:
        delta = codec.decode(payload, SceneDelta, topics.DELTA.encoding)
        self.deltas += 1
        if self.last_delta >= 0:
            self.missed_deltas += max(delta.sequence - self.last_delta - 1, 0)
        self.last_delta = delta.sequence


async def watch(endpoint: str, count: int) -> None:
    viewers = [Viewer(await join_session(endpoint, kind="viewer", timeout=30.0)) for _ in range(count)]
    await asyncio.gather(*(viewer.watch() for viewer in viewers))
    print("watching", flush=True)
    lines: asyncio.Queue[str] = asyncio.Queue()
    asyncio.get_running_loop().add_reader(sys.stdin.fileno(), lambda: lines.put_nowait(sys.stdin.readline()))
    tell: Callable[[], str] | None = None
    while await lines.get():
        if tell is None:
            tell = begin(viewers)
        else:
            print(tell(), flush=True)
            tell = None
    await asyncio.gather(*(viewer.session.close() for viewer in viewers))


def begin(viewers: list[Viewer]) -> Callable[[], str]:
    """Begins to count; what it returns tells."""
    for viewer in viewers:
        viewer.begin()
    processor = time.process_time()

    def tell() -> str:
        return json.dumps(
            {
                "states": [viewer.states for viewer in viewers],
                "sizes": [viewer.size for viewer in viewers],
                "missed_states": [viewer.missed_states for viewer in viewers],
                "deltas": [viewer.deltas for viewer in viewers],
                "missed_deltas": [viewer.missed_deltas for viewer in viewers],
                "ages": [round(age, 2) for viewer in viewers for age in viewer.ages],
                "process": time.process_time() - processor,
            }
        )

    return tell


if __name__ == "__main__":
    asyncio.run(watch(sys.argv[1], int(sys.argv[2])))

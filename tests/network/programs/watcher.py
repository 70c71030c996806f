"""A node that watches a session, says all that it holds, and does what it is told: what a viewer or an editor far away would see.

    python watcher.py ENDPOINT[,ENDPOINT...]

It says, one a line, with its own clock [s] in front:
    begun                        all is loaded
    joined EPOCH NODE            the handshake is done
    scene COUNT                  the whole scene is there for the first time
    link 0|1 EPOCH               the host went, or is back
    state EPOCH TICK HASH SUM AGE   a state frame that it now shows; SUM: a checksum of all that it holds of it; AGE [s]
    mirror EPOCH SEQUENCE SUM    the scene as it now holds it, after a change
    reply WORD accepted|refused  to a line of its input
    failed SENTENCE              and it ends

It hears `rename OLD NEW`, `paint ENTITY R G B`, `play`, `pause`, `end`.
"""

from __future__ import annotations

import asyncio
import os
import shlex
import sys
import time
import zlib

from elys.bus import topics
from elys.bus.discovery import join_session
from elys.bus.following import follow_scene, follow_state
from elys.bus.messages.commands import Command, CommandRequest, Rename, SetComponent, SetPlaying
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.bus.session import Session
from elys.common.errors import ElysError

MOVING = ("Transform", "RigidBody")


def say(*words: object) -> None:
    print(f"{time.monotonic():.6f}", *words, flush=True)


def frame_sum(frame: StateFrame) -> int:
    """Of where all bodies are and how they move."""
    total = 0
    for column in ("position", "rotation", "linear_velocity", "angular_velocity", "entity"):
        total = zlib.crc32(getattr(frame, column).tobytes(), total)
    return total


def scene_sum(mirror: SceneMirror) -> int:
    """Of all entities: names, tree and components, but for those that time moves and states tell."""
    total = 0
    for entity in mirror.in_order():
        standing = sorted((name, repr(value)) for name, value in entity.components.items() if name not in MOVING)
        told = (entity.id, entity.name, entity.parent, entity.enabled, standing)
        total = zlib.crc32(repr(told).encode(), total)
    return total


class Watcher:
    """Tells what comes."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.mirror = SceneMirror()
        session.on_link(lambda connected: say("link", int(connected), session.epoch))

    async def follow(self) -> None:
        await follow_scene(self.session, self.mirror, self._scene)
        say("scene", len(self.mirror.entities))
        follow_state(self.session, self.mirror, self._state)

    def _state(self, frame: StateFrame) -> None:
        age = (time.time_ns() - frame.published_at) * 1e-9  # all machines of the laboratory have one clock
        say("state", frame.epoch, frame.tick, f"{frame.state_hash:016x}", frame_sum(frame), f"{age:.4f}")

    def _scene(self, _: MirrorUpdate) -> None:
        say("mirror", self.mirror.epoch, self.mirror.sequence, scene_sum(self.mirror))

    def _entity(self, name: str) -> int:
        return next(entity.id for entity in self.mirror.entities.values() if entity.name == name)

    async def obey(self, words: list[str]) -> None:
        command: Command
        match words:
            case ["rename", old, new]:
                command = Rename(entity=self._entity(old), name=new)
            case ["paint", name, *color]:
                values = {"base_color": [float(part) for part in color]}
                command = SetComponent(entity=self._entity(name), component="Material", values=values)
            case ["play"] | ["pause"]:
                command = SetPlaying(playing=words[0] == "play")
            case _:
                raise SystemExit(f"watcher.py does not know {words}")
        try:
            request = CommandRequest(origin="watcher", command=command)
            reply = await self.session.request(topics.COMMAND, request, timeout=10.0)
            say("reply", words[0], "accepted" if reply.accepted else f"refused {reply.reason}")
        except ElysError as error:
            say("reply", words[0], f"refused {error}")


async def watch(endpoint: str) -> None:
    say("begun")
    session = await join_session(endpoint, kind="tool", timeout=30.0)
    say("joined", session.epoch, session.node.id)
    watcher = Watcher(session)
    loop = asyncio.get_running_loop()
    lines: asyncio.Queue[str] = asyncio.Queue()
    loop.add_reader(sys.stdin, lambda: lines.put_nowait(sys.stdin.readline()))
    following = asyncio.create_task(watcher.follow())
    while (line := await lines.get()).strip() not in ("", "end"):
        await watcher.obey(shlex.split(line))
    following.cancel()
    await session.close()


if __name__ == "__main__":
    os.environ["ELYS_STATES"] = "full"  # a stream is told as exactly as a link carries; here every bit is compared
    try:
        asyncio.run(watch(sys.argv[1]))
    except ElysError as error:
        say("failed", error)
        sys.exit(1)

"""What process tests do as one more node of a session: join, follow, ask."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable

from elys.bus import topics
from elys.bus.discovery import join_session
from elys.bus.following import follow_scene, follow_state
from elys.bus.messages.commands import Command, CommandReply, CommandRequest
from elys.bus.messages.session import SessionStatus
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.bus.session import Session


class Client:
    """A joined node with a mirror of the scene, all frames that it saw and the newest status."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.mirror = SceneMirror()
        self.frames: list[StateFrame] = []
        self.status: SessionStatus | None = None

    async def follow(self) -> None:
        self.session.subscribe(topics.STATUS, lambda status, _: setattr(self, "status", status))
        await follow_scene(self.session, self.mirror)
        follow_state(self.session, self.mirror, self.frames.append)

    async def ask(self, command: Command) -> CommandReply:
        return await self.session.request(topics.COMMAND, CommandRequest(origin="test", command=command), timeout=10)

    def entity(self, name: str) -> int:
        return next(entity.id for entity in self.mirror.entities.values() if entity.name == name)

    async def until(self, condition: Callable[[], bool], *, seconds: float = 20.0) -> None:
        """Waits for a condition on what the bus tells."""
        async with asyncio.timeout(seconds):
            while not condition():
                await asyncio.sleep(0.005)


@contextlib.asynccontextmanager
async def client(endpoint: str, *, kind: str = "tool") -> AsyncIterator[Client]:
    """A client in the session at an endpoint, following it."""
    session = await join_session(endpoint, kind=kind, timeout=20)
    try:
        joined = Client(session)
        await joined.follow()
        yield joined
    finally:
        await session.close()

"""What waits to be sent to one browser: of news the newest of each kind, answers and pictures in order.

A browser that reads slowly has the newest waiting for it and never the history; one that reads nothing at all is let go.
"""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Any, Final, Protocol

import msgspec

from elys.common.errors import ConnectionLost

MOST_ANSWERS: Final = 200  # that may wait
PATIENCE: Final = 20.0  # [s] for one message to leave


class Socket(Protocol):
    """The part of a WebSocket that sends; each waits while the way is full."""

    async def send_str(self, data: str) -> None: ...
    async def send_bytes(self, data: bytes) -> None: ...


class Outbox:
    """Messages for one browser. `run` sends them."""

    def __init__(self) -> None:
        self._news: dict[str, Any] = {}
        self._answers: deque[Any] = deque()
        self._wake = asyncio.Event()
        self._is_full = False

    def tell(self, kind: str, /, **content: Any) -> None:
        """News: replaces what waits of its kind."""
        self._news[kind] = {"type": kind, **content}
        self._wake.set()

    def answer(self, kind: str, /, **content: Any) -> None:
        """What comes once, and after what was said before it."""
        self._put({"type": kind, **content})

    def put_picture(self, about: dict[str, Any], picture: bytes) -> None:
        """A picture with what is known of it: u32 length, little-endian, of a JSON object, that object, then the picture."""
        head = msgspec.json.encode(about)
        self._put(len(head).to_bytes(4, "little") + head + picture)

    def _put(self, message: Any) -> None:
        if len(self._answers) < MOST_ANSWERS:
            self._answers.append(message)
        else:
            self._is_full = True  # `run` lets it go: who asks in a task of its own could not
        self._wake.set()

    async def run(self, socket: Socket) -> None:
        """Sends until cancelled. Raises ConnectionLost, or ConnectionError, when the browser is gone or takes nothing."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._news or self._answers:
                if self._is_full:
                    raise ConnectionLost("this browser asks and does not listen")
                if self._answers:
                    message = self._answers.popleft()
                else:
                    message = self._news.pop(next(iter(self._news)))
                try:
                    async with asyncio.timeout(PATIENCE):
                        await self._send(socket, message)
                except TimeoutError:
                    raise ConnectionLost(f"this browser has taken nothing for {PATIENCE:g} s") from None

    async def _send(self, socket: Socket, message: Any) -> None:
        if isinstance(message, bytes):
            await socket.send_bytes(message)
        else:
            await socket.send_str(msgspec.json.encode(message).decode())

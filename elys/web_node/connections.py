"""How many connections there may be, of one address and of all: who opens more is cut off, and nobody else.

So is who opens one and asks nothing, or a letter at a time: aiohttp would wait for ever.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable
from typing import Any, Final, cast

from elys.web_node.doors import is_loopback

MOST: Final = 400
HEADER_PATIENCE: Final = 10.0  # [s] for the first question to be told
MOST_OF_AN_ADDRESS: Final = 60  # a browser opens six at most, and as many may sit behind one


def limited(factory: Callable[[], Any]) -> Callable[[], asyncio.BaseProtocol]:
    """A factory of the same protocols, that lets in only so many connections."""
    count: Counter[str] = Counter()

    def make() -> asyncio.BaseProtocol:
        return _Counted(factory(), count)

    return make


class _Counted(asyncio.Protocol):
    """Hands everything on to a protocol that does the work, unless there are too many already."""

    def __init__(self, inner: Any, count: Counter[str]) -> None:
        self._inner = inner
        self._count = count
        self._address: str | None = None  # that it is counted under
        self._patience: asyncio.TimerHandle | None = None  # until the first question has come
        self._tail = b""  # of what has come of it

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Counts, and hands on or cuts off."""
        address = str((transport.get_extra_info("peername") or ("",))[0])
        # All that come through a tunnel, or from this machine, have one address: they are bounded together.
        most = MOST if is_loopback(address) else MOST_OF_AN_ADDRESS
        if self._count.total() >= MOST or self._count[address] >= most:
            cast(asyncio.Transport, transport).abort()
            return
        self._address = address
        self._count[address] += 1
        abort = cast(asyncio.Transport, transport).abort
        self._patience = asyncio.get_running_loop().call_later(HEADER_PATIENCE, abort)
        self._inner.connection_made(transport)

    def connection_lost(self, error: Exception | None) -> None:
        """Counts one fewer."""
        if self._address is None:
            return
        self._count[self._address] -= 1
        if not self._count[self._address]:
            del self._count[self._address]
        self._stop_waiting()
        self._inner.connection_lost(error)

    def data_received(self, data: bytes) -> None:
        """Hands on."""
        if self._address is None:
            return
        if self._patience is not None:
            self._tail += data
            if b"\r\n\r\n" in self._tail:
                self._stop_waiting()
            self._tail = self._tail[-3:]
        self._inner.data_received(data)

    def _stop_waiting(self) -> None:
        if self._patience is not None:
            self._patience.cancel()
            self._patience = None

    def eof_received(self) -> bool | None:
        """Hands on."""
        return cast("bool | None", self._inner.eof_received()) if self._address is not None else None

    def pause_writing(self) -> None:
        """Hands on."""
        self._inner.pause_writing()

    def resume_writing(self) -> None:
        """Hands on."""
        self._inner.resume_writing()

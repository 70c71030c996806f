"""Exact states for a recorder from outside: asked of the host at the start, rarely later, and where nothing else tells enough."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import Any, Final

import msgspec
import zstandard

from elys.bus import topics
from elys.bus.exact_keeping import ExactNeed
from elys.bus.messages.exact_state import EXACT_HEADER, ExactHead, ExactReply, ExactRequest, unpack_head
from elys.bus.messages.state_frame import HEADER
from elys.bus.session import Session
from elys.bus.topics import Topic
from elys.common.errors import BusError, MessageError

MOST: Final = 1 << 30  # [bytes] of a state unpacked
_RETRY: Final = 0.5  # [s]
_TIMEOUT: Final = 30.0  # [s]
_log = logging.getLogger(__name__)


class _Told(msgspec.Struct):
    """What of a command's record says that an exact state is needed."""

    beat: int = -1
    forked_from: int = -1
    physics_of: int = -1
    is_broken: bool = False


_records: Final = msgspec.json.Decoder(_Told)


class ExactAsking:
    """`keep` gets each state, head included, and the facts of the build that made it."""

    def __init__(self, session: Session, keep: Callable[[bytes, dict[str, str]], None]) -> None:
        self._session = session
        self._keep = keep
        self._need = ExactNeed()
        self._size = 0
        self._last: ExactHead | None = None
        self._asked: asyncio.Queue[ExactRequest] = asyncio.Queue()
        self._is_regular = False  # whether one is under way because it is time for one
        self._said = ""
        self._asked.put_nowait(ExactRequest())

    def ask_anew(self) -> None:
        """Another run of the host may be there."""
        self._need.is_urgent = True
        self._asked.put_nowait(ExactRequest())

    def heard(self, topic: Topic[Any], body: bytes) -> None:
        """Looks at a message that is recorded."""
        self._need.said(len(body))
        if topic is topics.COMMANDS:
            self._heard_command(body)
        elif topic is topics.STATE and self._last is not None and not self._is_regular and len(body) >= HEADER.size:
            _, _, time, _, _, state_hash, *_ = HEADER.unpack_from(body)
            if state_hash != self._last.state_hash and self._need.is_pressing(time, self._size):
                self._is_regular = True
                self._asked.put_nowait(ExactRequest(instant=self._last.instant + 1, newest=True))

    async def run(self) -> None:
        """Asks, until cancelled."""
        while True:
            request = await self._asked.get()
            try:
                reply = await self._session.request(topics.EXACT, request, timeout=_TIMEOUT)
                state = _unpacked(reply)
                head = unpack_head(state)
            except BusError as error:
                if str(error) != self._said:
                    self._said = str(error)
                    _log.debug("no exact state now, asking again: %s", error)
                await asyncio.sleep(_RETRY)
                self._asked.put_nowait(request)
                continue
            self._is_regular = self._is_regular and not request.newest
            self._take(head, state, reply.build)

    def _take(self, head: ExactHead, state: bytes, build: dict[str, str]) -> None:
        last = self._last
        if last is not None and (head.epoch, head.fork, head.instant) == (last.epoch, last.fork, last.instant):
            return
        self._need.taken(head)
        self._last, self._size = head, len(state)
        self._keep(state, build)

    def _heard_command(self, body: bytes) -> None:
        try:
            told = _records.decode(body)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return
        if told.physics_of >= 0 or told.is_broken:
            self._asked.put_nowait(ExactRequest(instant=told.beat))
        elif 0 <= told.forked_from < self._need.oldest:
            self._asked.put_nowait(ExactRequest())


def _unpacked(reply: ExactReply) -> bytes:
    if not EXACT_HEADER.size <= reply.size <= MOST:
        raise MessageError(f"an exact state claims to have {reply.size} bytes")
    try:
        return zstandard.ZstdDecompressor().decompress(reply.packed, max_output_size=reply.size)
    except zstandard.ZstdError as error:
        raise MessageError(f"an exact state is damaged: {error}") from error

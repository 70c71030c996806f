"""What a viewer knows of the host, and the one thing that it asks of it: to play or to pause."""

from __future__ import annotations

import logging
import time
from typing import Final

from elys.bus import topics
from elys.bus.messages.commands import CommandRequest, SetPlaying
from elys.bus.messages.session import SessionStatus
from elys.bus.session import Session
from elys.common.errors import BusError

SILENCE: Final = 1.5  # [s] without a status, of which four come a second, after which the host counts as hung
_log = logging.getLogger(__name__)


class PlayControl:
    """Follows the host's status."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self.status: SessionStatus | None = None
        self._heard_at = time.monotonic()
        session.subscribe(topics.STATUS, self._heard)

    @property
    def is_playing(self) -> bool:
        """Whether time goes on, as far as is known."""
        return self.status is None or self.status.playing

    def is_lost(self, silence: float = SILENCE) -> bool:
        """Whether the host is gone, or has said nothing for `silence` [s]."""
        return not self._session.connected or time.monotonic() - self._heard_at > silence

    def toggle(self) -> None:
        """Asks to pause what plays, and to play what is paused."""
        self._session.start(self._ask(not self.is_playing))

    def _heard(self, status: SessionStatus, _: str) -> None:
        self.status, self._heard_at = status, time.monotonic()

    async def _ask(self, playing: bool) -> None:
        what = "play" if playing else "pause"
        request = CommandRequest(origin=self._session.node.id, command=SetPlaying(playing=playing))
        try:
            reply = await self._session.request(topics.COMMAND, request)
        except BusError as error:
            _log.warning("could not %s: %s", what, error)
            return
        if not reply.accepted:
            _log.warning("could not %s: %s", what, reply.reason)

"""The ghosts of a session as the editor lists them: recorded runs that are seen beside it, whoever serves them."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Final

from elys.bus import topics
from elys.bus.ghost_following import SILENCE
from elys.bus.messages.ghosts import GHOST_COLORS, Color, Ghost, GhostChange
from elys.bus.session import Session
from elys.common.errors import BusError
from elys.editor_node.language import tr

TIMEOUT: Final = 5.0  # [s]


class GhostList:
    """`all` are those that were heard of lately, the oldest first. What one refuses is a sentence for `say`."""

    def __init__(
        self,
        session: Session,
        *,
        say: Callable[[str], None],
        request_redraw: Callable[[float], None] = lambda within: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._session, self._say, self._request_redraw, self._clock = session, say, request_redraw, clock
        self._heard: dict[str, tuple[Ghost, float]] = {}
        session.subscribe(topics.GHOST, self._take)
        session.on_link(self._link_changed)

    @property
    def all(self) -> tuple[Ghost, ...]:
        """Those there are."""
        now = self._clock()
        self._heard = {key: told for key, told in self._heard.items() if now - told[1] <= SILENCE}
        return tuple(ghost for ghost, _ in self._heard.values())

    @property
    def next_color(self) -> Color:
        """One that no ghost has yet, as long as there are any."""
        taken = {ghost.color for ghost in self.all}
        free = [color for color in GHOST_COLORS if color not in taken]
        return free[0] if free else GHOST_COLORS[len(taken) % len(GHOST_COLORS)]

    def recolor(self, ghost: Ghost, color: Color) -> None:
        """Tints it."""
        self._ask(ghost, GhostChange(color=color))

    def begin_at(self, ghost: Ghost, now: float) -> None:
        """Lets its run begin at a time [s] of the session."""
        self._ask(ghost, GhostChange(offset=ghost.start_time - now))

    def run_along(self, ghost: Ghost) -> None:
        """Shows it at the session's own times."""
        self._ask(ghost, GhostChange(offset=0.0))

    def remove(self, ghost: Ghost) -> None:
        """Takes it away, for all who see it."""
        self._ask(ghost, GhostChange(is_removed=True))

    def _ask(self, ghost: Ghost, change: GhostChange) -> asyncio.Task[None]:
        async def ask() -> None:
            try:
                told = await self._session.request(topics.GHOST_CHANGE, change, key=ghost.ghost, timeout=TIMEOUT)
            except BusError as error:
                self._say(tr("{name} cannot be changed: {reason}", name=ghost.title, reason=str(error)))
                return
            if change.is_removed:
                self._heard.pop(ghost.ghost, None)
            else:
                self._heard[ghost.ghost] = (told, self._clock())
            self._request_redraw(0.0)

        return self._session.start(ask())

    def _take(self, told: Ghost, key: str) -> None:
        if told.ghost != key:
            return
        known = self._heard.get(key)
        if told.is_gone:
            self._heard.pop(key, None)
        else:
            self._heard[key] = (told, self._clock())
        if told.is_gone or known is None or known[0] != told:
            self._request_redraw(0.0)

    def _link_changed(self, connected: bool) -> None:
        if not connected:
            self._heard.clear()

"""The session as all browsers see it: one mirror of the scene, one status, and who is told when they change."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Final

import msgspec

from elys.bus import topics
from elys.bus.following import follow_scene, follow_state
from elys.bus.messages.session import SessionStatus
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.bus.session import Node, Session
from elys.common.errors import ConnectionLost

if TYPE_CHECKING:
    from elys.web_node.browser import Browser

MOST_PLAYERS: Final = 16  # as many as a simulation tells apart


class LiveSession:
    """Follows a session for the browsers that are here."""

    def __init__(self, session: Session, *, most_browsers: int) -> None:
        self.session = session
        self.mirror = SceneMirror()
        self.status: SessionStatus | None = None
        self.browsers: dict[int, Browser] = {}  # by slot
        self.has_scene = asyncio.Event()
        self._most = most_browsers
        session.subscribe(topics.STATUS, self._status_came)
        session.on_link(self._link_changed)
        session.on_nodes(self._nodes_changed)
        # Always, and not only while somebody looks: of a session that was paused since, nobody says again where bodies are.
        follow_state(session, self.mirror, self._state_came)
        session.start(self._follow())

    # --- who is here ---------------------------------------------------------------------------------------------------

    def free_slot(self) -> int:
        """A place for one more browser. Raises ConnectionLost where there is none."""
        slot = next((number for number in range(1, self._most + 1) if number not in self.browsers), 0)
        if not slot:
            raise ConnectionLost(f"{self._most} browsers look at this session already")
        return slot

    def add(self, browser: Browser) -> None:
        """One more; it is told how things stand."""
        self.browsers[browser.slot] = browser
        self._tell_link(browser)
        self._tell_status(browser)

    def remove(self, browser: Browser) -> None:
        """One fewer."""
        self.browsers.pop(browser.slot, None)

    def free_player(self, browser: Browser) -> int:
        """The player as whom a browser plays: every one is another, as long as there are any left."""
        taken = {other.plays_as for other in self.browsers.values() if other is not browser}
        return next((number for number in range(1, MOST_PLAYERS + 1) if number not in taken), MOST_PLAYERS)

    @property
    def has_renderer(self) -> bool:
        """Whether anybody draws."""
        return bool(self.session.nodes_of("render"))

    # --- what changes --------------------------------------------------------------------------------------------------

    async def _follow(self) -> None:
        await follow_scene(self.session, self.mirror)
        self.has_scene.set()

    def _state_came(self, _: StateFrame) -> None:
        for browser in self.browsers.values():
            browser.inspection.moved()

    def _status_came(self, status: SessionStatus, _: str) -> None:
        self.status = status
        for browser in self.browsers.values():
            self._tell_status(browser)

    def _link_changed(self, connected: bool) -> None:
        for browser in self.browsers.values():
            if connected:
                browser.forget_author()
            browser.pictures.refresh()
            self._tell_link(browser)

    def _nodes_changed(self, node: Node, alive: bool) -> None:
        if node.kind == "render":
            for browser in self.browsers.values():
                browser.pictures.tend()
                self._tell_link(browser)

    def _tell_status(self, browser: Browser) -> None:
        if self.status is not None:
            browser.outbox.tell("status", **msgspec.structs.asdict(self.status))

    def _tell_link(self, browser: Browser) -> None:
        browser.outbox.tell("link", connected=self.session.connected, renderer=self.has_renderer)

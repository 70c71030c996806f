"""Which session the editor is attached to, and how it comes to another: by endpoint, found on this machine, or started for it."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
from typing import Final, Protocol

from elys.bus.access.credentials import Credentials
from elys.bus.beacon import FoundSession, look_around
from elys.bus.discovery import SessionRecord, complete_place, find_sessions, join_session
from elys.bus.log import SessionLogHandler, log_to_session
from elys.bus.messages.ghosts import Color
from elys.bus.session import Session
from elys.common.errors import BusError, ElysError
from elys.editor_node.host_keys import HostKeys
from elys.editor_node.language import tr
from elys.editor_node.preferences import Preferences, remember
from elys.editor_node.seat import Seat

JOIN_TIMEOUT: Final = 5.0  # [s]
LOOK_INTERVAL: Final = 1.0  # [s] between two looks for sessions, while somebody wants to see them
RENDERER_PATIENCE: Final = 0.5  # [s] for a render node to show itself, before one is started
_log = logging.getLogger(__name__)

Join = Callable[[str], Awaitable[Session]]


class Openers(Protocol):
    """What takes other nodes, and so is given to the editor by whoever started it."""

    @property
    def samples(self) -> tuple[tuple[str, str], ...]:
        """Scenes that can always be opened: name and title."""

    async def simulate(self, scene: str) -> str:
        """Starts a simulation of a scene file or a sample; its endpoint. ElysError says why not."""

    async def play(self, recording: str) -> str:
        """Starts a player of a recording; its endpoint. ElysError says why not."""

    async def fork(self, recording: str, time: float, record: str) -> str:
        """Starts a simulation that goes on from a time [s] of a recording, recorded to `record` unless that is empty; its
        endpoint. ElysError says why not.
        """

    async def show_ghost(self, recording: str, endpoint: str, color: Color, starts_now: bool) -> None:
        """Starts what shows a recording as ghost in the session at an endpoint. ElysError says why not."""

    async def draw(self, endpoint: str) -> None:
        """Starts a render node for the session at an endpoint. ElysError says why not."""

    def show(self, endpoint: str, credentials: Credentials | None) -> None:
        """What is started for the session at an endpoint shows these from now on; None: what this process would."""


class Attachments:
    """Connecting never blocks: it is done beside the frames, `doing` says what, and `error` what came of it."""

    def __init__(
        self,
        seat: Seat,
        preferences: Preferences,
        *,
        openers: Openers | None = None,
        join: Join | None = None,
        on_change: Callable[[], None] = lambda: None,
        on_leave: Callable[[], None] = lambda: None,
        on_failure: Callable[[str], None] = lambda reason: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`on_leave` is called before a session is left for good, `on_failure` with why something beside it failed."""
        self.seat = seat
        self.openers = openers
        self.doing = ""  # what is under way, for the person to read
        self.doing_beside = ""  # likewise, of what leaves the session as it is
        self.error = ""  # why the last wish was not fulfilled
        self.forked_from = ""  # endpoint of the replay of which the session is a fork, begun here
        # The place: with the session's name, where several are behind one endpoint and it was chosen by name.
        self.endpoint = (seat.session.place or seat.transport.endpoint) if seat.session is not None else ""
        self.sessions: tuple[SessionRecord, ...] = ()  # that run on this machine, as far as somebody looks
        self.nearby: tuple[FoundSession, ...] | None = None  # of the local network, once somebody asked
        self._asking: asyncio.Task[None] | None = None
        self._preferences = preferences
        self.keys = HostKeys()
        self._join = join or (
            lambda endpoint: join_session(
                endpoint, kind=seat.node.kind, node=seat.node, credentials=self.keys.of(endpoint)
            )
        )
        self._on_change = on_change
        self._on_leave = on_leave
        self._on_failure = on_failure
        self._clock = clock
        self._work: asyncio.Task[None] | None = None
        self._looking: asyncio.Task[None] | None = None
        self._looked_at = -LOOK_INTERVAL
        self._lost_at: float | None = None
        self._own: Session | None = None  # joined here, and so to be closed here
        self._leaving: set[asyncio.Task[None]] = set()
        self._log_handler: SessionLogHandler | None = None
        seat.on_link(self._link_changed)

    # --- what is so ------------------------------------------------------------------------------------------------

    @property
    def is_attached(self) -> bool:
        """Whether there is a session, be it that its host is gone for the moment."""
        return self.seat.session is not None

    @property
    def lost_for(self) -> float | None:
        """How long [s] the host of the session has been gone; None while it is there."""
        return self._clock() - self._lost_at if self._lost_at is not None and self.is_attached else None

    @property
    def is_busy(self) -> bool:
        """Whether something is under way."""
        return self._work is not None and not self._work.done()

    def look(self) -> None:
        """Keeps `sessions` up to date while nothing is attached, else for a while. Call it each frame in which they are shown."""
        self._looked_at = self._clock()
        if self._looking is None or self._looking.done():
            self._looking = self.seat.start(self._look())

    @property
    def is_looking_around(self) -> bool:
        """Whether the local network is being asked."""
        return self._asking is not None and not self._asking.done()

    def look_around(self) -> None:
        """Asks the local network once for sessions that answer; `nearby` says what was found."""
        if not self.is_looking_around:
            self._asking = self.seat.start(self._look_around())

    # --- what can be wished for ------------------------------------------------------------------------------------

    def connect(self, text: str, *, key: str | None = None) -> None:
        """Attaches to the session at an endpoint, as a person writes one; shows it `key` from now on, or with "" what is shown
        everywhere.
        """
        try:
            endpoint = complete_place(text.strip())
            if key is not None:
                self.keys.choose(endpoint, key)
        except BusError as error:
            self._refuse(str(error))
            return
        self._begin(tr("Connecting to {endpoint}", endpoint=endpoint), self._connect(endpoint))

    def open_scene(self, scene: str) -> None:
        """Starts a simulation of a scene file or a sample, and attaches to it."""
        self._open(
            tr("Starting a simulation of {name}", name=scene), scene, "simulate", self._preferences.recent_scenes
        )

    def open_recording(self, recording: str) -> None:
        """Starts a player of a recording, and attaches to it."""
        self._open(tr("Opening {name}", name=recording), recording, "play", self._preferences.recent_recordings)

    def fork(self, recording: str, time: float, *, record: str = "") -> None:
        """Starts a simulation that goes on from a time [s] of the recording that is attached to, and attaches to it."""
        openers = self._openers_or_refusal()
        if openers is None:
            return
        replay = self.endpoint

        async def work() -> None:
            await self._connect(await openers.fork(recording, time, record), forked_from=replay)

        self._begin(tr("Going on from {time} s", time=f"{time:.3f}"), work())

    def back_to_recording(self) -> None:
        """Leaves a fork, which goes on, and attaches to the replay of which it is one."""
        if self.forked_from:
            self._begin(tr("Connecting to {endpoint}", endpoint=self.forked_from), self._connect(self.forked_from))

    def show_ghost(self, recording: str, *, color: Color, starts_now: bool = False) -> None:
        """Starts what shows a recording beside the session, for all who see it."""
        openers = self._openers_or_refusal()
        if openers is None or not self.is_attached:
            return

        async def work() -> None:
            try:
                await openers.show_ghost(recording, self.endpoint, color, starts_now)
                remember(self._preferences.recent_recordings, recording)
            except ElysError as error:
                self.error = str(error)
                self._on_failure(self.error)
            finally:
                self.doing_beside = ""
                self._on_change()

        self.doing_beside, self.error = tr("Opening {name}", name=recording), ""
        self.seat.start(work())
        self._on_change()

    def retry(self) -> None:
        """Knocks anew at the endpoint of the session whose host is gone; attaches to whoever answers there."""
        self._begin(tr("Connecting to {endpoint}", endpoint=self.endpoint), self._connect(self.endpoint))

    def detach(self) -> None:
        """Leaves the session, which goes on without the editor."""
        self.cancel()
        self.error = ""
        if self.is_attached:
            self._on_leave()
            self._let_go()
        self._on_change()

    def cancel(self) -> None:
        """Gives up what is under way."""
        if self._work is not None:
            self._work.cancel()
        self._work, self.doing = None, ""
        self._on_change()

    async def close(self) -> None:
        """Leaves for good, before the editor ends."""
        self.cancel()
        if self.is_attached:
            self._on_leave()
        own, self._own = self._own, None
        if self._log_handler is not None:
            self._log_handler.detach()
        await asyncio.gather(*self._leaving)
        await self.seat.close()
        if own is not None:
            await own.close()

    # --- inside ----------------------------------------------------------------------------------------------------

    def _open(self, doing: str, name: str, how: str, recent: list[str]) -> None:
        openers = self._openers_or_refusal()
        if openers is None:
            return
        opener: Callable[[str], Awaitable[str]] = getattr(openers, how)

        async def work() -> None:
            await self._connect(await opener(name))
            remember(recent, name)

        self._begin(doing, work())

    def _openers_or_refusal(self) -> Openers | None:
        if self.openers is None:
            self._refuse(tr("this editor cannot start other processes: start one with `elys run` and connect to it"))
        return self.openers

    def _begin(self, doing: str, work: Awaitable[None]) -> None:
        self.cancel()
        self.doing, self.error = doing, ""
        self._work = self.seat.start(self._told(work))
        self._on_change()

    async def _told(self, work: Awaitable[None]) -> None:
        me = asyncio.current_task()
        try:
            await work
        except ElysError as error:
            self.error = str(error)
            _log.info("%s", error)
        finally:
            if self._work is me:
                self.doing = ""
            self._on_change()

    def _refuse(self, reason: str) -> None:
        self.error = reason
        self._on_change()

    async def _connect(self, endpoint: str, *, forked_from: str = "") -> None:
        session = await self._join(endpoint)
        if self.openers is not None:
            self.openers.show(endpoint, self.keys.of(endpoint))
        if self.is_attached:
            self._on_leave()
            self._let_go()
        self._own, self.endpoint, self.forked_from = session, endpoint, forked_from
        self._log_handler = log_to_session(session)
        self.seat.attach(session)
        remember(self._preferences.recent_endpoints, endpoint)
        self._on_change()
        if self.openers is not None:
            await asyncio.sleep(RENDERER_PATIENCE)
            if self.seat.session is session and not session.nodes_of("render"):
                await self.openers.draw(endpoint)

    def _let_go(self) -> None:
        self.seat.detach()
        self._lost_at = None
        own, self._own = self._own, None
        if self._log_handler is not None:
            self._log_handler.detach()
            self._log_handler = None
        if own is not None:  # who was given a session closes it himself
            leaving = self.seat.start(own.close())
            self._leaving.add(leaving)
            leaving.add_done_callback(self._leaving.discard)

    async def _look(self) -> None:
        while not self.is_attached or self._clock() - self._looked_at < 3.0 * LOOK_INTERVAL:
            found = tuple(await asyncio.to_thread(find_sessions))
            if found != self.sessions:
                self.sessions = found
                self._on_change()
            await asyncio.sleep(LOOK_INTERVAL)

    async def _look_around(self) -> None:
        try:
            self.nearby = tuple(await look_around())
        except BusError as error:
            self._refuse(str(error))
        self._on_change()

    def _link_changed(self, connected: bool) -> None:
        self._lost_at = None if connected else self._clock()
        if connected:
            self.error = ""
        self._on_change()

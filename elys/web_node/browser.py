"""One browser: what it says is done as far as its role may, and it is told what it has in sight."""

from __future__ import annotations

import asyncio
import logging
import time
from typing import Any, Final

from aiohttp import WSCloseCode, WSMsgType, web

import elys
from elys.bus import topics
from elys.bus.access.roles import Role
from elys.bus.input_sender import InputSender
from elys.bus.messages.commands import CommandRequest, Time, role_for
from elys.bus.messages.history import HistoryRequest
from elys.bus.messages.views import PickRequest, ViewFrame
from elys.common.errors import BusError, ConnectionLost, MessageError
from elys.web_node.inspection import Inspection, declared
from elys.web_node.live_session import LiveSession
from elys.web_node.outbox import Outbox
from elys.web_node.picture_stream import PictureStream
from elys.web_node.requests import (
    Ask,
    Inspect,
    Keys,
    Look,
    Open,
    Pick,
    Ping,
    Request,
    Reveal,
    Rows,
    Shown,
    closing_reason,
    request_from,
)
from elys.web_node.tree_window import TreeWindow

TEND_INTERVAL: Final = 0.5  # [s]
MOST_A_SECOND: Final = 300.0  # messages, and twice as many at once
MOST_UNDER_WAY: Final = 32  # questions that wait for an answer from the bus
PICK_TIMEOUT: Final = 2.0  # [s]
_FORBIDDEN: Final = "this takes the role {needed}; yours is {role}"
_log = logging.getLogger(__name__)


class Browser:
    """A connection and what it has in sight. `slot` is its number among those that are here, from 1 on."""

    def __init__(self, live: LiveSession, *, role: Role, slot: int, most_a_second: float, bit_rate: float) -> None:
        self._live = live
        self.role = role
        self.slot = slot
        self.name = f"{slot}-{live.session.node.id}"
        self.outbox = Outbox()
        self.tree = TreeWindow(live.mirror, self.outbox.tell)
        self.inspection = Inspection(live.mirror, self.outbox.tell)
        self.pictures = PictureStream(
            live.session,
            name=self.name,
            on_picture=self._picture_came,
            most_a_second=most_a_second,
            bit_rate=bit_rate,
        )
        self._player: InputSender | None = None
        self.plays_as = 0  # the number of the player that keys from here are of; 0 for who has not played
        self._author: str | None = None
        self._asking: set[asyncio.Task[None]] = set()
        self._bucket = _Bucket(MOST_A_SECOND)

    async def serve(self, socket: web.WebSocketResponse) -> None:
        """Until the browser is gone, or has said what cannot be said."""
        works = [self.outbox.run(socket), self.tree.run(), self.inspection.run(), self._tend(), self._read(socket)]
        tasks = [asyncio.ensure_future(work) for work in works]
        self.outbox.answer(
            "welcome",
            role=self.role.title,
            session=self._live.session.name,
            version=elys.__version__,
            components=declared(),
        )
        self._live.add(self)
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                await self._close(socket, task.exception())
        finally:
            self._live.remove(self)
            self._leave()
            for task in (*tasks, *self._asking):
                task.cancel()
            await asyncio.gather(*tasks, *self._asking, return_exceptions=True)

    async def _close(self, socket: web.WebSocketResponse, error: BaseException | None) -> None:
        if isinstance(error, MessageError):
            _log.info("browser %s is let go: %s", self.name, error)
            await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=closing_reason(str(error)).encode())
        elif isinstance(error, ConnectionLost):
            _log.info("browser %s is let go: %s", self.name, error)
            await socket.close(code=WSCloseCode.TRY_AGAIN_LATER, message=closing_reason(str(error)).encode())
        elif error is not None and not isinstance(error, ConnectionError):
            _log.error("browser %s failed", self.name, exc_info=error)
            await socket.close(code=WSCloseCode.INTERNAL_ERROR, message=b"this browser's connection failed")

    async def _read(self, socket: web.WebSocketResponse) -> None:
        """Raises MessageError for what cannot be said."""
        async for message in socket:
            if message.type is WSMsgType.TEXT:
                if not self._bucket.take():
                    raise MessageError(f"more than {MOST_A_SECOND:g} messages a second")
                self._take(request_from(message.data))
            elif message.type is WSMsgType.BINARY:
                raise MessageError("this is no request: requests are texts")

    async def _tend(self) -> None:
        while True:
            self.pictures.tend()
            await asyncio.sleep(TEND_INTERVAL)

    def _take(self, request: Request) -> None:
        match request:
            case Look():
                self.pictures.want(request)
            case Shown(picture=picture, lost=lost):
                self.pictures.shown(picture, lost=lost)
            case Rows():
                self.tree.want(request)
            case Open(entity=entity, is_open=is_open, all_below=all_below):
                self.tree.set_open(entity, is_open, all_below=all_below)
            case Reveal(entity=entity):
                self.tree.reveal(entity)
            case Inspect(entity=entity):
                self.inspection.inspect(entity)
            case Ping(time=at):
                self.outbox.answer("pong", time=at)
            case Keys():
                self._play(request)
            case Pick():
                self._start(request.id, self._pick(request))
            case Ask():
                self._ask_if_allowed(request)

    # --- pictures and picking ----------------------------------------------------------------------------------------

    def _picture_came(self, frame: ViewFrame, number: int, look: int) -> None:
        age = (time.time_ns() - frame.state_published_at) * 1e-6 if frame.state_published_at else -1.0
        about: dict[str, Any] = {
            "picture": number,
            "look": look,
            "tick": frame.tick,
            "age": round(age, 1),  # [ms] when it was sent from here
            "width": frame.width,
            "height": frame.height,
            "camera": frame.camera,
            "encoding": "h264" if frame.h264 else "jpeg",
            "keyframe": frame.keyframe,
            "drawing": round(frame.render_time, 1),  # [ms]
        }
        self.outbox.put_picture(about, frame.h264 or frame.jpeg)

    async def _pick(self, request: Pick) -> None:
        renderer = self.pictures.renderer
        if renderer is None:
            self._answer(request.id, reason="no render node draws this session")
            return
        question = PickRequest(
            camera=request.camera, width=request.width, height=request.height, x=request.x, y=request.y
        )
        try:
            reply = await self._live.session.request(topics.PICK, question, key=renderer.id, timeout=PICK_TIMEOUT)
        except BusError as error:
            self._answer(request.id, reason=str(error))
            return
        found = self._live.mirror.entities.get(reply.entity)
        name = found.name if found is not None else ""
        self._answer(request.id, accepted=True, entity=reply.entity, name=name, position=reply.position)

    # --- commands and input ------------------------------------------------------------------------------------------

    def _ask_if_allowed(self, request: Ask) -> None:
        needed = role_for(request.command)
        if self.role >= needed:
            self._start(request.id, self._ask(request))
        else:
            self._forbid(request.id, needed)

    async def _ask(self, request: Ask) -> None:
        command, session = request.command, self._live.session
        try:
            author = "" if isinstance(command, Time) else await self._as_author()
            question = CommandRequest(
                origin=self.name,
                command=command,
                author=author,
                label=request.label,
                stroke=request.stroke,
                made_from=request.made_from,
            )
            reply = await session.request(topics.COMMAND, question)
        except BusError as error:
            self._answer(request.id, reason=str(error))
            return
        self._answer(request.id, accepted=reply.accepted, reason=reply.reason, tick=reply.tick)

    async def _as_author(self) -> str:
        """As whom edits from here can be undone: whoever has this place next finds them, as who loads the page anew does."""
        if self._author is None:
            question = HistoryRequest(person=f"browser {self.slot}", node=self.name)
            self._author = (await self._live.session.request(topics.HISTORY, question)).author
        return self._author

    def forget_author(self) -> None:
        """Another run of the host knows nobody yet."""
        self._author = None

    def _play(self, keys: Keys) -> None:
        if self.role < Role.PLAYER:
            self._forbid(0, Role.PLAYER)
            return
        if self._player is None:
            self.plays_as = self._live.free_player(self)
            self._player = InputSender(self._live.session, player=self.plays_as)
        player = self._player
        if keys.lets_go:
            player.let_go_of_all()
        for name, is_down in keys.changes:
            (player.press if is_down else player.let_go)(name)
        for name, distance in keys.moved.items():
            player.move(name, distance)
        if keys.text:
            player.type(keys.text)
        player.send()

    # --- inside --------------------------------------------------------------------------------------------------------

    def _start(self, number: int, work: Any) -> None:
        if len(self._asking) >= MOST_UNDER_WAY:
            work.close()
            self._answer(number, reason=f"more than {MOST_UNDER_WAY} questions wait for an answer")
            return
        task = asyncio.ensure_future(work)
        self._asking.add(task)
        task.add_done_callback(self._asking.discard)

    def _answer(self, number: int, *, accepted: bool = False, **content: Any) -> None:
        self.outbox.answer("answer", id=number, accepted=accepted, **content)

    def _forbid(self, number: int, needed: Role) -> None:
        values = {"needed": needed.title, "role": self.role.title}
        self._answer(number, reason=_FORBIDDEN.format(**values), problem=_FORBIDDEN, values=values)

    def _leave(self) -> None:
        self.pictures.close()
        self.tree.close()
        self.inspection.close()
        if self._player is not None:
            self._player.let_go_of_all()
            self._player.send()


class _Bucket:
    """So much a second, and twice as much at once."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._left = 2.0 * rate
        self._at = time.monotonic()

    def take(self) -> bool:
        """Whether there is one more."""
        now = time.monotonic()
        self._left = min(self._left + (now - self._at) * self._rate, 2.0 * self._rate)
        self._at = now
        self._left -= 1.0
        return self._left >= 0.0

"""What the tests of the web node share: a session with a small host, somebody who draws, the real server, and browsers at it."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import aiohttp
import msgspec
import pytest

from elys.bus import topics
from elys.bus.access.roles import GIVEN, Role
from elys.bus.messages.views import PickReply, PickRequest, ViewCamera, ViewFrame, ViewRequest
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.scene import EntityRecord
from elys.web_node.access import Doorkeeper
from elys.web_node.node import WebOptions, serve_browsers
from tests.unit.editor_node.scene_host import SceneHost

PATIENCE = 20.0  # [s] far beyond what anything here takes; a failure, not a measure
SECRETS = {role: f"the secret of the {role.title}" for role in GIVEN}
CAMERA = ViewCamera(position=(0.0, 0.0, 5.0), rotation=(0.0, 0.0, 0.0, 1.0))
RECORDS = [
    EntityRecord(name="Table", components={"Transform": {}}),
    EntityRecord(name="Crate", parent=0, components={"Transform": {}, "RigidBody": {}, "MeshRenderer": {}}),
    EntityRecord(name="Lamp", components={"Transform": {}, "Light": {}}),
]


class Painter:
    """A render node that draws nothing: its pictures are texts of what was asked for. It answers while `is_quick`."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.asked: list[ViewRequest] = []
        self.is_quick = True
        self.number = 0  # of the next picture of a stream
        self.tick = 1
        self.picked = PickReply(entity=0)
        session.subscribe(topics.VIEW_REQUEST, self._asked, key=session.node.id)
        session.serve(topics.PICK, self._pick, key=session.node.id)

    def _asked(self, request: ViewRequest, _: str) -> None:
        self.asked.append(request)
        if self.is_quick and request.newer_than_tick < self.tick:
            self.draw(request)

    def draw(self, request: ViewRequest, **changes: Any) -> None:
        """Sends the picture of a request."""
        self.number += 1
        is_video = request.encoding == "h264"
        frame = ViewFrame(
            view=request.view,
            sequence=request.sequence,
            tick=self.tick,
            state_published_at=0,
            camera=request.camera or CAMERA,
            width=request.width,
            height=request.height,
            jpeg=b"" if is_video else b"jpeg",
            h264=b"h264" if is_video else b"",
            number=self.number,
            keyframe=request.keyframe,
        )
        self.session.publish(topics.VIEW_FRAME, msgspec.structs.replace(frame, **changes), key=request.view)

    async def _pick(self, request: PickRequest, _: str) -> PickReply:
        return self.picked


class Visitor:
    """A browser's WebSocket, and what came over it."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.socket = socket
        self.pictures: list[dict[str, Any]] = []
        self.others: list[dict[str, Any]] = []

    async def say(self, kind: str, **content: Any) -> None:
        """Sends a request."""
        await self.socket.send_str(msgspec.json.encode({"type": kind, **content}).decode())

    async def hear(self, kind: str, **wanted: Any) -> dict[str, Any]:
        """The next message of a kind with these values, of those that came or come; what came before it is passed over."""
        async with asyncio.timeout(PATIENCE):
            while True:
                while self.others:
                    message = self.others.pop(0)
                    if message["type"] == kind and all(message.get(name) == value for name, value in wanted.items()):
                        return message
                await self.next_message()

    async def picture(self) -> dict[str, Any]:
        """The next picture, as it is told of; its bytes as "data"."""
        async with asyncio.timeout(PATIENCE):
            while not self.pictures:
                await self.next_message()
        return self.pictures.pop(0)

    async def next_message(self) -> None:
        """Takes in one message; ConnectionError when there is no more."""
        message = await self.socket.receive()
        if message.type is aiohttp.WSMsgType.TEXT:
            self.others.append(msgspec.json.decode(message.data))
        elif message.type is aiohttp.WSMsgType.BINARY:
            length = int.from_bytes(message.data[:4], "little")
            self.pictures.append(
                msgspec.json.decode(message.data[4 : 4 + length]) | {"data": message.data[4 + length :]}
            )
        else:
            raise ConnectionError(f"{self.socket.close_code}: {message.extra}")

    async def ask(self, number: int, command: dict[str, Any], **about: Any) -> dict[str, Any]:
        """A command and its answer."""
        await self.say("ask", id=number, command=command, **about)
        return await self.hear("answer", id=number)

    async def last_words(self) -> tuple[int | None, str]:
        """Code and reason with which the other side ends the connection."""
        async with asyncio.timeout(PATIENCE):
            while True:
                message = await self.socket.receive()
                if message.type in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED, aiohttp.WSMsgType.CLOSING):
                    return self.socket.close_code, str(message.extra or "")


class Web:
    """A session in the web node, and those around it."""

    def __init__(self, host: SceneHost, painter: Painter, node: Session, port: int) -> None:
        self.host = host
        self.painter = painter
        self.node = node
        self.port = port
        self.url = f"http://127.0.0.1:{port}"
        self._clients = contextlib.AsyncExitStack()

    async def client(self) -> aiohttp.ClientSession:
        """Somebody with a cookie jar of its own, not known yet."""
        jar = aiohttp.CookieJar(unsafe=True)  # it keeps cookies of addresses that are numbers
        return await self._clients.enter_async_context(aiohttp.ClientSession(self.url, cookie_jar=jar))

    async def log_in(self, client: aiohttp.ClientSession, secret: str, **headers: str) -> aiohttp.ClientResponse:
        return await client.post("/login", json={"secret": secret}, headers={"Origin": self.url, **headers})

    async def visitor(self, role: Role) -> Visitor:
        """A browser that has come in."""
        client = await self.client()
        assert (await self.log_in(client, SECRETS[role])).status == 200
        return Visitor(await client.ws_connect("/ws", headers={"Origin": self.url}))

    async def close(self) -> None:
        await self._clients.aclose()


@contextlib.asynccontextmanager
async def open_web(doorkeeper: Doorkeeper | None = None, **options: Any) -> AsyncIterator[Web]:
    """Everything in one process, over a loopback and real sockets."""
    broker = LoopbackBroker()
    hosting = await Session.host(broker.listen(), name="play", kind="simulation", epoch=1)
    host = SceneHost(hosting)
    host.load(RECORDS)
    drawing = await Session.join(broker.connect(), kind="render")
    node = await Session.join(broker.connect(), kind="tool")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    ready = asyncio.Event()
    serving = asyncio.create_task(
        serve_browsers(
            node,
            doorkeeper or Doorkeeper(SECRETS),
            WebOptions(port=port, **{"most_a_second": 1000.0, **options}),
            on_ready=lambda _: ready.set(),
        )
    )
    waiting = asyncio.create_task(ready.wait())
    await asyncio.wait([waiting, serving], return_when=asyncio.FIRST_COMPLETED)
    if serving.done():
        serving.result()
    web = Web(host, Painter(drawing), node, port)
    try:
        yield web
    finally:
        await web.close()
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        for session in (node, drawing, hosting):
            await session.close()


@pytest.fixture
def on_the_web() -> Callable[..., None]:
    """Runs `await scenario(web)`; whatever a task fails with fails the test."""

    def play(scenario: Callable[[Web], Awaitable[None]], **options: Any) -> None:
        failures: list[dict[str, Any]] = []

        async def main() -> None:
            asyncio.get_running_loop().set_exception_handler(lambda _, context: failures.append(context))
            async with open_web(**options) as web:
                await scenario(web)

        asyncio.run(main())
        assert not failures, failures

    return play

"""Sessions on the local network, for those who ask: a host that was told to (`--discover`) answers whoever looks around.

    asker  --> 239.255.69.76:7445   b"ELYS?" 1 nonce(16), filled up to 1200 bytes
    host   --> asker                b"ELYS!" 1 nonce(16), JSON: [Announcement, ...], 1200 bytes at most

Nobody is told unasked, and nothing leaves the local network (time to live 1, a group of administrative scope, RFC 2365). An
answer is never longer than its question and answers are counted out, so nobody can be flooded through a host by questions that
bear his address. What comes is taken for hostile: it must bear the question's nonce, its endpoint's address is the one that it
came from, whatever it says, its texts are cut and cleaned, and of a flood only so much is read.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import secrets
import socket
import struct
import time
from collections.abc import AsyncIterator, Callable, Sequence
from typing import Annotated, Final, Literal, cast

import msgspec

from elys.bus.topics import is_chunk
from elys.common.errors import BusError

GROUP: Final = "239.255.69.76"
PORT: Final = 7445
DATAGRAM_SIZE: Final = 1200  # [bytes] passes through every network in one piece
LOOKING_TIME: Final = 1.0  # [s]
MOST_FOUND: Final = 256
MOST_FROM_ONE: Final = 32  # sessions that one address may announce
MOST_READ: Final = 2000  # datagrams that one look around reads

_QUESTION: Final = b"ELYS?\x01"
_ANSWER: Final = b"ELYS!\x01"
_NONCE_SIZE: Final = 16
_HEAD_SIZE: Final = len(_ANSWER) + _NONCE_SIZE
_TEXT_LENGTH: Final = 64
_ANSWERS_PER_SECOND: Final = 20.0
_ANSWER_BURST: Final = 40.0
_REPEATS: Final = 3  # questions, since any may be lost
_INTERFACES_AFTER: Final = 5.0  # [s] between two looks for new interfaces
_log = logging.getLogger(__name__)

Port = Annotated[int, msgspec.Meta(ge=1, le=65535)]


class Announcement(msgspec.Struct, frozen=True, kw_only=True):
    """What a host says of its session."""

    name: str
    kind: Literal["simulation", "replay"]
    port: Port
    scene: str = ""
    protocol: Literal["tcp", "tls", "quic"] = "tcp"
    age: float = 0.0  # [s]
    load: float = -1.0  # share of a tick's time that a tick takes; below 0: not known
    clients: int = 0
    needs_secret: bool = False
    version: str = ""


class FoundSession(msgspec.Struct, frozen=True, kw_only=True):
    """A session of the local network, as it says of itself."""

    name: str
    kind: str
    scene: str
    endpoint: str
    age: float  # [s]
    load: float  # share of a tick's time; below 0: not known
    clients: int
    needs_secret: bool
    version: str

    @property
    def place(self) -> str:
        """What to give to `join_session`."""
        return f"{self.name}@{self.endpoint}"


class Beacon(asyncio.DatagramProtocol):
    """A host's side: answers with what `announcements` returns. Make it with `answering_askers`."""

    def __init__(
        self, announcements: Callable[[], Sequence[Announcement]], *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._announcements = announcements
        self._clock = clock
        self._left = _ANSWER_BURST
        self._counted_at = clock()
        self._transport: asyncio.DatagramTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The socket is open."""
        self._transport = cast(
            asyncio.DatagramTransport, transport
        )  # which it is, but says so from Python 3.12 on only

    def datagram_received(self, data: bytes, address: tuple[str, int]) -> None:
        """Somebody asks, or says something else, which is left alone."""
        answer = self.answer(data)
        if answer and self._transport is not None:
            self._transport.sendto(answer, address)

    def error_received(self, error: Exception) -> None:
        """An earlier answer found nobody."""

    def answer(self, question: bytes) -> bytes:
        """The answer to a datagram; empty if it deserves none or too many were given just now."""
        if len(question) != DATAGRAM_SIZE or not question.startswith(_QUESTION) or not self._may_answer():
            return b""
        nonce = question[len(_QUESTION) : _HEAD_SIZE]
        body, size = [], _HEAD_SIZE + 2
        for announcement in self._announcements():
            text = msgspec.json.encode(announcement)
            size += len(text) + 1
            if size > DATAGRAM_SIZE:
                break
            body.append(text)
        return _ANSWER + nonce + b"[" + b",".join(body) + b"]" if body else b""

    def _may_answer(self) -> bool:
        now = self._clock()
        self._left = min(_ANSWER_BURST, self._left + (now - self._counted_at) * _ANSWERS_PER_SECOND)
        self._counted_at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


@contextlib.asynccontextmanager
async def answering_askers(announcements: Callable[[], Sequence[Announcement]]) -> AsyncIterator[None]:
    """Answers those who look around, while this lasts; BusError if the group's port cannot be had."""
    loop = asyncio.get_running_loop()
    sock = _socket_of_group()
    transport, _ = await loop.create_datagram_endpoint(lambda: Beacon(announcements), sock=sock)
    following = asyncio.ensure_future(_follow_interfaces(sock))
    try:
        yield
    finally:
        following.cancel()
        transport.close()


async def look_around(seconds: float = LOOKING_TIME) -> list[FoundSession]:
    """The sessions of the local network that answer within so many seconds, by name; BusError if nobody can be asked."""
    nonce = secrets.token_bytes(_NONCE_SIZE)
    question = (_QUESTION + nonce).ljust(DATAGRAM_SIZE, b"\0")
    loop = asyncio.get_running_loop()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
        sock.bind(("", 0))
        answers = Answers(nonce)
        reading = asyncio.ensure_future(_read(loop, sock, answers))
        try:
            for _ in range(_REPEATS):
                _ask_everywhere(sock, question)
                await asyncio.sleep(seconds / _REPEATS)
        finally:
            reading.cancel()
    return answers.found()


class Answers:
    """What came to a question."""

    def __init__(self, nonce: bytes) -> None:
        self._nonce = nonce
        self._found: dict[tuple[str, str], FoundSession] = {}  # by name and endpoint
        self._from: dict[str, int] = {}  # how many, by address

    def take(self, data: bytes, address: str) -> None:
        """Keeps what an answer announces, if it is one; the rest is left alone."""
        if len(data) > DATAGRAM_SIZE or data[:_HEAD_SIZE] != _ANSWER + self._nonce:
            return
        try:
            announced = msgspec.json.decode(memoryview(data)[_HEAD_SIZE:], type=list[Announcement])
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return
        for announcement in announced:
            self._keep(announcement, address)

    def found(self) -> list[FoundSession]:
        """All of them, by name."""
        return sorted(self._found.values(), key=lambda found: (found.name, found.endpoint))

    def _keep(self, announced: Announcement, address: str) -> None:
        endpoint = f"{announced.protocol}/{address}:{announced.port}"
        place = (announced.name, endpoint)
        if not is_chunk(announced.name) or len(announced.name) > _TEXT_LENGTH:
            return
        if place not in self._found:
            if len(self._found) >= MOST_FOUND or self._from.get(address, 0) >= MOST_FROM_ONE:
                return
            self._from[address] = self._from.get(address, 0) + 1
        self._found[place] = FoundSession(
            name=announced.name,
            kind=announced.kind,
            scene=clean(announced.scene),
            endpoint=endpoint,
            age=_bounded(announced.age, 0.0, 1e10),
            load=_bounded(announced.load, -1.0, 1e3),
            clients=min(max(announced.clients, 0), 10**9),
            needs_secret=announced.needs_secret,
            version=clean(announced.version),
        )


def clean(text: str) -> str:
    """A stranger's text as it may stand in a terminal: one short line of what can be printed."""
    cut = text[:_TEXT_LENGTH]
    return "".join(letter if letter.isprintable() else "?" for letter in cut)


def announced_endpoint(endpoint: str) -> tuple[str, int]:
    """Protocol and port of an endpoint that others can reach; BusError for one of loopback."""
    protocol, _, rest = endpoint.partition("/")
    host, _, port = rest.rpartition(":")
    if host in ("127.0.0.1", "localhost", "[::1]") or host.startswith("127."):
        raise BusError(
            f"{endpoint} can be reached from this machine alone, so there is nothing to announce: "
            "leave --discover out, or listen for others, as with --listen tcp/0.0.0.0:7447"
        )
    if protocol not in ("tcp", "tls", "quic") or not port.isdecimal():
        raise BusError(f"'{endpoint}' cannot be announced on a network: give tcp/ADDRESS:PORT")
    return protocol, int(port)


def _bounded(value: float, low: float, high: float) -> float:
    return min(max(value, low), high) if math.isfinite(value) else low


async def _read(loop: asyncio.AbstractEventLoop, sock: socket.socket, answers: Answers) -> None:
    for _ in range(MOST_READ):
        data, address = await loop.sock_recvfrom(sock, DATAGRAM_SIZE + 1)
        answers.take(data, address[0])


def _ask_everywhere(sock: socket.socket, question: bytes) -> None:
    """Sends the question on every interface; BusError if none takes it."""
    failure: OSError | None = None
    asked = 0
    for index, _ in socket.if_nameindex():
        try:
            sock.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, _on_interface(index))
            sock.sendto(question, (GROUP, PORT))
            asked += 1
        except OSError as error:  # one that is down, or has no address
            failure = error
    if not asked:
        raise BusError(f"there is no network to look around in ({failure or 'no interface'}): is an interface up?")


def _socket_of_group() -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # several hosts of one machine answer
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
        sock.setblocking(False)
        sock.bind((GROUP, PORT))
    except OSError as error:
        sock.close()
        raise BusError(f"nobody can be answered at port {PORT} ({error.strerror}): leave --discover out") from error
    return sock


async def _follow_interfaces(sock: socket.socket) -> None:
    """Listens on all interfaces, also on those that come up later."""
    while True:
        for index, _ in socket.if_nameindex():
            with contextlib.suppress(OSError):  # listened on already, or one that cannot be
                sock.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, _on_interface(index))
        await asyncio.sleep(_INTERFACES_AFTER)


def _on_interface(index: int) -> bytes:
    """struct ip_mreqn, ip(7): the group, any address, an interface."""
    return struct.pack("=4s4si", socket.inet_aton(GROUP), b"\0\0\0\0", index)

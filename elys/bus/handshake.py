"""The handshake: who comes into a session first compares protocol versions with its host, and learns which session it is; and
what the host's clock says.

Behind one endpoint there may be several sessions (worlds behind a router). Whoever names none gets the only one, or is told
which there are.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import elys
from elys.bus import codec, topics
from elys.bus.messages.session import ClockReply, ClockRequest, Hello, Welcome
from elys.bus.picture_ring import boot_id
from elys.bus.topics import PROTOCOL_VERSION, Encoding
from elys.bus.transports.transport import IncomingQuery, Transport
from elys.common.errors import BusError, ConnectionLost, MessageError, ProtocolError, RequestError

if TYPE_CHECKING:
    from elys.bus.session import Node

_ROUND: Final = 1.0  # [s] for the answers to one question
_PAUSE: Final = 0.02  # [s] where nobody answers at once; the host may be starting
_SHOWN: Final = 12  # sessions that a sentence names


def hello_of(*, kind: str, node: str) -> bytes:
    """What a node says first."""
    hello = Hello(protocol=PROTOCOL_VERSION, kind=kind, node=node, version=elys.__version__)
    return codec.encode(hello, Encoding.JSON)


def answer_hello(incoming: IncomingQuery, *, session: str, epoch: int) -> None:
    """The host's answer; to another version of the protocol it says what to do."""
    refusal = ""
    try:
        codec.check_prefix(incoming.payload, Encoding.JSON)
        codec.decode_body(incoming.payload, Hello, Encoding.JSON, offset=codec.PREFIX.size)
    except ProtocolError as error:
        refusal = f"{error}: install the same release of ELYS on both sides (this one is {elys.__version__})"
    except MessageError as error:
        incoming.refuse(str(error))
        return
    welcome = Welcome(
        protocol=PROTOCOL_VERSION,
        version=elys.__version__,
        session=session,
        epoch=epoch,
        refusal=refusal,
        machine=boot_id(),
    )
    incoming.reply(codec.encode(welcome, Encoding.JSON))


def answer_clock(incoming: IncomingQuery, *, epoch: int) -> None:
    """What the host's clock says now."""
    now = time.time_ns()
    try:
        codec.decode(incoming.payload, ClockRequest, Encoding.JSON)
    except (MessageError, ProtocolError) as error:
        incoming.refuse(str(error))
        return
    incoming.reply(codec.encode(ClockReply(epoch=epoch, wall_clock=now), Encoding.JSON))


async def greet(transport: Transport, *, node: Node, name: str, timeout: float) -> Welcome:
    """The welcome of the host of session `name`, or with "*" of the only one there is.

    Raises:
        ConnectionLost: it did not answer within `timeout` seconds. ProtocolError: it speaks another version.
        BusError: there are several, and none was named.
    """
    deadline = time.monotonic() + timeout
    while True:
        left = deadline - time.monotonic()
        if left <= 0:
            raise ConnectionLost(await _missing(transport, node, name, timeout))
        welcomes = await all_welcomes(transport, node=node, name=name, timeout=min(left, _ROUND))
        if welcomes:
            break
        await asyncio.sleep(_PAUSE)
    others = names_of(welcomes)
    if len(others) > 1:
        raise BusError(f"several sessions are here, {_listed(others)}: name one with --session NAME")
    return checked(welcomes[0])


async def all_welcomes(transport: Transport, *, node: Node, name: str, timeout: float) -> list[Welcome]:
    """What all hosts of sessions `name` ("*": of any) answer within `timeout` seconds.

    Raises:
        ProtocolError: an answer cannot be read. RequestError: there are refusals, and nothing else.
    """
    key = topics.greeting_key(name, node.id)
    loop = asyncio.get_running_loop()
    future: asyncio.Future[tuple[list[bytes], list[str]]] = loop.create_future()

    def settle(answers: list[bytes], reasons: list[str]) -> None:
        if not future.done():
            future.set_result((answers, reasons))

    def ended(answers: list[bytes], reasons: list[str]) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended: nobody is left to hear it
            loop.call_soon_threadsafe(settle, answers, reasons)

    transport.survey(key, hello_of(kind=node.kind, node=node.id), timeout, ended)
    answers, reasons = await future
    if reasons and not answers:
        raise RequestError(reasons[0])
    return [_read(answer) for answer in answers]


def names_of(welcomes: Sequence[Welcome]) -> list[str]:
    """The sessions that answered, each once, in the order of their names."""
    return sorted({welcome.session for welcome in welcomes})


def checked(welcome: Welcome) -> Welcome:
    """A welcome of this version; ProtocolError says why it is none."""
    if welcome.refusal:
        raise ProtocolError(welcome.refusal)
    if welcome.protocol != PROTOCOL_VERSION:
        raise ProtocolError(
            f"the host speaks protocol version {welcome.protocol} (ELYS {welcome.version}), this side "
            f"{PROTOCOL_VERSION} (ELYS {elys.__version__}): install the same release on both sides"
        )
    return welcome


def _read(answer: bytes) -> Welcome:
    try:
        welcome = codec.decode_body(answer, Welcome, Encoding.JSON, offset=codec.PREFIX.size)
    except MessageError as error:
        raise ProtocolError(f"the host's greeting cannot be read ({error}): another release of ELYS?") from error
    if not topics.is_chunk(welcome.session):
        raise ProtocolError("the host's greeting names no session: another release of ELYS?")
    return welcome


async def _missing(transport: Transport, node: Node, name: str, timeout: float) -> str:
    """Why nobody answered, as a sentence."""
    if name != "*":
        with contextlib.suppress(BusError):
            others = names_of(await all_welcomes(transport, node=node, name="*", timeout=_ROUND))
            if others:
                return f"there is no session {name} here; there is {_listed(others)}: name one of these with --session"
    return f"no session answered within {timeout:g} s"


def _listed(names: Sequence[str]) -> str:
    more = len(names) - _SHOWN
    return ", ".join(names[:_SHOWN]) + (f" and {more} more" if more > 0 else "")

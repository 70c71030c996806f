"""Hello and Welcome: two nodes find out whether they can talk before they do; and what the host's clock says."""

from __future__ import annotations

import time

import elys
from elys.bus import codec
from elys.bus.messages.session import ClockReply, ClockRequest, Hello, Welcome
from elys.bus.picture_ring import boot_id
from elys.bus.topics import PROTOCOL_VERSION, Encoding
from elys.bus.transports.transport import IncomingQuery
from elys.common.errors import MessageError, ProtocolError


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


def read_welcome(answer: bytes) -> Welcome:
    """What the host answered; ProtocolError says why the two cannot talk."""
    try:
        welcome = codec.decode_body(answer, Welcome, Encoding.JSON, offset=codec.PREFIX.size)
    except MessageError as error:
        raise ProtocolError(f"the host's greeting cannot be read ({error}): another release of ELYS?") from error
    if welcome.refusal:
        raise ProtocolError(welcome.refusal)
    if welcome.protocol != PROTOCOL_VERSION:
        raise ProtocolError(
            f"the host speaks protocol version {welcome.protocol} (ELYS {welcome.version}), this side "
            f"{PROTOCOL_VERSION} (ELYS {elys.__version__}): install the same release on both sides"
        )
    return welcome

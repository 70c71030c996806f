"""The web node: joins a session as one more node, and shows it to browsers.

browsers ──WebSocket──> Browser ──> LiveSession ──bus──> host, render node
                           │            mirror, status <──┘
         <── outbox <──────┴── pictures, tree, inspector
"""

from __future__ import annotations

import asyncio
import errno
import ssl
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from aiohttp import web

from elys.bus.session import Session
from elys.common.errors import ElysError
from elys.web_node.access import Doorkeeper
from elys.web_node.connections import limited
from elys.web_node.doors import own_names
from elys.web_node.live_session import LiveSession
from elys.web_node.server import WebServer

PORT: Final = 8090
PORTS_TRIED: Final = 20
CLOSING: Final = 2.0  # [s] for browsers to be told that it is over


@dataclass(frozen=True, slots=True, kw_only=True)
class WebOptions:
    """How a session is shown."""

    host: str = "127.0.0.1"
    port: int = 0  # 0: the first that is free, from PORT on
    names: tuple[str, ...] = ()  # under which this machine may be called, besides those that it knows itself
    certificate: Path | None = None  # PEM; with it and its key everything is encrypted
    certificate_key: Path | None = None
    most_browsers: int = 32
    most_a_second: float = 30.0  # pictures for each
    bit_rate: float = 0.0  # [bit/s] of H.264; 0 for any
    # What the page has no translation of itself, by language and English text.
    texts: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    @property
    def is_secure(self) -> bool:
        """Whether all is encrypted."""
        return self.certificate is not None


async def serve_browsers(
    session: Session, doorkeeper: Doorkeeper, options: WebOptions, *, on_ready: Callable[[int], None]
) -> None:
    """Shows the session to browsers until cancelled; `on_ready` hears the port.

    Raises:
        ElysError: the address cannot be listened at, or certificate and key cannot be used.
    """
    encryption = _encryption(options)
    live = LiveSession(session, most_browsers=options.most_browsers)
    server = WebServer(
        live,
        doorkeeper,
        names=own_names(options.names),
        texts=options.texts,
        is_secure=options.is_secure,
        most_a_second=options.most_a_second,
        bit_rate=options.bit_rate,
    )
    runner = web.AppRunner(
        server.application, access_log=None, handle_signals=False, keepalive_timeout=20.0, shutdown_timeout=CLOSING
    )
    await runner.setup()
    assert runner.server is not None
    listening = await _listen(limited(runner.server), options, encryption)
    try:
        on_ready(listening.sockets[0].getsockname()[1])
        await asyncio.get_running_loop().create_future()
    finally:
        listening.close()
        await runner.cleanup()


def _encryption(options: WebOptions) -> ssl.SSLContext | None:
    if options.certificate is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(options.certificate, options.certificate_key)
    except (OSError, ssl.SSLError) as error:
        key = options.certificate_key or "the same file"
        raise ElysError(
            f"{options.certificate} and its key in {key} cannot be used ({error.strerror or error}): give a certificate and its "
            "private key, both PEM, with --cert and --cert-key"
        ) from error
    return context


async def _listen(
    factory: Callable[[], asyncio.BaseProtocol], options: WebOptions, encryption: ssl.SSLContext | None
) -> asyncio.Server:
    loop = asyncio.get_running_loop()
    ports = [options.port] if options.port else range(PORT, PORT + PORTS_TRIED)
    for port in ports:
        try:
            return await loop.create_server(factory, options.host, port, ssl=encryption)
        except OSError as error:
            if error.errno == errno.EADDRINUSE and port != ports[-1]:
                continue
            raise ElysError(
                f"{options.host}:{port} cannot be listened at ({error.strerror or error}): choose another with --host and --port"
            ) from error
    raise AssertionError("there is at least one port")

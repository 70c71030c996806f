"""What somebody sees who listens in on the line, and what idle strangers at the door keep others from."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from elys.bus import topics
from elys.bus.access.credentials import Credentials
from elys.bus.access.host import HostAccess, with_certificate
from elys.bus.access.keyring import Keyring, new_key
from elys.bus.access.roles import GIVEN
from elys.bus.discovery import join_session
from elys.bus.messages.session import LogLine
from elys.bus.session import Session
from elys.bus.transports.zenoh import ZenohTransport
from tests.unit.bus.access.guarded import free_port

TEXT = "what the simulation says"


@pytest.fixture(autouse=True)
def without_own_keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "none"))


class Tap:
    """Passes everything on, and keeps it."""

    def __init__(self, port: int) -> None:
        self.seen = bytearray()
        self._target = port
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listening.getsockname()[1]
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def close(self) -> None:
        self._listening.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listening.accept()
                far = socket.create_connection(("127.0.0.1", self._target))
                for one, other in ((near, far), (far, near)):
                    threading.Thread(target=self._pass_on, args=(one, other), daemon=True).start()

    def _pass_on(self, one: socket.socket, other: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := one.recv(1 << 16):
                self.seen += data
                other.sendall(data)
        with contextlib.suppress(OSError):
            other.shutdown(socket.SHUT_WR)


@pytest.fixture
def keyring() -> Iterator[Keyring]:
    ring = Keyring(keys=[new_key(role) for role in GIVEN])
    ring.authority.ensure()
    yield ring


async def overheard(protocol: str, access: HostAccess, credentials: Credentials) -> bytes:
    """All that went over the line while somebody joined and heard a line of the log."""
    port = free_port()
    host = await Session.host(
        ZenohTransport.listen(f"{protocol}/127.0.0.1:{port}", access=access), name="yard", kind="simulation", epoch=1
    )
    tap = Tap(port)
    joined = await join_session(f"{protocol}/127.0.0.1:{tap.port}", kind="tool", credentials=credentials)
    heard: list[str] = []
    joined.subscribe(topics.LOG, lambda line, _: heard.append(line.text))
    while not heard:
        host.publish(topics.LOG, LogLine(node="simulation-1", level="info", text=TEXT, time=0.0))
        await asyncio.sleep(0.01)
    await joined.close()
    await host.close()
    tap.close()
    assert heard[0] == TEXT
    return bytes(tap.seen)


async def test_the_secret_itself_never_goes_over_the_line(keyring: Keyring) -> None:
    key = keyring.named("viewer")
    seen = await overheard("tcp", HostAccess.of(keyring), keyring.credentials(key))
    assert key.user.encode() in seen and TEXT.encode() in seen  # as docs/security.md says: not encrypted
    assert key.secret.encode() not in seen and key.secret.encode()[4:-4] not in seen


async def test_inside_tls_nothing_can_be_read(keyring: Keyring) -> None:
    key = keyring.named("viewer")
    access = HostAccess.with_certificates(keyring, ("127.0.0.1",))
    seen = await overheard("tls", access, with_certificate(key, keyring.authority))
    for text in (TEXT, key.user, key.secret, "elys/", "ELYS", "yard"):
        assert text.encode() not in seen
    assert len(seen) > 1000


async def test_strangers_who_say_nothing_keep_nobody_out(keyring: Keyring) -> None:
    port = free_port()
    endpoint = f"tcp/127.0.0.1:{port}"
    transport = ZenohTransport.listen(endpoint, access=HostAccess.of(keyring))
    host = await Session.host(transport, name="yard", kind="simulation", epoch=1)
    silent = [socket.create_connection(("127.0.0.1", port)) for _ in range(150)]
    joined = await join_session(endpoint, kind="tool", credentials=keyring.credentials(keyring.named("viewer")))
    await joined.close()
    # Those who never say who they are are shut out.
    for connection in silent[:5]:
        connection.settimeout(20.0)
        with contextlib.suppress(ConnectionResetError):
            while await asyncio.to_thread(connection.recv, 100):
                pass
    for connection in silent:
        connection.close()
    await host.close()

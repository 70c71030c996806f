"""Who is not let in hears why: secrets, certificates and ports of every wrong kind, at real hosts."""

from __future__ import annotations

import asyncio
import contextlib
import re
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from elys.bus import topics
from elys.bus.access import refusals
from elys.bus.access.certificates import Authority
from elys.bus.access.credentials import Credentials
from elys.bus.access.host import HostAccess, own_credentials, with_certificate
from elys.bus.access.keyring import Keyring, new_key
from elys.bus.access.roles import GIVEN, Role
from elys.bus.discovery import join_session
from elys.bus.messages.commands import CommandRequest, Input, SetPlaying
from elys.bus.messages.session import LogLine
from elys.bus.session import Session
from elys.bus.transports.zenoh import ZenohTransport
from elys.common.errors import AccessError, ConnectionLost, RequestError
from tests.unit.bus.access.guarded import free_port

TIMEOUT = 10.0  # [s] that joining may take; what is refused is refused long before


@pytest.fixture(autouse=True)
def without_own_keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "none"))
    for name in ("ELYS_SECRET", "ELYS_KEY"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def keyring() -> Keyring:
    ring = Keyring(keys=[new_key(role) for role in GIVEN])
    ring.authority.ensure()
    return ring


@pytest.fixture
def host() -> Iterator[Callable[..., str]]:
    """Starts hosts: `host(access, protocol)` is the endpoint of one."""
    loops: list[tuple[asyncio.AbstractEventLoop, threading.Thread]] = []

    def start(access: HostAccess | None, protocol: str = "tcp") -> str:
        endpoint = f"{protocol}/127.0.0.1:{free_port()}"
        loop = asyncio.new_event_loop()
        thread = threading.Thread(target=loop.run_forever)
        thread.start()
        loops.append((loop, thread))

        async def work() -> Session:
            transport = ZenohTransport.listen(endpoint, access=access)
            return await Session.host(transport, name="yard", kind="simulation", epoch=7)

        session = asyncio.run_coroutine_threadsafe(work(), loop).result(20)
        loops_sessions.append((loop, session))
        return endpoint

    loops_sessions: list[tuple[asyncio.AbstractEventLoop, Session]] = []
    yield start
    for loop, session in loops_sessions:
        asyncio.run_coroutine_threadsafe(session.close(), loop).result(20)
    for loop, thread in loops:
        loop.call_soon_threadsafe(loop.stop)
        thread.join(20)
        loop.close()


async def refusal(endpoint: str, credentials: Credentials | None, *, timeout: float = TIMEOUT) -> str:
    with pytest.raises(AccessError) as caught:
        await join_session(endpoint, kind="tool", timeout=timeout, credentials=credentials)
    sentence = str(caught.value)
    assert len(sentence) < 400 and "\n" not in sentence
    return sentence


def of(keyring: Keyring, name: str) -> Credentials:
    return replace(keyring.credentials(keyring.named(name)), source="ELYS_SECRET")


async def test_secrets(keyring: Keyring, host: Callable[..., str]) -> None:
    endpoint = host(HostAccess.of(keyring))
    for role in GIVEN:
        session = await join_session(endpoint, kind="tool", credentials=of(keyring, role.title))
        assert session.permissions.role is role and session.epoch == 7
        assert session.node.id.endswith(f".{keyring.named(role.title).user}")
        await session.close()
    said = await refusal(endpoint, None)
    assert re.search("lets in only who shows a secret: .*elys keys show viewer", said)
    wrong = replace(of(keyring, "viewer"), secret="x" * 32)
    assert "does not take the secret of viewer-" in await refusal(endpoint, wrong)
    stranger = replace(wrong, user="owner-zzzzzz")
    said = await refusal(endpoint, stranger)
    assert "owner-zzzzzz (from ELYS_SECRET)" in said and "x" * 32 not in said


async def test_what_a_role_may_not_be_or_say_it_hears_at_once(
    keyring: Keyring, host: Callable[..., str], caplog: pytest.LogCaptureFixture
) -> None:
    endpoint = host(HostAccess.of(keyring))
    for name in ("viewer", "player"):
        with pytest.raises(AccessError, match=f"a {name} may not be a render node: join with the key of an editor"):
            await join_session(endpoint, kind="render", credentials=of(keyring, name))
    session = await join_session(endpoint, kind="tool", credentials=of(keyring, "viewer"))
    with pytest.raises(RequestError, match="a viewer may not ask for command"):
        await session.request(topics.COMMAND, CommandRequest(origin="x", command=SetPlaying(playing=True)))
    for _ in range(3):
        session.publish(topics.INPUT, Input(player=0), key=session.node.id)
        session.publish(topics.LOG, LogLine(node="x", level="info", text="", time=0.0))
    session.subscribe(topics.INPUT, lambda message, key: None)()
    assert [record.message for record in caplog.records if "may not" in record.message] == [
        "a viewer may not publish input: join with the key of a player"
    ]
    await session.close()


async def test_certificates(keyring: Keyring, host: Callable[..., str]) -> None:
    endpoint = host(HostAccess.with_certificates(keyring, ("localhost", "127.0.0.1")), "tls")
    good = with_certificate(keyring.named("viewer"), keyring.authority)
    session = await join_session(endpoint, kind="tool", credentials=good)
    assert session.permissions.role is Role.VIEWER
    with pytest.raises(RequestError, match="a viewer may not ask for command: join with the key of an editor"):
        await session.request(topics.COMMAND, CommandRequest(origin="x", command=SetPlaying(playing=True)))
    await session.close()

    assert "asks for a certificate, and nothing was shown" in await refusal(endpoint, None)
    said = await refusal(endpoint, of(keyring, "viewer"))
    assert "asks for a certificate, and ELYS_SECRET, which has no certificate" in said

    expired = with_certificate(keyring.named("viewer"), keyring.authority, days=-3)
    assert re.search(
        r"certificate of viewer-\w+ in .* expired on \d{4}-\d\d-\d\d: make another", await refusal(endpoint, expired)
    )

    other = Authority()
    other.ensure()
    strange = replace(with_certificate(keyring.named("viewer"), other), authority=keyring.authority.certificate)
    assert "is of another authority" in await refusal(endpoint, strange)
    assert "shows a certificate of another authority" in await refusal(
        endpoint, replace(good, authority=other.certificate)
    )


async def test_a_renewed_or_revoked_certificate_opens_nothing(keyring: Keyring, host: Callable[..., str]) -> None:
    old = with_certificate(keyring.named("viewer"), keyring.authority)
    keyring.keys[0] = new_key(Role.VIEWER)
    endpoint = host(HostAccess.with_certificates(keyring, ("127.0.0.1",)), "tls")
    said = await refusal(endpoint, old, timeout=2.0)
    assert f"does not speak with {old.user}: that key was renewed or revoked" in said


async def test_who_was_let_in_cannot_pass_for_the_host(keyring: Keyring, host: Callable[..., str]) -> None:
    owner = own_credentials(keyring)
    imposter = HostAccess(
        users=(), authority=owner.authority, certificate=owner.certificate, private_key=owner.private_key
    )
    endpoint = host(imposter, "tls")
    victim = with_certificate(keyring.named("editor"), keyring.authority)
    await refusal(endpoint, victim)


async def test_wrong_kinds_of_ports(keyring: Keyring, host: Callable[..., str]) -> None:
    plain = host(HostAccess.of(keyring))
    tls = host(HostAccess.with_certificates(keyring, ("127.0.0.1",)), "tls")
    named = host(HostAccess.with_certificates(keyring, ("server.example",)), "tls")
    good = with_certificate(keyring.named("viewer"), keyring.authority)

    said = await refusal(tls.replace("tls/", "tcp/"), good)
    assert f"speaks TLS: connect with {tls}" in said
    said = await refusal(plain.replace("tcp/", "tls/"), good)
    assert f"speaks no TLS: connect with {plain}" in said
    for without in (None, of(keyring, "viewer")):
        assert f"speaks no TLS: connect with {plain}" in await refusal(plain.replace("tcp/", "tls/"), without)
    said = await refusal(named, good)
    assert "is not for the name '127.0.0.1'" in said and "--address" in said

    with socket.create_server(("127.0.0.1", 0)) as stranger:
        answering = threading.Thread(target=answer_http, args=(stranger,), daemon=True)
        answering.start()
        port = stranger.getsockname()[1]
        assert "is no session of ELYS" in await refusal(f"tcp/127.0.0.1:{port}", good)
        assert "is no session of ELYS" in await refusal(f"tls/127.0.0.1:{port}", good)
    answering.join(TIMEOUT)

    with pytest.raises(ConnectionLost, match="nobody answers at"):
        await join_session(f"tcp/127.0.0.1:{free_port()}", kind="tool", timeout=0.2, credentials=good)


async def test_a_host_that_does_not_answer_yet_is_waited_for(
    keyring: Keyring, host: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may have died while it was asked why it lets nobody in: a connection that ends without a word says nothing."""
    endpoint = host(HostAccess.of(keyring))
    asked = threading.Event()
    why_refused = refusals.why_refused

    def asking_why(*what: Any) -> refusals.Refusal:
        reason = why_refused(*what)
        assert "does not answer" in reason.sentence and not reason.is_sure
        asked.set()
        return reason

    monkeypatch.setattr(refusals, "why_refused", asking_why)
    with socket.create_server(("127.0.0.1", 0)) as door:
        port = door.getsockname()[1]
        threading.Thread(
            target=hang_up_until, args=(door, asked, int(endpoint.rpartition(":")[2])), daemon=True
        ).start()
        session = await join_session(
            f"tcp/127.0.0.1:{port}", kind="tool", timeout=30.0, credentials=of(keyring, "viewer")
        )
        assert asked.is_set() and session.permissions.role is Role.VIEWER
        await session.close()


async def test_a_host_that_sends_a_far_client_away_once_is_asked_again(
    keyring: Keyring, host: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only who sends away again and again refuses; to a far host the first attempt goes without a knock."""
    inside = int(host(HostAccess.of(keyring)).rpartition(":")[2])
    monkeypatch.setattr("elys.bus.transports.zenoh.is_near", lambda endpoint: False)
    monkeypatch.setattr("elys.bus.transports.zenoh._NEAR", 0.0)
    ready = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as door:
        port = door.getsockname()[1]
        threading.Thread(target=hang_up_until, args=(door, ready, inside), daemon=True).start()
        joining = asyncio.create_task(
            join_session(f"tcp/127.0.0.1:{port}", kind="tool", timeout=5.0, credentials=of(keyring, "viewer"))
        )
        await asyncio.sleep(0.7)
        ready.set()
        session = await joining
        assert session.permissions.role is Role.VIEWER
        await session.close()


def hang_up_until(door: socket.socket, ready: threading.Event, port: int) -> None:
    """Ends each connection without a word; once `ready` is set passes them on to another port."""
    with contextlib.suppress(OSError):
        while True:
            connection, _ = door.accept()
            if not ready.is_set():
                connection.recv(1000)
                connection.close()
                continue
            inside = socket.create_connection(("127.0.0.1", port))
            for source, target in ((connection, inside), (inside, connection)):
                threading.Thread(target=pass_on, args=(source, target), daemon=True).start()


def pass_on(source: socket.socket, target: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while data := source.recv(1 << 16):
            target.sendall(data)
    with contextlib.suppress(OSError):
        target.shutdown(socket.SHUT_WR)


def answer_http(listening: socket.socket) -> None:
    """Some other server, that takes anything for a request it does not understand."""
    with contextlib.suppress(OSError):
        while True:
            connection, _ = listening.accept()
            with connection, contextlib.suppress(OSError):
                connection.recv(1000)
                connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")


async def test_whoever_shows_a_secret_where_nobody_is_asked_comes_in(
    keyring: Keyring, host: Callable[..., str]
) -> None:
    endpoint = host(None)
    session = await join_session(endpoint, kind="tool", timeout=TIMEOUT, credentials=of(keyring, "viewer"))
    assert session.permissions.role is Role.OWNER
    await session.close()


async def test_hosts_of_this_machine_are_shown_the_users_own_keys(
    host: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from elys.bus.access.listening import LOOPBACK, Listening, access_of

    monkeypatch.setenv("ELYS_CONFIG_DIR", str(tmp_path / "mine"))
    for listening, protocol in ((LOOPBACK, "tcp"), (Listening(endpoint="tls/127.0.0.1:1"), "tls")):
        endpoint = host(access_of(listening), protocol)
        session = await join_session(endpoint, kind="tool")
        assert session.permissions.role is Role.OWNER
        await session.close()
        with monkeypatch.context() as other:  # another user of the machine
            other.setenv("ELYS_CONFIG_DIR", str(tmp_path / "theirs"))
            await refusal(endpoint, None)
            access_of(LOOPBACK)  # who has keys of his own
            said = await refusal(endpoint, None)
            assert "this user's own keys" in said or "another authority" in said or "has no certificate" in said


async def test_who_comes_just_before_a_slow_host_has_opened_is_let_in(
    keyring: Keyring, host: Callable[..., str]
) -> None:
    """Half a second of knocking at a door whose host takes longer to answer is no refusal."""
    endpoint = host(HostAccess.of(keyring))
    door = free_port()

    async def pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError):
            while data := await reader.read(65536):
                writer.write(data)
                await writer.drain()
        writer.close()

    async def visit(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await asyncio.sleep(0.7)
        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", int(endpoint.rpartition(":")[2]))
        await asyncio.gather(pass_on(reader, inner_writer), pass_on(inner_reader, writer))

    joining = asyncio.ensure_future(
        join_session(f"tcp/127.0.0.1:{door}", kind="tool", timeout=TIMEOUT, credentials=of(keyring, "viewer"))
    )
    await asyncio.sleep(1.0)
    async with await asyncio.start_server(visit, "127.0.0.1", door):
        session = await joining
        assert session.permissions.role is Role.VIEWER
        await session.close()

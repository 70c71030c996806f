"""A session against good and bad company: handshakes, requests, presence, and garbage on everything there is."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from typing import Any

import msgspec
import pytest

import elys
from elys.bus import codec, topics
from elys.bus.messages.scene import SceneDelta, Snapshot, SnapshotRequest
from elys.bus.messages.session import EventBatch, Hello, LogLine, Welcome
from elys.bus.mirror import SceneMirror
from elys.bus.session import Node, Session
from elys.bus.topics import Encoding
from elys.bus.transports.loopback import LoopbackBroker
from elys.bus.transports.transport import IncomingQuery, Transport
from elys.bus.transports.zenoh import ZenohTransport
from elys.common.errors import BusError, ConnectionLost, ProtocolError, RequestError


class Pair:
    """A host and who joins it, over a transport of one kind."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.broker = LoopbackBroker()
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"

    def listen(self) -> Transport:
        return self.broker.listen() if self.kind == "loopback" else ZenohTransport.listen(self.endpoint)

    def connect(self) -> Transport:
        return self.broker.connect() if self.kind == "loopback" else ZenohTransport.connect(self.endpoint, timeout=10)

    async def open(self) -> tuple[Session, Session]:
        host = await Session.host(self.listen(), name="yard", kind="simulation", epoch=3)
        return host, await Session.join(self.connect(), kind="editor")


@pytest.fixture(params=["loopback", "zenoh"])
def pair(request: pytest.FixtureRequest) -> Pair:
    return Pair(request.param)


async def until(condition: Callable[[], Any]) -> None:
    """Returns once it holds; the test's own time limit ends it otherwise."""
    while not condition():
        await asyncio.sleep(0.005)


async def close(*sessions: Session) -> None:
    for session in sessions:
        await session.close()


def log_line(text: str) -> LogLine:
    return LogLine(node="n", level="info", text=text, time=0.0)


async def test_who_joins_learns_name_and_epoch_and_is_seen(pair: Pair) -> None:
    host, joined = await pair.open()
    assert (joined.name, joined.epoch) == ("yard", 3)
    await until(lambda: host.nodes_of("editor") and joined.nodes_of("simulation"))
    assert joined.nodes_of("simulation") == [host.node]
    changes: list[tuple[Node, bool]] = []
    host.on_nodes(lambda node, alive: changes.append((node, alive)))
    await joined.close()
    await until(lambda: (joined.node, False) in changes)
    await host.close()


async def test_messages_and_requests_pass(pair: Pair) -> None:
    host, joined = await pair.open()
    heard: list[str] = []
    joined.subscribe(topics.LOG, lambda line, _: heard.append(line.text))

    async def answer(request: SnapshotRequest, key: str) -> Snapshot:
        raise RequestError("the scene is not loaded yet: ask again")

    host.serve(topics.SNAPSHOT, answer)
    with pytest.raises(RequestError, match="not loaded yet"):
        while True:  # nobody is known to serve it for a moment
            try:
                await joined.request(topics.SNAPSHOT, SnapshotRequest(), timeout=1.0)
            except ConnectionLost:
                continue
    while not heard:
        host.publish(topics.LOG, log_line("here"))
        await asyncio.sleep(0.01)
    assert set(heard) == {"here"}
    await close(joined, host)


async def test_a_fault_in_a_handler_is_told_to_both_sides(pair: Pair) -> None:
    host, joined = await pair.open()
    said: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: said.append(context))

    async def fail(request: SnapshotRequest, key: str) -> Snapshot:
        raise ZeroDivisionError("oops")

    host.serve(topics.SNAPSHOT, fail)
    with pytest.raises(RequestError, match="oops"):
        while True:
            try:
                await joined.request(topics.SNAPSHOT, SnapshotRequest(), timeout=1.0)
            except ConnectionLost:
                continue
    assert isinstance(said[0]["exception"], ZeroDivisionError)
    await close(joined, host)


async def test_a_fault_in_a_reader_costs_only_its_message() -> None:
    host, joined = await Pair("loopback").open()
    said: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: said.append(context))
    heard: list[str] = []

    def read(line: LogLine, _: str) -> None:
        if line.text == "bad":
            raise ZeroDivisionError
        heard.append(line.text)

    joined.subscribe(topics.LOG, read)
    for text in ("a", "bad", "b"):
        host.publish(topics.LOG, log_line(text))
    await until(lambda: len(heard) == 2)
    assert heard == ["a", "b"] and len(said) == 1
    await close(joined, host)


def bad_payloads(encoding: Encoding) -> list[bytes]:
    good_prefix = codec.with_prefix(b"", encoding)
    other = next(one for one in Encoding if one is not encoding)
    broken = [
        b"",
        b"\0",
        b"garbage that is longer than a prefix",
        good_prefix[:-1],
        b"ELYS\xff\xff" + good_prefix[6:] + b"{}",
        codec.with_prefix(b"{}", other),
    ]
    if encoding is Encoding.RAW:  # any bytes are such a message: its reader looks at them
        return broken
    return [
        *broken,
        good_prefix,
        good_prefix + b"\xff\xfe\x00{",
        good_prefix + b'{"epoch": "not a number"}',
        good_prefix + b"[" * 100_000,
        good_prefix + bytes(55),
        good_prefix + bytes(57),
        good_prefix + b"\xff" * 56,
    ]


async def test_garbage_on_every_topic_harms_nobody(pair: Pair) -> None:
    host, joined = await pair.open()
    heard: dict[str, int] = {}
    for topic in topics.TOPICS:
        joined.subscribe(topic, lambda message, key, name=topic.name: heard.update({name: heard.get(name, 0) + 1}))
    lines: list[str] = []
    joined.subscribe(topics.LOG, lambda line, _: lines.append(line.text))
    while "ready" not in lines:
        host.publish(topics.LOG, log_line("ready"))
        await asyncio.sleep(0.01)
    for topic in topics.TOPICS:
        key = topics.key_of("yard", topic, "somebody")
        for payload in bad_payloads(topic.encoding):
            before = joined.refused.get(topic.name, 0)
            host.transport.publish(key, payload, topic.delivery)
            await until(lambda name=topic.name, before=before: joined.refused.get(name, 0) > before)
    host.publish(topics.LOG, log_line("still here"))
    await until(lambda: "still here" in lines)
    assert set(heard) <= {"log"}
    # LOG has two readers, so each of its bad messages is refused twice.
    counts = {topic.name: len(bad_payloads(topic.encoding)) for topic in topics.TOPICS}
    assert joined.refused == {**counts, "log": 2 * counts["log"]}
    await close(joined, host)


async def test_garbage_in_every_request_is_refused_with_a_reason(pair: Pair) -> None:
    host, joined = await pair.open()

    async def never(request: Any, key: str) -> Any:
        raise AssertionError(f"a garbled request was answered: {request!r}")

    for query in topics.QUERIES:
        if query not in (topics.HELLO, topics.CLOCK):  # a session answers these by itself
            host.serve(query, never)
    loop = asyncio.get_running_loop()
    for query in topics.QUERIES:
        key = topics.asked_key("yard", query, "somebody", asker="somebody")
        for payload in bad_payloads(query.request_encoding):
            if query.request_encoding is Encoding.RAW and payload.startswith(codec.with_prefix(b"", Encoding.RAW)):
                continue  # any bytes are good bytes
            if len(payload) > query.largest:
                continue  # dropped by the host's router: see test_limits.py
            asks_nothing = query.request_encoding is not Encoding.RAW and not any(
                field.required for field in msgspec.structs.fields(query.request)
            )
            if asks_nothing and payload.endswith(b"}"):
                continue  # unknown fields are left to later releases
            reason = ""
            while not reason:
                answered: asyncio.Future[tuple[bytes | None, str]] = loop.create_future()
                joined.transport.request(
                    key,
                    payload,
                    1.0,
                    lambda data, why, future=answered: loop.call_soon_threadsafe(future.set_result, (data, why)),
                )
                data, reason = await answered
                if query is topics.HELLO and data is not None:
                    reason = codec.decode_body(data, Welcome, Encoding.JSON, offset=codec.PREFIX.size).refusal
    await close(joined, host)


async def test_garbage_in_answers_is_an_error_for_the_asker_alone(pair: Pair) -> None:
    host, joined = await pair.open()
    host.transport.serve(topics.asked_key("yard", topics.SNAPSHOT), lambda query: query.reply(b"garbage instead"))
    with pytest.raises(BusError, match="not a message of ELYS"):
        while True:
            try:
                await joined.request(topics.SNAPSHOT, SnapshotRequest(), timeout=1.0)
            except ConnectionLost:
                continue
    assert joined.connected
    await close(joined, host)


async def test_another_protocol_version_is_refused_with_a_sentence(pair: Pair) -> None:
    host = await Session.host(pair.listen(), name="yard", kind="simulation", epoch=1)
    transport = pair.connect()
    hello = codec.encode(Hello(protocol=99, kind="editor", node="e", version="9.9"), Encoding.JSON)
    old = b"ELYS\x63\x00" + hello[6:]
    loop = asyncio.get_running_loop()
    data = None
    while data is None:
        answered: asyncio.Future[bytes | None] = loop.create_future()
        transport.request(
            topics.key_of("yard", topics.HELLO),
            old,
            1.0,
            lambda payload, why, future=answered: loop.call_soon_threadsafe(future.set_result, payload),
        )
        data = await answered
    refusal = codec.decode_body(data, Welcome, Encoding.JSON, offset=codec.PREFIX.size).refusal
    assert "protocol version 99" in refusal and "install the same release" in refusal
    await host.close()
    await asyncio.to_thread(transport.close)


@pytest.mark.parametrize(
    ("welcome", "sentence"),
    [
        (b"ELYS\x63\x00\x01\x00" + b'{"greeting": "changed"}', "cannot be read"),
        (
            b"ELYS\x63\x00\x01\x00" + b'{"protocol": 99, "version": "9.9", "session": "yard", "epoch": 1}',
            r"protocol version 99 \(ELYS 9\.9\), this side",
        ),
    ],
)
async def test_a_host_of_another_version_is_refused(welcome: bytes, sentence: str) -> None:
    pair = Pair("loopback")
    transport = pair.listen()
    transport.serve("elys/yard/hello/*", lambda query: query.reply(welcome))
    with pytest.raises(ProtocolError, match=sentence):
        await Session.join(pair.connect(), kind="editor")
    transport.close()


async def test_with_no_host_there_the_wait_ends() -> None:
    with pytest.raises(ConnectionLost, match="no session answered"):
        await Session.join(LoopbackBroker().connect(), kind="editor", timeout=0.1)


async def test_a_silent_host_is_given_up(pair: Pair) -> None:
    host, joined = await pair.open()
    kept: list[IncomingQuery] = []
    host.transport.serve(topics.asked_key("yard", topics.SNAPSHOT), kept.append)
    while not kept:
        with pytest.raises(ConnectionLost, match="nobody answered"):
            await joined.request(topics.SNAPSHOT, SnapshotRequest(), timeout=0.1)
    await close(joined, host)


async def test_what_nobody_serves_is_not_waited_for(pair: Pair) -> None:
    host, joined = await pair.open()
    with pytest.raises(ConnectionLost, match="nobody answered and nobody is there who could"):
        await joined.request(topics.SNAPSHOT, SnapshotRequest(), timeout=30.0)
    await close(joined, host)


async def test_the_host_comes_back_as_another_run(pair: Pair) -> None:
    host, joined = await pair.open()
    links: list[bool] = []
    joined.on_link(links.append)
    deltas: list[int] = []
    joined.subscribe(topics.DELTA, lambda delta, _: deltas.append(delta.epoch))
    await host.close()
    await until(lambda: links == [False])
    assert not joined.connected
    again = await Session.host(pair.listen(), name="yard", kind="simulation", epoch=4)
    await until(lambda: links == [False, True])
    assert joined.epoch == 4
    while not deltas:
        again.publish(topics.DELTA, SceneDelta(epoch=4, sequence=1, tick=0))
        await asyncio.sleep(0.01)
    await until(lambda: again.nodes_of("editor") == [joined.node] and joined.nodes_of("simulation") == [again.node])
    await close(joined, again)


async def test_what_is_asked_while_the_host_is_away_is_answered_when_it_is_back(pair: Pair) -> None:
    """On a line that is just being replaced it would be asked of nobody, and end at once."""
    host, joined = await pair.open()
    asked: list[SnapshotRequest] = []

    async def answer(request: SnapshotRequest, _: str) -> Snapshot:
        asked.append(request)
        mirror = SceneMirror()
        mirror.scene = "Yard"
        return mirror.to_snapshot()

    host.serve(topics.SNAPSHOT, answer)
    await joined.request(topics.SNAPSHOT, SnapshotRequest())
    await until(lambda: joined.nodes_of("simulation") == [host.node])
    asked.clear()
    joined._link_changed(False)
    with pytest.raises(ConnectionLost, match=r"nobody answered within 0\.05 s"):
        await joined.request(topics.SNAPSHOT, SnapshotRequest(), timeout=0.05)
    asking = asyncio.create_task(joined.request(topics.SNAPSHOT, SnapshotRequest(), timeout=30.0))
    await asyncio.sleep(0)
    assert not asked
    joined._link_changed(True)
    assert (await asking).scene == "Yard" and len(asked) == 1

    await host.close()
    await until(lambda: not joined.connected)
    asking = asyncio.create_task(joined.request(topics.SNAPSHOT, SnapshotRequest(), timeout=30.0))
    again = await Session.host(pair.listen(), name="yard", kind="simulation", epoch=4)
    again.serve(topics.SNAPSHOT, answer)
    with pytest.raises(ConnectionLost, match="the host was started anew meanwhile"):
        await asking
    assert len(asked) == 1 and (await joined.request(topics.SNAPSHOT, SnapshotRequest())).scene == "Yard"
    await close(joined, again)


async def test_another_session_in_the_hosts_place_is_not_taken_for_it(
    pair: Pair, caplog: pytest.LogCaptureFixture
) -> None:
    host, joined = await pair.open()
    links: list[bool] = []
    joined.on_link(links.append)
    await host.close()
    await until(lambda: links == [False])
    stranger = await Session.host(pair.listen(), name="beach", kind="simulation", epoch=4)
    await until(lambda: "where session yard was, session beach runs now" in caplog.text)
    await stranger.close()
    again = await Session.host(pair.listen(), name="yard", kind="simulation", epoch=5)
    await until(lambda: links == [False, True])
    assert joined.epoch == 5
    await close(joined, again)


async def test_a_tap_sees_every_publication() -> None:
    host, joined = await Pair("loopback").open()
    seen: list[tuple[str, bytes]] = []
    host.taps.append(lambda topic, key, payload: seen.append((topic.name, payload)))
    batch = EventBatch(epoch=3, tick=1, events=())
    host.publish(topics.EVENTS, batch)
    assert seen == [("events", codec.encode(batch, Encoding.JSON))]
    await close(joined, host)
    host.publish(topics.EVENTS, batch)
    assert len(seen) == 1


def test_versions_are_what_the_package_says() -> None:
    assert elys.__version__
    assert codec.with_prefix(b"", Encoding.JSON)[:4] == b"ELYS"


async def test_viewers_hear_of_hosts_and_render_nodes_and_an_editor_of_everybody(pair: Pair) -> None:
    host, editor = await pair.open()
    kinds = ("viewer", "viewer", "render")
    viewer, other, render = [await Session.join(pair.connect(), kind=kind) for kind in kinds]
    await until(lambda: len(editor.nodes) == len(host.nodes) == 5 and len(viewer.nodes) == len(other.nodes) == 2)
    assert set(viewer.nodes) == set(other.nodes) == {host.node.id, render.node.id}
    await close(viewer, other, render, editor, host)

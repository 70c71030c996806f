"""What every transport promises, held against the in-process one and against real zenoh over TCP."""

from __future__ import annotations

import queue
import socket
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.bus.access.limits import MAX_MESSAGE_SIZE
from elys.bus.topics import Delivery
from elys.bus.transports.loopback import LoopbackBroker, intersects
from elys.bus.transports.transport import IncomingQuery, Transport
from elys.bus.transports.zenoh import ZenohTransport
from elys.common.errors import BusError, ConnectionLost

PATIENCE = 20.0  # [s] far beyond what anything here takes; a failure, not a measure


class Network:
    """Opens a host's and others' transports of one kind, and closes all of them at the end."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.broker = LoopbackBroker()
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.transports: list[Transport] = []

    def host(self) -> Transport:
        return self._opened(self.broker.listen() if self.kind == "loopback" else ZenohTransport.listen(self.endpoint))

    def client(self) -> Transport:
        if self.kind == "loopback":
            return self._opened(self.broker.connect())
        return self._opened(ZenohTransport.connect(self.endpoint, timeout=PATIENCE))

    def _opened(self, transport: Transport) -> Transport:
        self.transports.append(transport)
        return transport


class Inbox:
    """Collects what callbacks bring, from any thread."""

    def __init__(self) -> None:
        self._queue: queue.Queue[Any] = queue.Queue()

    def __call__(self, *arguments: Any) -> None:
        self._queue.put(arguments)

    def next(self) -> Any:
        return self._queue.get(timeout=PATIENCE)

    def wait_for(self, wanted: Callable[[Any], bool]) -> Any:
        while not wanted(item := self.next()):
            pass
        return item

    def empty(self) -> bool:
        return self._queue.empty()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture(params=["loopback", "zenoh"])
def network(request: pytest.FixtureRequest) -> Iterator[Network]:
    opened = Network(request.param)
    yield opened
    for transport in reversed(opened.transports):
        transport.close()


def test_a_transport_knows_whether_anybody_listens(network: Network) -> None:
    host, client = network.host(), network.client()
    assert not host.has_listener("elys/s/lines/boxes")
    close = client.subscribe("elys/s/lines/*", lambda key, payload: None)
    waited = threading.Event()
    for wanted in (True, False):
        for _ in range(2000):
            if host.has_listener("elys/s/lines/boxes") == wanted:
                break
            waited.wait(PATIENCE / 2000)  # nothing tells of it: whoever publishes asks when there is something to say
        assert host.has_listener("elys/s/lines/boxes") == wanted
        assert not host.has_listener("elys/s/other")
        if wanted:
            close()


def settle(sender: Transport, receiver: Transport) -> None:
    """Returns once what `receiver` declared is known to `sender`: a subscription declared after it has been heard of."""
    arrived = threading.Event()
    close = receiver.subscribe("probe/settle", lambda key, payload: arrived.set())
    while not arrived.is_set():
        sender.publish("probe/settle", b"", Delivery.SEQUENCED)
        arrived.wait(0.02)
    close()


def ask(transport: Transport, key: str, payload: bytes = b"", timeout: float = PATIENCE) -> tuple[bytes | None, str]:
    """Asks until somebody who serves the key has been heard of."""
    while True:
        inbox = Inbox()
        transport.request(key, payload, timeout, inbox)
        answer = inbox.next()
        if answer != (None, ""):
            return answer  # type: ignore[no-any-return]


@pytest.mark.parametrize("delivery", list(Delivery))
def test_all_who_subscribe_hear_what_is_published_in_order(network: Network, delivery: Delivery) -> None:
    host, reader, other = network.host(), network.client(), network.client()
    inboxes = [Inbox() for _ in range(3)]
    for transport, inbox in zip((host, reader, other), inboxes, strict=True):
        transport.subscribe("a/b", inbox)
    for transport in (reader, other):
        settle(host, transport)
    payloads = [index.to_bytes(4, "little") for index in range(500)]
    for payload in payloads:
        host.publish("a/b", payload, delivery)
    for inbox in inboxes:
        assert [inbox.next() for _ in payloads] == [("a/b", payload) for payload in payloads]


def test_clients_reach_one_another_through_the_host(network: Network) -> None:
    network.host()
    one, other = network.client(), network.client()
    inbox = Inbox()
    other.subscribe("view/request/x", inbox)
    settle(one, other)
    one.publish("view/request/x", b"please", Delivery.LATEST)
    assert inbox.next() == ("view/request/x", b"please")


def test_wildcards_take_one_part_or_all_the_rest(network: Network) -> None:
    host, reader = network.host(), network.client()
    one, rest = Inbox(), Inbox()
    reader.subscribe("s/*/x", one)
    reader.subscribe("s/**", rest)
    settle(host, reader)
    for key in ("s/a/x", "s/a/y", "s/a/b/x", "t/a/x", "s/z/x"):
        host.publish(key, key.encode(), Delivery.SEQUENCED)
    assert [one.next()[0] for _ in range(2)] == ["s/a/x", "s/z/x"]
    assert [rest.next()[0] for _ in range(4)] == ["s/a/x", "s/a/y", "s/a/b/x", "s/z/x"]
    assert one.empty() and rest.empty()


def test_a_closed_subscription_hears_nothing_more(network: Network) -> None:
    host, reader = network.host(), network.client()
    closed, kept = Inbox(), Inbox()
    close = reader.subscribe("a", closed)
    reader.subscribe("a", kept)
    settle(host, reader)
    close()
    close()
    host.publish("a", b"1", Delivery.SEQUENCED)
    assert kept.next() == ("a", b"1")
    assert closed.empty()


@pytest.mark.parametrize("delivery", list(Delivery))
def test_four_megabytes_arrive_whole(network: Network, delivery: Delivery) -> None:
    host, reader = network.host(), network.client()
    inbox = Inbox()
    reader.subscribe("big", inbox)
    settle(host, reader)
    payload = bytes(range(256)) * (4 << 12)
    host.publish("big", payload, delivery)
    assert inbox.next() == ("big", payload)


def test_any_bytes_arrive_as_they_are(network: Network) -> None:
    host, reader = network.host(), network.client()
    inbox = Inbox()
    reader.subscribe("garbage", inbox)
    settle(host, reader)
    for payload in (b"", b"\0", b"\xff" * 70_000, b"ELYS", "ünïcode".encode()):
        host.publish("garbage", payload, Delivery.SEQUENCED)
        assert inbox.next() == ("garbage", payload)


def test_many_subscribers_all_hear(network: Network) -> None:
    host, reader = network.host(), network.client()
    inboxes = [Inbox() for _ in range(100)]
    for inbox in inboxes:
        reader.subscribe("many", inbox)
    settle(host, reader)
    host.publish("many", b"all", Delivery.LATEST)
    assert {inbox.next() for inbox in inboxes} == {("many", b"all")}


def test_a_request_is_answered(network: Network) -> None:
    host, client = network.host(), network.client()
    host.serve("double/*", lambda query: query.reply(query.payload * 2))
    assert ask(client, "double/x", b"ab") == (b"abab", "")
    assert ask(client, "*/x", b"c") == (b"cc", "")


def test_clients_answer_one_another(network: Network) -> None:
    network.host()
    one, other = network.client(), network.client()
    one.serve("pick/me", lambda query: query.reply(query.key.encode()))
    assert ask(other, "pick/me") == (b"pick/me", "")


def test_big_questions_and_answers(network: Network) -> None:
    host, client = network.host(), network.client()
    host.serve("echo", lambda query: query.reply(query.payload))
    payload = bytes(range(256)) * (4 << 12)
    assert ask(client, "echo", payload) == (payload, "")


def test_a_refusal_carries_its_reason(network: Network) -> None:
    host, client = network.host(), network.client()
    host.serve("no", lambda query: query.refuse("because ß"))
    assert ask(client, "no") == (None, "because ß")


def test_an_answer_may_come_later_from_another_thread(network: Network) -> None:
    host, client = network.host(), network.client()
    waiting: queue.Queue[IncomingQuery] = queue.Queue()
    host.serve("later", waiting.put)
    settle(client, host)
    inbox = Inbox()
    client.request("later", b"", PATIENCE, inbox)
    query = waiting.get(timeout=PATIENCE)
    threading.Thread(target=query.reply, args=(b"now",)).start()
    assert inbox.next() == (b"now", "")


def test_a_request_that_nobody_answers_fails_without_a_reason(network: Network) -> None:
    host, client = network.host(), network.client()
    kept = []
    host.serve("silent", kept.append)
    settle(client, host)
    for key in ("silent", "nobody"):
        inbox = Inbox()
        client.request(key, b"", 0.2, inbox)
        assert inbox.next() == (None, "")


def test_only_the_first_answer_counts(network: Network) -> None:
    host, client = network.host(), network.client()

    def twice(query: IncomingQuery) -> None:
        query.reply(b"first")
        query.reply(b"second")

    host.serve("twice", twice)
    settle(client, host)
    inbox = Inbox()
    client.request("twice", b"", PATIENCE, inbox)
    assert inbox.next() == (b"first", "")
    assert ask(client, "twice") == (b"first", "")
    assert inbox.empty()


def test_liveliness_tells_who_is_there_comes_and_goes(network: Network) -> None:
    host, early = network.host(), network.client()
    early.announce("node/editor/e")
    settle(host, early)
    seen = Inbox()
    host.watch("node/*/*", seen)
    assert seen.next() == ("node/editor/e", True)
    late = network.client()
    withdraw = late.announce("node/render/r")
    assert seen.next() == ("node/render/r", True)
    withdraw()
    assert seen.next() == ("node/render/r", False)
    early.close()
    assert seen.next() == ("node/editor/e", False)


def test_the_host_goes_and_comes_back_and_everything_works_again(network: Network) -> None:
    host, client = network.host(), network.client()
    link, samples, nodes = Inbox(), Inbox(), Inbox()
    client.watch_link(link)
    client.watch("node/*/*", nodes)
    client.subscribe("state", samples)
    client.serve("question", lambda query: query.reply(b"answer"))
    client.announce("node/editor/e")
    assert link.next() == (True,)
    host.announce("node/simulation/1")
    nodes.wait_for(lambda item: item == ("node/simulation/1", True))
    host.close()
    assert link.wait_for(lambda item: item == (False,))
    nodes.wait_for(lambda item: item == ("node/simulation/1", False))

    again = network.host()
    assert link.wait_for(lambda item: item == (True,))
    again.announce("node/simulation/2")
    nodes.wait_for(lambda item: item == ("node/simulation/2", True))
    settle(again, client)
    again.publish("state", b"2", Delivery.LATEST)
    assert samples.next() == ("state", b"2")
    assert ask(again, "question") == (b"answer", "")
    seen = Inbox()
    again.watch("node/editor/*", seen)
    assert seen.next() == ("node/editor/e", True)


def test_a_closed_transport_says_so(network: Network) -> None:
    host = network.host()
    host.close()
    host.close()
    with pytest.raises(BusError, match="closed"):
        host.publish("a", b"", Delivery.LATEST)
    with pytest.raises(BusError, match="closed"):
        host.subscribe("a", lambda key, payload: None)


def test_a_port_in_use_is_named_with_a_remedy() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(BusError, match=rf"127\.0\.0\.1:{port} is in use.*choose another port"):
            ZenohTransport.listen(f"tcp/127.0.0.1:{port}")
        host = ZenohTransport.listen_on_free_port(first_port=port)
        assert host.endpoint != f"tcp/127.0.0.1:{port}"
        host.close()


def test_nobody_there_is_said_with_a_remedy() -> None:
    with pytest.raises(ConnectionLost, match=r"nobody answers at tcp/127\.0\.0\.1:\d+ .*elys run SCENE"):
        ZenohTransport.connect(f"tcp/127.0.0.1:{free_port()}", timeout=0.2)


@pytest.mark.parametrize("endpoint", ["nonsense", "tcp/127.0.0.1", "carrier-pigeon/1.2.3.4:5"])
def test_an_endpoint_that_is_none_is_refused(endpoint: str) -> None:
    with pytest.raises(BusError):
        ZenohTransport.listen(endpoint)
    with pytest.raises(BusError):
        ZenohTransport.connect(endpoint, timeout=0.2)


def test_a_message_beyond_all_measure_costs_only_itself() -> None:
    network = Network("zenoh")
    host, client = network.host(), network.client()
    inbox = Inbox()
    host.subscribe("big", inbox)
    settle(client, host)
    client.publish("big", bytes(MAX_MESSAGE_SIZE + (1 << 20)), Delivery.SEQUENCED)
    settle(client, host)  # until it is through, the queue has no room for anything else
    client.publish("big", b"small", Delivery.SEQUENCED)
    assert inbox.next() == ("big", b"small")
    client.close()
    host.close()


parts = st.sampled_from(["a", "b", "*"])
heads, tails = st.lists(parts, min_size=1, max_size=4), st.sampled_from([[], ["**"]])
expressions = st.builds(lambda head, tail: "/".join([*head, *tail]), heads, tails)


@given(expressions, expressions)
def test_intersection_is_that_of_zenoh(left: str, right: str) -> None:
    import zenoh

    assert intersects(left, right) == zenoh.KeyExpr(left).intersects(zenoh.KeyExpr(right))

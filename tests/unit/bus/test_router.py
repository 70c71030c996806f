"""A tree of routers over real connections: what crosses them is counted."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Iterator

import pytest

from elys.bus import topics
from elys.bus.messages.scene import SceneDelta
from elys.bus.messages.vitals import VitalsRequest
from elys.bus.router import Router
from elys.bus.session import Session
from elys.bus.topics import Delivery
from elys.bus.transports.zenoh import ZenohTransport
from elys.bus.transports.zenoh_router import ZenohRouter
from elys.common.errors import BusError, RequestError
from tests.counting_relay import CountingRelay

PATIENCE = 20.0
FRAME = bytes(40_000)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Tree:
    """A host, one router below it through a relay that counts, and a second router below that one."""

    def __init__(self) -> None:
        ports = [free_port() for _ in range(3)]
        self.endpoints = [f"tcp/127.0.0.1:{port}" for port in ports]
        self.host = ZenohTransport.listen(self.endpoints[0])
        self.relay = CountingRelay(ports[0])
        self.upper = ZenohRouter.open(self.endpoints[1], [self.relay.endpoint])
        self.lower = ZenohRouter.open(self.endpoints[2], [self.endpoints[1]])
        self.opened: list[ZenohTransport] = [self.lower, self.upper, self.host]

    def client(self, place: int) -> ZenohTransport:
        transport = ZenohTransport.connect(self.endpoints[place], timeout=PATIENCE)
        self.opened.insert(0, transport)
        return transport

    def close(self) -> None:
        for transport in self.opened:
            transport.close()
        self.relay.__exit__(None, None, None)


@pytest.fixture
def tree() -> Iterator[Tree]:
    made = Tree()
    yield made
    made.close()


class Reader:
    """Counts what comes on a key and wakes who waits for so many."""

    def __init__(self, transport: ZenohTransport, key: str) -> None:
        self.payloads: list[bytes] = []
        self._came = threading.Condition()
        self.close = transport.subscribe(key, self._heard)

    def _heard(self, key: str, payload: bytes) -> None:
        with self._came:
            self.payloads.append(payload)
            self._came.notify_all()

    def wait_for(self, last: bytes) -> None:
        with self._came:
            assert self._came.wait_for(lambda: bool(self.payloads) and self.payloads[-1] == last, PATIENCE)


def until_heard(host: ZenohTransport, key: str, reader: Reader) -> None:
    """Returns when the host's messages reach a reader: its wish has come up the tree."""
    wait = threading.Event()
    while not reader.payloads:
        host.publish(key, b"?", Delivery.SEQUENCED)
        wait.wait(0.02)


def test_a_message_crosses_a_connection_once_for_all_who_want_it_below_and_never_for_nobody(tree: Tree) -> None:
    readers = [Reader(tree.client(place), "elys/a/state") for place in (1, 1, 1, 2, 2, 2)]
    wanted = Reader(tree.client(2), "elys/a/wanted")
    for reader in readers:
        until_heard(tree.host, "elys/a/state", reader)
    until_heard(tree.host, "elys/a/wanted", wanted)

    before = tree.relay.down
    for number in range(20):
        tree.host.publish("elys/a/state", FRAME + bytes([number]), Delivery.SEQUENCED)
        for reader in readers:  # one by one: a machine that is busy elsewhere might take more than a queue's time
            reader.wait_for(FRAME + bytes([number]))
    for reader in readers:
        assert sum(len(payload) > 1 for payload in reader.payloads) == 20
    crossed = tree.relay.down - before
    assert 20 * len(FRAME) < crossed < 20 * len(FRAME) * 1.1  # six readers, and each message came once

    before = tree.relay.down
    for _ in range(20):
        tree.host.publish("elys/a/unwanted", FRAME, Delivery.SEQUENCED)
        tree.host.publish("elys/b/state", FRAME, Delivery.SEQUENCED)
    tree.host.publish("elys/a/wanted", b"last", Delivery.SEQUENCED)  # comes after all before it
    wanted.wait_for(b"last")
    assert tree.relay.down - before < len(FRAME) / 4

    for reader in readers:
        reader.close()
    wait = threading.Event()
    while tree.host.has_listener("elys/a/state"):
        wait.wait(0.01)
    before = tree.relay.down
    for _ in range(20):
        tree.host.publish("elys/a/state", FRAME, Delivery.SEQUENCED)
    tree.host.publish("elys/a/wanted", b"end", Delivery.SEQUENCED)
    wanted.wait_for(b"end")
    assert tree.relay.down - before < len(FRAME) / 4


async def test_sessions_work_through_routers_and_a_router_shows_itself(tree: Tree) -> None:
    said: list[str] = []
    router = Router(tree.lower, said.append)
    router.start()
    host = await Session.host(tree.host, name="yard", kind="simulation", epoch=7)
    joined = await Session.join(tree.client(2), kind="editor", name="yard")
    assert (joined.name, joined.epoch) == ("yard", 7)
    deltas: list[int] = []
    joined.subscribe(topics.DELTA, lambda delta, _: deltas.append(delta.sequence))
    while not host.has_listener(topics.DELTA):
        await asyncio.sleep(0.005)
    for sequence in range(1, 200):
        host.publish(topics.DELTA, SceneDelta(epoch=7, sequence=sequence, tick=sequence))
    while len(deltas) < 199:
        await asyncio.sleep(0.005)
    assert deltas == list(range(1, 200))

    while router.id not in joined.nodes:
        await asyncio.sleep(0.005)
    vitals = await joined.request(topics.VITALS, VitalsRequest(), key=router.id)
    assert vitals.kind == "router" and joined.transport.identity() in {n.identity for n in vitals.neighbours}
    with pytest.raises(RequestError, match="at least 8 bytes"):
        await joined._ask(topics.asked_key("yard", topics.VITALS, router.id, asker=joined.node.id), b"", 5.0)
    assert "session yard (simulation) is here" in said
    tree.opened.remove(tree.host)
    await host.close()
    while router.sessions:
        await asyncio.sleep(0.005)
    while router.id in joined.nodes:
        await asyncio.sleep(0.005)
    assert "session yard (simulation) is gone" in said and not joined.connected
    router.close()


def test_a_router_waits_for_what_is_above_and_says_what_is_wrong_with_its_endpoints() -> None:
    above, own = free_port(), f"tcp/127.0.0.1:{free_port()}"
    router = ZenohRouter.open(own, [f"tcp/127.0.0.1:{above}"])
    try:
        with pytest.raises(BusError, match=f"{own} is in use"):
            ZenohRouter.open(own)
        with pytest.raises(BusError, match="give tcp/ADDRESS:PORT"):
            ZenohRouter.open("nonsense")
        connected = threading.Event()
        router.watch_links(lambda identity, kind, alive: connected.set() if alive else None)
        host = ZenohTransport.listen(f"tcp/127.0.0.1:{above}")
        assert connected.wait(PATIENCE)
        host.close()
    finally:
        router.close()

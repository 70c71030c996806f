"""Roles hold through a router as they do at a host: over real zenoh, with clients that care for no rule."""

from __future__ import annotations

import asyncio
import queue
import threading
from collections.abc import Iterator
from dataclasses import replace

import pytest
from zenoh.handlers import Callback

from elys.bus import topics
from elys.bus.access.host import HostAccess, with_certificate
from elys.bus.access.keyring import Keyring, new_key
from elys.bus.access.roles import GIVEN, Role, signed_id
from elys.bus.router import Router
from elys.bus.session import Session
from elys.bus.topics import NODE_KINDS, QUERIES, TOPICS, Delivery
from elys.bus.transports.zenoh import ZenohTransport
from elys.bus.transports.zenoh_router import ZenohRouter
from elys.common.errors import AccessError
from tests.unit.bus.access.guarded import NAME, PATIENCE, Guarded, Raw, free_port, wait_until

LARGE = bytes(300_000)  # more than anybody but a host may say at once


class Tree(Guarded):
    """A guarded host, a router below it that shows the key of `role`, and clients of both."""

    def __init__(self, role: Role = Role.OWNER) -> None:
        super().__init__()
        self.below = f"tcp/127.0.0.1:{free_port()}"
        credentials = self.keyring.credentials(self.keyring.named(role.title))
        access = HostAccess.of(self.keyring)
        self.router = ZenohRouter.open(self.below, [self.endpoint], access=access, credentials=credentials)
        up = threading.Event()
        self.router.watch_links(lambda identity, kind, alive: up.set())
        assert up.wait(PATIENCE)

    def client_below(self, role: Role) -> Raw:
        key = self.keyring.named(role.title)
        self.clients.append(Raw(self.below, key.user, key.secret))
        return self.clients[-1]

    def close(self) -> None:
        for client in self.clients:
            client.zenoh.close()
        self.clients.clear()
        self.router.close()
        super().close()


@pytest.fixture
def tree() -> Iterator[Tree]:
    opened = Tree()
    yield opened
    opened.close()


def until_way_up(tree: Tree, client: Raw, heard: queue.Queue[tuple[str, bytes]]) -> None:
    """Returns when what the client below says comes to who listens above."""

    def came() -> bool:
        client.say(topics.key_of(NAME, topics.VIEW_REQUEST, "anybody"), b"marker of the way")
        try:
            heard.get(timeout=0.01)
        except queue.Empty:
            return False
        return True

    wait_until(came)


@pytest.mark.parametrize("role", [Role.VIEWER, Role.PLAYER, Role.EDITOR], ids=lambda role: role.title)
def test_what_a_role_may_not_say_below_a_router_reaches_nobody_above_or_beside(tree: Tree, role: Role) -> None:
    tree.listen()
    above, beside = tree.client(Role.OWNER), tree.client_below(Role.OWNER)
    for witness in (above, beside):
        for topic in TOPICS:
            witness.listen(topics.key_of(NAME, topic, "*"))
    client = tree.client_below(role)
    for heard in (tree.heard, above.heard, beside.heard):
        until_way_up(tree, client, heard)
    other = tree.keyring.named("owner").user
    expected = []
    for topic in TOPICS:
        for node in (client.node, f"tool-1.{other}", "tool-1"):
            key = topics.key_of(NAME, topic, node if topic.by_node else "anything")
            client.say(key, b"said by " + node.encode())
            if role >= topic.publisher and (node == client.node or not topic.by_node):
                expected.append((key, b"said by " + node.encode()))
    for heard in (tree.heard, above.heard, beside.heard):
        assert sorted(tree.heard_of(client, heard)) == sorted(expected)
    # Spelled out, so that a wrong table cannot make a wrong router right.
    assert not {key for key, _ in expected} & {
        f"elys/{NAME}/{name}" for name in ("state", "delta", "status", "commands")
    }


def test_a_viewers_forged_command_reply_and_token_reach_nobody_through_a_router(tree: Tree) -> None:
    asked: list[str] = []

    def answer(query: object) -> None:
        asked.append(query.key)  # type: ignore[attr-defined]
        query.reply(b"answer")  # type: ignore[attr-defined]

    tree.transport.serve("elys/**", answer)
    viewer, owner = tree.client_below(Role.VIEWER), tree.client(Role.OWNER)
    for query in QUERIES:
        for key in ("something", viewer.node, f"render-1.{owner.user}"):
            expression = topics.asked_key(NAME, query, key)
            viewer.zenoh.declare_queryable(expression, Callback(answer_forged, indirect=False))
    seen: queue.Queue[str] = queue.Queue()
    tree.transport.watch(topics.node_key(NAME, "*", "*"), lambda key, alive: seen.put(key))
    tokens = [
        viewer.zenoh.liveliness().declare_token(topics.node_key(NAME, kind, node))
        for kind in (*NODE_KINDS, "stranger")
        for node in (viewer.node, f"other-1.{owner.user}", "other-2")
    ]
    shown = {seen.get(timeout=PATIENCE) for least in NODE_KINDS.values() if least is Role.VIEWER}
    assert shown == {
        topics.node_key(NAME, kind, viewer.node) for kind, least in NODE_KINDS.items() if least is Role.VIEWER
    }
    wait_until(lambda: viewer.ask(topics.asked_key(NAME, topics.SNAPSHOT, asker=viewer.node), timeout=1.0))
    asked.clear()
    for node in (viewer.node, f"tool-1.{owner.user}", "*"):
        assert viewer.ask(f"elys/{NAME}/command/{node}", b"forged", timeout=1.0) == []
        assert viewer.ask(f"elys/{NAME}/offer/some/{node}", b"forged", timeout=1.0) == []
    assert asked == []
    for query in QUERIES:
        if query.answerer > Role.VIEWER:
            answers = owner.ask(topics.asked_key(NAME, query, "something", asker=owner.node))
            assert answers == [b"answer"], query.name
    assert seen.empty()
    del tokens


def answer_forged(query: object) -> None:
    query.reply(str(query.key_expr), b"forged")  # type: ignore[attr-defined]


def test_a_router_with_a_viewers_key_passes_up_no_more_than_that_viewer_may() -> None:
    tree = Tree(Role.VIEWER)
    try:
        tree.listen()
        asked: list[str] = []
        tree.transport.serve("elys/**", lambda query: (asked.append(query.key), query.reply(b"answer")))
        owner = tree.client_below(Role.OWNER)
        until_way_up(tree, owner, tree.heard)
        for topic in TOPICS:
            owner.say(topics.key_of(NAME, topic, owner.node), b"said")
        said = {key for key, payload in tree.heard_of(owner, tree.heard) if payload == b"said"}
        assert said == {
            topics.key_of(NAME, topic, owner.node)
            for topic in TOPICS
            if topic.publisher is Role.VIEWER and not topic.by_node
        }
        for query in QUERIES:
            assert owner.ask(topics.asked_key(NAME, query, "something", asker=owner.node), timeout=0.3) == []
        assert asked == []
    finally:
        tree.close()


def test_what_a_host_says_comes_down_however_large_and_sessions_may_be_hosted_below_by_owners_alone(tree: Tree) -> None:
    viewer, editor, owner = (tree.client_below(role) for role in (Role.VIEWER, Role.EDITOR, Role.OWNER))
    viewer.listen(f"elys/{NAME}/state")
    viewer.listen("elys/meadow/state")

    def heard(say: object, payload: bytes) -> bool:
        say()  # type: ignore[operator]
        try:
            return viewer.heard.get(timeout=0.01)[1] == payload
        except queue.Empty:
            return False

    key = f"elys/{NAME}/state"
    wait_until(lambda: heard(lambda: tree.transport.publish(key, LARGE, Delivery.SEQUENCED), LARGE))
    wait_until(lambda: heard(lambda: owner.say("elys/meadow/state", LARGE), LARGE))
    editor.say("elys/meadow/state", b"forged")
    editor.say("elys/meadow/log", b"line")
    owner.listen("elys/meadow/log")
    owner.say("elys/meadow/state", b"end")
    payloads = []
    while not payloads or payloads[-1] != b"end":
        payloads.append(viewer.heard.get(timeout=PATIENCE)[1])
    assert b"forged" not in payloads


async def test_sessions_are_joined_through_a_guarded_router_which_shows_itself(tree: Tree) -> None:
    router = Router(tree.router, lambda sentence: None)
    router.start()
    host = await Session.host(tree.transport, name=NAME, kind="simulation", epoch=7)
    shown = tree.keyring.credentials(tree.keyring.named("viewer"))
    transport = await asyncio.to_thread(lambda: ZenohTransport.connect(tree.below, credentials=shown))
    joined = await Session.join(transport, kind="tool", name=NAME)
    assert joined.epoch == 7 and joined.node.id == signed_id(joined.node.id, shown.user)
    async with asyncio.timeout(PATIENCE):
        while router.id not in joined.nodes or router.id not in host.nodes or joined.node.id not in host.nodes:
            await asyncio.sleep(0.005)
    vitals = await joined.request(topics.VITALS, topics.VITALS.request(), key=router.id)
    assert joined.transport.identity() in {neighbour.identity for neighbour in vitals.neighbours}
    above = {neighbour.identity for neighbour in vitals.neighbours if neighbour.kind == "router"}
    assert above == {tree.transport.identity()} and vitals.identity in {link.peer for link in tree.transport.links()}
    router.close()
    await joined.close()
    await host.close()


def test_a_router_asks_below_for_what_it_shows_above() -> None:
    keyring = Keyring(keys=[])
    with pytest.raises(AccessError, match="whoever it let in otherwise would be taken for its owner"):
        ZenohRouter.open("tcp/127.0.0.1:0", ["tcp/127.0.0.1:1"], access=HostAccess.of(keyring))


def test_a_router_takes_secrets_or_certificates_on_both_sides() -> None:
    keyring = Keyring(keys=[new_key(role) for role in GIVEN])
    access, shown = HostAccess.of(keyring), keyring.credentials(keyring.named("owner"))
    for below, above in (("tcp", "tls"), ("tls", "tcp")):
        with pytest.raises(AccessError, match="give endpoints of tls/ to both --listen and --connect, or to neither"):
            ZenohRouter.open(f"{below}/127.0.0.1:1", [f"{above}/127.0.0.1:2"], access=access, credentials=shown)
    with pytest.raises(AccessError, match="has no certificate: make a file with `elys keys export owner`"):
        ZenohRouter.open("tls/127.0.0.1:1", ["tls/127.0.0.1:2"], access=access, credentials=shown)
    other = replace(shown, secret="x" * 32)
    with pytest.raises(AccessError, match="has one secret above this router and another one here"):
        ZenohRouter.open("tcp/127.0.0.1:1", ["tcp/127.0.0.1:2"], access=access, credentials=other)


def test_roles_hold_through_a_router_that_speaks_tls() -> None:
    keyring = Keyring(keys=[new_key(role) for role in GIVEN])
    keyring.authority.ensure()
    access = HostAccess.with_certificates(keyring, ("127.0.0.1", "localhost"))
    above, below = (f"tls/127.0.0.1:{free_port()}" for _ in range(2))
    shown = {role: with_certificate(keyring.named(role.title), keyring.authority) for role in GIVEN}
    host = ZenohTransport.listen(above, access=access)
    router = ZenohRouter.open(below, [above], access=access, credentials=shown[Role.OWNER])
    viewer = ZenohTransport.connect(below, timeout=PATIENCE, credentials=shown[Role.VIEWER])
    try:
        at_host: queue.Queue[tuple[str, bytes]] = queue.Queue()
        at_viewer: queue.Queue[tuple[str, bytes]] = queue.Queue()
        host.subscribe("elys/**", lambda key, payload: at_host.put((key, payload)))
        viewer.subscribe(f"elys/{NAME}/state", lambda key, payload: at_viewer.put((key, payload)))

        def goes(say: ZenohTransport, key: str, heard: queue.Queue[tuple[str, bytes]]) -> bool:
            say.publish(key, b"way", Delivery.SEQUENCED)
            try:
                return heard.get(timeout=0.01) == (key, b"way")
            except queue.Empty:
                return False

        wait_until(lambda: goes(host, f"elys/{NAME}/state", at_viewer))
        wait_until(lambda: goes(viewer, f"elys/{NAME}/view/request/anybody", at_host))
        viewer.publish(f"elys/{NAME}/delta", b"forged", Delivery.SEQUENCED)
        viewer.publish(f"elys/{NAME}/view/request/anybody", b"end", Delivery.SEQUENCED)
        viewer.publish(f"elys/{NAME}/view/request/anybody", b"end", Delivery.LATEST)
        came = []
        while [payload for _, payload in came].count(b"end") < 2:
            came.append(at_host.get(timeout=PATIENCE))
        assert b"forged" not in [payload for _, payload in came]
    finally:
        for transport in (viewer, router, host):
            transport.close()

"""What each role may do, held against zenoh's router by clients that try all of it: the table of topics.py comes true."""

from __future__ import annotations

import asyncio
import queue
from collections.abc import Iterator

import pytest
from zenoh.handlers import Callback

from elys.bus import codec, topics
from elys.bus.access.roles import GIVEN, Role
from elys.bus.messages.commands import CommandReply, CommandRequest, KeepLast, LoadScene, SetPlaying
from elys.bus.messages.streaming import StreamInterest
from elys.bus.session import Session
from elys.bus.streaming.sender import Sender
from elys.bus.streaming.server import StreamServer
from elys.bus.streaming.wire import WANTS_KEY, Ack, pack_ack
from elys.bus.topics import NODE_KINDS, QUERIES, TOPICS, Encoding
from tests.unit.bus.access.guarded import NAME, PATIENCE, Guarded, Raw, wait_until

ROLES = pytest.mark.parametrize("role", GIVEN, ids=[role.title for role in GIVEN])


@pytest.fixture
def guarded() -> Iterator[Guarded]:
    opened = Guarded()
    yield opened
    opened.close()


def said_key(topic: topics.Topic, node: str) -> str:
    return topics.key_of(NAME, topic, node if topic.by_node else "anything")


@ROLES
def test_what_a_role_may_not_say_reaches_neither_host_nor_others(guarded: Guarded, role: Role) -> None:
    guarded.listen()
    witness = guarded.client(Role.OWNER)
    for topic in TOPICS:
        witness.listen(topics.key_of(NAME, topic, "*"))
    client = guarded.client(role)
    wait_until(lambda: reaches(guarded, client, witness))
    for topic in TOPICS:
        client.say(said_key(topic, client.node), b"said")
        client.take_back(said_key(topic, client.node))
    expected = sorted(
        (said_key(topic, client.node), payload)
        for topic in TOPICS
        if role >= topic.publisher
        for payload in (b"said", b"")
    )
    at_host = guarded.heard_of(client, guarded.heard)
    at_witness = guarded.heard_of(client, witness.heard)
    assert sorted(at_host) == expected
    assert sorted(at_witness) == expected
    # Spelled out, so that a wrong table cannot make a wrong router right.
    assert not {key for key, _ in at_host} & {
        f"elys/{NAME}/{name}" for name in ("state", "delta", "status", "commands")
    }
    assert (f"elys/{NAME}/input/{client.node}", b"said") in at_host or role is Role.VIEWER


def reaches(guarded: Guarded, client: Raw, witness: Raw) -> bool:
    """Whether what the client says comes to the witness yet."""
    client.say(topics.key_of(NAME, topics.VIEW_REQUEST, "anybody"), b"marker of the way")
    try:
        witness.heard.get(timeout=0.01)
    except queue.Empty:
        return False
    return True


def test_nobody_sends_input_as_another_user(guarded: Guarded) -> None:
    guarded.listen()
    player = guarded.client(Role.PLAYER)
    other = guarded.keyring.named("editor").user
    for node in (f"tool-1.{other}", f"tool-1.{player.user}.{other}", "tool-1", f"tool-1.{player.user}x"):
        player.say(f"elys/{NAME}/input/{node}", b"forged")
    player.say(f"elys/{NAME}/input/tool-1.{player.user}", b"own")
    assert guarded.heard_of(player, guarded.heard) == [(f"elys/{NAME}/input/tool-1.{player.user}", b"own")]


async def test_nobody_acknowledges_a_stream_for_another(guarded: Guarded) -> None:
    """An ack says what its viewer has, and may have it told all anew: forged, it would starve another's stream or blind it."""
    host = await Session.host(guarded.transport, name=NAME, kind="simulation", epoch=7)
    server = StreamServer(host)
    viewer, player = guarded.client(Role.VIEWER), guarded.client(Role.PLAYER)
    theirs, own = f"0123-viewer-1.{viewer.user}", f"4567-viewer-2.{player.user}"

    def say(client: Raw, stream: str, ack: Ack, chosen: int) -> None:
        interest = codec.encode(StreamInterest(chosen=(chosen,)), Encoding.MSGPACK)
        client.say(f"elys/{NAME}/stream/ack/{stream}", codec.with_prefix(pack_ack(ack), Encoding.RAW))
        client.say(f"elys/{NAME}/stream/interest/{stream}", interest)

    async def served(stream: str, chosen: int) -> Sender:
        async with asyncio.timeout(PATIENCE):
            while stream not in server.viewers or server.viewers[stream].sender.interest.chosen != (chosen,):
                await asyncio.sleep(0.005)
        return server.viewers[stream].sender

    say(viewer, theirs, Ack(0, 0, 0, 0, 0, 0, 1), 1)
    sender = await served(theirs, 1)
    generation = sender.generation
    lost = Ack(WANTS_KEY, generation, 1, 0, 0, 0, 0)  # nothing came, tell it anew, and there is no connection any more
    for stream in (
        theirs,
        f"0123-viewer-1.{player.user}.{viewer.user}",
        "0123-viewer-1",
        f"0123-viewer-1.{player.user}x",
    ):
        say(player, stream, lost, 2)
    say(player, own, Ack(0, 0, 0, 0, 0, 0, 1), 3)  # comes after all that
    await served(own, 3)
    assert set(server.viewers) == {theirs, own}
    assert server.viewers[theirs].sender is sender and sender.interest.chosen == (1,)
    assert (sender.generation, sender.restarts, sender._lanes.open) == (generation, 0, 1)
    await host.close()


@ROLES
def test_only_who_may_ask_is_answered(guarded: Guarded, role: Role) -> None:
    guarded.transport.serve("elys/**", lambda query: query.reply(b"answer"))
    client = guarded.client(role)
    other = guarded.keyring.named("owner" if role is not Role.OWNER else "viewer").user
    for query in QUERIES:
        key = topics.asked_key(NAME, query, "something", asker=client.node)
        assert client.ask(key) == ([b"answer"] if role >= query.asker else []), query.name
        by_another = client.ask(topics.asked_key(NAME, query, "something", asker=f"editor-1.{other}"))
        assert by_another == ([b"answer"] if role is Role.OWNER else [])  # a router is an owner that asks for others
        assert client.ask(topics.asked_key(NAME, query, "something", asker="editor-1")) == []
    for everything in ("elys/**", f"elys/{NAME}/**", f"elys/{NAME}/command/*"):
        assert client.ask(everything) == []
    assert (client.ask(f"elys/{NAME}/command/{client.node}") == [b"answer"]) == (role >= Role.EDITOR)


@ROLES
def test_only_who_may_answer_is_asked(guarded: Guarded, role: Role) -> None:
    client, owner = guarded.client(role), guarded.client(Role.OWNER)
    for query in QUERIES:
        for key in (client.node, f"render-1.{owner.user}"):
            expression = topics.asked_key(NAME, query, key)
            client.zenoh.declare_queryable(expression, Callback(answer_forged, indirect=False))
    guarded.listen()
    guarded.heard_of(client, guarded.heard)  # all that was declared is with the router
    for query in QUERIES:
        mine = topics.asked_key(NAME, query, client.node, asker=owner.node)
        may = role >= query.answerer
        if may:
            wait_until(lambda mine=mine: owner.ask(mine))
        assert owner.ask(mine) == ([b"forged"] if may else []), query.name
        if role is not Role.OWNER:
            others = topics.asked_key(NAME, query, f"render-1.{owner.user}", asker=owner.node)
            assert owner.ask(others) == []
    assert owner.ask(f"elys/{NAME}/snapshot/{owner.node}") == []


def answer_forged(query: object) -> None:
    query.reply(str(query.key_expr), b"forged")  # type: ignore[attr-defined]


@ROLES
def test_nobody_shows_itself_as_what_it_is_not(guarded: Guarded, role: Role) -> None:
    client, owner = guarded.client(role), guarded.client(Role.OWNER)
    seen: queue.Queue[tuple[str, bool]] = queue.Queue()
    guarded.transport.watch(topics.node_key(NAME, "*", "*"), lambda key, alive: seen.put((key, alive)))
    kept = [
        client.zenoh.liveliness().declare_token(topics.node_key(NAME, kind, node))
        for kind in (*NODE_KINDS, "stranger")
        for node in (client.node, f"other-1.{owner.user}" if role is not Role.OWNER else "other-1", "other-2")
    ]
    guarded.listen()
    guarded.heard_of(client, guarded.heard)
    shown = {seen.get(timeout=PATIENCE) for kind, least in NODE_KINDS.items() if role >= least}
    assert shown == {
        (topics.node_key(NAME, kind, client.node), True) for kind, least in NODE_KINDS.items() if role >= least
    }
    assert seen.empty()
    assert not any("/simulation/" in key or "/replay/" in key for key, _ in shown)
    del kept


def test_nobody_reads_along_what_is_not_for_him(guarded: Guarded) -> None:
    viewer, owner, player = guarded.client(Role.VIEWER), guarded.client(Role.OWNER), guarded.client(Role.PLAYER)
    for expression in ("elys/**", "**", f"elys/{NAME}/*", f"elys/{NAME}/input/*", f"elys/{NAME}/view/request/*"):
        viewer.listen(expression)
    owner.listen(f"elys/{NAME}/input/*")
    viewer.listen(f"elys/{NAME}/log")  # may be heard, and tells when all else would have come
    key = f"elys/{NAME}/input/tool-1.{player.user}"
    wait_until(lambda: said_and_heard(player, owner, key))
    wait_until(lambda: said_and_heard(owner, viewer, f"elys/{NAME}/log"))
    player.say(key, b"typed")
    while owner.heard.get(timeout=PATIENCE)[1] != b"typed":
        pass
    owner.say(f"elys/{NAME}/log", b"end")
    came = []
    while (item := viewer.heard.get(timeout=PATIENCE)) != (f"elys/{NAME}/log", b"end"):
        came.append(item[0])
    assert set(came) <= {f"elys/{NAME}/log"}


def said_and_heard(speaker: Raw, listener: Raw, key: str) -> bool:
    speaker.say(key, b"way")
    try:
        listener.heard.get(timeout=0.01)
    except queue.Empty:
        return False
    return True


async def test_the_host_itself_refuses_an_editor_what_only_owners_may(guarded: Guarded) -> None:
    host = await Session.host(guarded.transport, name=NAME, kind="simulation", epoch=1)
    asked: list[str] = []

    async def take(request: CommandRequest, key: str) -> object:
        asked.append(type(request.command).__name__)
        return CommandReply(accepted=True, tick=1)

    host.serve(topics.COMMAND, take)
    for role in (Role.EDITOR, Role.OWNER):
        client = guarded.client(role)
        for command in (SetPlaying(playing=True), LoadScene(name="other", records=()), KeepLast()):
            payload = codec.encode(CommandRequest(origin="x", command=command), Encoding.JSON)
            key = topics.asked_key(NAME, topics.COMMAND, asker=client.node)
            (answer,) = await asyncio.to_thread(client.ask, key, payload)
            if role is Role.EDITOR and not isinstance(command, SetPlaying):
                assert answer == "an editor may not ask for command: join with the key of an owner"
            else:
                assert b'"accepted":true' in answer
    assert asked == ["SetPlaying", "SetPlaying", "LoadScene", "KeepLast"]
    await host.close()


def test_what_is_larger_than_its_topic_is_dropped_at_the_door(guarded: Guarded) -> None:
    guarded.listen()
    guarded.transport.serve("elys/**", lambda query: query.reply(str(len(query.payload)).encode()))
    owner = guarded.client(Role.OWNER)
    for topic in TOPICS:
        if topic.publisher <= Role.OWNER and topic.largest < 1 << 23:
            key = said_key(topic, owner.node)
            owner.say(key, bytes(topic.largest + 1))
            owner.say(key, bytes(topic.largest))
            assert [(k, len(p)) for k, p in guarded.heard_of(owner, guarded.heard)] == [(key, topic.largest)]
    for query in QUERIES:
        if query.largest < 1 << 23:
            key = topics.asked_key(NAME, query, "something", asker=owner.node)
            assert owner.ask(key, bytes(query.largest)) == [str(query.largest).encode()]
            assert owner.ask(key, bytes(query.largest + 1)) == []

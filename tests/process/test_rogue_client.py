"""A client that speaks nonsense on every topic and every query of a running session: refused, logged seldom, harmless."""

from __future__ import annotations

import asyncio
import json
import random
import struct
import time
from collections.abc import Iterator
from typing import Any

import pytest
import zenoh
from mcap.reader import make_reader

from elys.bus import codec, topics
from elys.bus.access.keyring import required_keyring
from elys.bus.messages.commands import Rename
from elys.bus.messages.ghosts import Ghost
from elys.bus.messages.state_frame import HEADER
from elys.bus.messages.views import PickRequest, ViewCamera, ViewFrame, ViewRequest
from elys.bus.topics import PROTOCOL_VERSION, QUERIES, TOPICS, Encoding, Query, Topic
from tests.process.clients import Client, client

pytestmark = pytest.mark.process

CODES = {Encoding.JSON: 1, Encoding.MSGPACK: 2, Encoding.STATE: 3, Encoding.RAW: 4}
FLOOD_SECONDS = 2.0  # at least, and until there were
FLOOD_MESSAGES = 1000
BODIES = (
    b"",
    b"{}",
    b"[]",
    b"null",
    b'"text"',
    b"1e999",
    b'{"epoch":1e400}',
    b'{"a":' * 5000,
    b"[" * 200_000,
    b"\xff\xfe\x00",
    b'{"view":"' + b"a" * 1_000_000 + b'"}',
    bytes(4096),
    HEADER.pack(1, 2, 3.0, 4, 5, 6, 1 << 31, 0),  # says that it has two thousand million bodies
    HEADER.pack(1, 2, float("nan"), 4, 5, 6, 0, 0),
    HEADER.pack(2**64 - 1, 2**64 - 1, 1e308, 2**64 - 1, 2**64 - 1, 2**64 - 1, 0, 0xFFFFFFFF),
    HEADER.pack(1, 2, 1.0, 4, 5, 6, 2, 0) + bytes(68),  # two bodies, and the bytes of one
)
CAMERA = {"position": [1e308, -1e308, 0], "rotation": [0, 0, 0, 0], "field_of_view": -1e9, "near": 0, "far": -1}
VIEW = {"view": "rogue", "sequence": 1, "camera": CAMERA, "width": 10**9, "height": -5, "selection": [1, 2**40, -7]}
RING = {"machine": "", "process": 1, "descriptor": 0, "slot_count": 2**40, "slot_size": 2**60}


def payloads(topic: Topic[Any] | Query[Any, Any], noise: random.Random) -> Iterator[bytes]:
    """What no reader of a topic can use: no prefix, a wrong one, a right one before nonsense, and a lot of nothing."""
    code = CODES[topic.encoding if isinstance(topic, Topic) else topic.request_encoding]
    yield from (
        b"",
        b"x",
        noise.randbytes(7),
        noise.randbytes(1000),
        noise.randbytes(100_000),
        noise.randbytes(5 << 20),
    )
    for version in (0, PROTOCOL_VERSION + 1, 65535):
        yield struct.pack("<4sHBB", b"ELYS", version, code, 0) + b"{}"
    for wrong_code in (0, code % 4 + 1, 255):
        yield struct.pack("<4sHBB", b"ELYS", PROTOCOL_VERSION, wrong_code, 0) + b"{}"
    prefix = struct.pack("<4sHBB", b"ELYS", PROTOCOL_VERSION, code, 0)
    yield from (prefix + body for body in (*BODIES, noise.randbytes(500)))


class Rogue:
    """A raw client of the bus that was let in as an editor, knows the keys and cares for nothing else."""

    def __init__(self, endpoint: str, *, name: str, render_node: str, ghost: str) -> None:
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        config.insert_json5("scouting/multicast/enabled", "false")
        user = required_keyring().named("editor")
        config.insert_json5("transport/auth/usrpwd", json.dumps({"user": user.user, "password": user.secret}))
        self._zenoh = zenoh.open(config)
        self._noise = random.Random(7)
        self._key = {topic.name: topics.key_of(name, topic, render_node if topic.keyed else "") for topic in TOPICS}
        for query in QUERIES:
            whom = ghost if query.name.startswith("ghost_") else render_node
            key = whom if query.keyed else ""
            self._key[query.name] = topics.asked_key(name, query, key, asker=f"rogue.{user.user}")

    def publish_nonsense(self) -> None:
        for topic in TOPICS:
            for payload in payloads(topic, self._noise):
                self._put(self._key[topic.name], payload)

    def ask_nonsense(self) -> dict[str, list[str]]:
        """The answers by query: "" for one that was answered, else the refusal. What is too large is dropped unread."""
        answers: dict[str, list[str]] = {}
        for query in QUERIES:
            for payload in payloads(query, self._noise):
                if len(payload) > query.largest:
                    assert not list(self._zenoh.get(self._key[query.name], payload=payload, timeout=10.0))
                    continue
                for reply in self._zenoh.get(self._key[query.name], payload=payload, timeout=10.0):
                    refusal = "" if reply.ok is not None else reply.err.payload.to_bytes().decode()
                    answers.setdefault(query.name, []).append(refusal)
        return answers

    def ask_for_impossible_views(self) -> None:
        for changes in (
            {},
            {"view": "x" * 10_000},
            {"view": "a/../b"},
            {"ring": RING},
            {"width": 2**70},
            {"sequence": 2**70},
        ):
            self._put_json("view/request", {**VIEW, **changes})
        for number in range(200):
            self._put_json("view/request", {**VIEW, "view": f"rogue-{number}", "width": 64, "height": 64})
        for x in (-1, 0, 2**62):
            pick = {"camera": CAMERA, "width": 10**9, "height": 0, "x": x, "y": x}
            payload = codec.with_prefix(json.dumps(pick).encode(), Encoding.JSON)
            assert len(list(self._zenoh.get(self._key["pick"], payload=payload, timeout=10.0))) == 1

    def flood(self) -> None:
        """Short nonsense on everything, as fast as it goes, for a while."""
        count, end = 0, time.monotonic() + FLOOD_SECONDS
        while time.monotonic() < end or count < FLOOD_MESSAGES:
            for key in self._key.values():
                self._zenoh.put(key, self._noise.randbytes(self._noise.randrange(300)))
                self._zenoh.get(key, lambda _: None, payload=self._noise.randbytes(50), timeout=1.0)
                count += 2

    def close(self) -> None:
        self._zenoh.close()

    def _put_json(self, topic: str, content: dict[str, Any]) -> None:
        self._put(self._key[topic], codec.with_prefix(json.dumps(content).encode(), Encoding.JSON))

    def _put(self, key: str, payload: bytes) -> None:
        """All of it arrives: by zenoh's default what finds a full queue is dropped."""
        self._zenoh.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)


def test_nonsense_on_every_topic_and_query_harms_nobody(elys, free_port, tmp_path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    simulation = elys("run", "yard", "--headless", "--listen", endpoint, "--record", "it.mcap")
    simulation.wait_for("first tick")
    assert elys("run", "yard", "--steps", "60", "--headless", "--record", "earlier.mcap").wait() == 0
    ghost = elys("node", "ghost", "earlier.mcap", "--connect", endpoint)
    render = elys("node", "render", "--connect", endpoint)
    outside = elys("record", "--connect", endpoint, "-o", "outside.mcap")
    render.wait_for("drawing views on")
    outside.wait_for("recording Yard")
    began = time.monotonic()
    asyncio.run(suffer(endpoint))
    seconds = time.monotonic() - began
    for command in (ghost, render, outside, simulation):
        assert command.process.poll() is None, command.output
        assert "Traceback" not in command.output
        assert "error" not in command.output.lower()
        refusals = [line for line in command.lines if "refused a message" in line]
        # One line a second for each topic or query, whatever comes.
        assert len(refusals) <= (seconds + 2.0) * (len(TOPICS) + len(QUERIES)), command.output
        command.process.terminate()
        assert command.wait() == 0, command.output
    assert any("so far" in line for line in simulation.lines)
    for name in ("it.mcap", "outside.mcap"):
        with (tmp_path / name).open("rb") as file:
            assert sum(1 for _ in make_reader(file).iter_messages()) > 100
    info = elys("info", "it.mcap")
    assert info.wait() == 0, info.output
    assert "complete" in info.output


async def suffer(endpoint: str) -> None:
    """Everything the rogue can do, seen by an honest client."""
    async with client(endpoint) as honest:
        await honest.until(lambda: len(honest.frames) > 5 and bool(honest.session.nodes_of("render")))
        ghosts: list[Ghost] = []
        honest.session.subscribe(topics.GHOST, lambda ghost, _: ghosts.append(ghost))
        await honest.until(lambda: bool(ghosts))
        painter = honest.session.nodes_of("render")[0].id
        name = honest.session.name
        rogue = await asyncio.to_thread(Rogue, endpoint, name=name, render_node=painter, ghost=ghosts[0].ghost)
        try:
            first = honest.frames[-1]
            await asyncio.to_thread(rogue.publish_nonsense)
            answers = await asyncio.to_thread(rogue.ask_nonsense)
            await asyncio.to_thread(rogue.ask_for_impossible_views)
            await asyncio.to_thread(rogue.flood)
            check_answers(answers)
            await check_all_is_well(honest, painter)
            last = honest.frames[-1]
            assert last.epoch == first.epoch
            # It gives up ticks that it cannot catch up; on a busy machine of two cores it may be a few.
            wall = (last.published_at - first.published_at) / 1e9
            assert last.simulation_time - first.simulation_time > 0.6 * wall
        finally:
            await asyncio.to_thread(rogue.close)


def check_answers(answers: dict[str, list[str]]) -> None:
    told = f"sent in protocol version {PROTOCOL_VERSION + 1}, this side speaks {PROTOCOL_VERSION}"
    assert answers.keys() == {query.name for query in QUERIES}
    for name, refusals in answers.items():
        assert len(refusals) == expected_count(name), name  # every question was answered
        assert any("starts with" in refusal for refusal in refusals), name
        if name != "hello":  # whose answer it is that says what is wrong with the version
            assert any(told in refusal for refusal in refusals), name
        assert all(len(refusal) < 1000 for refusal in refusals)


def expected_count(name: str) -> int:
    """How many of the questions fit through the door."""
    (query,) = (query for query in QUERIES if query.name == name)
    return sum(len(payload) <= query.largest for payload in payloads(query, random.Random(7)))


async def check_all_is_well(honest: Client, painter: str) -> None:
    """Commands are answered, the scene is followed, pictures are drawn."""
    ground = honest.entity("Ground")
    assert (await honest.ask(Rename(entity=ground, name="Grund"))).accepted
    await honest.until(lambda: honest.mirror.entities[ground].name == "Grund")
    seen = len(honest.frames)
    await honest.until(lambda: len(honest.frames) > seen + 30)
    camera = ViewCamera(position=(0.0, 20.0, 0.0), rotation=(-0.70710678, 0.0, 0.0, 0.70710678))  # from above
    pick = PickRequest(camera=camera, width=64, height=64, x=32, y=32)
    reply = await honest.session.request(topics.PICK, pick, key=painter, timeout=20.0)
    assert reply.entity in honest.mirror.entities
    pictures: list[ViewFrame] = []
    honest.session.subscribe(topics.VIEW_FRAME, lambda picture, _: pictures.append(picture), key="honest")
    # The rogue has asked for more views than there can be: they are forgotten after ten seconds of silence.
    async with asyncio.timeout(30.0):
        while not any(picture.jpeg for picture in pictures):
            request = ViewRequest(view="honest", sequence=len(pictures) + 1, camera=camera, width=64, height=64)
            honest.session.publish(topics.VIEW_REQUEST, request, key=painter)
            await asyncio.sleep(0.1)

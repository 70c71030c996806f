"""What makes hosts far away bearable: packed answers, doors that are found, silence that is seen, names that are free."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import zstandard

from elys.bus import codec, topics
from elys.bus.discovery import advertise, choose_endpoint
from elys.bus.following import follow_state
from elys.bus.messages.state_frame import StateFrame
from elys.bus.mirror import SceneMirror
from elys.bus.session import Node, Session
from elys.bus.session_names import claimed_name
from elys.bus.topics import Encoding
from elys.bus.transports.loopback import LoopbackBroker
from elys.bus.transports.reaching import reach
from elys.bus.transports.zenoh import ZenohTransport
from elys.bus.vigil import GONE_AFTER, ON_ONE_MACHINE, Vigil, patience
from elys.common.errors import BusError, ConnectionLost, MessageError


def test_packed_answers_come_back_as_they_were():
    payload = codec.with_prefix(b"[" + b"1234, " * 5000 + b"0]", Encoding.JSON)
    packed = codec.packed(payload)
    assert len(packed) < len(payload) / 10
    assert zstandard.ZstdDecompressor().decompress(packed[8:]) == payload[8:]
    assert codec.unpacked(packed) == payload
    assert codec.unpacked(payload) == payload
    noise = codec.with_prefix(bytes(range(256)), Encoding.RAW)
    assert codec.packed(noise) == noise  # would be longer


def test_what_only_says_that_it_is_packed_is_refused():
    packed = codec.packed(codec.with_prefix(bytes(100_000), Encoding.RAW))
    for damaged in (packed[:-3], packed[:8] + b"nonsense", packed[:8]):
        with pytest.raises(MessageError):
            codec.unpacked(damaged)
    bomb = packed[:8] + zstandard.ZstdCompressor().compress(bytes(codec.MOST + 1))
    with pytest.raises(MessageError, match="claims to have"):
        codec.unpacked(bomb)


def test_only_who_says_so_gets_packed_answers():
    request = codec.with_prefix(b"{}", Encoding.JSON)
    assert not codec.may_be_packed(request)
    asking = codec.with_packed_answer(request)
    assert codec.may_be_packed(asking)
    assert codec.decode(asking, dict[str, int], Encoding.JSON) == {}


def test_the_first_door_that_opens_is_found():
    with socket.create_server(("127.0.0.1", 0)) as open_door, socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))  # nobody listens
        endpoints = [f"tcp/127.0.0.1:{one.getsockname()[1]}" for one in (closed, open_door)]
        found = reach(endpoints, timeout=10.0)
        assert found is not None and found.endpoint == endpoints[1]
        assert 0.0 < found.round_trip < 1.0
        assert reach(endpoints[:1], timeout=0.3) is None


def test_of_several_doors_the_earlier_one_is_preferred():
    with socket.create_server(("127.0.0.1", 0)) as one, socket.create_server(("127.0.0.1", 0)) as other:
        endpoints = [f"tcp/127.0.0.1:{door.getsockname()[1]}" for door in (one, other)]
        assert [reach(order, timeout=10.0).endpoint for order in (endpoints, endpoints[::-1])] == endpoints


def test_who_comes_before_the_host_waits_for_it():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    hosts: list[ZenohTransport] = []
    late = threading.Timer(0.5, lambda: hosts.append(ZenohTransport.listen(endpoint)))
    late.start()
    joined = ZenohTransport.connect(endpoint, timeout=30.0)
    late.join()
    joined.close()
    hosts[0].close()


def test_knocking_ends_when_it_is_told_to():
    stop = threading.Event()
    threading.Timer(0.1, stop.set).start()
    begun = time.monotonic()
    assert reach(["tcp/127.0.0.1:1"], timeout=60.0, stop=stop) is None
    assert time.monotonic() - begun < 30.0


class SilentLine:
    """A transport that hears nothing but what the test says."""

    endpoint, round_trip = "tcp/10.0.0.1:7447", 0.02

    def __init__(self) -> None:
        self.silence = 0.0
        self.suspected = 0

    def suspect(self) -> None:
        self.suspected += 1


async def test_silence_is_seen_and_asked_about_first():
    line, told, asked, now = SilentLine(), [], [], [100.0]

    async def ask(timeout: float) -> None:
        asked.append(timeout)
        raise ConnectionLost("nobody")

    vigil = Vigil(line, ask, told.append, clock=lambda: now[0])

    def look(silence: float, later: float = 0.1) -> None:
        line.silence, now[0] = silence, now[0] + later
        vigil.look()

    look(0.1)
    await asyncio.sleep(0)
    assert not asked and not told
    look(0.3)
    await asyncio.sleep(0)
    assert len(asked) == 1 and not told
    look(GONE_AFTER + 0.01)
    assert told == [False] and line.suspected == 1
    look(GONE_AFTER + 0.1)
    assert told == [False] and line.suspected == 2
    look(0.0)
    assert told == [False, True]
    look(5.0, later=5.0)  # it was this side that slept
    assert told == [False, True]


def test_a_far_host_may_be_silent_for_longer():
    assert patience("tcp/10.0.0.1:7447", 0.0) == GONE_AFTER < 1.0
    assert patience("tcp/10.0.0.1:7447", 0.6) > 2 * 0.6
    assert patience("tcp/127.0.0.1:7447", 0.0) == patience("", 0.0) == ON_ONE_MACHINE


def test_a_taken_name_gets_a_number_or_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("ELYS_RUNTIME_DIR", str(tmp_path))
    closers = []
    for number, expected in enumerate(("yard", "yard-2", "yard-3")):
        with claimed_name("yard", is_chosen=False) as name:
            assert name == expected
            endpoint = f"tcp/127.0.0.1:{7447 + number}"
            closers.append(advertise(name=name, endpoint=endpoint, kind="simulation", scene="yard"))
    with (
        pytest.raises(
            BusError, match=r"a session called yard-2 runs already at tcp/127.0.0.1:7448 .*choose another --name"
        ),
        claimed_name("yard-2", is_chosen=True),
    ):
        pass
    closers[1]()
    with claimed_name("yard-2", is_chosen=True) as name:
        assert name == "yard-2"


@pytest.mark.parametrize("kind", ["loopback", "zenoh"])
async def test_two_of_one_name_cannot_host_at_one_router(kind: str):
    if kind == "loopback":
        broker = LoopbackBroker()
        one, other = broker.listen(), broker.listen()
        router = None
    else:
        router = await asyncio.to_thread(ZenohTransport.listen_on_free_port, first_port=17600)
        one, other = [await asyncio.to_thread(ZenohTransport.connect, router.endpoint) for _ in range(2)]
    first = await Session.host(one, name="yard", kind="simulation", epoch=1)
    with pytest.raises(BusError, match="hosts a session called yard there already: choose another --name"):
        await Session.host(other, name="yard", kind="simulation", epoch=2)
    beside = await Session.host(other, name="beach", kind="simulation", epoch=2)
    await beside.close()
    await first.close()
    if router is not None:
        await asyncio.to_thread(router.close)


async def test_who_finds_two_hosts_is_told_and_sees_the_one_that_was_greeted(caplog: pytest.LogCaptureFixture):
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=1)
    joined = await Session.join(broker.connect(), kind="editor")
    mirror, seen = SceneMirror(), []
    follow_state(joined, mirror, seen.append)
    rival = broker.listen()
    rival.announce(topics.node_key("yard", "simulation", "simulation-2"))
    other = Session(rival, name="yard", node=Node("simulation", "simulation-2"), epoch=9)
    async with asyncio.timeout(20.0):
        while len(seen) < 3 or "at the same time" not in caplog.text:
            for session in (other, host):
                session.publish(topics.STATE, frame_of(session.epoch))
                await asyncio.sleep(0.01)  # one after the other, or the newest of both alone would be seen
    assert {frame.epoch for frame in seen} == {1} and mirror.latest_frame.epoch == 1
    for session in (other, joined, host):
        await session.close()


def frame_of(epoch: int) -> StateFrame:
    return StateFrame(
        epoch=epoch,
        tick=1,
        simulation_time=0.0,
        published_at=0,
        delta_sequence=0,
        state_hash=0,
        playing=True,
        position=np.zeros((1, 3)),
        rotation=np.zeros((1, 4), np.float32),
        linear_velocity=np.zeros((1, 3), np.float32),
        angular_velocity=np.zeros((1, 3), np.float32),
        entity=np.ones(1, np.uint32),
    )


def test_several_endpoints_have_commas_between_them():
    assert choose_endpoint("server, 10.0.0.2:7000") == "tcp/server:7447,tcp/10.0.0.2:7000"
    with pytest.raises(BusError, match="'a b' is no endpoint"):
        choose_endpoint("server,a b")

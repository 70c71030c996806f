"""Both ends of a stream over a session: who gets one, what falls back, and what is refused."""

from __future__ import annotations

import asyncio
import dataclasses
import threading

import numpy as np
import pytest

from elys.bus import codec, topics
from elys.bus.messages.streaming import StreamInterest, StreamOffer, StreamRequest
from elys.bus.picture_ring import boot_id
from elys.bus.session import Session
from elys.bus.state_packing.planes import PlaneReader, PlaneWriter
from elys.bus.state_source import tell_interest
from elys.bus.streaming import rice
from elys.bus.streaming.choice import STATES, wants_stream
from elys.bus.streaming.client import StreamClient
from elys.bus.streaming.connections import COUNT, Connections
from elys.bus.streaming.rate import LEAST, RateControl
from elys.bus.streaming.server import MOST_STREAMS, StreamServer
from elys.bus.streaming.wire import ACK_SIZE, Ack, pack_ack, unpack_ack
from elys.bus.topics import Delivery, Encoding
from elys.bus.transports.loopback import LoopbackBroker
from elys.bus.transports.transport import Transport
from elys.common.errors import BusError


async def until(condition, seconds: float = 20.0) -> None:
    async with asyncio.timeout(seconds):
        while not condition():
            await asyncio.sleep(0.005)


async def opened(broker: LoopbackBroker, random_host):
    """A host with a streaming server beside it, and a viewer whose states come by a stream."""
    host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=9)
    random = random_host(host)

    async def offer(request: StreamRequest, _: str) -> StreamOffer:
        return StreamOffer()

    host.serve(topics.STREAM_ASK, offer)
    beside = await Session.join(broker.connect(), kind="streamer")
    server = StreamServer(beside)
    serving = asyncio.create_task(server.run())
    viewer = await Session.join(broker.connect(), kind="tool")
    viewer.states = StreamClient(viewer, lambda *_: broker.connect())
    return host, random, server, serving, beside, viewer


async def test_a_viewer_gets_states_by_a_stream_and_says_how_they_do(random_host):
    host, random, server, serving, beside, viewer = await opened(LoopbackBroker(), random_host)
    frames, full = [], []
    viewer.subscribe(topics.STATE, lambda frame, _: frames.append(frame))
    viewer.subscribe_payloads(topics.STATE, lambda _, payload: full.append(payload), every=True)
    reports = []
    host.subscribe(topics.STREAM_REPORT, lambda report, _: reports.append(report))
    await until(lambda: server.viewers)
    for _ in range(60):
        random.publish_tick(edits=False)
        await asyncio.sleep(1 / 60)
    await until(lambda: frames and frames[-1].tick == 60 and len(frames[-1].entity) == 5 and reports)
    truth = random.frames[60]
    await until(lambda: np.abs(frames[-1].position - truth.position).max() < 1e-3)
    assert frames[-1].epoch == 9 and frames[-1].state_hash == truth.state_hash
    assert len(full) == 60  # whoever takes every frame gets the host's own
    report = viewer.states.report()
    assert report.known == report.bodies == 5 and report.position_error < 10.0
    assert report.stream == viewer.states.name and reports[-1].stream == report.stream
    tell_interest(viewer, StreamInterest(chosen=(1,)))
    await until(lambda: next(iter(server.viewers.values())).sender.interest.chosen == (1,))
    serving.cancel()
    for session in (viewer, beside, host):
        await session.close()


async def test_a_stream_says_what_is_past_and_what_is_of_a_fork(random_host):
    """After a rewind, and a fork from there, who looks through a stream knows as much of each state as one beside the host."""
    host, random, server, serving, beside, viewer = await opened(LoopbackBroker(), random_host)
    frames = []
    viewer.subscribe(topics.STATE, lambda frame, _: frames.append(frame))
    await until(lambda: server.viewers)
    told = {"is_told_again": False, "is_forked": False, "playing": True}
    for instant, tick, said in (
        (40, 40, told),
        (10, 9, {**told, "is_told_again": True, "playing": False}),
        (11, 9, {**told, "is_forked": True}),
        ((1 << 28) - 2, 60, told),
        (-1, 61, told),
    ):
        frame = dataclasses.replace(random._frame(), tick=tick, simulation_time=tick / 60, instant=instant, **said)
        for _ in range(2):  # the second finds the bodies known, and tells what changed
            host.publish(topics.STATE, frame)
            count = len(frames)
            await until(lambda count=count: len(frames) > count)
        await until(lambda tick=tick, instant=instant: (frames[-1].tick, frames[-1].instant) == (tick, instant))
        assert {name: getattr(frames[-1], name) for name in said} == said
    serving.cancel()
    for session in (viewer, beside, host):
        await session.close()


async def test_a_host_without_streams_sends_full_frames(random_host):
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=9)
    random = random_host(host)

    async def refuse(request: StreamRequest, _: str) -> StreamOffer:
        raise BusError("this host has no streams")

    host.serve(topics.STREAM_ASK, refuse)
    viewer = await Session.join(broker.connect(), kind="tool")
    viewer.states = client = StreamClient(viewer, lambda *_: broker.connect())
    frames = []
    viewer.subscribe(topics.STATE, lambda frame, _: frames.append(frame))
    await until(lambda: client.is_full)
    sent = random.publish_tick()
    await until(lambda: frames)
    assert frames[-1].position.tobytes() == sent.position.tobytes()
    assert client.report() is None
    await viewer.close()
    await host.close()


async def test_what_strangers_send_to_the_server_harms_no_viewer(random_host):
    broker = LoopbackBroker()
    host, random, server, serving, beside, viewer = await opened(broker, random_host)
    frames = []
    viewer.subscribe(topics.STATE, lambda frame, _: frames.append(frame))
    await until(lambda: server.viewers)
    rogue, chance = broker.connect(), np.random.default_rng(3)
    key = topics.key_of("yard", topics.STREAM_ACK, "rogue")
    for number in range(600):
        body = chance.bytes(int(chance.integers(0, 2 * ACK_SIZE)))
        rogue.publish(key, codec.with_prefix(body, Encoding.RAW) if number % 2 else body, Delivery.LATEST)
        interest = topics.key_of("yard", topics.STREAM_INTEREST, "rogue")
        rogue.publish(interest, codec.with_prefix(body, Encoding.MSGPACK), Delivery.LATEST)
        if number % 20 == 0:
            await asyncio.sleep(0)
    for number in range(2 * MOST_STREAMS):
        ack = codec.with_prefix(pack_ack(Ack(0, 0, 0, 0, 0, 0, 1)), Encoding.RAW)
        rogue.publish(topics.key_of("yard", topics.STREAM_ACK, f"s{number}"), ack, Delivery.LATEST)
        await asyncio.sleep(0)
    assert len(server.viewers) <= MOST_STREAMS and server.refused > 0
    random.publish_tick(edits=False)
    await until(lambda: frames and frames[-1].tick == 1)
    serving.cancel()
    for session in (viewer, beside, host):
        await session.close()


def test_who_gets_a_stream(monkeypatch):
    monkeypatch.delenv(STATES, raising=False)
    here = boot_id()
    assert not wants_stream("tool", "tcp/127.0.0.1:7447", here)
    assert wants_stream("tool", "tcp/10.0.0.3:7447", here)
    assert wants_stream("editor", "tcp/127.0.0.1:7447", "another machine, through a tunnel")
    assert not wants_stream("recorder", "tcp/10.0.0.3:7447", "another")
    monkeypatch.setenv(STATES, "full")
    assert not wants_stream("tool", "tcp/10.0.0.3:7447", "another")
    monkeypatch.setenv(STATES, "stream")
    assert wants_stream("tool", "tcp/127.0.0.1:7447", here) and not wants_stream("recorder", "tcp/10.0.0.3:1", "")
    monkeypatch.setenv(STATES, "all")
    with pytest.raises(BusError, match="ELYS_STATES=all says nothing"):
        wants_stream("tool", "tcp/10.0.0.3:7447", "")


@pytest.mark.parametrize("scale", [0.4, 3.0, 200.0, 1e6, 2.0**31])
def test_numbers_survive_and_take_about_what_they_must(scale):
    values = np.random.default_rng(1).exponential(scale, 3000).astype(np.uint64).clip(0, 2**32 - 1).astype(np.uint32)
    values[::50] = 2**32 - 1 if scale > 1e5 else 60_000
    out = PlaneWriter()
    rice.write(out, values)
    packed = out.take()
    assert np.array_equal(rice.read(PlaneReader(packed, 0), 3000), values)
    counts = np.unique(values, return_counts=True)[1] / 3000
    entropy = -(counts * np.log2(counts)).sum()
    if scale < 1e3:
        assert len(packed) * 8 / 3000 < entropy + 1.2


def test_acks_survive():
    ack = Ack(1, 2**62, 7, 9, 2**64 - 1, 12, 0b1010)
    assert unpack_ack(pack_ack(ack), 0) == ack


def test_the_rate_follows_a_bottleneck_and_survives_silence():
    """A link of 50 kB/s and 40 ms, as a queue that the rate fills or not."""
    control, queue, now = RateControl(0.0), 0.0, 0.0
    rates = []
    for step in range(3000):
        now += 0.01
        queue = max(queue + control.rate * 0.01 - 500.0, 0.0)
        sent = min(control.rate * 0.01, 500.0)
        control.answered(now, [(now - 0.04 - queue / 5e4, 0.04 + queue / 5e4)], sent)
        control.look(now, is_limited=True, is_waiting=True)
        rates.append(control.rate)
        if step > 1000:
            assert queue / 5e4 < 0.15
    assert 3.0e4 < np.mean(rates[1000:]) < 6.0e4
    before = control.rate
    for _ in range(500):
        now += 0.01
        control.look(now, is_limited=True, is_waiting=True)
        before = before if control.stands_still else control.rate
    assert control.stands_still and control.rate == LEAST
    control.heard(now)
    assert not control.stands_still and control.rate == before
    # What looks like a short queue, as with each lost packet on the first connection, changes nothing yet; a long one does.
    for _ in range(40):
        now += 0.01
        control.answered(now, [(now - 0.08, 0.08)], 300.0)
        control.look(now, is_limited=True, is_waiting=True)
    assert control.rate == before
    for _ in range(40):
        now += 0.01
        control.answered(now, [(now - 0.2, 0.2)], 300.0)
        control.look(now, is_limited=True, is_waiting=True)
    assert control.rate < before


async def test_new_connections_take_the_place_of_those_that_wait_and_of_no_others():
    """The host goes silent, four knock; two of the old speak again before a door opens."""
    broker, now, asked = LoopbackBroker(), 0.0, []
    host = broker.listen()
    door = threading.Event()

    def connect(patience: float, knocks_until: threading.Event | None) -> Transport:
        asked.append(knocks_until is not None)
        if knocks_until is not None:
            door.wait(10.0)
        return broker.connect()

    connections = Connections(
        connect, lambda lane: f"elys/lane/{lane}", heard=lambda _: None, opened=lambda: None, clock=lambda: now
    )
    while connections.count < COUNT:
        connections.tend(0.5, 0.1)
        await asyncio.sleep(0.01)

    async def speak(*lanes: int) -> None:
        connections.heard_at = -1.0
        for lane in lanes:
            host.publish(f"elys/lane/{lane}", b"", Delivery.LATEST)
        await until(lambda: connections.heard_at == now)
        await asyncio.sleep(0.05)

    await speak(0, 1, 2, 3)
    assert connections.bits == 0b1111 and asked == [False] * COUNT
    for _ in range(8):
        now += 0.4
        connections.tend(0.5, 0.1)
        await asyncio.sleep(0.01)
    assert asked == [False] * COUNT + [True] * COUNT
    await speak(1, 3)
    door.set()
    await until(lambda: not connections.tries)
    assert connections.bits == 0b111010  # 0 and 2 waited; of the four new ones two are enough
    await connections.close()
    host.close()

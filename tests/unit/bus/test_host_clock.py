"""What is known of the host's clock, against clocks that are made up."""

from __future__ import annotations

import asyncio
from typing import Any

import numpy as np
import pytest

from elys.bus import topics
from elys.bus.host_clock import QUICK_PINGS, WANDER, ClockFilter, HostClock
from elys.bus.lateness import MOST_MISSING, SHARE, SPAN, Lateness
from elys.bus.messages.session import ClockReply, ClockRequest
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.errors import ConnectionLost

OFFSET = 1.7e9  # [s] from the clock here to the host's


@pytest.mark.parametrize("drift", [0.0, 200e-6, -200e-6])
@pytest.mark.parametrize("seed", range(4))
def test_the_offset_is_never_wrong_by_more_than_is_said(drift: float, seed: int) -> None:
    rng, known, time = np.random.default_rng(seed), ClockFilter(), 10.0
    for _ in range(200):
        there, back = 0.02 + rng.exponential(0.03, 2)  # both ways wait, and not as long
        known.take(time, OFFSET + (time + there) * (1.0 + drift), time + there + back)
        time += float(rng.uniform(0.5, 3.0))
        truth = OFFSET + time * (1.0 + drift)
        assert abs(known.host_time(time) - truth) <= known.error(time) + 1e-6
        assert known.error(time) < 0.25
    # Better than any one ping: that with the shortest way counts.
    assert known.round_trip < 0.1
    assert abs(known.host_time(time) - truth) < 0.03 + WANDER * 24.0


def test_a_clock_that_was_set_is_believed_at_once() -> None:
    known = ClockFilter()
    for number in range(8):
        known.take(float(number), OFFSET + number, number + 0.01)
    known.take(9.0, OFFSET + 9.0 + 3600.0, 9.5)
    assert known.host_time(10.0) == pytest.approx(OFFSET + 3610.0, abs=0.3)
    known.forget()
    assert known.host_time(10.0) is None
    assert known.round_trip is None
    assert known.error(10.0) == float("inf")


class Host:
    """Answers as a session would; None for a host that is gone."""

    def __init__(self) -> None:
        self.connected = True
        self.now = 50.0
        self.reply: ClockReply | None = ClockReply(epoch=1, wall_clock=round(OFFSET * 1e9))
        self.asked = 0

    async def request(self, query: Any, request: Any, *, timeout: float) -> Any:
        assert query is topics.CLOCK
        self.asked += 1
        self.now += 0.02
        if self.reply is None:
            raise ConnectionLost("nobody answered")
        return self.reply


async def test_another_run_of_the_host_has_another_clock_and_silence_is_told() -> None:
    host = Host()
    clock = HostClock(host, clock=lambda: host.now)
    assert clock.age_of(OFFSET) is None
    await clock.ping()
    assert clock.round_trip == pytest.approx(0.02)
    assert clock.age_of(OFFSET) == pytest.approx(0.01)
    host.now += 1.0
    assert clock.age_of(OFFSET) == pytest.approx(1.01)
    assert clock.age_of(OFFSET + 60.0) == 0.0
    host.reply = ClockReply(epoch=2, wall_clock=10**9)
    await clock.ping()
    assert clock.host_time() == pytest.approx(1.01)
    host.reply = None
    await clock.ping()
    assert clock.round_trip is None
    assert clock.host_time() is not None  # what is known goes on to be true for a while
    host.connected = False
    await clock.ping()
    assert clock.host_time() is None


async def test_it_pings_quickly_at_first() -> None:
    host, done = Host(), asyncio.Event()
    clock = HostClock(host, interval=0.0, on_change=lambda: done.set() if host.asked > QUICK_PINGS else None)
    running = asyncio.create_task(clock.run())
    await asyncio.wait_for(done.wait(), 10.0)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)


async def test_every_host_tells_what_its_clock_says() -> None:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=7)
    joined = await Session.join(broker.connect(), kind="tool")
    clock = HostClock(joined)
    for _ in range(3):
        await clock.ping()
    reply = await joined.request(topics.CLOCK, ClockRequest())
    assert reply.epoch == host.epoch
    # Both are the same clock here.
    assert clock.age_of(reply.wall_clock * 1e-9) <= clock.error + 1.0
    assert clock.round_trip is not None
    await joined.close()
    await host.close()


def test_lateness_counts_those_that_were_overtaken() -> None:
    late, sorted_delays = Lateness(), []
    stamps = np.arange(400) * 0.01
    for number in range(0, 400, 4):  # of four the last is taken
        came = stamps[number + 3] + 0.5 + (0.2 if number % 40 == 0 else 0.0)
        late.note(float(stamps[number + 3]), float(came), missing=3, spacing=0.01)
        sorted_delays += [came - stamps[number + part] for part in range(4)]
    sorted_delays.sort()
    assert late.least == pytest.approx(sorted_delays[0])
    wanted = sorted_delays[int(np.ceil(SHARE * len(sorted_delays))) - 1]
    assert late.usual == pytest.approx(wanted - sorted_delays[0])


def test_what_this_side_kept_is_not_the_ways_lateness() -> None:
    late = Lateness()
    late.note(0.0, 1.0)
    late.note(0.4, 1.4, first=1.1, missing=3, spacing=0.1)  # came when they should, and waited here
    assert late.usual == pytest.approx(0.0)
    late.note(0.8, 1.8, first=1.8, missing=3, spacing=0.1)  # all came at once
    assert late.usual == pytest.approx(0.3)
    late.note(1e6, 1e6 + 1.0, missing=10**9, spacing=0.1)  # a gap of any length is counted up to a bound
    assert late.usual <= MOST_MISSING * 0.1
    late.note(1e6 + 2 * SPAN, 1e6 + 2 * SPAN + 1.0)
    assert late.usual == 0.0
    late.forget()
    assert not late.is_known

"""What nodes count, and what others make of it when they ask."""

from __future__ import annotations

import asyncio

import numpy as np

from elys.bus import codec, topics
from elys.bus.messages.session import SessionStatus
from elys.bus.messages.state_frame import StateFrame
from elys.bus.messages.vitals import HostFacts
from elys.bus.network import NetworkWatch
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.bus.vitals import Arrivals

MS = 1_000_000  # [ns]


def frame(tick: int, *, epoch: int = 1, published_at: int = 0) -> StateFrame:
    none = np.zeros((0, 3), np.float32)
    return StateFrame(
        epoch=epoch,
        tick=tick,
        simulation_time=tick / 60,
        published_at=published_at,
        delta_sequence=0,
        state_hash=0,
        playing=True,
        position=none.astype(float),
        rotation=np.zeros((0, 4), np.float32),
        linear_velocity=none,
        angular_velocity=none,
        entity=np.zeros(0, np.uint32),
    )


def payload(tick: int, **of: int) -> bytes:
    return codec.encode(frame(tick, **of), topics.STATE.encoding)


def missed(*ticks: int, epoch: int = 1) -> int:
    arrivals = Arrivals(is_state=True)
    for tick in ticks:
        arrivals.note(payload(tick, epoch=epoch))
    return arrivals.missed


def test_states_that_did_not_come_are_counted_by_their_ticks() -> None:
    assert missed(1, 2, 3) == 0
    assert missed(1, 2, 5, 6, 9) == 4
    assert missed(2, 4, 6, 10) == 1, "a replay at double speed tells every second tick"
    assert missed(100, 101, 3, 4, 5) == 0, "wound back"
    assert missed(1, 2, 5000, 5001) == 0, "wound on"
    assert missed(7, 7, 7, 8) == 0, "told again while paused"


def test_another_run_of_the_host_is_no_loss() -> None:
    arrivals = Arrivals(is_state=True)
    for epoch, tick in ((1, 10), (1, 11), (2, 15), (2, 16)):
        arrivals.note(payload(tick, epoch=epoch))
    assert arrivals.missed == 0


def test_ages_are_told_by_their_median_and_their_worst() -> None:
    now = 0
    arrivals = Arrivals(is_state=True, clock=lambda: now)
    for tick in range(100):
        now = (10 if tick != 50 else 90) * MS
        arrivals.note(payload(tick))
    stream = arrivals.stream()
    assert (stream.age_p50, stream.age_p99, stream.messages) == (10.0, 90.0, 100)
    assert stream.size == 100 * len(payload(0))
    arrivals.note(b"too short for a state")
    assert arrivals.stream().messages == 101


async def test_who_asks_sees_rates_sizes_and_who_says_what() -> None:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=1)
    host.host_facts = lambda: HostFacts(scene="Yard", started=0.0, tick_rate=60.0, load=0.5)
    viewer = await Session.join(broker.connect(), kind="tool")
    tool = await Session.join(broker.connect(), kind="tool")
    seen: list[int] = []
    viewer.subscribe(topics.STATE, lambda state, _: seen.append(state.tick))
    while len(tool.nodes) < 3:
        await asyncio.sleep(0.001)
    watch = NetworkWatch(tool)
    for tick in (1, 2):
        host.publish(topics.STATE, frame(tick))
    await watch.ask()
    for tick in (3, 4, 6):
        host.publish(topics.STATE, frame(tick))
    host.publish(topics.STATUS, status())
    await watch.ask()
    report = watch.report()
    assert report.host is not None and (report.host.scene, report.host.load) == ("Yard", 0.5)
    simulation, row = report.nodes
    assert (simulation.node, row.node) == (host.node.id, viewer.node.id)
    assert simulation.sent_rate > 0.0 < row.heard_rate
    assert np.isclose(row.heard_size, row.heard_rate * len(payload(1)))
    assert (row.missed, row.answers) == (1, True) and row.round_trip > 0.0
    use = watch.topic_use("state")
    assert (use.publishers, use.listeners) == ((host.node.id,), (viewer.node.id,))
    assert use.size == len(payload(1))
    assert watch.topic_use("delta").publishers == ()
    await viewer.close()
    while viewer.node.id in tool.nodes:
        await asyncio.sleep(0.001)
    await watch.ask()
    assert [node.node for node in watch.report().nodes] == [host.node.id]
    await tool.close()
    await host.close()


async def test_a_node_that_does_not_answer_is_shown_as_silent(monkeypatch) -> None:
    monkeypatch.setattr("elys.bus.network.PATIENCE", 0.05)
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=1)
    tool = await Session.join(broker.connect(), kind="tool")
    withdraw = broker.connect().announce(topics.node_key("yard", "editor", "ghost"))
    while "ghost" not in tool.nodes:
        await asyncio.sleep(0.001)
    watch = NetworkWatch(tool)
    await watch.ask()
    rows = {row.node: row for row in watch.report().nodes}
    assert not rows["ghost"].answers and rows[host.node.id].answers
    withdraw()
    await tool.close()
    await host.close()


def status() -> SessionStatus:
    return SessionStatus(
        epoch=1, kind="simulation", scene="Yard", tick=1, simulation_time=0.0, playing=True, tick_rate=60.0
    )

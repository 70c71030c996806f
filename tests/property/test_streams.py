"""Streams in virtual time: what a viewer shows is what was promised, whatever the link does to frames and acks."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from elys.bus.messages.state_frame import unpack_frame
from elys.bus.messages.streaming import StreamInterest
from elys.bus.messages.views import ViewCamera
from elys.bus.streaming.receiver import Receiver
from elys.bus.streaming.sender import Sender
from elys.bus.streaming.wire import Ack
from elys.common.errors import MessageError
from elys.render_node.timeline import Timeline
from tests.property.simulated_link import Conditions
from tests.property.streamed_bodies import TICK, Bodies, Stream, ages, errors

SLACK = 1e-5  # of rotations, which scipy calculates otherwise


def check_claims(stream: Stream, *, every: int = 1) -> None:
    """No body of any state shown is farther from the truth than was said."""
    assert stream.shown
    for _, frame, arrival in stream.shown[::every]:
        off, turned = errors(stream, frame)
        assert off.max(initial=0.0) <= arrival.claim.position
        assert turned.max(initial=0.0) <= arrival.claim.rotation + SLACK


@settings(max_examples=12, deadline=None)
@given(
    seed=st.integers(0, 2**16),
    delay=st.sampled_from([0.0, 0.01, 0.05, 0.15]),
    loss=st.sampled_from([0.0, 0.02, 0.2]),
    jitter=st.sampled_from([0.0, 0.03]),
    drop=st.sampled_from([0.0, 0.0, 0.1]),
    repeat=st.sampled_from([0.0, 0.1]),
    rate=st.sampled_from([1.5e4, 1e5, 1e7]),
    lanes=st.sampled_from([1, 4]),
    restless=st.booleans(),
    tail=st.sampled_from([0, 3]),
)
def test_nothing_shown_is_farther_off_than_claimed(
    seed, delay, loss, jitter, drop, repeat, rate, lanes, restless, tail
):
    """Under loss, jitter, reordering between connections, messages given up and doubled; while bodies come and go."""
    bodies = Bodies(20, seed=seed, resting=0.3, restless=restless)
    bodies.tail_count = tail
    link = Conditions(delay=delay, loss=loss, jitter=jitter, drop=drop, repeat=repeat, rate=rate)
    stream = Stream(bodies, link, seed=seed, lanes=lanes)
    stream.run(3.0)
    check_claims(stream, every=3)
    assert stream.sender.refused == 0 and stream.sender.restarts == 0


@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 2**16), rate=st.sampled_from([2e4, 1e6]), drop=st.sampled_from([0.0, 0.15]))
def test_what_has_come_to_rest_is_shown_as_it_is_and_costs_nothing_more(seed, rate, drop):
    bodies = Bodies(50, seed=seed)
    stream = Stream(bodies, Conditions(rate=rate, drop=drop), seed=seed)
    stream.run(1.0)
    bodies.stop()
    stream.run(8.0)
    _, frame, arrival = stream.shown[-1]
    off, turned = errors(stream, frame)
    assert len(frame.entity) == 50
    assert off.max() < 0.7e-3 and turned.max() < 5e-4
    assert off.max() <= arrival.claim.position < 0.7e-3
    before = stream.network.carried[0]
    stream.run(2.0)
    assert stream.network.carried[0] - before < 2.0 * 6 * 400  # five frames a second that say that nothing has changed


def test_fifty_milliseconds_and_two_per_cent_keep_a_thousand_bodies_fresh():
    stream = Stream(Bodies(1000, seed=1), Conditions(delay=0.05, loss=0.02, rate=1e6), seed=2)
    stream.run(4.0)
    assert np.percentile(ages(stream, 2.0, 4.0), 95) < 0.15
    check_claims(stream, every=20)
    assert np.median([errors(stream, frame)[0].max() for when, frame, _ in stream.shown[::20] if when > 2.0]) < 0.01


@pytest.mark.parametrize("rate", [1e6, 6e4])  # all is told, and a third
def test_what_is_seen_of_a_stream_is_no_older_than_promised_and_even(rate):
    """With the wait for late states, which makes motion even: 50 ms one way and 2 % loss."""
    stream = Stream(Bodies(150, seed=1), Conditions(delay=0.05, loss=0.02, rate=rate), seed=2)
    stream.run(15.0)
    timeline, states = Timeline(), [(came, frame) for came, frame, _ in stream.shown]
    timeline.expect_stream()
    seen, place = [], 0
    moments = np.arange(0.5, 15.0, 1.0 / 59.4)
    for now in moments:
        while place < len(states) and states[place][0] <= now:
            came, frame = states[place]
            stamp = round((frame.simulation_time - TICK) * 1e9)  # tick 1 was at 0
            timeline.take(dataclasses.replace(frame, published_at=stamp), came)
            place += 1
        seen.append(timeline.seen_time(now) - TICK)
    settled = moments > 10.0
    assert np.percentile((moments - seen)[settled], 95) < (0.15 if rate > 1e5 else 0.16)
    assert np.std(np.diff(np.array(seen)[settled])) * 59.4 < 0.1  # a tenth of the speed of time


def test_a_bottleneck_holds_no_stale_data():
    """A tenth of what would be sent: what comes is fresh all the same, and the link is used."""
    link = Conditions(delay=0.02, loss=0.0, rate=4e4)
    stream = Stream(Bodies(300, seed=3), link, seed=3)
    stream.run(8.0)
    assert np.percentile(ages(stream, 3.0, 8.0), 95) < 0.15
    assert stream.network.carried[0] > 0.6 * 4e4 * 8.0
    link.rate = 2e4  # and then it becomes narrower still
    stream.run(6.0)
    assert np.percentile(ages(stream, 11.0, 14.0), 95) < 0.3


@pytest.mark.parametrize("seed", range(2))
def test_after_an_outage_the_view_is_right_within_a_second(seed):
    """A new connection stands two round trips after the link heals; the old ones wait, as TCP does."""
    link = Conditions(delay=0.05, loss=0.02, rate=1e6, outages=((4.0, 7.0),))
    stream = Stream(Bodies(400, seed=seed), link, seed=seed)
    stream.run(7.0)
    stream.network.at(7.0 + 4 * link.delay, lambda: setattr(stream, "lanes", 0b11110000))
    stream.network.at(7.0 + 4 * link.delay, stream._say)
    stream.run(3.0)
    right = [
        when
        for when, frame, _ in stream.shown
        if when > 7.0 and (frame.tick - 1) * TICK > 7.0 and errors(stream, frame)[0].max() < 0.05
    ]
    assert right and right[0] < 8.0
    check_claims(stream, every=10)


def test_a_sender_that_was_started_anew_is_followed():
    stream = Stream(Bodies(60, seed=4), Conditions(), seed=4)
    stream.run(2.0)
    stream.new_sender()
    count = len(stream.shown)
    stream.run(2.0)
    assert len(stream.shown) > count + 60 and stream.receiver.restarts == 1
    check_claims(stream, every=5)


def test_a_viewer_that_was_started_anew_is_told_all_again():
    stream = Stream(Bodies(60, seed=5), Conditions(), seed=5)
    stream.run(2.0)
    stream.receiver = Receiver()
    stream.run(2.0)
    assert stream.sender.restarts == 1
    assert stream.receiver.known_count == 60
    check_claims(stream, every=5)


def test_everything_gets_its_turn_and_what_is_chosen_first():
    bodies = Bodies(200, seed=6)
    stream = Stream(bodies, Conditions(rate=1.5e4, loss=0.0), seed=6)
    chosen = (7, 8, 9)
    far = ViewCamera(position=(0.0, 0.0, 400.0), rotation=(0.0, 1.0, 0.0, 0.0))  # looks away
    stream.look(StreamInterest(cameras=(far,), chosen=chosen))
    stream.run(8.0)
    assert stream.receiver.known_count == 200
    held = stream.receiver._held
    assert held is not None and (bodies.tick * TICK - held.time).max() < 5.0
    off = np.array([errors(stream, frame)[0] for when, frame, _ in stream.shown if when > 4.0])
    rows = np.isin(held.entities, chosen)
    assert off[:, rows].mean() < 0.3 * off[:, ~rows].mean()


def test_memory_stays_bounded_whatever_the_viewer_does_not_answer():
    bodies, stream = Bodies(60, seed=7), None
    stream = Stream(bodies, Conditions(rate=1e7), seed=7)
    stream.run(2.0)
    sizes = []
    stream.network.send = lambda *_, **__: None  # nothing comes through any more
    for _ in range(8):
        stream.run(1.0)
        sizes.append(stream.sender.size)
    assert max(sizes[4:]) <= max(sizes[:3])
    assert stream.receiver.size < 64 << 20


@settings(max_examples=20, deadline=None)
@given(
    acks=st.lists(
        st.builds(
            Ack,
            flags=st.integers(0, 255),
            generation=st.sampled_from([0, 1000, 1001, 2**63, 2**64 - 1]),
            number=st.integers(0, 2**32 - 1) | st.integers(0, 40),
            newest=st.integers(0, 2**32 - 1) | st.integers(0, 40),
            bits=st.integers(0, 2**64 - 1),
            merged=st.integers(0, 2**32 - 1) | st.integers(0, 40),
            lanes=st.integers(0, 2**32 - 1),
        ),
        min_size=1,
        max_size=12,
    )
)
def test_acks_that_lie_break_nothing(acks):
    """The sender goes on, and a viewer that acknowledges truly then is told all again."""
    stream = Stream(Bodies(20, seed=8), Conditions(delay=0.01, loss=0.0, rate=1e6), seed=8)
    stream.run(0.3)
    for ack in acks:
        stream.sender.acked(ack, stream.network.now)
        stream.run(0.05)
    stream.run(1.5)
    assert stream.shown[-1][0] > stream.network.now - 0.5
    assert stream.receiver.known_count == 20
    check_claims(stream, every=10)


def test_damaged_frames_are_refused_and_change_nothing():
    stream = Stream(Bodies(30, seed=9), Conditions(delay=0.0, loss=0.0, rate=1e8), seed=9)
    bodies: list[bytes] = []
    take = stream.receiver.take
    stream.receiver.take = lambda body: bodies.append(body) or take(body)  # type: ignore[method-assign]
    stream.run(1.0)
    random = np.random.default_rng(1)
    refused = 0
    for _ in range(1500):
        body = bytearray(bodies[random.integers(len(bodies))])
        for _ in range(random.integers(1, 4)):
            body[random.integers(len(body))] = random.integers(256)
        cut = bytes(body[: random.integers(len(body))]) if random.random() < 0.3 else bytes(body)
        victim = Receiver()
        victim.take(bodies[0])
        before = victim.ack(1)
        try:
            arrival = victim.take(cut)
        except MessageError as error:
            refused += 1
            assert str(error)
            assert victim.ack(1) == before
        else:
            if arrival.state is not None:
                assert unpack_frame(arrival.state).body_count <= 1 << 20
    assert refused > 200


def test_a_sender_sends_nothing_to_nobody():
    sender, bodies = Sender(0.0, generation=1), Bodies(5, seed=1)
    stream = Stream(bodies, Conditions(), seed=1)
    stream.run(0.1)
    assert stream._truth is not None
    assert sender.frame(stream._truth, 1.0) is None  # no connection is open yet

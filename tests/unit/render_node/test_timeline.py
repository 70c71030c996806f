"""What is seen between frames, and when they come late."""

from __future__ import annotations

import asyncio
import itertools

import numpy as np
import pytest

from elys.bus.session import Session
from elys.bus.streaming.client import StreamClient
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.components import MeshRenderer, Transform
from elys.render_node.playout import BRIDGED_AT_MOST, SLEW, STREAM_WAIT
from elys.render_node.scene_following import SceneFollower
from elys.render_node.timeline import LONGEST_LOOKAHEAD, Timeline

BODY = np.array([1], np.uint32)
STEP = 0.05  # [s] between two frames, of simulation and of the clock


@pytest.fixture
def frame_at(make_frame):
    """Frame number n of a body that goes along x at 1 m/s."""

    def make(number: int, **header):
        poses = {1: (number * STEP, 0.0, 0.0)}
        nanoseconds = round(number * STEP * 1e9)
        return make_frame(
            poses, **({"tick": number, "simulation_time": number * STEP, "published_at": nanoseconds} | header)
        )

    return make


def seen(timeline: Timeline, now: float) -> float:
    """Where the body is seen along x."""
    return float(timeline.poses(BODY, timeline.fraction(now))[0][0, 0])


def test_in_time_frames_are_seen_one_interval_late(frame_at) -> None:
    timeline = Timeline()
    for number in range(4):
        timeline.take(frame_at(number), 10.0 + number * STEP)
    for share in (0.0, 0.3, 1.0):
        now = 10.0 + (3 + share) * STEP
        assert seen(timeline, now) == pytest.approx((2 + share) * STEP)
        assert timeline.seen_time(now) == pytest.approx((2 + share) * STEP)
        assert timeline.seen_age(now) == pytest.approx(STEP)


def test_a_late_frame_is_bridged_up_to_the_cap(frame_at) -> None:
    timeline = Timeline()
    timeline.take(frame_at(0), 10.0)
    timeline.take(frame_at(1), 10.0 + STEP)
    last = 10.0 + STEP
    assert seen(timeline, last + 1.5 * STEP) == pytest.approx(1.5 * STEP)
    assert timeline.is_moving(last + 1.5 * STEP)
    for late in (2.0 * STEP, 3.0 * STEP, 60.0):  # one interval ahead, and not farther
        assert seen(timeline, last + late) == pytest.approx(2.0 * STEP)
        assert not timeline.is_moving(last + late)
    assert timeline.seen_age(last + 60.0) == pytest.approx(60.0 - STEP)


def test_the_cap_is_one_of_time_where_frames_are_far_apart(make_frame) -> None:
    timeline = Timeline()
    for number in range(2):
        timeline.take(
            make_frame(
                {1: (float(number), 0.0, 0.0)},
                tick=number,
                simulation_time=0.25 * number,
                published_at=round(number * 0.25e9),
            ),
            10.0 + 0.25 * number,
        )
    assert seen(timeline, 11.0) == pytest.approx(1.0 + LONGEST_LOOKAHEAD / 0.25)


@pytest.mark.parametrize("delays", [(0.0, 0.4, 0.0, 0.0, 0.9, 0.2, 0.0), (0.0, 0.99, 0.99, 0.99), (0.0, 0.5, 0.7, 0.1)])
def test_nothing_goes_back_or_jumps_when_frames_come_late(frame_at, delays: tuple[float, ...]) -> None:
    timeline = Timeline()
    timeline.take(frame_at(0), 10.0)
    arrivals = [10.0 + (number + delay) * STEP for number, delay in enumerate(delays, 1)]
    moments = np.arange(10.0 + STEP, arrivals[-1] + 2.0 * STEP, STEP / 50)
    places, number = [], 1
    for now in moments:
        while number <= len(arrivals) and arrivals[number - 1] <= now:
            timeline.take(frame_at(number), arrivals[number - 1])
            number += 1
        places.append(seen(timeline, now))
    steps = np.diff(places)
    assert steps.min() >= -1e-9
    # The body's own speed, at which it would be seen had no frame been late, and what is caught up.
    assert steps.max() < STEP / 50 * (1.0 + SLEW) + 1e-9
    assert places[-1] > (len(delays) - 1) * STEP


def test_a_pause_is_gone_to_at_an_even_speed_and_nothing_beyond(frame_at) -> None:
    timeline = Timeline()
    for number in range(3):
        timeline.take(frame_at(number), 10.0 + number * STEP)
    timeline.take(frame_at(3, playing=False), 10.0 + 3 * STEP)
    for late, place in ((0.0, 2.0), (0.5 * STEP, 2.5), (STEP, 3.0), (5.0, 3.0)):
        assert seen(timeline, 10.0 + 3 * STEP + late) == pytest.approx(place * STEP)
    assert not timeline.is_moving(16.0)


def test_what_was_bridged_before_a_pause_has_not_come_to_pass(frame_at) -> None:
    timeline = Timeline()
    for number in range(3):
        timeline.take(frame_at(number), 10.0 + number * STEP)
    assert seen(timeline, 10.0 + 3.5 * STEP) == pytest.approx(2.5 * STEP)
    timeline.take(frame_at(2, playing=False, published_at=round(2.2 * STEP * 1e9)), 10.0 + 3.5 * STEP)
    assert seen(timeline, 10.0 + 3.5 * STEP) == pytest.approx(2 * STEP)
    # Steps and edits while time stands are seen at once; when it goes on, nothing moved meanwhile.
    timeline.take(frame_at(3, playing=False, published_at=10**9), 11.0)
    assert seen(timeline, 11.0) == pytest.approx(3 * STEP)
    timeline.take(frame_at(4, published_at=round(2e9)), 12.0)
    for late, place in ((0.0, 3.0), (0.5, 3.5), (1.0, 4.0)):
        assert seen(timeline, 12.0 + late * STEP) == pytest.approx(place * STEP)


def test_offline_times_are_never_beyond_the_frames(frame_at) -> None:
    timeline = Timeline()
    timeline.take(frame_at(0), 0.0)
    timeline.take(frame_at(1), 0.0)
    assert timeline.fraction_at(-1.0) == 0.0
    assert timeline.fraction_at(0.4 * STEP) == pytest.approx(0.4)
    assert timeline.fraction_at(9.0) == 1.0


def test_what_was_bridged_stands_right_once_the_body_rests(stage, frame_at) -> None:
    body = stage.add(Transform(), MeshRenderer())
    world = stage.world()
    assert body == 1
    world.take_state(frame_at(0), 10.0)
    world.take_state(frame_at(1), 10.0 + STEP)
    world.place(10.0 + 2.9 * STEP)
    assert world.position[0][0] > 1.8 * STEP
    for number, now in ((2, 10.0 + 3 * STEP), (3, 10.0 + 4 * STEP), (4, 10.0 + 5 * STEP)):
        poses = frame_at(1, tick=number, simulation_time=number * STEP, published_at=round(number * STEP * 1e9))
        world.take_state(poses, now)
        world.place(now)
    assert world.position[0][0] == pytest.approx(STEP)


def test_frames_that_come_early_do_not_go_back(frame_at) -> None:
    timeline = Timeline()
    places = []
    for number, now in enumerate((10.0, 10.05, 10.07, 10.12, 10.2)):
        timeline.take(frame_at(number), now)
        places.append(seen(timeline, now))
    assert all(after >= before for before, after in itertools.pairwise(places))


@pytest.mark.parametrize("is_stream", [True, False])
def test_of_a_stream_less_is_waited_for(frame_at, is_stream: bool) -> None:
    async def main() -> float:
        broker = LoopbackBroker()
        host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=1)
        viewer = await Session.join(broker.connect(), kind="tool")
        viewer.states = StreamClient(viewer, lambda _: broker.connect()) if is_stream else None
        timeline = SceneFollower(viewer).world.timeline
        came = 0.0
        for number in range(200):  # each tenth is 0.2 s late, and holds up those after it
            came = max(came, 10.0 + number * STEP + (0.2 if number % 10 == 0 else 0.0))
            timeline.take(frame_at(number), came)
        await viewer.close()
        await host.close()
        return timeline.delay

    assert asyncio.run(main()) == pytest.approx(STEP + (STREAM_WAIT if is_stream else 0.2 - BRIDGED_AT_MOST))

"""The time that is seen, over links of every kind and in virtual time, against a plain model and the host's own truth."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from elys.bus.lateness import SHARE, SPAN
from elys.render_node.playout import BRIDGED, LEAP, LONGEST_WAIT, SLEW, Playout
from elys.render_node.timeline import Timeline
from tests.benchmarks.clock import frame_of, watcher_of
from tests.link_traces import LINKS, TICK_RATE, Come, Course, Watcher, here, steady, trace, watched

TICK = 1.0 / TICK_RATE  # [s]
RADIUS, TURN = 2.0, 3.0  # [m], [rad/s] of a body on a circle


def plain_delay(states: list[Come]) -> tuple[float, float]:
    """The quickest way, and after it the delay [s], of a steady 60 Hz: every tick by itself, sorted, in plain Python."""
    now = states[-1].came
    delays, before = [], states[0].tick
    for come in states:
        if now - come.came <= SPAN:
            for tick in range(before + 1, come.tick + 1):  # those that were overtaken came with who overtook them
                stamp = come.published - (come.tick - tick) * TICK
                came = come.came if tick == come.tick else max(come.first, stamp)
                delays.append(came - stamp)
        before = come.tick
    delays.sort()
    usual = delays[math.ceil(SHARE * len(delays)) - 1] - delays[0]
    return delays[0], TICK + min(max(usual - BRIDGED * TICK, 0.0), LONGEST_WAIT)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("link", LINKS)
def test_time_is_seen_evenly_and_as_late_as_is_meant(link: str, seed: int) -> None:
    states = trace(LINKS[link], seed=seed, unevenness=0.0, seconds=40.0)
    seen = watched(states, watcher_of(Timeline()))
    speed = np.diff(seen.seen) / np.diff(seen.now)
    assert speed.min() >= 0.0
    assert speed.max() <= 1.0 + SLEW + 1e-6
    least, delay = plain_delay(states)
    late = seen.settled_age(skip=30.0)
    # Windows that begin elsewhere hold other late ones; what came latest found things standing.
    assert np.median(late) == pytest.approx(least - here(0.0) + delay, rel=0.12, abs=2e-3)
    if link == "one machine":
        assert late.max() < TICK + 2e-3
        assert seen.stutter() < 0.01


@pytest.mark.parametrize("drift", [-200e-6, 200e-6])
def test_clocks_that_go_apart_change_nothing(drift: float) -> None:
    states = trace(steady(0.02, 0.001), seconds=240.0, drift=drift)
    seen = watched(states, watcher_of(Timeline()), drift=drift)
    wrong = abs(drift) * SPAN  # by the quickest of the last seconds
    assert np.abs(seen.settled_age() - (TICK + 0.02)).max() < wrong + 3e-3
    assert seen.stutter() < 0.02


RATES = ((0.0, 1.0), (5.0, 0.01), (20.0, 0.3), (25.0, 3.0), (30.0, 100.0), (33.0, 1.0), (38.0, 0.0), (41.0, 1.0))


def test_other_rates_and_pauses_are_followed() -> None:
    course = Course(RATES)
    states = trace(LINKS["cable, 20 ms"], course=course, seconds=48.0, unevenness=0.0)
    timeline = Timeline()
    seen = watched(states, watcher_of(timeline), course=course)
    assert np.diff(seen.seen).min() >= 0.0
    time = seen.now - here(0.0)
    for number, (start, rate) in enumerate(RATES):
        end = RATES[number + 1][0] if number + 1 < len(RATES) else 48.0
        # Two intervals until another rate is known, one until it is as late as it has to be, then what is slewed.
        settled = (time > min(start + 3.2 / (TICK_RATE * max(rate, 0.01)) + 2.5, end - 1.0)) & (time < end)
        speed = (np.diff(seen.seen) / np.diff(seen.now))[settled[1:]]
        assert speed.max() <= rate * (1.0 + SLEW) * 1.02 + 1e-9, rate
        assert speed.mean() == pytest.approx(rate, rel=0.05, abs=1e-9), rate
        if rate:
            assert seen.age[settled].max() < 1.02 * max(1.0 / TICK_RATE / rate, 1e-3) + 0.03, rate


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(0.0, 0.45), min_size=40, max_size=160), st.integers(0, 2**16))
def test_whatever_comes_late_no_time_is_seen_twice_or_skipped(delays: list[float], seed: int) -> None:
    rest = itertools.cycle(delays)
    states = trace(lambda _, __: next(rest), seconds=len(delays) / TICK_RATE + 1.0, seed=seed, unevenness=0.0)
    seen = watched(states, watcher_of(Timeline()))
    speed = np.diff(seen.seen) / np.diff(seen.now)
    assert speed.min() >= 0.0
    assert speed.max() <= 1.0 + SLEW + 1e-6
    assert (seen.age > 0.0).all()


@pytest.mark.parametrize("link", LINKS)
def test_bodies_stand_where_they_were_at_the_time_that_is_seen(link: str) -> None:
    timeline, errors, bounds = Timeline(), [], []

    def place(time: float) -> tuple[float, float, float]:
        return RADIUS * math.cos(TURN * time), RADIUS * math.sin(TURN * time), 0.0

    def take(come: Come) -> None:
        timeline.take(frame_of(come, position=place(come.simulation_time)), come.came, first=come.first)

    def look(now: float) -> float:
        fraction = timeline.fraction(now)
        found = timeline.poses(np.array([1], np.uint32), fraction)[0][0]
        time, gap = timeline.time_at(fraction), timeline.gap
        errors.append(float(np.linalg.norm(found - place(time))))
        # A chord's error: half the acceleration times the ways [s] to both ends.
        bounds.append(RADIUS * TURN**2 / 2.0 * abs(fraction * (1.0 - fraction)) * gap**2)
        assert time == pytest.approx(timeline.seen_time(now), abs=1e-9)
        return time

    watched(trace(LINKS[link], seconds=15.0), Watcher(take, look))
    assert (np.array(errors) <= np.array(bounds) * 1.001 + 1e-9).all()
    assert max(errors) > 1e-6
    if link in ("one machine", "cable, 20 ms"):
        assert max(errors[60:]) < 1e-3  # [m]


# --- where time is set ---------------------------------------------------------------------------------------------


def run_of(epoch: int, start: float, count: int, *, tick: int = 0, at: float = 0.0, playing: bool = True) -> list[Any]:
    """Frames of a run, when they come [s], from a tick on, `at` [s] by the host's clock first."""
    found = []
    for number in range(count):
        come = Come(tick + number, (tick + number) * TICK, at + number * TICK, playing, 0.0, start + number * TICK)
        found.append((frame_of(come, epoch=epoch), come.came))
    return found


def follow(timeline: Timeline, frames: list[Any]) -> None:
    for frame, came in frames:
        timeline.seen_time(came)
        timeline.take(frame, came)


@pytest.mark.parametrize("host_clock", [5000.0, 3.0])
def test_another_host_is_seen_at_once_whatever_its_clock_says(host_clock: float) -> None:
    timeline = Timeline()
    follow(timeline, run_of(1, 100.0, 60, at=50.0))
    follow(timeline, run_of(2, 103.0, 3, at=host_clock))
    assert timeline.seen_time(103.0 + 2 * TICK) == pytest.approx(TICK)
    follow(timeline, run_of(2, 103.0 + 3 * TICK, 60, tick=3, at=host_clock + 3 * TICK))
    assert timeline.seen_age(103.0 + 62 * TICK) == pytest.approx(TICK, abs=1e-6)


@pytest.mark.parametrize("leap", [-3600.0, 3600.0])
def test_a_host_whose_clock_is_set_goes_on_in_time(leap: float) -> None:
    timeline = Timeline()
    follow(timeline, run_of(1, 100.0, 60, at=5000.0))
    follow(timeline, run_of(1, 100.0 + 60 * TICK, 60, tick=60, at=5000.0 + 60 * TICK + leap))
    assert timeline.seen_time(100.0 + 119 * TICK) == pytest.approx(118 * TICK, abs=TICK)


@pytest.mark.parametrize("target", [5, 4000])
def test_a_seek_is_seen_at_once_and_time_goes_on_from_there(target: int) -> None:
    timeline = Timeline()
    follow(timeline, run_of(1, 100.0, 60, at=50.0))
    now = 100.0 + 60 * TICK
    sought = run_of(1, now, 20, tick=target, at=50.0 + 60 * TICK)
    follow(timeline, sought[:1])
    assert timeline.seen_time(now) == pytest.approx(target * TICK)
    places = []
    for number, (frame, came) in enumerate(sought[1:]):
        timeline.take(frame, came)
        places += [timeline.seen_time(came + share * TICK) for share in (0.0, 0.5)]
        assert places[-1] <= (target + number + 1) * TICK
    assert (np.diff(places) >= 0.0).all()
    assert places[-2] == pytest.approx((target + 18) * TICK, abs=TICK / 4)


def test_single_steps_are_seen_at_once() -> None:
    timeline = Timeline()
    follow(timeline, run_of(1, 100.0, 60, at=50.0))
    stand = run_of(1, 102.0, 1, tick=59, at=52.0, playing=False)
    follow(timeline, stand)
    for number in range(60, 70):
        (frame, _), came = run_of(1, 0.0, 1, tick=number, at=53.0 + number, playing=False)[0], 103.0 + number
        assert timeline.take(frame, came)
        assert timeline.seen_time(came) == pytest.approx(number * TICK)
    edited = replace(frame, published_at=frame.published_at + 10**8, position=frame.position + 1.0)
    assert timeline.take(edited, came + 0.1)
    assert timeline.poses(np.array([1], np.uint32), timeline.fraction(came + 0.1))[0][0, 0] == 1.0
    assert not timeline.take(frame, came + 0.2)


def test_a_difference_above_the_bound_is_set_and_one_below_is_slewed() -> None:
    for late, is_set in ((LEAP - 0.1, False), (LEAP + 0.1, True)):
        playout = Playout()
        playout.begin(0.0, 0.0, came=10.0)
        for number in range(1, 30):
            playout.follow(number * TICK, number * TICK, ticks=1, first=10.0 + number * TICK, came=10.0 + number * TICK)
            playout.moment(10.0 + number * TICK, end=number * TICK)
        before = playout.moment(10.0 + 29 * TICK, end=1e9)
        playout.moment(10.0 + 29 * TICK + late, end=29 * TICK)  # nothing came
        after = playout.moment(10.0 + 29 * TICK + late + 0.01, end=1e9)
        assert (after - before > late) == is_set

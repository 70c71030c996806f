"""The fixed step, on a clock that the test turns."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from elys.common.clock import FixedStepClock


class Hand:
    """A clock's hand that stands until it is moved."""

    def __init__(self) -> None:
        self.time = 1000.0

    def __call__(self) -> float:
        return self.time


def run_due(clock: FixedStepClock) -> int:
    due = clock.take_due()
    for _ in range(due):
        clock.advance()
    return due


def test_one_tick_a_step_and_none_in_between() -> None:
    hand = Hand()
    clock = FixedStepClock(60, now=hand)
    assert clock.take_due() == 0
    assert clock.seconds_until_due() == pytest.approx(1 / 60)
    hand.time += 1 / 120
    assert clock.take_due() == 0
    hand.time += 1 / 120
    assert run_due(clock) == 1
    assert clock.tick == 1
    assert clock.seconds_until_due() == pytest.approx(1 / 60)


def test_waking_at_each_deadline_loses_and_adds_nothing_in_an_hour() -> None:
    hand = Hand()
    clock = FixedStepClock(60, now=hand)
    for tick in range(1, 60 * 3600 + 1):
        hand.time = clock.deadline
        assert run_due(clock) == 1
        assert clock.tick == tick
    assert hand.time == pytest.approx(1000.0 + 3600.0, abs=1e-6)
    assert clock.lost_ticks == 0


def test_a_short_delay_is_caught_up_and_a_long_one_is_given_up_and_counted() -> None:
    hand = Hand()
    clock = FixedStepClock(100, now=hand, max_catch_up=5)
    hand.time += 0.035
    assert run_due(clock) == 3
    assert clock.lost_ticks == 0
    hand.time += 1.0
    assert run_due(clock) == 5
    assert clock.lost_ticks == 95
    assert clock.take_due() == 0
    assert clock.seconds_until_due() == pytest.approx(0.005)


def test_a_pause_is_never_caught_up() -> None:
    hand = Hand()
    clock = FixedStepClock(60, now=hand)
    hand.time += 0.5 / 60
    clock.pause()
    assert clock.deadline == math.inf
    assert clock.realtime_factor == 0.0
    hand.time += 1e6
    assert clock.take_due() == 0
    clock.advance()
    clock.play()
    clock.play()
    assert clock.tick == 1
    assert clock.take_due() == 0
    assert clock.seconds_until_due() == pytest.approx(1 / 60)
    hand.time = clock.deadline
    assert run_due(clock) == 1
    assert clock.lost_ticks == 0


def test_the_rate_stretches_time() -> None:
    hand = Hand()
    clock = FixedStepClock(60, now=hand, rate=0.5)
    assert clock.seconds_until_due() == pytest.approx(1 / 30)
    clock.set_rate(2.0)
    assert clock.seconds_until_due() == pytest.approx(1 / 120)


def test_as_fast_as_it_can() -> None:
    hand = Hand()
    clock = FixedStepClock(60, now=hand, rate=0.0)
    for _ in range(10):
        assert clock.seconds_until_due() == 0.0
        assert run_due(clock) == 1
        hand.time += 0.001
    assert clock.lateness() == 0.0
    assert clock.realtime_factor == pytest.approx(10 / 60 / 0.010)


def test_the_realtime_factor_is_what_was_reached() -> None:
    hand = Hand()
    clock = FixedStepClock(60, now=hand, max_catch_up=1)
    for _ in range(200):
        hand.time += 1 / 30  # the machine only manages half
        run_due(clock)
    assert clock.realtime_factor == pytest.approx(0.5, rel=0.05)
    assert clock.lost_ticks > 190


def test_lateness() -> None:
    hand = Hand()
    clock = FixedStepClock(60, now=hand)
    assert clock.lateness() == 0.0
    hand.time = clock.deadline + 0.003
    assert clock.lateness() == pytest.approx(0.003)


def test_seeking_and_another_tick_rate_start_anew() -> None:
    hand = Hand()
    clock = FixedStepClock(60, now=hand)
    hand.time += 10.0
    clock.seek(600)
    assert (clock.tick, clock.take_due()) == (600, 0)
    clock.set_tick_rate(120)
    assert clock.step == 1 / 120
    assert clock.seconds_until_due() == pytest.approx(1 / 120)


@given(st.lists(st.floats(0.0, 0.5), max_size=60), st.sampled_from([1, 30, 60, 144, 1000]), st.integers(1, 8))
def test_done_and_lost_ticks_are_all_the_time_that_passed(waits: list[float], tick_rate: int, catch_up: int) -> None:
    hand = Hand()
    clock = FixedStepClock(tick_rate, now=hand, max_catch_up=catch_up)
    for wait in waits:
        hand.time += wait
        assert run_due(clock) <= catch_up
    passed = (hand.time - 1000.0) * tick_rate
    assert abs(clock.tick + clock.lost_ticks - passed) <= 1.001


@pytest.mark.parametrize(
    "arguments",
    [
        {"tick_rate": 0},
        {"tick_rate": -1},
        {"tick_rate": math.nan},
        {"tick_rate": 60, "max_catch_up": 0},
        {"tick_rate": 60, "rate": -1.0},
        {"tick_rate": 60, "rate": math.inf},
    ],
)
def test_impossible_clocks_are_refused(arguments: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must|least"):
        FixedStepClock(now=Hand(), **arguments)

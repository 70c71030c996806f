"""Times of clips and the instants they pass, against exact fractions: each pass is told once, whatever the tick."""

from __future__ import annotations

import random
from fractions import Fraction

import numpy as np
import pytest

from elys.sim_node.animation.clip_times import ONCE, PING_PONG, REPEAT, Way, clip_times, ends_met, go_on, instants_met

TICKS = 60


class PlainWay:
    """One player's time as an exact number that never begins anew."""

    def __init__(self, loop: int, duration: float, start: float) -> None:
        self.loop, self.duration, self.at = loop, Fraction(duration), Fraction(start)
        self.period = self.duration * 2 if loop == PING_PONG else self.duration

    def met(self, end: Fraction, instants: list[float]) -> list[int]:
        """Which instants lie from here, inclusive, to `end`, exclusive, in order; ends of clips count as they are come to."""
        start, self.at = self.at, end
        found: list[tuple[Fraction, Fraction, int]] = []
        sign = 1 if end > start else -1
        for number, instant in enumerate(map(Fraction, instants)):
            if instant > self.duration:
                continue
            places = {instant}
            if self.loop == PING_PONG:
                places |= {self.period - instant} if instant not in (0, self.duration) else set()
            for place in places:
                for lap in self.laps_between(start, end):
                    at = place + lap * self.period
                    is_inside = start <= at < end if sign > 0 else end < at <= start
                    if sign > 0 and self.loop == REPEAT and instant == self.duration:
                        is_inside = start < at <= end  # the end of a clip belongs to the pass that ends there
                    stops = self.loop == ONCE and at == end != start and at in (0, self.duration)
                    is_end = stops and (at == self.duration) == (sign > 0)
                    if is_inside or is_end:
                        found.append((abs(at - start), -instant * sign, number))
        return [number for *_, number in sorted(found)]

    def laps_between(self, start: Fraction, end: Fraction) -> range:
        if self.loop == ONCE:
            return range(1)
        low, high = min(start, end), max(start, end)
        return range(int(low // self.period) - 1, int(high // self.period) + 2)


def way_of(time: float, step: float, loop: int, duration: float) -> Way:
    return go_on(np.array([time]), np.array([step]), np.array([loop], np.uint8), np.array([duration]))


@pytest.mark.parametrize("seed", range(60))
def test_every_pass_is_met_once_and_in_order(seed: int) -> None:
    chance = random.Random(seed)
    loop = chance.choice((REPEAT, PING_PONG, ONCE))
    duration = chance.choice((1.0, 0.1, 1.0 / 3.0, chance.uniform(0.01, 3.0)))
    instants = [0.0, duration, duration / 2.0, duration * 2.0, *(chance.uniform(0.0, duration) for _ in range(3))]
    scale = chance.choice((0.02, 0.1, 0.25, 1.0, 7.3))  # of a clip in a tick
    speed = duration * scale
    time = chance.choice((0.0, duration / 2.0, chance.uniform(0.0, duration)))
    plain = PlainWay(loop, duration, time)
    total = 0
    for tick in range(TICKS):
        if tick % 20 == 19:
            speed = chance.choice((-speed, speed, 0.0)) or duration * scale
        if tick % 13 == 12:
            speed = chance.uniform(-2.0, 2.0) * duration * scale
        way = way_of(time, speed, loop, duration)
        end = float(way.end[0])
        total += int(way.laps[0])
        exact = Fraction(end) + total * plain.period
        assert abs(exact - plain.at - Fraction(speed)) < Fraction(duration) * Fraction(1, 10**12) or loop == ONCE
        assert 0.0 <= end <= float(plain.period)
        assert instants_met(way, 0, loop, duration, instants) == plain.met(exact, instants), (tick, time, speed)
        time = end


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("loop", [REPEAT, PING_PONG])
def test_long_runs_meet_each_instant_as_often_as_they_go_round(loop: int, sign: float) -> None:
    duration, instants = 0.7, [0.0, 0.1, 0.35, 0.7]
    period = duration * (2 if loop == PING_PONG else 1)
    counts, time, laps = np.zeros(4, int), 0.0, 0
    for _ in range(5000):
        way = way_of(time, sign * 0.05, loop, duration)
        for number in instants_met(way, 0, loop, duration, instants):
            counts[number] += 1
        time, laps = float(way.end[0]), laps + int(way.laps[0])
    rounds = 5000 * 0.05 / period
    assert abs(laps * sign - rounds) <= 1
    once_a_round = np.array((1, 2, 2, 1)) if loop == PING_PONG else np.ones(4)
    assert (np.abs(counts - rounds * once_a_round) <= 2).all()


def test_a_clip_that_ends_is_over_once() -> None:
    loop = np.array([ONCE], np.uint8)
    over = []
    time = 0.0
    for _ in range(30):
        way = way_of(time, 0.1, ONCE, 1.0)
        over.append(int(ends_met(way, loop)[0]))
        time = float(way.end[0])
    assert sum(over) == 1 and time == 1.0


def test_a_tiny_step_back_from_the_beginning_stays_within_the_clip() -> None:
    way = way_of(0.0, -1e-30, REPEAT, 1.0)
    assert 0.0 < float(way.end[0]) < 1.0
    assert instants_met(way, 0, REPEAT, 1.0, [0.0]) == [0]
    again = way_of(float(way.end[0]), -1e-30, REPEAT, 1.0)
    assert instants_met(again, 0, REPEAT, 1.0, [0.0]) == []


def test_on_the_way_back_clips_run_backwards() -> None:
    times = clip_times(np.array((0.25, 1.25, 1.75)), np.array([PING_PONG] * 3, np.uint8), np.ones(3))
    np.testing.assert_allclose(times, (0.25, 0.75, 0.25))


def test_a_clip_of_one_key_meets_nothing() -> None:
    way = way_of(0.0, 1.0, REPEAT, 0.0)
    assert float(way.end[0]) == 0.0
    assert instants_met(way, 0, REPEAT, 0.0, [0.0]) == []

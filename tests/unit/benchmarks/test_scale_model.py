"""The model of trees of routers, against what can be worked out on paper and against a plain walk through the events."""

from __future__ import annotations

import heapq

import numpy as np
import pytest

from tests.scale.measured import Point, fitted, predicted
from tests.scale.model import Costs, Level, run, tree_for

COSTS = Costs(take=1e-5, take_byte=1e-9, give=2e-5, give_byte=1e-10, hop=3e-4)
SIZE = 10_000.0


def test_without_waiting_each_viewer_is_as_late_as_its_place() -> None:
    found = run([Level(fan_out=1), Level(fan_out=50, delay=0.02)], COSTS, size=SIZE)
    taking, giving = 1e-5 + 1e-5, 2e-5 + 1e-6
    expected = 2 * 3e-4 + 0.02 + 2 * taking + giving * (1 + np.arange(1, 51))
    np.testing.assert_allclose(found.ages, np.broadcast_to(expected, found.ages.shape), rtol=0, atol=1e-12)
    assert found.lost == 0.0
    assert found.levels[1].processor == pytest.approx(60 * (taking + 50 * giving))
    assert found.levels[1].sent == 60 * 50 * SIZE


def test_a_link_that_is_slower_than_the_processor_counts() -> None:
    found = run([Level(fan_out=10, bandwidth=10 * SIZE * 60 * 2)], COSTS, size=SIZE)
    np.testing.assert_allclose(found.ages[-1], 3e-4 + np.arange(1, 11) / (10 * 60 * 2), atol=1e-12)


def test_what_is_overloaded_loses_what_it_cannot_carry_and_no_more() -> None:
    fan_out = 2000  # 42 ms of giving in 16.7 ms
    found = run([Level(fan_out=fan_out)], COSTS, size=SIZE, ticks=2000)
    carried = (1 / 60) / (COSTS.taking(SIZE) + fan_out * COSTS.giving(SIZE))
    assert found.lost == pytest.approx(1 - carried, abs=0.05)
    assert found.levels[0].processor > 1.0


def test_waiting_is_what_a_walk_through_the_events_finds() -> None:
    """Jitter above makes messages come in heaps at the lower router; walked here one event after the other."""
    levels = [Level(fan_out=1, jitter=0.03), Level(fan_out=400)]
    found = run(levels, COSTS, size=SIZE, ticks=300)
    giving, taking = COSTS.giving(SIZE), COSTS.taking(SIZE)
    jitter = np.random.default_rng(1).exponential(0.03, (300, 1, 1))[:, 0, 0]
    coming = [(tick / 60 + taking + giving + COSTS.hop + jitter[tick], tick) for tick in range(300)]
    in_order = 0.0
    events = []
    for at, tick in coming:
        in_order = max(in_order, at)
        heapq.heappush(events, (in_order, tick))
    free_at, ages = 0.0, np.zeros(300)
    while events:
        at, tick = heapq.heappop(events)
        begins = max(at, free_at)
        free_at = begins + taking + 400 * giving
        ages[tick] = free_at + COSTS.hop - tick / 60
    np.testing.assert_allclose(found.ages[:, -1], ages, atol=1e-9)


def test_a_tree_carries_all_and_no_router_more_than_it_may() -> None:
    for viewers in (1, 2, 30, 31, 900, 901, 10_000, 100_000):
        fan_outs = tree_for(viewers, fan_out=30)
        assert np.prod(fan_outs) >= viewers and max(fan_outs) <= 30


def test_costs_are_found_again_in_what_they_make() -> None:
    points = [
        Point(
            scene="", viewers=n, size=size, router=COSTS.taking(size) + n * COSTS.giving(size), age_p50=1.0, age_p99=2.0
        )
        for n in (2, 20)
        for size in (700.0, 68_000.0)
    ]
    costs = fitted(points, snapshot=0.0)
    for point in points:
        assert predicted(point, costs) == pytest.approx(point.router, rel=1e-9)
    assert (costs.give, costs.take_byte) == (pytest.approx(COSTS.give), pytest.approx(COSTS.take_byte))

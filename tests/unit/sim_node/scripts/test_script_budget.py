"""Who takes most of a tick is named, from numbers: when too much is taken, in the tick in which it was, and not again at once."""

from __future__ import annotations

import pytest

from elys.sim_node.scripts.budget import BUDGET, FIRST_WAIT, Budget
from elys.sim_node.scripts.running import Running

DT = 1.0 / 60.0
MUCH, LITTLE = 1.5 * BUDGET * DT, 0.5 * BUDGET * DT


class Ticks:
    """Scripts whose times are told, as far as they are asked for."""

    def __init__(self, count: int = 3) -> None:
        self.budget = Budget()
        self.running = [Running(entity=number, source="", values={}) for number in range(count)]

    def tick(self, *spent: float, beside: float = 0.0) -> None:
        """What each script takes [s]; `beside` is what all else does."""
        if self.budget.measures:
            for one, share in zip(self.running, spent, strict=True):
                one.spent += share
        named = lambda one: f"script {one.entity}"  # noqa: E731
        self.budget.look(sum(spent) + beside, self.running, dt=DT, named=named)


def told(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if "scripts took" in record.getMessage()]


def test_who_takes_most_is_named_with_what_all_take(caplog: pytest.LogCaptureFixture) -> None:
    ticks = Ticks()
    for _ in range(3):
        ticks.tick(0.25 * MUCH, 0.5 * MUCH, 0.25 * MUCH)
    (line,) = told(caplog)
    assert line == f"scripts took {1e3 * MUCH:.1f} of a tick's 16.7 ms, script 1 alone {0.5e3 * MUCH:.1f} ms"
    assert all(one.spent == 0.0 for one in ticks.running)


def test_nobody_is_measured_or_named_below_the_budget(caplog: pytest.LogCaptureFixture) -> None:
    ticks = Ticks()
    for _ in range(10):
        ticks.tick(LITTLE, 0.0, 0.0)
        assert not ticks.budget.measures
    assert not told(caplog)


@pytest.mark.parametrize("pause", [1, 2, 50])
def test_a_spike_now_and_then_is_named_with_who_made_it(caplog: pytest.LogCaptureFixture, pause: int) -> None:
    ticks = Ticks()
    for tick in range(3 * pause + 3):
        ticks.tick(0.6 * LITTLE, 0.0, MUCH if tick % (pause + 1) == 0 else 0.0)
    (line,) = told(caplog)
    assert f"script 2 alone {1e3 * MUCH:.1f} ms" in line  # of that tick alone: those between are not added up


def test_one_spike_ends_in_no_measuring_for_ever(caplog: pytest.LogCaptureFixture) -> None:
    ticks = Ticks()
    ticks.tick(0.0, 0.0, MUCH)
    assert ticks.budget.measures
    for _ in range(FIRST_WAIT):
        ticks.tick(LITTLE, 0.0, 0.0)
    assert not ticks.budget.measures and not told(caplog)


def test_it_is_not_said_again_at_once(caplog: pytest.LogCaptureFixture) -> None:
    ticks = Ticks()
    for _ in range(20):
        ticks.tick(MUCH, 0.0, 0.0)
    assert len(told(caplog)) == 1
    ticks.budget._said -= 6.0  # as if that had been six seconds ago
    for _ in range(3):
        ticks.tick(0.0, MUCH, 0.0)
    assert "script 1 alone" in told(caplog)[1]


def test_a_scene_without_scripts_left_names_nobody(caplog: pytest.LogCaptureFixture) -> None:
    ticks = Ticks(0)
    for _ in range(3):
        ticks.tick(beside=MUCH)
    assert not told(caplog)

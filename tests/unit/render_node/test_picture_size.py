"""How large pictures from elsewhere are over ways that are made up, against what such a way can carry at best."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from elys.render_node.picture_size import FIRST_TRIAL, LEAST_RATE, QUICK, SLOW, STEPS, PictureSize

WINDOW = (1280, 720)
PICTURE = 130_000  # [bytes] of a whole one
ROUND_TRIP = 0.04  # [s]


def watch(
    size: PictureSize, rate: Callable[[float], float], *, start: float = 0.0, seconds: float = 60.0
) -> list[float]:
    """Pictures one after the other over a way of `rate(now)` [bit/s]; the scale of each."""
    rng, now, scales = np.random.default_rng(3), start, []
    while now < start + seconds:
        width, height = size.size(*WINDOW)
        count = int(PICTURE * width * height / (WINDOW[0] * WINDOW[1]))
        way = ROUND_TRIP + count * 8.0 / rate(now) + float(rng.exponential(0.002))
        now += way + 0.01
        scales.append(size.scale)
        size.note(now, way, count, round_trip=ROUND_TRIP)
    return scales


@pytest.mark.parametrize("rate", [1e6, 3e6, 6e6, 10e6, 20e6, 100e6])
def test_pictures_become_as_large_as_the_way_carries_in_time(rate: float) -> None:
    size = PictureSize()
    scales = watch(size, lambda _: rate)
    # The largest of the steps that is not slow: with the time of what the way has to carry for it alone.
    fitting = [step for step in STEPS if PICTURE * step**2 * 8.0 / rate < SLOW]
    best = fitting[0] if fitting else STEPS[-1]
    settled = scales[len(scales) // 2 :]
    assert np.median(settled) in (best, STEPS[min(STEPS.index(best) + 1, len(STEPS) - 1)])
    # Larger ones are tried more and more seldom.
    assert np.count_nonzero(np.diff(settled)) <= 6
    # Known after a few of them, where they take long enough to tell.
    if rate <= 20e6:
        assert size.rate == pytest.approx(rate, rel=0.5)


def test_a_way_that_becomes_slow_and_quick_again_is_followed() -> None:
    size = PictureSize()
    assert set(watch(size, lambda _: 100e6, seconds=5.0)) == {1.0}
    slow = watch(size, lambda _: 2e6, start=5.0, seconds=20.0)
    assert slow.index(STEPS[-1]) <= 4 * len(STEPS)  # two pictures a step, and those by which the rate is known
    assert size.bit_rate < 2e6
    quick = watch(size, lambda _: 100e6, start=25.0, seconds=40.0)
    assert quick[-1] == 1.0
    assert size.bit_rate == 0.0 or size.bit_rate > 10e6


def test_a_single_late_picture_changes_nothing_and_small_windows_stay_windows() -> None:
    size = PictureSize()
    for number in range(100):
        size.note(0.1 * number, 2.0 * SLOW if number % 10 == 5 else 0.02, PICTURE)
        assert size.size(*WINDOW) == WINDOW
    for number in range(100):
        size.note(10.0 + number, 1.0, 1000, is_meant=False)  # one to rest on, which may take its time
    assert size.scale == 1.0
    for number in range(40):  # so few bytes
        size.note(200.0 + number, 0.02 if number % 3 == 0 else 9.0, 1000)
    assert size.scale == 1.0
    for number in range(20):
        size.note(300.0 + number, 0.02 if number == 0 else 9.0, 1000)
    assert size.scale == STEPS[-1]
    assert size.size(20, 20) == (16, 16)
    assert size.bit_rate == pytest.approx(LEAST_RATE)
    assert FIRST_TRIAL > 10 * QUICK


def test_pictures_that_do_not_come_become_smaller_and_larger_again_when_they_do() -> None:
    size = PictureSize()
    size.missed()
    size.note(1.0, 0.02, PICTURE)
    size.missed()
    assert size.scale == 1.0  # one of them may be lost for any reason
    for step in STEPS[1:]:
        size.missed()
        assert size.scale in (step, STEPS[STEPS.index(step) - 1])
        size.missed()
    assert (size.scale, size.bit_rate) == (STEPS[-1], LEAST_RATE)
    size.missed()
    assert watch(size, lambda _: 100e6, start=10.0, seconds=40.0)[-1] == 1.0


def test_the_bit_rate_changes_seldom() -> None:
    size, rng, found = PictureSize(), np.random.default_rng(5), []
    for number in range(600):
        count = int(rng.uniform(5_000, 16_000))
        way = ROUND_TRIP + count * 8.0 / 4e6 + float(rng.exponential(0.003))
        size.note(0.05 * number, way, count, round_trip=ROUND_TRIP)
        found.append(size.bit_rate)
    settled = found[100:]
    assert np.count_nonzero(np.diff(settled)) <= 4
    assert 0.8e6 < np.median(settled) < 4e6

"""Profiles over time: spikes are kept for a minute, figures are numpy's, bars lie where the stages ran."""

from __future__ import annotations

import random
import statistics

import numpy as np
import pytest

from elys.editor_node.frame_profiles import REST, Bar, ProfileTrack, Sample, flame


def sample(number, total, *, at=None, **stages):
    return Sample(number=number, at=number / 60.0 if at is None else at, total=total, stages=stages)


def tick(number=1):
    stages = {
        "apply_commands": 0.5,
        "physics.broadphase": 1.0,
        "physics.solve": 2.0,
        "simulate_physics": 3.5,
        "publish": 1.0,
    }
    return Sample(number=number, at=0.0, total=5.25, stages=stages)


def test_the_worst_of_the_last_minute_is_that_of_a_plain_search():
    rng = random.Random(4)
    track, samples, now = ProfileTrack(kept=50), [], 0.0
    for number in range(3000):
        now += rng.choice((0.01, 0.02, 3.0))
        samples.append(sample(number, rng.expovariate(1.0), at=now))
        track.add(samples[-1])
        if number % 97 == 0:
            assert track.worst is max((s for s in samples if s.at >= now - 60.0), key=lambda s: s.total)
    assert len(track.samples) == 50


def test_figures_are_those_of_the_kept_ones():
    track = ProfileTrack(budget=5.0, kept=100)
    assert track.figures() is None
    for number in range(250):
        track.add(sample(number, float(number % 10)))
    found = track.figures()
    values = [float(number % 10) for number in range(150, 250)]
    assert found.sample_count == 100
    assert found.mean == pytest.approx(statistics.fmean(values))
    assert found.median == pytest.approx(statistics.median(values))
    assert found.p99 == pytest.approx(statistics.quantiles(values, n=100, method="inclusive")[98])
    assert found.longest == 9.0
    assert found.over_budget == 40


def test_one_is_held_until_it_is_let_go():
    track = ProfileTrack()
    for number in range(5):
        track.add(sample(number, 1.0 + (number == 2)))
    assert track.chosen.number == 4
    track.hold(track.worst)
    track.add(sample(5, 1.0))
    assert track.chosen.number == 2
    assert track.nearest(3.4).number == 3
    track.hold(None)
    assert track.chosen.number == 5


def test_a_host_that_starts_anew_is_another_story():
    track = ProfileTrack()
    for number in (7, 8, 9, 1):
        track.add(sample(number, float(number)))
    assert [s.number for s in track.samples] == [1]
    assert track.worst.number == 1


def test_curves_of_many_keep_every_spike():
    rng, track = random.Random(8), ProfileTrack()
    for number in range(600):
        track.add(sample(number, rng.expovariate(1.0)))
    drawn = track.drawn(limit=100)
    assert [max(list(track.samples)[i : i + 6], key=lambda s: s.total) for i in range(0, 600, 6)] == drawn
    assert max(s.total for s in drawn) == track.figures().longest
    assert track.drawn(limit=600) == list(track.samples)
    assert ProfileTrack().drawn() == []


def test_stages_within_stages_are_counted_once():
    own = tick().own
    assert own["simulate_physics"] == pytest.approx(0.5)
    assert own[REST] == pytest.approx(0.25)
    assert sum(own.values()) == pytest.approx(5.25)


def test_bars_stand_in_order_and_parts_below_what_they_are_parts_of():
    assert flame(tick()) == [
        Bar("apply_commands", 0.0, 0.5, 0),
        Bar("simulate_physics", 0.5, 3.5, 0),
        Bar("physics.broadphase", 0.5, 1.0, 1),
        Bar("physics.solve", 1.5, 2.0, 1),
        Bar("publish", 4.0, 1.0, 0),
        Bar(REST, 5.0, 0.25, 0),
    ]


def test_a_part_without_a_whole_stands_by_itself():
    alone = Sample(number=1, at=0.0, total=3.0, stages={"physics.solve": 2.0, "publish": 1.0})
    assert flame(alone) == [Bar("physics.solve", 0.0, 2.0, 0), Bar("publish", 2.0, 1.0, 0)]


def test_curves_stand_upon_one_another_up_to_the_total():
    track = ProfileTrack()
    for number in range(4):
        track.add(tick(number))
    track.add(sample(4, 2.0, apply_commands=1.5, late_one=0.5))
    names = track.stage_names()
    rows = track.stacked(names, track.drawn())
    assert names[-1] == REST
    assert set(names) == {*tick().stages, "late_one", REST}
    assert (np.diff(rows, axis=0) >= 0.0).all()
    assert rows[0].tolist() == [0.0] * 5
    assert rows[-1] == pytest.approx(track.totals())

"""Running a case: what is recorded is what the simulation did, and the worst seed counts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from elys.common.scene import SceneDocument
from elys.lab.cases import record_case, run_case
from elys.samples.hard_cases import HARD_CASES, CaseMeasure, HardCase
from elys.samples.hard_cases.scenery import ground, scene, solid

G = 9.81


def falling(seed: int) -> SceneDocument:
    """A ball of 2 kg that starts at rest, higher for each seed, above the ground."""
    ball = solid("Ball", "sphere", position=(0.0, 20.0 + seed, 0.0), mass=2.0)
    return scene("Falling", [ground(), ball], eye=(0.0, 2.0, 9.0), target=(0.0, 1.0, 0.0))


def case(**changes: object) -> HardCase:
    values = {
        "name": "falling",
        "title": "a ball",
        "difficulty": "none",
        "answer": "the parabola",
        "build": falling,
        "duration": 1.0,
        "measures": (),
        "picture_time": 0.0,
    }
    return HardCase(**{**values, **changes})  # type: ignore[arg-type]


def test_a_fall_is_recorded_at_every_stride():
    run = record_case(case(stride=4), 3)
    assert run.seed == 3 and set(run.names) == {"Ball", "Ground"}
    np.testing.assert_allclose(run.time, np.arange(16) * 4 / 60, atol=1e-12)
    np.testing.assert_allclose(run.position("Ball")[:, 1], 23.0 - 0.5 * G * run.time**2, atol=1e-9)
    np.testing.assert_array_equal(run.position("Ground"), np.tile([0.0, -0.5, 0.0], (16, 1)))
    np.testing.assert_allclose(run.velocity("Ball")[:, 1], -G * run.time, rtol=1e-6)
    np.testing.assert_allclose(run.momentum[:, 1], -2.0 * G * run.time, rtol=1e-6)
    np.testing.assert_allclose(run.kinetic, (G * run.time) ** 2, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(run.energy, 2.0 * G * 23.0, rtol=1e-6)
    assert not run.overlap.any() and not run.joint_gap.any() and run.problems == ()


def test_the_worst_seed_is_the_error_of_a_case():
    height = CaseMeasure(name="height", unit="m", bound=21.5, of=lambda run: float(run.position("Ball")[0, 1]))
    told: list[float] = []
    outcome = run_case(case(measures=(height,), seeds=(0, 2, 1)), progress=told.append)
    assert [(error.value, error.is_met) for error in outcome.errors] == [(22.0, False)]
    assert not outcome.is_met
    assert told == sorted(told) and told[-1] == pytest.approx(1.0)


def test_an_error_without_end_is_none_and_a_miss():
    never = CaseMeasure(name="never", unit="s", bound=1.0, of=lambda run: math.inf)
    (error,) = run_case(case(measures=(never,))).errors
    assert error.value is None and not error.is_met


def test_gaps_of_joints_are_seen_in_the_places_of_entities():
    chain = HARD_CASES["heavy-chain"]
    run = record_case(replace(chain, duration=0.5), 0)
    assert 0.0 < run.joint_gap.max() < 1e-3
    link, ball = run.position("Link 20")[-1], run.position("Ball")[-1]
    assert np.linalg.norm(ball - link) == pytest.approx(0.1 + 0.25, abs=1e-3)


def test_bodies_may_be_kept_awake():
    resting = solid("Ball", "sphere", position=(0.0, 0.5, 0.0), linear_velocity=(0.001, 0.0, 0.0))
    document = scene("Resting", [ground(), resting], eye=(0.0, 2.0, 9.0), target=(0.0, 1.0, 0.0))
    ends = [
        record_case(case(build=lambda seed: document, duration=3.0, sleeping=sleeping), 0).velocity("Ball")[-1, 0]
        for sleeping in (True, False)
    ]
    assert ends[0] == 0.0 and ends[1] > 0.0


def test_what_physics_complains_about_is_kept():
    run = record_case(replace(HARD_CASES["spawned-inside"], duration=0.1), 0)
    assert any("deep into" in problem for problem in run.problems)

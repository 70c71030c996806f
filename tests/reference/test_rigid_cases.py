"""The hard cases of rigid bodies, each within its bound."""

from __future__ import annotations

import functools

import pytest

from elys.samples.rigid_cases import RIGID_CASES
from tests.benchmarks.rigid_engines import Elys, record


def _checks() -> list[object]:
    return [
        pytest.param(case.name, measure, id=f"{case.name}-{measure.name}")
        for case in RIGID_CASES.values()
        for measure in case.measures
    ]


@functools.cache
def _worst_errors(name: str) -> dict[str, float]:
    """Of a case over its seeds: it runs once for all its measures."""
    case = RIGID_CASES[name]
    found = []
    for seed in case.seeds:
        scene = case.build(seed)
        trajectory, _ = record(Elys(scene), case.step_count, stride=case.stride)
        found.append(case.errors(scene, trajectory))
    return {measure.name: max(errors[measure.name] for errors in found) for measure in case.measures}


@pytest.mark.parametrize(("name", "measure"), _checks())
def test_a_hard_case_stays_within_its_bound(name, measure):
    error = _worst_errors(name)[measure.name]
    assert measure.is_met(error), f"{RIGID_CASES[name].title}: {measure.name} is off by {error:.3g} {measure.unit}"

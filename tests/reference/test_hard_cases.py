"""The hard cases at a size for every change, each error within its bound; what is known to be missed must still be missed."""

from __future__ import annotations

import functools

import pytest

from elys.lab.cases import CaseOutcome, run_case
from elys.samples.hard_cases import HARD_CASES


def _checks() -> list[object]:
    return [
        pytest.param(
            name,
            measure.name,
            id=f"{name}-{measure.name}",
            marks=[pytest.mark.xfail(strict=True, reason=measure.known_miss)] if measure.known_miss else [],
        )
        for name, case in HARD_CASES.items()
        for measure in case.quick.measures
    ]


@functools.cache
def _outcome(name: str) -> CaseOutcome:
    """A case runs once for all its measures."""
    return run_case(HARD_CASES[name].quick)


@pytest.mark.parametrize(("name", "measure"), _checks())
def test_a_hard_case_stays_within_its_bound(name, measure):
    error = next(error for error in _outcome(name).errors if error.name == measure)
    value = "not finite" if error.value is None else f"{error.value:.3g} {error.unit}"
    assert error.is_met, f"{HARD_CASES[name].title}: {measure} is {value}, at most {error.bound:g} would do"

"""Errors against answers that a scene declares: of the hard cases, by the measures of their registry."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

from elys.lab.cases import record_case
from elys.lab.observables import ObservableError, Scales
from elys.lab.setting import Setting
from elys.samples.hard_cases import hard_case

ANSWER: Final = "answer: "  # before the name of a measure

# What 1 of a unit is, as a share of what is typical. What is counted is wrong altogether from 1 on.
_SHARES: Final[dict[str, Callable[[Scales], float]]] = {
    "m": lambda scales: 1.0 / scales.length,
    "mm": lambda scales: 1e-3 / scales.length,
    "s": lambda scales: 1.0 / scales.time,
    "ms": lambda scales: 1e-3 / scales.time,
    "J": lambda scales: 1.0 / scales.energy,
    "%": lambda scales: 0.01,
    "deg": lambda scales: math.radians(1.0),
}


class AnswerJob(NamedTuple):
    """A run of a hard case that is asked for."""

    case: str
    setting: Setting


class Answer(NamedTuple):
    """What a measure of a case came to."""

    name: str
    value: float
    unit: str


def run_answer(job: AnswerJob) -> list[Answer]:
    """The errors of a case at a setting, the worst over its seeds; at the size that suits every day."""
    case = hard_case(job.case).quick
    found = [case.errors(record_case(case, seed, setting=job.setting)) for seed in case.seeds]
    return [
        Answer(ANSWER + measure.name, _worst(errors[measure.name] for errors in found), measure.unit)
        for measure in case.measures
    ]


def _worst(errors: Iterable[float]) -> float:
    """The largest; what is not a number is as wrong as can be, not unknown."""
    return max(math.inf if math.isnan(error) else error for error in errors)


def as_errors(answers: list[Answer], scales: Scales) -> list[ObservableError]:
    """Answers as the errors of observables, which need no reference."""
    return [
        ObservableError(name, value, unit, value * _SHARES.get(unit, lambda scales: 1.0)(scales), 0.0)
        for name, value, unit in answers
    ]

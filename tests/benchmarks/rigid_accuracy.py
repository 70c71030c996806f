"""How exact engines are: each case's errors, and what a step of it costs."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from elys.lab.peers.engine import CannotError, Engine
from elys.samples.rigid_cases import RigidCase
from tests.benchmarks.rigid_engines import engines, record


class AccuracyRow(NamedTuple):
    """One measure of one case."""

    case: str
    measure: str
    unit: str
    bound: float
    errors: dict[str, float]  # engine -> worst over the seeds
    step_ms: dict[str, float]  # engine -> median, in processor time

    @property
    def is_met(self) -> bool:
        """Whether ELYS is as exact as it must be."""
        return bool(self.errors["ELYS"] <= self.bound)


def measure_case(case: RigidCase, *, quick: bool = False, others: Sequence[type[Engine]] = ()) -> list[AccuracyRow]:
    """A row for each of the case's measures; `quick` takes the first seed alone, `others` are engines beside the usual."""
    errors: dict[str, dict[str, float]] = {}
    step_ms: dict[str, float] = {}
    for engine in [*engines(), *others]:
        print(f"  {case.name} in {engine.label} ...", file=sys.stderr, flush=True)
        runs = [_run(case, engine, seed) for seed in (case.seeds[:1] if quick else case.seeds)]
        step_ms[engine.label] = float(np.median([cost for _, cost in runs]))
        errors[engine.label] = {
            measure.name: max(found[measure.name] for found, _ in runs) for measure in case.measures
        }
    return [
        AccuracyRow(
            case.name,
            measure.name,
            measure.unit,
            measure.bound,
            {label: found[measure.name] for label, found in errors.items()},
            step_ms,
        )
        for measure in case.measures
    ]


def _run(case: RigidCase, engine: type[Engine], seed: int) -> tuple[dict[str, float], float]:
    scene = case.build(seed)
    try:
        trajectory, times = record(engine(scene), case.step_count, stride=case.stride)
    except CannotError as reason:
        print(f"    {reason}", file=sys.stderr)
        return {measure.name: math.nan for measure in case.measures}, math.nan
    return case.errors(scene, trajectory), float(np.median(times))


def accuracy_table(rows: list[AccuracyRow]) -> str:
    """Markdown."""
    labels = list(rows[0].errors)
    head = ["case", "error", *labels, "must reach", "", *(f"{label}, ms a step" for label in labels)]
    lines = ["| " + " | ".join(head) + " |", "| " + " | ".join(["---"] * len(head)) + " |"]
    for row in rows:
        figures = [_figure(row.errors[label], ".3g") for label in labels]
        costs = [_figure(row.step_ms[label], ".3f") for label in labels]
        verdict = "ok" if row.is_met else "MISS"
        cells = [row.case, f"{row.measure} [{row.unit}]", *figures, f"{row.bound:g}", verdict, *costs]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _figure(value: float, form: str) -> str:
    return "-" if math.isnan(value) else format(value, form)

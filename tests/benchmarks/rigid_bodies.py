"""Rigid bodies against peers and against truth.

python -m tests.benchmarks rigid                       everything
python -m tests.benchmarks rigid --case stack-30       one case or crowd; may be given again
python -m tests.benchmarks rigid --quick               first seeds and short windows
python -m tests.benchmarks rigid --stages              also what the stages of ELYS's step take
python -m tests.benchmarks rigid --mujoco              cases in MuJoCo too, if that is installed
"""

from __future__ import annotations

import argparse
import json
import math
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from elys.lab.peers.engine import Engine
from elys.lab.peers.mujoco import MuJoCo
from elys.samples.rigid_cases import CROWDS, RIGID_CASES
from tests.benchmarks.machine import machine
from tests.benchmarks.rigid_accuracy import AccuracyRow, accuracy_table, measure_case
from tests.benchmarks.rigid_engines import engines, versions
from tests.benchmarks.rigid_services import ServiceRow, growth, measure_rays, measure_spawning, service_table
from tests.benchmarks.rigid_speed import SETTLED, SpeedRow, measure_crowd, speed_table, stage_table

ROOT = Path(__file__).parents[2]
SERVICES = {"rays": measure_rays, "spawn": measure_spawning}


class Report(NamedTuple):
    """All that was measured."""

    quick: bool
    load: float  # processes that ran or waited in the minute before: what else kept the machine busy
    accuracy: list[AccuracyRow]
    speed: list[SpeedRow]
    services: list[ServiceRow]


def main(words: Sequence[str]) -> None:
    """The command line."""
    names = [*RIGID_CASES, *CROWDS, *SERVICES]
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks rigid", description="Rigid bodies against peers and against truth."
    )
    parser.add_argument(
        "--case", action="append", choices=names, metavar="NAME", help=f"only this, may be repeated: {', '.join(names)}"
    )
    parser.add_argument("--quick", action="store_true", help="first seeds and short windows: figures to steer by")
    parser.add_argument("--stages", action="store_true", help="also what the stages of ELYS's step take")
    parser.add_argument("--mujoco", action="store_true", help="cases in MuJoCo too, if that is installed")
    parser.add_argument("--json", type=Path, default=ROOT / "rigid.json", help="where the figures are written")
    options = parser.parse_args(words)
    others = [MuJoCo] if options.mujoco else []
    report = measure_report(options.case or names, quick=options.quick, stages=options.stages, others=others)
    show(report)
    write(report, options.json)


def measure() -> list[tuple[str, str]]:
    """Everything, as a suite of `make bench`: prints its own tables, and gives the rows that the README shows."""
    report = measure_report([*RIGID_CASES, *CROWDS, *SERVICES])
    show(report)
    write(report, ROOT / "rigid.json")
    missed = sum(not row.is_met for row in report.accuracy)
    rows = [
        ("hard cases of rigid bodies within their bounds", f"{len(report.accuracy) - missed} of {len(report.accuracy)}")
    ]
    for row in report.speed:
        if row.window == SETTLED:
            figures = " / ".join(f"{cost:.2f}" for cost in row.step_ms.values())
            rows.append((f"step of {row.title}, settled, {' / '.join(row.step_ms)}", f"{figures} ms"))
    return rows


def measure_report(
    names: Sequence[str], *, quick: bool = False, stages: bool = False, others: Sequence[type[Engine]] = ()
) -> Report:
    """Measures cases, crowds and services by their names."""
    load = os.getloadavg()[0]
    cases = [RIGID_CASES[name] for name in names if name in RIGID_CASES]
    accuracy = [row for case in cases for row in measure_case(case, quick=quick, others=others)]
    crowds = [CROWDS[name] for name in names if name in CROWDS]
    speed = [row for crowd in crowds for row in measure_crowd(crowd, quick=quick, stages=stages)]
    services = [row for name in names if name in SERVICES for row in SERVICES[name](quick=quick)]
    return Report(quick, load, accuracy, speed, services + growth(speed))


def show(report: Report) -> None:
    """Prints the tables that have rows."""
    print(
        f"{machine()} Load {report.load:.1f}.\n{', '.join(f'{name} {version}' for name, version in versions().items())}"
    )
    if report.load > 1.5:
        print("The machine was busy: believe the quiet figures, and those only roughly.")
    if len(engines()) == 1:
        print("No peer is installed; `pip install -e .[peers]` brings rapier3d.")
    if report.accuracy:
        print(f"\n{accuracy_table(report.accuracy)}")
    if report.speed:
        print(f"\n{speed_table(report.speed)}")
    if any(row.stages for row in report.speed):
        print(f"\n{stage_table(report.speed)}")
    if report.services:
        print(f"\n{service_table(report.services)}")


def write(report: Report, path: Path) -> None:
    """The report as JSON, with what it was measured on and when."""
    facts: dict[str, Any] = {"machine": machine(), "versions": versions(), "date": time.strftime("%Y-%m-%d")}
    facts |= {"quick": report.quick, "load": report.load}
    facts["accuracy"] = [row._asdict() | {"is_met": row.is_met} for row in report.accuracy]
    facts["speed"] = [
        row._asdict() | {"ratio": row.ratio, "quiet_ratio": row.quiet_ratio, "is_met": row.is_met}
        for row in report.speed
    ]
    facts["services"] = [row._asdict() | {"is_met": row.is_met} for row in report.services]
    path.write_text(json.dumps(_strict(facts), indent=2, allow_nan=False) + "\n")


def _strict(value: Any) -> Any:
    """JSON has no infinity: an error without bound and a figure that is not known are null there."""
    if isinstance(value, dict):
        return {key: _strict(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_strict(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value

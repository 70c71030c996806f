"""The tick of 1000 bodies in real time, alone and with four viewers that follow the scene and every state frame.

The viewers draw nothing here: with software OpenGL four pictures would take every core, and that is what would be measured.
"""

from __future__ import annotations

import contextlib
import json
import sys

from tests.benchmarks.figures import percentiles
from tests.benchmarks.processes import environment, running

STEP_COUNT = 900  # 15 s: the pile falls for the first few, then settles
VIEWER_COUNT = 4
SCENE = "pile"
Row = tuple[str, str]


def measure() -> list[Row]:
    """Rows of the table."""
    rows: list[Row] = []
    for viewer_count in (0, VIEWER_COUNT):
        report, ages = run_with(viewer_count)
        figure = f"{report['tick_p50']:.2f} / {report['tick_p99']:.2f} ms"
        rows.append((f"tick of {report['body_count']} bodies at 60 Hz, {viewer_count} viewers, p50 / p99", figure))
        if ages:
            rows.append((f"simulation to viewer, {viewer_count} viewers, p50 / p99", percentiles(ages)))
    return rows


def run_with(viewer_count: int) -> tuple[dict[str, float], list[float]]:
    """The report of a real-time run that so many viewers watch, and how old the frames were that they got [ms]."""
    words = (
        sys.executable,
        "-m",
        "elys",
        "run",
        SCENE,
        "--headless",
        "--realtime",
        "--steps",
        str(STEP_COUNT),
        "--json",
    )
    watcher = (sys.executable, "-m", "tests.benchmarks.watcher")
    with environment() as env, contextlib.ExitStack() as viewers:
        simulation = viewers.enter_context(running(words, env=env, wait_for="simulating"))
        watching = [viewers.enter_context(running(watcher, env=env, wait_for="watching")) for _ in range(viewer_count)]
        assert simulation.stdout is not None
        text = simulation.stdout.read()
        ages = [
            age for process in watching if process.stdout for age in json.loads(process.stdout.read().split("\n")[-2])
        ]
    return json.loads(text[text.index("{") :]), ages

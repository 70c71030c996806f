"""States on their way: on one machine in full, and by streams over links of a laboratory."""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from elys.common.scene import SceneDocument, SceneSettings, write_scene
from elys.samples.entities import body, camera, obstacle, sun
from tests.benchmarks.figures import percentiles
from tests.benchmarks.processes import environment, running
from tests.network.laboratory import Laboratory, RelayedLink, why_impossible
from tests.network.streams import Watched, watch

Row = tuple[str, str]
SECONDS = 12.0
SETTLED = 3.0  # [s] after which a stream is judged
LINKS = {
    "LAN, 1 ms": {"delay": 0.0005},
    "Wi-Fi, 10 ms, jitter 10 ms, 0.5 % loss": {"delay": 0.005, "jitter": 0.01, "loss": 0.005, "rate": 2.5e6},
    "50 ms, 2 % loss": {"delay": 0.05, "loss": 0.02},
    "150 ms, 2 % loss": {"delay": 0.15, "loss": 0.02},
    "30 ms, 60 kB/s": {"delay": 0.03, "rate": 6e4},
}


def measure() -> list[Row]:
    """Rows of the table."""
    rows = [("one machine, 10,000 bodies, full frames: simulation to viewer, p50 / p99", _near())]
    if reason := why_impossible():
        print(f"no links are measured: {reason}", file=sys.stderr)
        return rows
    for name, conditions in LINKS.items():
        what = f"1000 bouncing balls, one way {name}: age p50 / p95; link; body off, median, 95th; worst"
        rows.append((what, _over(conditions)))
    rows.append(("50 ms, 2 % loss, after an outage of 3 s: first state; all within 5 cm of the truth", _outage()))
    return rows


def _near() -> str:
    """Full frames of 10,000 bodies that lie still, at 60 Hz."""
    side = 100
    cubes = [
        body(f"Cube {n}", "box", size=(0.5,) * 3, position=(n % side - side / 2, 0.25, n // side - side / 2))
        for n in range(side * side)
    ]
    floor = obstacle("Floor", size=(120.0, 1.0, 120.0), position=(0.0, -0.5, 0.0))
    nodes = [sun(), camera((0.0, 60.0, 90.0), (0.0, 0.0, 0.0)), floor, *cubes]
    with tempfile.TemporaryDirectory() as folder, environment() as env:
        scene = Path(folder, "cubes.scene.json")
        write_scene(SceneDocument(name="Cubes", settings=SceneSettings(), entities=nodes), scene)
        words = (
            sys.executable,
            "-m",
            "elys",
            "run",
            str(scene),
            "--headless",
            "--realtime",
            "--steps",
            "1200",
            "--keep",
            "0",
        )
        watcher = (sys.executable, "-m", "tests.benchmarks.watcher")
        with running(words, env=env, wait_for="first tick"), running(watcher, env=env, wait_for="watching") as viewer:
            assert viewer.stdout is not None
            ages = json.loads(viewer.stdout.read().split("\n")[-2])
    return percentiles(ages[len(ages) // 4 :])


def _watched(conditions: dict[str, float], during: Callable[[RelayedLink], None] = lambda _: None) -> Watched:
    with tempfile.TemporaryDirectory() as folder, Laboratory(Path(folder)) as laboratory:
        return watch(laboratory, Path(folder), seconds=SECONDS, during=during, **conditions)


def _over(conditions: dict[str, float]) -> str:
    seen = _watched(conditions)
    ages = seen.ages_between(SETTLED, SECONDS) * 1e3
    errors = seen.errors[len(seen.errors) // 4 :]
    middle, most, worst = (np.median(errors[:, column]) * 1e3 for column in (4, 5, 0))
    bad = int((errors[:, 0] > errors[:, 2]).sum())
    wrong = f"; {bad} states farther off than claimed" if bad else ""
    rate = seen.bytes_per_second
    age = f"{np.percentile(ages, 50):.0f} / {np.percentile(ages, 95):.0f} ms"
    return f"{age}; {rate / 1e3:.0f} kB/s, {rate / 60:.0f} B a tick; {middle:.2g}, {most:.2g} mm; {worst:.2g} mm{wrong}"


def _outage() -> str:
    healed = []

    def spoil(link: RelayedLink) -> None:
        time.sleep(4.0)
        link.cut()
        time.sleep(3.0)
        link.heal()
        healed.append(time.time())

    states = _watched(LINKS["50 ms, 2 % loss"], spoil).states
    fresh = states[states[:, 1] > healed[0]]
    right = fresh[fresh[:, 3] < 0.05]
    first = f"{fresh[0, 0] - healed[0]:.2f} s" if len(fresh) else "none"
    return f"{first}; " + (f"{right[0, 0] - healed[0]:.2f} s" if len(right) else "not in 5 s")

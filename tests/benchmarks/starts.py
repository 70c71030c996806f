"""From the command to the first tick on the bus: with compiled kernels, and on a machine that has none yet."""

from __future__ import annotations

import statistics
import sys
import tempfile
import time

from tests.benchmarks.processes import environment, running

REPEATS = 5
Row = tuple[str, str]


def measure() -> list[Row]:
    """Rows of the table."""
    warm_start()  # fills the kernel cache and the disk's
    warm = statistics.median(warm_start() for _ in range(REPEATS))
    with tempfile.TemporaryDirectory() as cache:
        cold = warm_start(ELYS_KERNEL_CACHE=cache)
    return [
        ("warm start: command to first tick, yard of 200 bodies, median of 5", f"{warm:.2f} s"),
        ("cold start: the same, compiling all kernels", f"{cold:.1f} s"),
    ]


def warm_start(**variables: str) -> float:
    """Seconds from starting the command until it says that its first tick is published."""
    words = (sys.executable, "-m", "elys", "run", "yard", "--headless")
    with environment(**variables) as env:
        started = time.perf_counter()
        with running(words, env=env, wait_for="first tick"):
            return time.perf_counter() - started

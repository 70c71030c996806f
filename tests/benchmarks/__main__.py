"""make bench: what ELYS costs, measured on real processes over real zenoh, as a table for people and JSON for machines.

python -m tests.benchmarks                 all, and the table of the README is written anew
python -m tests.benchmarks ticks starts    only these
"""

from __future__ import annotations

import json
import platform
import re
import sys
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

from tests.benchmarks import latency, queries, scene_tree, starts, ticks

ROOT = Path(__file__).parents[2]
SUITES: dict[str, Callable[[], list[tuple[str, str]]]] = {
    "ticks": ticks.measure,
    "latency": latency.measure,
    "starts": starts.measure,
    "tree": scene_tree.measure,
    "queries": queries.measure,
}


def main() -> None:
    chosen = sys.argv[1:] or list(SUITES)
    unknown = [name for name in chosen if name not in SUITES]
    if unknown:
        sys.exit(f"there is no benchmark '{unknown[0]}'; there are {', '.join(SUITES)}")
    rows: list[tuple[str, str]] = []
    for name in chosen:
        print(f"measuring {name} ...", file=sys.stderr, flush=True)
        rows += SUITES[name]()
    table = "\n".join(["| measure | figure |", "| --- | --- |", *(f"| {what} | {figure} |" for what, figure in rows)])
    print(f"{machine()}\n\n{table}")
    facts = {"machine": machine(), "date": time.strftime("%Y-%m-%d"), "rows": dict(rows)}
    (ROOT / "bench.json").write_text(json.dumps(facts, indent=2) + "\n")
    if set(chosen) == set(SUITES):
        write_into_readme(f"{machine()}\n\n{table}")


def machine() -> str:
    """What was measured on, with the versions that matter."""
    cpu = platform.machine()
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            cpu = line.split(":", 1)[1].strip()
            break
    cores = len([line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("processor")])
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("numba", "numpy", "eclipse-zenoh"))
    return f"{cpu}, {cores} cores, software OpenGL; Python {platform.python_version()}, {versions}."


def write_into_readme(text: str) -> None:
    """Puts the table between the README's marks."""
    path = ROOT / "README.md"
    marked = re.compile(r"(<!-- bench -->\n).*?(<!-- /bench -->)", re.DOTALL)
    path.write_text(marked.sub(lambda match: f"{match[1]}{text}\n{match[2]}", path.read_text()))


if __name__ == "__main__":
    main()

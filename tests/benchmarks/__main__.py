"""make bench: what ELYS costs, measured on real processes over real zenoh, as a table for people and JSON for machines.

python -m tests.benchmarks                 all, and the table of the README is written anew
python -m tests.benchmarks ticks starts    only these
python -m tests.benchmarks rigid --help    rigid bodies have choices of their own
"""

from __future__ import annotations

import json
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tests.benchmarks import latency, models, pictures, queries, rigid_bodies, scene_tree, starts, ticks, view_streams
from tests.benchmarks.machine import machine

ROOT = Path(__file__).parents[2]
SUITES: dict[str, Callable[[], list[tuple[str, str]]]] = {
    "ticks": ticks.measure,
    "latency": latency.measure,
    "views": view_streams.measure,
    "starts": starts.measure,
    "tree": scene_tree.measure,
    "rigid": rigid_bodies.measure,
    "queries": queries.measure,
    "models": models.measure,
    "pictures": pictures.measure,
}


def main() -> None:
    if sys.argv[1:2] == ["rigid"]:
        rigid_bodies.main(sys.argv[2:])
        return
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


def write_into_readme(text: str) -> None:
    """Puts the table between the README's marks."""
    path = ROOT / "README.md"
    marked = re.compile(r"(<!-- bench -->\n).*?(<!-- /bench -->)", re.DOTALL)
    path.write_text(marked.sub(lambda match: f"{match[1]}{text}\n{match[2]}", path.read_text()))


if __name__ == "__main__":
    main()

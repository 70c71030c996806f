"""make bench: what ELYS costs, measured on real processes over real zenoh, as a table for people and JSON for machines.

python -m tests.benchmarks                 all, and the tables of the README and of docs/editor.md are written anew
python -m tests.benchmarks ticks starts    only these
python -m tests.benchmarks viewers --help  many viewers have, too
python -m tests.benchmarks rigid --help    rigid bodies have choices of their own
"""

from __future__ import annotations

import json
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path

from elys.common.garbage import keep_searches_short
from tests.benchmarks import (
    access,
    characters,
    editor,
    latency,
    models,
    pictures,
    queries,
    recording,
    rigid_bodies,
    scene_tree,
    scripts,
    starts,
    streams,
    ticks,
    view_streams,
    viewers,
    web_page,
)
from tests.benchmarks.machine import machine

ROOT = Path(__file__).parents[2]
SUITES: dict[str, Callable[[], list[tuple[str, str]]]] = {
    "ticks": ticks.measure,
    "latency": latency.measure,
    "access": access.measure,
    "views": view_streams.measure,
    "starts": starts.measure,
    "tree": scene_tree.measure,
    "rigid": rigid_bodies.measure,
    "queries": queries.measure,
    "models": models.measure,
    "pictures": pictures.measure,
    "editor": editor.measure,
    "viewers": viewers.measure,
    "streams": streams.measure,
    "web": web_page.measure,
    "characters": characters.measure,
    "scripts": scripts.measure,
    "recordings": recording.measure,
}
PAGES = {
    "editor": "docs/editor.md",
    "streams": "docs/streaming.md",
    "web": "docs/web.md",
    "characters": "docs/characters.md",
    "scripts": "docs/scripts.md",
    "recordings": "docs/recording-format.md",
}  # whose rows stand there and not in the README


def main() -> None:
    keep_searches_short()  # as the programs do whose parts run here
    if sys.argv[1:2] == ["rigid"]:
        rigid_bodies.main(sys.argv[2:])
        return
    if sys.argv[1:2] == ["viewers"] and sys.argv[2:]:
        viewers.main(sys.argv[2:])
        return
    chosen = sys.argv[1:] or list(SUITES)
    unknown = [name for name in chosen if name not in SUITES]
    if unknown:
        sys.exit(f"there is no benchmark '{unknown[0]}'; there are {', '.join(SUITES)}")
    rows: list[tuple[str, str]] = []
    for name in chosen:
        print(f"measuring {name} ...", file=sys.stderr, flush=True)
        found = SUITES[name]()
        if name in PAGES:
            print(table_of(found))
            write_between_marks(ROOT / PAGES[name], table_of(found))
        else:
            rows += found
    if rows:
        finish(rows, is_all=set(chosen) == set(SUITES))


def finish(rows: list[tuple[str, str]], *, is_all: bool) -> None:
    """Shows and keeps what was measured, in the README as well if it is all."""
    print(table_of(rows))
    facts = {"machine": machine(), "date": time.strftime("%Y-%m-%d"), "rows": dict(rows)}
    (ROOT / "bench.json").write_text(json.dumps(facts, indent=2) + "\n")
    if is_all:
        write_between_marks(ROOT / "README.md", table_of(rows))


def table_of(rows: list[tuple[str, str]]) -> str:
    """The machine and what was measured on it, as Markdown."""
    lines = ["| measure | figure |", "| --- | --- |", *(f"| {what} | {figure} |" for what, figure in rows)]
    return f"{machine()}\n\n" + "\n".join(lines)


def write_between_marks(path: Path, text: str) -> None:
    """Puts a table between the marks of a page."""
    marked = re.compile(r"(<!-- bench -->\n).*?(<!-- /bench -->)", re.DOTALL)
    path.write_text(marked.sub(lambda match: f"{match[1]}{text}\n{match[2]}", path.read_text()))


if __name__ == "__main__":
    main()

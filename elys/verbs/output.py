"""How verbs print: facts as JSON or as an aligned table, progress to stderr."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Final

import msgspec
from rich.console import Console
from rich.table import Table

_PIPE_WIDTH: Final = 200  # columns


def print_json(facts: Any) -> None:
    """Facts for programs: indented JSON on stdout."""
    print(msgspec.json.format(msgspec.json.encode(facts), indent=2).decode())


def facts_console() -> Console:
    """Where tables go: as wide as the terminal, and in a pipe, where nobody sees an edge, as wide as they need."""
    return Console(highlight=False, width=None if sys.stdout.isatty() else _PIPE_WIDTH)


def print_table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Facts for people: one row a line."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in columns:
        table.add_column(column, overflow="fold")
    for row in rows:
        table.add_row(*(str(cell) for cell in row))
    facts_console().print(table)


def size_text(byte_count: float) -> str:
    """A number of bytes as people write it."""
    for unit in ("B", "kB", "MB"):
        if byte_count < 1000:
            return f"{byte_count:.0f} {unit}" if unit == "B" else f"{byte_count:.1f} {unit}"
        byte_count /= 1000
    return f"{byte_count:.2f} GB"


@contextlib.contextmanager
def progress_bar(title: str) -> Iterator[Callable[[int, int], None]]:
    """A bar on stderr while something takes its time, where a person can see it; call what it gives with done and total."""
    from rich.progress import Progress

    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(title, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)

"""What is promised of the editor: what it costs the simulation, how fluent it stays, how soon it shows what is done."""

from __future__ import annotations

from tests.benchmarks import editor_crowd, editor_echo, editor_load, editor_pace

Row = tuple[str, str]


def measure() -> list[Row]:
    """Rows of the table."""
    return [*editor_load.measure(), *editor_pace.measure(), *editor_crowd.measure(), *editor_echo.measure()]

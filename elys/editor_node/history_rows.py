"""The history as a list of lines."""

from __future__ import annotations

from typing import NamedTuple

from elys.editor_node.history import History


class HistoryRow(NamedTuple):
    """The scene after one edit; that before all of them has no label."""

    label: str
    is_made: bool  # not undone
    is_now: bool
    is_saved: bool  # the file has just this


def history_rows(history: History, *, saved: int) -> list[HistoryRow]:
    """From before the first edit to the last that can be made again; row N is what `go_to(N)` leads to."""
    entries = [*history.undoable, *reversed(history.redoable)]
    now = len(history.undoable)
    rows = [HistoryRow("", is_made=True, is_now=now == 0, is_saved=history.initial == saved)]
    for place, entry in enumerate(entries, start=1):
        rows.append(HistoryRow(entry.label, place <= now, place == now, entry.content == saved))
    return rows

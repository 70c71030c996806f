"""Plain values as a tree of lines: what is open shows what is in it, as far as a person can read."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final, NamedTuple

CHILDREN_SHOWN: Final = 200  # of one value; how many more there are is said
TEXT_SHOWN: Final = 200  # characters of one value


class TreeRow(NamedTuple):
    """A line. `path` names it; `is_open` is None for what holds nothing."""

    path: str
    depth: int
    label: str
    text: str
    is_open: bool | None


def tree_rows(value: Any, opened: Iterable[str], *, label: str = "") -> list[TreeRow]:
    """The lines of a value whose `opened` paths show what is in them; the value itself stands first only if it has a label."""
    rows: list[TreeRow] = []
    _add(rows, value, frozenset(opened), "", label, 0)
    return rows if label else rows[1:]


def _add(rows: list[TreeRow], value: Any, opened: frozenset[str], path: str, label: str, depth: int) -> None:
    children = _children(value)
    if children is None:
        rows.append(TreeRow(path, depth, label, _short(value), None))
        return
    is_open = not path or path in opened
    rows.append(TreeRow(path, depth, label, _summary(value), is_open if children else None))
    if not is_open:
        return
    below = depth + 1 if label else depth
    for name, child in children[:CHILDREN_SHOWN]:
        _add(rows, child, opened, f"{path}/{name}", name, below)
    if len(children) > CHILDREN_SHOWN:
        rows.append(TreeRow(f"{path}/...", below, "...", f"+ {len(children) - CHILDREN_SHOWN}", None))


def _children(value: Any) -> list[tuple[str, Any]] | None:
    """What is in a value; None for one that stands for itself, as short rows of numbers do."""
    if isinstance(value, dict):
        return [(str(name), child) for name, child in value.items()]
    if isinstance(value, (list, tuple)) and not _is_short_row(value):
        return [(str(place), child) for place, child in enumerate(value)]
    return None


def _is_short_row(value: list[Any] | tuple[Any, ...]) -> bool:
    """A vector or a quaternion is read better in one line."""
    return 0 < len(value) <= 4 and all(isinstance(number, (int, float)) for number in value)


def _summary(value: Any) -> str:
    return f"{{{len(value)}}}" if isinstance(value, dict) else f"[{len(value)}]"


def _short(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return "  ".join(f"{number:.6g}" if isinstance(number, float) else str(number) for number in value)
    text = repr(value) if isinstance(value, str) else f"{value:.9g}" if isinstance(value, float) else str(value)
    return text if len(text) <= TEXT_SHOWN else f"{text[:TEXT_SHOWN]}... ({len(text)})"

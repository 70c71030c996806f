"""The lines of the console: what every node logs, and what became of commands."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, get_args

from elys.bus.messages.session import LogLevel

LEVELS: Final[tuple[LogLevel, ...]] = get_args(LogLevel)
LINE_LIMIT: Final = 5000


@dataclass(slots=True)
class ConsoleLine:
    """One line; `count` tells how often it came in a row."""

    time: float  # [s] since 1970
    node: str
    level: LogLevel
    text: str
    tick: int = -1
    count: int = 1


class ConsoleLog:
    """The newest lines, the oldest first."""

    def __init__(self) -> None:
        self._lines: deque[ConsoleLine] = deque(maxlen=LINE_LIMIT)
        self.version = 0  # rises at every change

    def __len__(self) -> int:
        return len(self._lines)

    def __iter__(self) -> Iterator[ConsoleLine]:
        return iter(self._lines)

    def add(self, node: str, level: LogLevel, text: str, *, tick: int = -1, at: float | None = None) -> None:
        """Appends a line; the same text from the same node again only raises the last line's count."""
        self.version += 1
        last = self._lines[-1] if self._lines else None
        if last is not None and (last.node, last.level, last.text) == (node, level, text):
            last.count += 1
            last.tick = tick
            return
        self._lines.append(ConsoleLine(time.time() if at is None else at, node, level, text, tick))

    def clear(self) -> None:
        """Drops all lines."""
        self._lines.clear()
        self.version += 1

    def matching(self, levels: frozenset[LogLevel], text: str) -> list[ConsoleLine]:
        """The lines of these levels in which `text` stands, whatever the case."""
        wanted = text.casefold()
        return [
            line
            for line in self._lines
            if line.level in levels and (not wanted or wanted in line.text.casefold() or wanted in line.node.casefold())
        ]

"""The lines of the console: what every node logs, and what became of commands; and which of them are to be seen.

Both are made for many: a new line costs the same however many there are, and only another filter looks at all of them anew.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, get_args

from elys.bus.messages.session import LogLevel

LEVELS: Final[tuple[LogLevel, ...]] = get_args(LogLevel)
LINE_LIMIT: Final = 100_000
_DROPPED: Final = LINE_LIMIT // 10  # of the oldest at once, so that it is seldom


@dataclass(slots=True, eq=False)
class ConsoleLine:
    """One line; `count` tells how often it came in a row."""

    time: float  # [s] since 1970
    node: str
    level: LogLevel
    text: str
    tick: int = -1
    count: int = 1


class ConsoleLog:
    """The newest lines, the oldest first.

    Attributes:
        version: rises at every change.
        era: rises when lines are dropped or cleared, so that places among them change.
        counts: how many lines there are of each level, repeats counted.
        nodes: how many there are of each node, in the order in which they spoke first.
    """

    def __init__(self) -> None:
        self._lines: list[ConsoleLine] = []
        self.version = 0
        self.era = 0
        self.counts: dict[LogLevel, int] = dict.fromkeys(LEVELS, 0)
        self.nodes: dict[str, int] = {}

    def __len__(self) -> int:
        return len(self._lines)

    def __iter__(self) -> Iterator[ConsoleLine]:
        return iter(self._lines)

    def __getitem__(self, place: int) -> ConsoleLine:
        return self._lines[place]

    def add(self, node: str, level: LogLevel, text: str, *, tick: int = -1, at: float | None = None) -> None:
        """Appends a line; the same text from the same node again only raises the last line's count."""
        self.version += 1
        self.counts[level] += 1
        self.nodes[node] = self.nodes.get(node, 0) + 1
        last = self._lines[-1] if self._lines else None
        if last is not None and (last.node, last.level, last.text) == (node, level, text):
            last.count += 1
            last.tick = tick
            return
        self._lines.append(ConsoleLine(time.time() if at is None else at, node, level, text, tick))
        if len(self._lines) > LINE_LIMIT:
            self._drop(_DROPPED)

    def clear(self) -> None:
        """Drops all lines."""
        self._drop(len(self._lines))
        self.version += 1

    def matching(self, levels: frozenset[LogLevel], text: str) -> list[ConsoleLine]:
        """The lines of these levels in which `text` stands, whatever the case."""
        speaks = holds(text)
        return [line for line in self._lines if line.level in levels and speaks(line)]

    def _drop(self, count: int) -> None:
        for line in self._lines[:count]:
            self.counts[line.level] -= line.count
            self.nodes[line.node] -= line.count
        del self._lines[:count]
        self.nodes = {node: left for node, left in self.nodes.items() if left}
        self.era += 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Filter:
    """Which lines are wanted."""

    levels: frozenset[LogLevel] = frozenset(LEVELS)
    hidden_nodes: frozenset[str] = frozenset()  # all others are seen, also those that speak later
    text: str = ""  # that stands in the line or in its node's name, whatever the case
    is_regex: bool = False


@dataclass(slots=True, eq=False)
class Shown:
    """A line that is to be seen, and how often the same came."""

    line: ConsoleLine  # the newest of them
    earlier: int = 0  # of those before it that are seen as one with it

    @property
    def count(self) -> int:
        """How often it came."""
        return self.earlier + self.line.count


class ConsoleView:
    """The lines of a log that a filter lets through; with `merges` equal ones, also apart, are one, where the first stood."""

    def __init__(self, log: ConsoleLog) -> None:
        self._log = log
        self._key: tuple[object, ...] = ()
        self._seen = 0  # lines of the log that were looked at
        self._shown: list[Shown] = []
        self._merged: dict[tuple[str, str, str], Shown] = {}
        self._fits: Callable[[ConsoleLine], bool] = holds("")
        self.error = ""  # why the pattern cannot be read; nothing is filtered by it then

    def rows(self, wanted: Filter, *, merges: bool = False) -> list[Shown]:
        """What is to be seen now, the oldest first."""
        key = (wanted, merges, self._log.era)
        if key != self._key:
            self._key, self._seen, self._shown, self._merged = key, 0, [], {}
            self._fits = self._test(wanted)
        for place in range(self._seen, len(self._log)):
            line = self._log[place]
            if self._fits(line):
                self._show(line, merges)
        self._seen = len(self._log)
        return self._shown

    def _show(self, line: ConsoleLine, merges: bool) -> None:
        same = self._merged.get((line.node, line.level, line.text)) if merges else None
        if same is not None:
            same.earlier, same.line = same.count, line
            return
        shown = Shown(line)
        self._shown.append(shown)
        if merges:
            self._merged[line.node, line.level, line.text] = shown

    def _test(self, wanted: Filter) -> Callable[[ConsoleLine], bool]:
        self.error = ""
        speaks = holds(wanted.text)
        if wanted.is_regex and wanted.text:
            try:
                pattern = re.compile(wanted.text, re.IGNORECASE)
            except re.error as error:
                self.error = str(error)
                speaks = holds("")
            else:
                speaks = lambda line: bool(pattern.search(line.text) or pattern.search(line.node))  # noqa: E731
        levels, hidden = wanted.levels, wanted.hidden_nodes
        return lambda line: line.level in levels and line.node not in hidden and speaks(line)


def holds(text: str) -> Callable[[ConsoleLine], bool]:
    """Whether `text` stands in a line or in its node's name, whatever the case."""
    wanted = text.casefold()
    if not wanted:
        return lambda line: True
    return lambda line: wanted in line.text.casefold() or wanted in line.node.casefold()


def text_of(shown: list[Shown]) -> str:
    """Lines as they are copied: date and time, tick, node, level, text, separated by tabs."""
    return "\n".join(
        "\t".join((
            time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(row.line.time)),
            str(row.line.tick) if row.line.tick >= 0 else "",
            row.line.node,
            row.line.level,
            row.line.text + (f" ({row.count}x)" if row.count > 1 else ""),
        ))
        for row in shown
    )  # fmt: skip

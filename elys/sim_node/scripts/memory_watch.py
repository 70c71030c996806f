"""Keeps scripts from taking all memory: by how much they grow is counted, one block has a bound, and who holds most is found.

Counting is a read of a few bytes of the system's, twice a pass. What is held is looked through only when that is too much.
"""

from __future__ import annotations

import contextlib
import logging
import os
import sys
from collections import deque
from collections.abc import Iterable, Iterator
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from elys.sim_node.scripts.running import Running

try:
    import resource
except ImportError:  # not on Windows: there one block has no bound
    resource = None  # type: ignore[assignment]

LIMIT: Final = 1 << 30  # [bytes] by which scripts may grow, all together
BLOCK: Final = 4 << 30  # [bytes] that a pass may ask of the system: one list of a billion numbers, say
MOST_PARTS: Final = 2_000_000  # that are looked at of what a script holds
_log = logging.getLogger(__name__)
_PAGE: Final = os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096


class _SystemCount:
    """Reads how large this process is, [pages]: whole and resident."""

    def __init__(self) -> None:
        self._file = -1
        with contextlib.suppress(OSError):
            self._file = os.open("/proc/self/statm", os.O_RDONLY)
        self._process = os.getpid()

    def read(self) -> tuple[int, int]:
        if self._file < 0 or self._process != os.getpid():  # a fork reads the file of its parent
            return 0, 0
        whole, resident = os.pread(self._file, 64, 0).split(maxsplit=2)[:2]
        return int(whole), int(resident)

    def __del__(self) -> None:
        if self._file >= 0:
            os.close(self._file)


_count = _SystemCount()


def resident_size() -> int:
    """What this process holds in memory [bytes]; 0 where the system does not tell."""
    return _count.read()[1] * _PAGE


class MemoryWatch:
    """Adds up by how much the process grows while scripts run."""

    def __init__(self) -> None:
        self.grown = 0  # [bytes]
        self._before = 0

    @contextlib.contextmanager
    def bounded(self) -> Iterator[None]:
        """A pass of scripts: the system refuses what goes far beyond any use, so that a MemoryError comes and not the end."""
        whole, resident = _count.read()
        self._before = resident * _PAGE
        old = None
        if resource is not None and whole:
            old = resource.getrlimit(resource.RLIMIT_AS)
            bound = whole * _PAGE + BLOCK
            if old[0] == resource.RLIM_INFINITY or bound < old[0]:
                resource.setrlimit(resource.RLIMIT_AS, (bound, old[1]))
            else:
                old = None
        try:
            yield
        finally:
            if old is not None:
                resource.setrlimit(resource.RLIMIT_AS, old)
            self.grown = max(0, self.grown + resident_size() - self._before)

    def is_too_much(self) -> bool:
        """Whether scripts have grown by more than they may."""
        return self.grown > LIMIT

    def culprit(self, running: Iterable[Running]) -> tuple[Running, str] | None:
        """Who holds most, and what to tell them; None if nobody holds much of it. From here on it is counted anew."""
        grown, self.grown = self.grown, 0
        sizes = [(held_by(one), one) for one in running if one.itself is not None]
        size, worst = max(sizes, key=lambda pair: pair[0], default=(0, None))
        if worst is None or size < grown // 8:
            _log.warning(
                "scripts have grown by %d MB that none of them remembers: they make the scene too large", grown >> 20
            )
            return None
        return worst, (
            f"it remembers {size >> 20} MB, and all scripts together may grow by {LIMIT >> 20} MB: let go of what is not needed "
            "any more, above all in lists that only grow"
        )


def held_by(one: Running) -> int:
    """About what a script remembers, with the variables of its modules [bytes]."""
    modules = one.script.modules.loaded() if one.script is not None else ()
    parts: list[Any] = [value for name, value in vars(one.itself).items() if name not in ("entity", "world")]
    parts += [frame.variables for task in one.tasks for frame in task.frames]
    parts += [value for module in modules for name, value in vars(module).items() if not name.startswith("__")]
    return size_of(parts)


def size_of(parts: list[Any]) -> int:
    """About how large values are, with all that they hold [bytes]; what is shared counts once."""
    waiting, seen, size = deque(parts), set[int](), 0
    while waiting and len(seen) < MOST_PARTS:
        value = waiting.pop()
        if id(value) in seen or isinstance(value, type | ModuleType) or callable(value):
            continue
        seen.add(id(value))
        size += sys.getsizeof(value, 0)
        if isinstance(value, dict):
            waiting.extend(value.keys())
            waiting.extend(value.values())
        elif isinstance(value, list | tuple | set | frozenset | deque):
            waiting.extend(value)
        elif type(value).__module__ != "builtins" and hasattr(value, "__dict__"):
            waiting.extend(item for name, item in vars(value).items() if name not in ("entity", "world", "_scripts"))
    return size

"""Python's searches for garbage in cycles, kept short: what has outlived a whole one is not looked through again.

A node loads much that stays, and whenever enough has come to be Python looks through all that lives: 50 ms of a simulation, a
tenth of a second of an editor with many entities, in the middle of a tick or frame. After such a search what is left is set aside
(`gc.freeze`). It ends as ever when nobody refers to it; cycles among it are looked for again when what is set aside has doubled.

Exceptions that callbacks of `gc` raise are lost, and a Ctrl+C may strike in one: it is raised a moment later then.
"""

from __future__ import annotations

import _thread
import gc
import signal
import threading
from types import FrameType
from typing import Final

_WHOLE: Final = 2  # the oldest generation
_FEW: Final = 100_000  # objects
_MOMENT: Final = 0.005  # [s]


class ShortSearches:
    """A callback of `gc`: sets aside what outlives whole searches."""

    def __init__(self, few: int = _FEW) -> None:
        """Of `few` objects no more than that may come together before all are looked through."""
        self._few = self._limit = few
        self._is_of_all = False  # the next search

    def __call__(self, phase: str, facts: dict[str, int]) -> None:
        """Called before and after each search."""
        if phase != "stop" or facts["generation"] != _WHOLE:
            return
        gc.freeze()
        count = gc.get_freeze_count()
        if self._is_of_all:
            self._is_of_all, self._limit = False, max(self._few, 2 * count)
        elif count > self._limit:
            gc.unfreeze()
            self._is_of_all = True


def keep_searches_short() -> None:
    """From now on, for as long as this process lives."""
    if any(isinstance(callback, ShortSearches) for callback in gc.callbacks):
        return
    gc.callbacks.append(ShortSearches())
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        # asyncio takes Ctrl+C over where it finds the handler of this name, and puts that back.
        signal.default_int_handler = _interrupt  # type: ignore[assignment]
        signal.signal(signal.SIGINT, _interrupt)


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Raises KeyboardInterrupt, as Python's own handler does, but never where it would be lost."""
    if frame is not None and frame.f_code is ShortSearches.__call__.__code__:
        later = threading.Timer(_MOMENT, _thread.interrupt_main)
        later.daemon = True
        later.start()
        return
    raise KeyboardInterrupt

"""Python's searches for garbage in cycles, kept short: what has outlived a whole one is not looked through again.

A node loads much that stays, and whenever enough has come to be Python looks through all that lives: 50 ms of a simulation, a
tenth of a second of an editor with many entities, in the middle of a tick or frame. After such a search what is left is set aside
(`gc.freeze`). It ends as ever when nobody refers to it; cycles among it are looked for again when what is set aside has doubled.
"""

from __future__ import annotations

import gc
from typing import Final

_WHOLE: Final = 2  # the oldest generation
_FEW: Final = 100_000  # objects


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
    if not any(isinstance(callback, ShortSearches) for callback in gc.callbacks):
        gc.callbacks.append(ShortSearches())

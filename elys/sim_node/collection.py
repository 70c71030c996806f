"""Python's search for garbage in cycles, held back where much is made and nothing of it is garbage."""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Iterator


@contextlib.contextmanager
def without_collection() -> Iterator[None]:
    """Looks for no garbage meanwhile. Of an edit of 50,000 entities half the time went into looking through all that lives."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()

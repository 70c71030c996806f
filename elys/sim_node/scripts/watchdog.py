"""Ends a script that does not come back.

A thread looks at how long scripts have been running and raises an error in them when that is beyond a limit far above any budget.
What a script did until then stays, so a run in which it happened is not repeated exactly; whoever verifies it is told.
"""

from __future__ import annotations

import contextlib
import ctypes
import threading
import time
from collections.abc import Iterator
from typing import Final

LIMIT: Final = 2.0  # [s] that one script may run in a tick
_LOOKS: Final = 0.1  # [s] between two looks


class ScriptTimeout(BaseException):
    """Raised in a script that ran too long; no `except Exception` catches it."""


class Watchdog:
    """Watches the thread that makes it."""

    def __init__(self, limit: float = LIMIT) -> None:
        self._limit = limit
        self._watched = threading.get_ident()
        self._lock = threading.Lock()
        self._since = 0.0  # 0 while no script runs
        self._has_fired = False
        self._thread: threading.Thread | None = None

    @contextlib.contextmanager
    def watch(self) -> Iterator[None]:
        """Raises ScriptTimeout inside, should it take longer than the limit."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._look, name="elys-script-watchdog", daemon=True)
            self._thread.start()
        self.begin()
        try:
            yield
        finally:
            self.end()

    def begin(self) -> None:
        """A script runs from now on."""
        self._since = time.monotonic()

    def end(self) -> None:
        """It has come back."""
        with self._lock:
            self._since = 0.0
            has_fired, self._has_fired = self._has_fired, False
        if has_fired:  # raised already, or about to be: here it does no harm
            with contextlib.suppress(ScriptTimeout):
                for _ in range(1000):
                    pass

    def _look(self) -> None:
        while True:
            time.sleep(_LOOKS)
            with self._lock:
                since = self._since
                if since and not self._has_fired and time.monotonic() - since > self._limit:
                    self._has_fired = True
                    ctypes.pythonapi.PyThreadState_SetAsyncExc(
                        ctypes.c_ulong(self._watched), ctypes.py_object(ScriptTimeout)
                    )

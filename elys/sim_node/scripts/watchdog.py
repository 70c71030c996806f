"""Ends a script that does not come back, or that takes more and more memory.

A thread looks whether one call into a script has been going on for longer than a limit far above any budget, and raises an error
in it. What the script did until then stays, so a run in which this happened is not repeated exactly.
"""

from __future__ import annotations

import contextlib
import ctypes
import threading
import time
import weakref
from collections.abc import Iterator
from typing import Final

from elys.sim_node.scripts import memory_watch

LIMIT: Final = 3.0  # [s] that one script may run in a tick
_LOOKS: Final = 0.1  # [s] between two looks


class ScriptTimeout(BaseException):
    """Raised in a script that ran too long; no `except Exception` catches it."""


class ScriptGrowth(BaseException):
    """Raised in a script that takes more and more memory without coming back."""


def reason_of(error: BaseException) -> str:
    """What a script is told that was ended from outside, or had no more memory; "" for all else."""
    match error:
        case ScriptTimeout():
            return f"it did not come back within {LIMIT:g} s"
        case ScriptGrowth():
            return f"it took {memory_watch.LIMIT >> 20} MB of memory and went on: something in it grows without end"
        case MemoryError():
            return (
                "MemoryError: it asked for more memory than a script may have at once: take less, or a part at a time"
            )
    return ""


class Watchdog:
    """Watches the thread that makes it.

    Attributes:
        call: changes with every call into a script. To set it is all that watching costs a call.
        is_inside: whether one is going on.
    """

    def __init__(self, limit: float = LIMIT) -> None:
        self.call = 0
        self._limit = self._allowed = limit
        self._watched = threading.get_ident()
        self._lock = threading.Lock()
        self.is_inside = False
        self._has_fired = False
        self._thread: threading.Thread | None = None
        self._resident = 0  # [bytes] as scripts began

    def begin(self) -> None:
        """Scripts run from now on."""
        self._resident = memory_watch.resident_size()
        if self._thread is None:
            self._watched = threading.get_ident()
            self._thread = threading.Thread(
                target=_look, args=(weakref.ref(self),), name="elys-script-watchdog", daemon=True
            )
            self._thread.start()

    @contextlib.contextmanager
    def inside(self, limit: float = 0.0) -> Iterator[None]:
        """A call into a script, that may take `limit` [s]; 0: as long as all."""
        self._allowed = limit or self._limit
        self.call += 1
        self.is_inside = True
        try:
            yield
        finally:
            self.is_inside = False
            self._allowed = self._limit

    @contextlib.contextmanager
    def resting(self) -> Iterator[None]:
        """A script has called the engine, which may have to compile what it needs."""
        was_inside, self.is_inside = self.is_inside, False
        try:
            yield
        finally:
            self.call += 1
            self.is_inside = was_inside

    def end(self) -> None:
        """They are through: an error that was raised and has not come yet does no harm any more."""
        with self._lock:
            self.call += 1
            self.is_inside = False
            has_fired, self._has_fired = self._has_fired, False
        if has_fired:
            with contextlib.suppress(ScriptTimeout, ScriptGrowth):
                for _ in range(1000):
                    pass

    def look(self, seen: int, since: float) -> None:
        """Ends the call that was seen `since`, if it is still the same and that is too long ago."""
        with self._lock:
            if self.call == seen and time.monotonic() - since > self._allowed:
                self._end_call(ScriptTimeout)

    def look_at_memory(self) -> None:
        """Ends the call that goes on, if scripts have grown by too much since they began."""
        with self._lock:
            if memory_watch.resident_size() - self._resident > memory_watch.LIMIT:
                self._end_call(ScriptGrowth)

    def _end_call(self, error: type[BaseException]) -> None:
        if self.is_inside and not self._has_fired:
            self._has_fired = True
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._watched), ctypes.py_object(error))


def _look(watchdog: weakref.ref[Watchdog]) -> None:
    seen, since = 0, 0.0
    while True:
        time.sleep(_LOOKS)
        found = watchdog()
        if found is None:
            return
        if found.is_inside:
            found.look_at_memory()
        call = found.call
        if call != seen:
            seen, since = call, time.monotonic()
        else:
            found.look(seen, since)
        del found

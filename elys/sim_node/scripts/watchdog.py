"""Ends a script that does not come back, or that takes more and more memory.

    looks, every 0.1 s by a thread ─ too long ─▶ a signal to the main thread ─▶ its handler raises the error in the script
           every 0.5 s of processor time by a timer of the system's ────────────▲

A script that catches that error and goes on has it raised once more half a second later, and from the third time on wherever
Python looks for signals in it, so also between catching and going on: no loop catches that.

Sleeping, waiting for a lock and reading end with the signal. Python's `re` and large numbers let no thread run, but look for
signals by themselves, which is why the timer is there. Some calls into C do neither (`sum(range(10**10))`): what those hold up
nothing in this process can end, and not even say; `NativeWatch` does. In other threads than the main one, and on Windows, an
error is put between two bytecodes instead, which ends loops alone.

What the script did until then stays, so a run in which this happened is not repeated exactly.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import logging
import signal
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from types import FrameType
from typing import TYPE_CHECKING, Final

from elys.sim_node.scripts import memory_watch

if TYPE_CHECKING:
    from elys.sim_node.scripts.running import Running

LIMIT: Final = 3.0  # [s] that one script may run in a tick
AGAIN: Final = 0.5  # [s] after which an error that did not end it is raised once more
PATIENCE: Final = 3  # errors that a call may catch
NATIVE_LIMIT: Final = 10.0  # [s] without a line of Python run anywhere, after which the process says where it stands
_LOOKS: Final = 0.1  # [s] between two looks
_HAS_SIGNALS: Final = hasattr(signal, "pthread_kill") and hasattr(signal, "setitimer")
_log = logging.getLogger(__name__)
# Whose scripts the main thread runs now. A signal belongs to the process, so its handler finds them nowhere else.
_in_main_thread: Watchdog | None = None


class ScriptTimeout(BaseException):
    """Raised in a script that ran too long; no `except Exception` catches it."""

    limit = LIMIT  # [s]


class ScriptGrowth(BaseException):
    """Raised in a script that takes more and more memory without coming back."""


def reason_of(error: BaseException) -> str:
    """What a script is told that was ended from outside, or had no more memory; "" for all else."""
    match error:
        case ScriptTimeout():
            return f"it did not come back within {error.limit:g} s"
        case ScriptGrowth():
            return f"it took {memory_watch.LIMIT >> 20} MB of memory and went on: something in it grows without end"
        case MemoryError():
            return (
                "MemoryError: it asked for more memory than a script may have at once: take less, or a part at a time"
            )
    return ""


class Watchdog:
    """Watches the thread in which scripts run.

    Attributes:
        call: changes with every call into a script. To set it, and `who` is called, is all that watching costs a call.
        who: the script that is called.
        is_inside: whether a call is going on.
    """

    def __init__(self, limit: float = LIMIT, *, named: Callable[[Running], str] = str) -> None:
        """`named` says how sentences call a script."""
        self.call = 0
        self.who: Running | None = None
        self.is_inside = False
        self._limit = self._allowed = limit
        self._named = named
        self._watched = threading.get_ident()
        self._lock = threading.Lock()
        self._depth = 0  # of `begin`
        self._has_signals = False
        self._has_async_error = False
        self._seen, self._since = 0, 0.0  # a call, and when it was first seen [s]
        self._grown = 0  # a call in which too much memory was taken
        self._raised = (0, 0.0)  # in which call an error was raised, and when last [s]
        self._caught = 0  # errors that were raised in that call before
        self._asked = (0, 0.0)  # which call the thread wanted to end, and since when [s]
        self._said = 0  # a call that was said to be stuck
        self._thread: threading.Thread | None = None
        self._resident = 0  # [bytes] as scripts began

    def begin(self) -> None:
        """Scripts run from now on, until as many `end`s."""
        global _in_main_thread
        self._depth += 1
        if self._depth > 1:
            return
        self._resident = memory_watch.resident_size()
        if self._watched != threading.get_ident() or self._thread is None:
            self._watched = threading.get_ident()
            self._has_signals = _HAS_SIGNALS and _take_signal()
        if self._thread is None:
            self._thread = threading.Thread(
                target=_look_on, args=(weakref.ref(self),), name="elys-script-watchdog", daemon=True
            )
            self._thread.start()
        if self._has_signals:
            _in_main_thread = self
            signal.setitimer(signal.ITIMER_VIRTUAL, AGAIN, AGAIN)

    @contextlib.contextmanager
    def watching(self) -> Iterator[None]:
        """Inside, scripts run."""
        self.begin()
        try:
            yield
        finally:
            self.end()

    @contextlib.contextmanager
    def inside(self, limit: float = 0.0, *, who: Running | None = None) -> Iterator[None]:
        """A call into a script, that may take `limit` [s]; 0: as long as all."""
        self._allowed = limit or self._limit
        self.who = who
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
        global _in_main_thread
        self._depth -= 1
        if self._depth:
            return
        self.is_inside = False
        if self._has_signals:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
            _in_main_thread = None
            return
        with self._lock:
            self.call += 1
            has_error, self._has_async_error = self._has_async_error, False
        if has_error:
            with contextlib.suppress(ScriptTimeout, ScriptGrowth):
                for _ in range(1000):
                    pass

    def look(self) -> None:
        """From the watchdog's thread: ends the call that goes on if that is due, and says so if it does not end."""
        if not self.is_inside:
            return
        if memory_watch.resident_size() - self._resident > memory_watch.LIMIT:
            self._grown = self.call
        error = self.due_error()
        if error is None:
            return
        if self._asked[0] != self._seen:
            self._asked = (self._seen, time.monotonic())
        if self._has_signals:
            signal.pthread_kill(self._watched, signal.SIGVTALRM)
        else:
            self._raise_between_bytecodes(error)
        call, since = self._asked
        if call == self.call != self._said and time.monotonic() - since > AGAIN:
            self._said = call
            self._say_stuck()

    def due_error(self) -> BaseException | None:
        """What the call that goes on is to be ended with now; None if nothing. From either thread."""
        call, now = self.call, time.monotonic()
        if call != self._seen:
            self._since = now  # before `_seen`: the other thread must not find the new call with an old time
            self._seen = call
        if not self.is_inside:
            return None
        if self._grown == call:
            return ScriptGrowth()
        if now - self._since <= self._allowed:
            return None
        error = ScriptTimeout()
        error.limit = self._allowed
        return error

    def is_raised_anew(self) -> bool:
        """Notes that an error is raised; False if that was done a moment ago, and the script may be about to end."""
        call, last = self._raised
        now = time.monotonic()
        if call == self.call and now - last < AGAIN:
            return False
        self._caught = self._caught + 1 if call == self.call else 0
        self._raised = (self.call, now)
        return True

    def is_shaken_off(self) -> bool:
        """Whether the call has caught all that was raised in it so far, and would go on catching."""
        return self._raised[0] == self.call and self._caught >= PATIENCE

    def is_in_script(self, frame: FrameType | None) -> bool:
        """Whether a frame runs a line of the script's own files."""
        who = self.who
        return (
            frame is not None
            and who is not None
            and who.script is not None
            and frame.f_code.co_filename in who.script.modules.places
        )

    def _raise_between_bytecodes(self, error: BaseException) -> None:
        with self._lock:
            if self.is_inside and self._seen == self.call and self.is_raised_anew():
                self._has_async_error = True
                kind = type(
                    type(error).__name__, (type(error),), {"limit": self._allowed}
                )  # an object cannot be raised
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._watched), ctypes.py_object(kind))

    def _say_stuck(self) -> None:
        who = self.who
        places = who.script.modules.places if who is not None and who.script is not None else []
        where = place_of(sys._current_frames().get(self._watched), places)
        named = self._named(who) if who is not None else "a script's file, as it is loaded,"
        _log.error(
            "%s does not come back, and what it does cannot be interrupted: %s. The simulation stands until it ends",
            named,
            where,
        )


def place_of(frame: FrameType | None, places: list[str]) -> str:
    """Where a thread is: "door.py:12", the innermost line of some files; of all files if it is in none of those."""
    found, each = frame, frame
    while each is not None:
        if each.f_code.co_filename in places:
            found = each
            break
        each = each.f_back
    return f"{found.f_code.co_filename}:{found.f_lineno}" if found is not None else "nowhere"


def _take_signal() -> bool:
    """Whether the handler is there: in the main thread, where nobody else uses signal and timer."""
    if threading.current_thread() is not threading.main_thread():
        return False
    handler = signal.getsignal(signal.SIGVTALRM)
    if handler is _on_signal:
        return True
    if handler not in (signal.SIG_DFL, signal.SIG_IGN) or any(signal.getitimer(signal.ITIMER_VIRTUAL)):
        return False
    signal.signal(signal.SIGVTALRM, _on_signal)
    return True


def _on_signal(number: int, frame: FrameType | None) -> None:
    watchdog = _in_main_thread
    if watchdog is None or (error := watchdog.due_error()) is None:
        return
    if watchdog.is_shaken_off():
        _insist()
        if watchdog.is_in_script(frame):
            raise error
    elif watchdog.is_raised_anew():
        _let_wakeups_be_lost()
        raise error


class _Insistence:
    """Raises the error wherever Python looks for what is pending while a line of the script runs, and is pending again at once:
    the next place to look is behind the clause that caught it. Nothing is raised in what lies between the script and us.
    """

    def __bool__(self) -> bool:
        watchdog = _in_main_thread
        if watchdog is None or (error := watchdog.due_error()) is None:
            return False
        _insist()
        if watchdog.is_in_script(sys._getframe(1)):
            raise error
        return False


_insistence: Final = _Insistence()


def _insist() -> None:
    """Python asks whether the insistence is true as soon as it can: what may be pending is a C function that fails by -1."""
    function = ctypes.cast(ctypes.pythonapi.PyObject_IsTrue, ctypes.c_void_p)
    ctypes.pythonapi.Py_AddPendingCall(function, ctypes.py_object(_insistence))


def _let_wakeups_be_lost() -> None:
    """Who waits for signals by a file, as asyncio does, does not read it while a script stands: that it is full is no news."""
    if (descriptor := signal.set_wakeup_fd(-1)) >= 0:
        signal.set_wakeup_fd(descriptor, warn_on_full_buffer=False)


def _look_on(watchdog: weakref.ref[Watchdog]) -> None:
    while True:
        time.sleep(_LOOKS)
        found = watchdog()
        if found is None:
            return
        found.look()
        _native.go_on()
        del found


class NativeWatch:
    """Says where the process stands when no thread can run any Python for long: a thread of C's writes it to stderr.

    There is one for a whole process, and a program of somebody else's may use it: only `elys` itself switches it on.
    """

    def __init__(self) -> None:
        self.is_on = False
        self._set = -NATIVE_LIMIT

    def go_on(self) -> None:
        """Puts it off; called again and again, as long as Python runs."""
        now = time.monotonic()
        if self.is_on and now - self._set > 1.0:
            self._set = now
            with contextlib.suppress(OSError, ValueError, RuntimeError, AttributeError):  # there is no stderr
                faulthandler.dump_traceback_later(NATIVE_LIMIT)

    def end(self) -> None:
        """Nothing is said any more."""
        if self.is_on:
            self.is_on = False
            faulthandler.cancel_dump_traceback_later()


_native: Final = NativeWatch()


@contextlib.contextmanager
def native_calls_said() -> Iterator[None]:
    """Inside, a script that lets no Python run is said on stderr, with its line."""
    _native.is_on = True
    try:
        yield
    finally:
        _native.end()

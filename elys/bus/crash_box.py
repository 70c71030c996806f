"""The last seconds where they outlive the simulation: files in the runtime directory, which become a recording if it crashes.

    said-N      how many bytes follow (u64), and what was said in a quarter of the time that is kept; the oldest is written over
                when the others are enough, which costs less than new files
    scene-N     a snapshot of the scene; deltas-N what changed since
    exact-N     an exact state; commands-N what was asked since
    begin, assets
    lock        held as long as anybody has to do with them

All are frames as in the recorder's pipe. A shell, which costs nothing, waits for the simulation's word that all is well; where
that does not come, as after a kill or a segmentation fault, it becomes `elys.bus.crash_rescue`. The tick makes one system
call; what has to be packed first is packed by a thread.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import logging
import os
import queue
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from elys.bus.discovery import runtime_directory
from elys.bus.recording_pipe import FrameKind, frame_head

ROOM_FOR_ASSETS: Final = 64 << 20  # [bytes]; what does not fit is not in the file of a crash
LENGTH: Final = struct.Struct("<Q")
SAID: Final = "said-"
_FOLDER: Final = "last-"
_PARTS: Final = 4  # of the time that is kept
_MOST_FILES: Final = 3 * _PARTS  # with what was said: each part may be full or over, and the rate of ticks may change
_WATCH: Final = 'read -r said || exec "$0" -m elys.bus.crash_rescue "$@"'
_MOST_PIECES: Final = 1000  # that the system writes at once
_log = logging.getLogger(__name__)

Pieces = Iterable[bytes | memoryview]


@dataclass(slots=True)
class _Said:
    """A file of what was said."""

    descriptor: int
    begun: int = 0  # how much had been told before it [ticks]
    size: int = 0  # [bytes]

    def begin(self, told: int) -> None:
        """Forgets what was in it."""
        self.begun, self.size = told, 0
        os.pwrite(self.descriptor, LENGTH.pack(0), 0)

    def add(self, pieces: list[bytes | memoryview]) -> None:
        """What is there counts when all of it is there: a kill may come in the midst of writing."""
        for start in range(0, len(pieces), _MOST_PIECES):
            some = pieces[start : start + _MOST_PIECES]
            _require_all(os.pwritev(self.descriptor, some, LENGTH.size + self.size), some)
            self.size += sum(map(len, some))
        os.pwrite(self.descriptor, LENGTH.pack(self.size), 0)


class CrashBox:
    """Keeps what it is told for `seconds` of simulation, in `room` bytes at most. A crash makes PLACE-TICK.mcap of it.

    Where the system refuses to keep it, nothing is kept from then on, and the simulation goes on.
    """

    def __init__(self, place: Path, *, seconds: float, room: int) -> None:
        """Raises OSError if the runtime directory cannot be written."""
        self.alive = True
        self._seconds, self._room = seconds, room
        root = runtime_directory()
        root.mkdir(parents=True, exist_ok=True, mode=0o700)
        remove_orphans(root)
        self.folder = Path(tempfile.mkdtemp(prefix=_FOLDER, dir=root))  # of mode 0700
        self._said: deque[_Said] = deque()
        self._spare: list[_Said] = []  # to be written over
        self._pending: list[bytes | memoryview] = []
        self._tick = self._told = 0  # the last tick, and how many ticks were told: a step back is one as well
        self._scenes = self._states = self._first_scene = self._first_state = 0
        self._deltas = self._commands = -1
        self._asset_size = 0
        self._jobs: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        lock = os.open(self.folder / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        fcntl.flock(lock, fcntl.LOCK_EX)
        reading, self._telling = os.pipe()
        words = ["/bin/sh", "-c", _WATCH, sys.executable, str(self.folder), str(place.absolute())]
        # Of a session of its own: Ctrl-C and whoever ends the simulation's group leave it alone.
        self._watcher = subprocess.Popen(words, stdin=reading, pass_fds=[lock], start_new_session=True)
        os.close(reading)
        os.close(lock)
        self._thread = threading.Thread(target=self._work, name="elys-crash-box", daemon=True)
        self._thread.start()

    # --- by the tick -----------------------------------------------------------------------------------------------

    def message(self, name: str, body: bytes | memoryview, moment: int) -> None:
        """What was said in this tick."""
        if self.alive:
            self._pending += (frame_head(FrameKind.MESSAGE, name, len(body), moment), body)

    def delta(self, name: str, body: bytes | memoryview, moment: int) -> None:
        """A change of the scene."""
        self._append(self._deltas, [frame_head(FrameKind.MESSAGE, name, len(body), moment), body])

    def command(self, name: str, body: bytes | memoryview, moment: int) -> None:
        """What was asked for."""
        self._append(self._commands, [frame_head(FrameKind.MESSAGE, name, len(body), moment), body])

    def end_tick(self, tick: int, tick_rate: float) -> None:
        """Writes what was said in a tick, and lets go of what is too old."""
        if not self.alive:
            self._close_files()  # it may have been the thread that gave up
            return
        self._told += tick - self._tick if tick >= self._tick else 1
        self._tick = tick
        said, told, kept_ticks = self._said, self._told, self._seconds * tick_rate
        pieces, self._pending = self._pending, []
        try:
            if not said or told - said[-1].begun >= kept_ticks / _PARTS or said[-1].size > self._room / _PARTS:
                said.append(self._next_file())
                said[-1].begin(told)
            said[-1].add(pieces)
            while len(said) > 1 and (said[1].begun <= told - kept_ticks or self._is_over()):
                said[0].begin(0)
                self._spare.append(said.popleft())
        except OSError as error:
            self._give_up(error)

    # --- packed by the thread --------------------------------------------------------------------------------------

    def begin(self, pieces: Callable[[], Pieces]) -> None:
        """What a recording begins with."""
        self._later("begin", pieces)

    def scene(self, pieces: Callable[[], Pieces]) -> None:
        """The scene as it is; deltas follow."""
        self._deltas = self._anew(self._deltas, f"deltas-{self._scenes}")
        self._later(f"scene-{self._scenes}", pieces)
        self._scenes += 1

    def exact(self, pieces: Callable[[], Pieces]) -> None:
        """An exact state; commands follow."""
        self._commands = self._anew(self._commands, f"commands-{self._states}")
        self._later(f"exact-{self._states}", pieces)
        self._states += 1

    def assets(self, put: Callable[[], None]) -> None:
        """Has the thread look for assets that are new: `put` calls `asset`."""
        self._jobs.put(put)

    def asset(self, reference: str, data: bytes, moment: int) -> None:
        """A file that the scene names, if there is room; for the thread to call."""
        if self._asset_size + len(data) > ROOM_FOR_ASSETS:
            _log.debug("%s is too large to be kept for a crash", reference)
            return
        self._asset_size += len(data)
        self._write_file("assets", [frame_head(FrameKind.ASSET, reference, len(data), moment), data])

    def drop_scene(self) -> None:
        """The oldest scene is needed no more."""
        self._drop(f"scene-{self._first_scene}", f"deltas-{self._first_scene}")
        self._first_scene += 1

    def drop_exact(self) -> None:
        """The oldest exact state is needed no more."""
        self._drop(f"exact-{self._first_state}", f"commands-{self._first_state}")
        self._first_state += 1

    def close(self) -> None:
        """All is well: nothing is left."""
        self._jobs.put(None)
        self._thread.join()
        self._end()
        with contextlib.suppress(OSError):  # who waited has been killed
            os.write(self._telling, b"well\n")
        os.close(self._telling)
        self._watcher.wait()

    # --- inside ----------------------------------------------------------------------------------------------------

    def _is_over(self) -> bool:
        return len(self._said) > _MOST_FILES or sum(one.size for one in self._said) > self._room

    def _later(self, name: str, pieces: Callable[[], Pieces]) -> None:
        # Dropping comes after writing, as both are jobs.
        self._jobs.put(lambda: self._write_file(name, pieces()))

    def _drop(self, *names: str) -> None:
        def drop() -> None:
            for name in names:
                (self.folder / name).unlink(missing_ok=True)

        self._jobs.put(drop)

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            if not self.alive:
                continue
            try:
                job()
            except Exception as error:  # whatever it is: without this thread what is asked of it would pile up
                self._give_up(error)

    def _write_file(self, name: str, pieces: Pieces) -> None:
        with (self.folder / name).open("ab") as file:
            for piece in pieces:
                file.write(piece)

    def _next_file(self) -> _Said:
        if self._spare:
            return self._spare.pop()
        name = self.folder / f"{SAID}{len(self._said)}"
        return _Said(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600))

    def _anew(self, descriptor: int, name: str) -> int:
        if not self.alive:
            return descriptor
        if descriptor >= 0:
            os.close(descriptor)
        try:
            return os.open(self.folder / name, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o600)
        except OSError as error:
            self._give_up(error)
            return -1

    def _append(self, descriptor: int, pieces: list[bytes | memoryview]) -> None:
        if descriptor < 0 or not self.alive:
            return
        try:
            _require_all(os.writev(descriptor, pieces), pieces)
        except OSError as error:
            self._give_up(error)

    def _give_up(self, error: Exception) -> None:
        if self.alive:
            self.alive = False
            fault = None if isinstance(error, OSError) else error
            _log.info("the last seconds are not kept for a crash any more: %s", error, exc_info=fault)
        shutil.rmtree(self.folder, ignore_errors=True)

    def _end(self) -> None:
        self.alive = False
        self._close_files()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _close_files(self) -> None:
        """For who writes them: closed by the thread, their numbers could be those of other files when they are written next."""
        for descriptor in (*(said.descriptor for said in (*self._said, *self._spare)), self._deltas, self._commands):
            if descriptor >= 0:
                os.close(descriptor)
        self._said.clear()
        self._spare.clear()
        self._deltas = self._commands = -1


def _require_all(written: int, pieces: list[bytes | memoryview]) -> None:
    """Raises OSError where the system took less than it was given, as it does with the last that fits on a disk."""
    if written < sum(map(len, pieces)):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def remove_orphans(root: Path) -> None:
    """Removes what is left where the one who waited was killed as well, or the machine went down."""
    for folder in root.glob(f"{_FOLDER}*"):
        try:
            lock = os.open(folder / "lock", os.O_RDWR | os.O_CLOEXEC)
        except OSError:
            continue  # it is being made, or removed, or is nothing of ours
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            continue  # somebody lives
        else:
            if (
                time.time() - folder.stat().st_mtime > 1.0
            ):  # else it has just been made, and its lock not been taken yet
                shutil.rmtree(folder, ignore_errors=True)
        finally:
            os.close(lock)

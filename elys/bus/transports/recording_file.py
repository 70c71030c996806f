"""The file that a recording goes to: it holds whole records at any moment, and has room for its end kept on the disk.

Where a disk is full the index must still go somewhere. Linux gives a file blocks behind its end, so what the end needs is taken
before anything else is written; where the file system has no such thing, chunks have to make room (see `McapWriter`).
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import functools
import logging
import os
from typing import Final

_KEEP_SIZE: Final = 1  # FALLOC_FL_KEEP_SIZE
_SPARE: Final = 64 << 10  # [bytes] more than is asked for, so that not every chunk asks the system
_FULL: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_log = logging.getLogger(__name__)


def says_full(error: OSError) -> bool:
    """Whether there would be room if less were in the file."""
    return error.errno in _FULL


class RecordingFile:
    """Owns the descriptor. What is appended is in the file whole, or not at all."""

    def __init__(self, descriptor: int) -> None:
        self.size = 0  # [bytes]
        self._descriptor = descriptor
        self._reserved = 0  # up to which byte there are blocks
        self._can_reserve = hasattr(_libc(), "fallocate")

    def append(self, *pieces: bytes | memoryview, room: int = 0) -> None:
        """Writes at the end, where thereafter `room` bytes more would fit.

        Raises:
            OSError: they would not, or the system refused; the file is as it was.
        """
        views = [memoryview(piece) for piece in pieces if len(piece)]
        length = sum(map(len, views))
        self._reserve(self.size + length + room)
        try:
            self._write(views)
        except OSError:
            self._end_at(self.size)
            raise
        self.size += length

    def cut_back(self, size: int) -> None:
        """Ends the file there."""
        if size != self.size:  # else what is reserved would be given back, perhaps to somebody else
            self._end_at(size)

    def empty(self) -> None:
        """Takes away what was in the file when it was opened."""
        self._end_at(0)

    def sync(self) -> None:
        """Brings it to the disk."""
        os.fsync(self._descriptor)

    def close(self) -> None:
        """Gives back what was reserved and not used. A second call does nothing."""
        if self._descriptor < 0:
            return
        descriptor, self._descriptor = self._descriptor, -1
        if self._reserved > self.size:
            with contextlib.suppress(OSError):
                os.ftruncate(descriptor, self.size)
        os.close(descriptor)

    def _end_at(self, size: int) -> None:
        with contextlib.suppress(OSError):  # a device
            os.ftruncate(self._descriptor, size)
            os.lseek(self._descriptor, size, os.SEEK_SET)
        self.size = self._reserved = size

    def _write(self, views: list[memoryview]) -> None:
        while views:
            written = os.writev(self._descriptor, views[: os.sysconf("SC_IOV_MAX")])
            while views and written >= len(views[0]):
                written -= len(views[0])
                del views[0]
            if written:
                views[0] = views[0][written:]

    def _reserve(self, end: int) -> None:
        if not self._can_reserve or end <= self._reserved:
            return
        for wanted in (end + _SPARE, end):
            failed = _allocate(self._descriptor, self.size, wanted - self.size)
            if not failed:
                self._reserved = wanted
                return
        if failed in _FULL:
            raise OSError(failed, os.strerror(failed))
        self._can_reserve = False  # a device, or a file system that has nothing of the kind
        _log.debug("no room is kept for the end of the recording: %s", os.strerror(failed))


@functools.cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _allocate(descriptor: int, offset: int, length: int) -> int:
    """Takes blocks behind the end of a file; 0, or why not (an errno)."""
    fallocate = _libc().fallocate
    fallocate.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64)
    return 0 if fallocate(descriptor, _KEEP_SIZE, offset, length) == 0 else ctypes.get_errno()

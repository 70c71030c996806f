"""Where the two ends of a router meet: a directory that nobody else may enter, and that does not outlive its router for long.

Who holds it holds a lock in it, which ends with the process however that ends. A router that was killed leaves its directory
behind; the next one of the same user that starts removes it.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import tempfile
from pathlib import Path
from typing import Final

_PREFIX: Final = "elys-router-"
_LOCK: Final = "held"


class RouterSocket:
    """A new directory; `endpoint_path` is where the socket stands."""

    def __init__(self) -> None:
        remove_abandoned()
        self._directory = Path(tempfile.mkdtemp(prefix=_PREFIX))  # of mode 0700
        making = self._directory / "making"
        self._lock = os.open(making, os.O_CREAT | os.O_RDWR, 0o600)
        fcntl.flock(self._lock, fcntl.LOCK_EX)
        making.rename(self._directory / _LOCK)  # who finds it finds it locked

    @property
    def endpoint_path(self) -> Path:
        """Of the socket."""
        return self._directory / "router"

    def remove(self) -> None:
        """Removes it, with all in it."""
        shutil.rmtree(self._directory, ignore_errors=True)
        os.close(self._lock)


def remove_abandoned() -> None:
    """Removes this user's directories whose routers are no more."""
    for directory in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError):  # another user's, or one that is being removed or made
            if not directory.is_symlink() and directory.stat().st_uid == os.getuid() and _is_abandoned(directory):
                shutil.rmtree(directory, ignore_errors=True)


def _is_abandoned(directory: Path) -> bool:
    lock = os.open(directory / _LOCK, os.O_RDWR | os.O_NOFOLLOW)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(lock)
    return True

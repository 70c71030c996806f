"""Files that are whole or not there: what others read is never half of an export."""

from __future__ import annotations

import contextlib
import glob
import os
from collections.abc import Iterator
from pathlib import Path

from elys.common.errors import RecordingError


@contextlib.contextmanager
def whole_file(target: Path) -> Iterator[Path]:
    """A place beside `target` to write to, which takes its name at the end; what fails leaves nothing.

    Raises:
        RecordingError: it cannot be written there, now or later (a full disk).
    """
    if target.is_dir():
        raise RecordingError(f"{target} is a directory: name a file")
    place = target.resolve()  # a link goes on to lead there
    is_device = place.exists() and not place.is_file()
    # Each process has its own: of two that write to one name the last that ends wins, whole.
    part = place if is_device else place.with_name(f".{place.name}.{os.getpid()}.part")
    try:
        if not is_device:
            _sweep(place)
        yield part
        if not is_device:
            part.replace(place)
    except OSError as error:
        raise RecordingError(f"{target} cannot be written: {error.strerror or error}") from error
    finally:
        if not is_device:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)


def _sweep(place: Path) -> None:
    """Takes away what processes that were killed have left beside a file."""
    for left in place.parent.glob(f".{glob.escape(place.name)}.*.part"):
        writer = left.name.split(".")[-2]
        if writer.isdecimal() and (int(writer) == os.getpid() or not _is_alive(int(writer))):
            left.unlink(missing_ok=True)


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True

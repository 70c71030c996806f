"""Files that are whole or not there: what others read is never half of an export."""

from __future__ import annotations

import contextlib
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
    part = place if is_device else place.with_name(f".{place.name}.part")
    try:
        if not is_device:
            part.unlink(missing_ok=True)  # left by one that was killed
        yield part
        if not is_device:
            part.replace(place)
    except OSError as error:
        raise RecordingError(f"{target} cannot be written: {error.strerror or error}") from error
    finally:
        if not is_device:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)

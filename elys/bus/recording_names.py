"""Names of recordings: none that is there is written over unless somebody asked for it.

What happens while it is recorded cannot be had again, so a name that is taken gets a number and the recording goes on. What is
made of recordings can be made once more, so there a taken name is refused.
"""

from __future__ import annotations

import itertools
import os
import struct
from collections.abc import Collection
from pathlib import Path
from typing import Final

from mcap.opcode import Opcode

from elys.common.errors import RecordingError

REMEDY: Final = "move it away, name another file, or give --overwrite"
_BEGINNING: Final = struct.Struct("<8sBQI")  # magic, opcode and length of the header, length of the profile's name


def free_name(path: Path, taken: Collection[Path] = ()) -> Path:
    """The path, or with the first number behind its stem that is neither there nor `taken`: run.mcap, run-2.mcap, run-3.mcap."""
    names = itertools.chain((path,), (path.with_stem(f"{path.stem}-{number}") for number in itertools.count(2)))
    return next(name for name in names if name not in taken and not os.path.lexists(name))


def claimed(path: Path, *, overwrites: bool) -> Path:
    """The file to record to: an empty one of that name or with a number, made here so that nobody else takes it meanwhile.

    With `overwrites` it is the path itself, whatever is there; so is a device.

    Raises:
        RecordingError: no file can be made there.
    """
    if overwrites or is_device(path):
        return path
    while not is_made(name := free_name(path)):
        pass  # another process was faster
    return name


def is_made(path: Path) -> bool:
    """Makes an empty file; False if something is there, whoever was faster.

    Raises:
        RecordingError: no file can be made there.
    """
    try:
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666))
    except FileExistsError:
        return False
    except OSError as error:
        raise RecordingError(f"the recording {path} cannot be written: {error.strerror}") from error
    return True


def require_free(path: Path, *, remedy: str = REMEDY) -> None:
    """Raises RecordingError where a file is."""
    if path.is_file():
        raise RecordingError(f"{path} is there already: {remedy}")


def is_recording(path: Path) -> bool:
    """Whether a file begins as those do that ELYS records; other MCAP files are exports, which can be made again."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        magic, opcode, _, length = _BEGINNING.unpack(file.read(_BEGINNING.size).ljust(_BEGINNING.size, b"\0"))
        return magic == b"\x89MCAP0\r\n" and opcode == Opcode.HEADER and file.read(min(length, 8)) == b"elys"


def is_device(path: Path) -> bool:
    """Whether something is there that holds no recording: writing to it loses none."""
    return path.exists() and not path.is_file()

"""How scene files name other files: relative to themselves, or as a piece of ELYS's own, `elys:door.prefab.json`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final, TypeGuard

PIECES: Final = "elys:"  # begins the name of a file that ELYS brings, see docs/pieces.md
PIECES_FOLDER: Final = Path(__file__).parents[1] / "pieces"
PARTS_SUFFIX: Final = ".parts"  # of the folder beside a scene with what no other file holds
PREFAB_SUFFIX: Final = ".prefab.json"


def path_of(name: str, directory: Path) -> Path:
    """The file that a scene file in `directory` means by a name."""
    if name.startswith(PIECES):
        directory, name = PIECES_FOLDER, name.removeprefix(PIECES)
    # normpath, not resolve: a prefab reached by a link is looked for beside the link.
    return Path(os.path.normpath(directory / name))


def relative_name(path: Path, directory: Path) -> str:
    """The opposite: a file as scene files in `directory` name it."""
    normal = Path(os.path.normpath(path))
    if normal.is_relative_to(PIECES_FOLDER):
        return PIECES + normal.relative_to(PIECES_FOLDER).as_posix()
    return Path(os.path.relpath(normal, directory)).as_posix()


def is_prefab_name(value: object) -> TypeGuard[str]:
    """Whether a script's value or text names a prefab file."""
    return isinstance(value, str) and value.endswith(PREFAB_SUFFIX) and "\0" not in value and len(value) < 1000

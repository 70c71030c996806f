"""Whose scripts may run: a script is a program, and a scene of a stranger's must not run programs unasked.

Folders that a person has trusted are kept in the user's configuration; `--trust` of the command line trusts everything for one
run and what it starts, through the environment.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

import msgspec
import platformdirs

from elys.common.assets.store import replace_file
from elys.common.errors import ScriptError
from elys.common.scene_files import PARTS_SUFFIX

EVERYTHING: Final = "ELYS_TRUST_SCRIPTS"  # in the environment, "1"
_here: set[Path] = {Path(__file__).parents[1]}  # trusted by this process alone; what ELYS itself brings is


def trust(folder: str | Path) -> None:
    """Lets scripts below a folder run in this process."""
    _here.add(Path(folder).resolve())


def trust_everything() -> None:
    """Lets all scripts run, in this process and in those that it starts."""
    os.environ[EVERYTHING] = "1"


def is_trusted(place: str) -> bool:
    """Whether the script that came from a file may run; what came from no file here, as in a recording, only if all may."""
    if os.environ.get(EVERYTHING) == "1":
        return True
    if not place:
        return False
    path = Path(place).resolve()
    return any(_covers(folder, path) for folder in (*_here, *trusted_folders()))


def _covers(folder: Path, path: Path) -> bool:
    """Whether trust in a folder holds for a file in it: saving a scene puts scripts of others into its parts, unasked."""
    return path.is_relative_to(folder) and not any(
        part.endswith(PARTS_SUFFIX) for part in path.relative_to(folder).parts[:-1]
    )


def trusted_folders() -> list[Path]:
    """The folders that the user trusts; ScriptError if the list cannot be read."""
    path = _list()
    try:
        return [Path(folder) for folder in msgspec.json.decode(path.read_bytes(), type=list[str])]
    except FileNotFoundError:
        return []
    except (OSError, msgspec.DecodeError) as error:
        raise ScriptError(
            f"the list of trusted folders {path} cannot be read ({error}): mend it or take it away"
        ) from error


def remember(folder: str | Path, *, trusted: bool = True) -> None:
    """Trusts a folder from now on, or no longer; ScriptError if that cannot be written down."""
    wanted = Path(folder).resolve()
    kept = [known for known in trusted_folders() if known != wanted]
    path = _list()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, msgspec.json.encode([str(known) for known in (*kept, *([wanted] if trusted else []))]))
    except OSError as error:
        raise ScriptError(f"{path} cannot be written: {error.strerror}") from error


def _list() -> Path:
    return Path(os.environ.get("ELYS_CONFIG_DIR") or platformdirs.user_config_dir("elys")) / "trusted-folders.json"

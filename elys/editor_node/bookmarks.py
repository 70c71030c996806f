"""Instants that a person gave a name, kept for each session and recording in a file of its own."""

from __future__ import annotations

import contextlib
import logging
import os
import re
from pathlib import Path
from typing import Final

import msgspec
import platformdirs

_log = logging.getLogger(__name__)

MOST: Final = 1000
NAME_LENGTH: Final = 100  # characters


class Bookmark(msgspec.Struct, frozen=True, kw_only=True):
    """A named instant of a timeline."""

    name: str
    time: float  # [s] of simulation


def state_directory() -> Path:
    """Where the editor keeps what it remembers of sessions; ELYS_STATE_DIR names another place."""
    directory = os.environ.get("ELYS_STATE_DIR")
    return Path(directory) if directory else platformdirs.user_state_path("elys")


class Bookmarks:
    """The bookmarks of one session or recording, in the order of their times; each change is written at once."""

    def __init__(self, owner: str) -> None:
        """`owner` names whose they are."""
        self._path = state_directory() / "bookmarks" / f"{re.sub(r'[^A-Za-z0-9_.-]+', '-', owner)[:150]}.json"
        self._bookmarks = _load(self._path)

    @property
    def all(self) -> tuple[Bookmark, ...]:
        """The earliest first."""
        return tuple(self._bookmarks)

    def add(self, name: str, time: float) -> Bookmark:
        """A new one; the oldest instants go where there are too many."""
        bookmark = Bookmark(name=name.strip()[:NAME_LENGTH], time=time)
        self._change([*self._bookmarks, bookmark])
        return bookmark

    def rename(self, bookmark: Bookmark, name: str) -> None:
        """Gives one another name, if it is still there."""
        renamed = msgspec.structs.replace(bookmark, name=name.strip()[:NAME_LENGTH])
        self._change([renamed if known == bookmark else known for known in self._bookmarks])

    def remove(self, bookmark: Bookmark) -> None:
        """Forgets one."""
        self._change([known for known in self._bookmarks if known != bookmark])

    def _change(self, bookmarks: list[Bookmark]) -> None:
        self._bookmarks = sorted(bookmarks, key=lambda bookmark: bookmark.time)[-MOST:]
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            draft = self._path.with_suffix(".draft")
            draft.write_bytes(msgspec.json.format(msgspec.json.encode(self._bookmarks), indent=2))
            draft.replace(self._path)
        except OSError as error:
            _log.warning("bookmarks were not saved to %s: %s", self._path, error.strerror)


def _load(path: Path) -> list[Bookmark]:
    try:
        return sorted(msgspec.json.decode(path.read_bytes(), type=list[Bookmark]), key=lambda bookmark: bookmark.time)
    except FileNotFoundError:
        return []
    except (OSError, msgspec.DecodeError, UnicodeDecodeError) as error:
        broken = path.with_suffix(".broken")
        with contextlib.suppress(OSError):
            path.replace(broken)
        _log.warning("%s cannot be read (%s): its bookmarks are put aside as %s", path, error, broken)
        return []

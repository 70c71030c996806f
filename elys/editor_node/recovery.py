"""Scenes kept aside while they have edits that no file has, for the day on which editor and simulation both die.

    $ELYS_STATE_DIR or the user's state directory / recovery / {process}-{epoch}.scene.json   and .json, which says what it is

As long as the session lives nothing is lost with an editor: its host has all edits. What is kept here is for what dies with it.
"""

from __future__ import annotations

import logging
import os
import shutil
import time
from pathlib import Path

import msgspec
import platformdirs

from elys.bus.discovery import start_of_process
from elys.common.assets.store import replace_file
from elys.common.made_contents import parts_folder
from elys.common.scene import SCENE_SUFFIX

_log = logging.getLogger(__name__)


class Kept(msgspec.Struct, frozen=True, kw_only=True):
    """A scene that was kept aside: where, of which file and name it was, in which run, and when it was written."""

    scene: str
    path: str
    name: str
    epoch: int
    process: int
    process_started: str
    time: float  # [s] since 1970


def state_directory() -> Path:
    """Where the editor keeps what is of use until it was taken back: $ELYS_STATE_DIR, or the user's state directory."""
    chosen = os.environ.get("ELYS_STATE_DIR")
    return Path(chosen) if chosen else platformdirs.user_state_path("elys")


class Recovery:
    """The files of one editor, and those that others have left behind."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory / "recovery"

    def place(self, epoch: int) -> Path:
        """Where this editor keeps the scene of a run; OSError if there can be no such directory."""
        self._directory.mkdir(parents=True, exist_ok=True, mode=0o700)
        return self._directory / f"{os.getpid()}-{epoch}{SCENE_SUFFIX}"

    def note(self, scene: Path, *, path: Path | None, name: str, epoch: int) -> None:
        """Says what a scene is that was written at its `place`; raises OSError."""
        kept = Kept(
            scene=str(scene),
            path=str(path or ""),
            name=name,
            epoch=epoch,
            process=os.getpid(),
            process_started=start_of_process(os.getpid()),
            time=time.time(),
        )
        replace_file(_note_of(scene), msgspec.json.encode(kept), durable=False)

    def drop(self, epoch: int) -> None:
        """The scene of a run is in a file, or nobody wants it."""
        self.forget(self._directory / f"{os.getpid()}-{epoch}{SCENE_SUFFIX}")

    def forget(self, scene: Path | str) -> None:
        """Removes what was kept."""
        for path in (_note_of(Path(scene)), Path(scene)):
            try:
                path.unlink(missing_ok=True)
            except OSError as error:
                _log.warning("%s cannot be removed: %s", path, error.strerror)
        shutil.rmtree(parts_folder(Path(scene)), ignore_errors=True)

    def left_behind(self, *, path: Path | None, name: str, epoch: int) -> Kept | None:
        """The newest scene of this file, or of this name where it has none, whose editor is gone and whose run is another."""
        found: list[Kept] = []
        for note in sorted(self._directory.glob("*.json")) if self._directory.is_dir() else []:
            if note.name.endswith(SCENE_SUFFIX):
                continue
            try:
                kept = msgspec.json.decode(note.read_bytes(), type=Kept)
            except (OSError, msgspec.DecodeError) as error:
                _log.debug("%s is no note of a scene: %s", note, error)
                continue
            is_ours = kept.path == str(path) if path is not None or kept.path else kept.name == name
            if is_ours and kept.epoch != epoch and not _is_alive(kept) and Path(kept.scene).is_file():
                found.append(kept)
        return max(found, key=lambda kept: kept.time, default=None)


def _note_of(scene: Path) -> Path:
    return scene.with_name(scene.name.removesuffix(SCENE_SUFFIX) + ".json")


def _is_alive(kept: Kept) -> bool:
    started = start_of_process(kept.process)
    return bool(started) and started == kept.process_started

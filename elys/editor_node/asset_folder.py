"""A project's folder: which assets lie in it, kept up to date while files change on the disk. No ImGui, no decoding.

folder ──walk (thread)──> Listing ──changed files──> on_change
  ^                                                      │
  └── watchfiles, or a look every other second ──────────┘
"""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import watchfiles

from elys.common.assets.gltf import MODEL_SUFFIXES
from elys.common.assets.heights import HEIGHT_SUFFIXES
from elys.common.assets.images import IMAGE_SUFFIXES
from elys.common.scene import PREFAB_SUFFIX, SCENE_SUFFIX

AssetType = Literal["model", "image", "light", "scene", "prefab", "heights"]

LIGHT_SUFFIXES: Final = (".hdr", ".exr")  # pictures of light from all around
FILE_LIMIT: Final = 20_000  # assets of a folder that are listed
FOLDER_LIMIT: Final = 2_000  # folders that are looked into: somebody may choose their home
DEPTH_LIMIT: Final = 16
POLL_INTERVAL: Final = 2.0  # [s] between two looks where the system does not tell of changes
_SETTLE: Final = 100  # [ms] without another change after which a change is told: files are written in pieces
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class AssetFile:
    """A file that can be used in a scene."""

    path: Path
    folder: str  # relative to the project's folder, with slashes; "" for that itself
    type: AssetType
    size: int  # [bytes]
    modified: int  # [ns]

    @property
    def name(self) -> str:
        """As it is called in its folder."""
        return self.path.name

    @property
    def version(self) -> tuple[Path, int, int]:
        """Equal as long as nobody wrote to the file."""
        return self.path, self.size, self.modified


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing:
    """What lay in a folder at one look. `cut` says why there may be more, "" if there is not."""

    root: Path
    files: tuple[AssetFile, ...] = ()
    folders: tuple[str, ...] = ()  # relative to root, those below others behind them
    cut: Literal["", "files", "folders", "depth", "unreadable"] = ""


def asset_type(path: Path) -> AssetType | None:
    """What a file is, by its name; None for no asset."""
    name = path.name.lower()
    if name.endswith(PREFAB_SUFFIX):
        return "prefab"
    if name.endswith(SCENE_SUFFIX):
        return "scene"
    suffix = path.suffix.lower()
    if suffix in MODEL_SUFFIXES:
        return "model"
    if suffix in LIGHT_SUFFIXES:
        return "light"
    if suffix in IMAGE_SUFFIXES:
        return "image"
    return "heights" if suffix in HEIGHT_SUFFIXES else None


def walk(
    root: Path,
    *,
    file_limit: int = FILE_LIMIT,
    folder_limit: int = FOLDER_LIMIT,
    is_ended: Callable[[], bool] = lambda: False,
) -> Listing:
    """Looks through a folder and those in it, nearest first. Hidden ones, and links to folders, are passed over."""
    files: list[AssetFile] = []
    folders: list[str] = []
    cut: Literal["", "files", "folders", "depth", "unreadable"] = ""
    waiting = [""]
    for folder in waiting:
        if is_ended():
            break
        try:
            with os.scandir(root / folder) as entries:
                found = sorted(entries, key=lambda entry: entry.name.casefold())
        except OSError as error:
            _log.debug("%s is passed over: %s", root / folder, error)
            cut = cut or "unreadable"
            continue
        for entry in found:
            if entry.name.startswith(".") or entry.name == "__pycache__":
                continue
            inner = f"{folder}/{entry.name}" if folder else entry.name
            if entry.is_dir(follow_symlinks=False):
                if len(folders) >= folder_limit:
                    cut = "folders"
                elif inner.count("/") >= DEPTH_LIMIT:
                    cut = "depth"
                else:
                    folders.append(inner)
                    waiting.append(inner)
                continue
            file = _asset_file(root / inner, folder)
            if file is not None:
                if len(files) >= file_limit:
                    return Listing(root=root, files=tuple(files), folders=tuple(folders), cut="files")
                files.append(file)
    return Listing(root=root, files=tuple(files), folders=tuple(folders), cut=cut)


def _asset_file(path: Path, folder: str) -> AssetFile | None:
    kind = asset_type(path)
    if kind is None:
        return None
    try:
        stat = path.stat()
    except OSError:  # gone meanwhile, or a link to nothing
        return None
    if not path.is_file():
        return None
    return AssetFile(path=path, folder=folder, type=kind, size=stat.st_size, modified=stat.st_mtime_ns)


class AssetFolder:
    """The assets of one folder; `close` ends its thread.

    `on_change` is called on that thread with the files that came to be or were written to since the look before (none of them
    at the first one) whenever `listing` is another.
    """

    def __init__(
        self,
        root: Path,
        *,
        on_change: Callable[[list[AssetFile]], None] = lambda changed: None,
        is_watched: bool = True,
    ) -> None:
        """`is_watched` has the system tell of changes; without it the folder is looked through every other second."""
        self.root = root
        self.listing = Listing(root=root)
        self.is_known = False  # whether `listing` tells of a look
        self._on_change = on_change
        self._is_watched = is_watched
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="elys-asset-folder", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ends the thread, which may look through a large folder just now: it is not waited for long."""
        self._end.set()
        self._thread.join(timeout=1.0)

    def _run(self) -> None:
        self._look()
        while not self._end.is_set():
            if not self._is_watched:
                self._end.wait(POLL_INTERVAL)
            elif not self._wait_for_change():
                continue
            if not self._end.is_set():
                self._look()

    def _look(self) -> None:
        listing = walk(self.root, is_ended=self._end.is_set)
        before = {file.path: file.version for file in self.listing.files}
        if self.is_known and listing == self.listing:
            return
        changed = [file for file in listing.files if before.get(file.path) != file.version] if self.is_known else []
        self.listing, self.is_known = listing, True
        self._on_change(changed)

    def _wait_for_change(self) -> bool:
        """Whether something changed; False where only the way of looking, or what is to be looked at, did."""
        is_watching = False
        # Each folder by itself: what is passed over, a home's caches say, is not to be watched either.
        places = [self.root, *(self.root / folder for folder in self.listing.folders)]
        try:
            for changes in watchfiles.watch(
                *(place for place in places if place.is_dir()),
                watch_filter=None,
                recursive=False,
                step=_SETTLE,
                rust_timeout=250,
                yield_on_timeout=True,
                stop_event=self._end,
                ignore_permission_denied=True,
            ):
                if changes:
                    return True
                if not is_watching:  # what changed between the look and the watch nobody would tell of
                    is_watching, folders = True, self.listing.folders
                    self._look()
                    if self.listing.folders != folders:
                        return False
        except Exception as error:  # the library raises its own for a system that has no watches left
            _log.info("changes in %s are looked for every %g s: %s", self.root, POLL_INTERVAL, error)
            self._is_watched = False
        return False

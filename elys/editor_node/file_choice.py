"""Which file: the folders and files of a folder, for a dialog to show."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from elys.common.scene import PREFAB_SUFFIX, SCENE_SUFFIX

SUFFIXES: Final = (SCENE_SUFFIX, PREFAB_SUFFIX, ".gltf", ".glb")


@dataclass(frozen=True, slots=True)
class FileEntry:
    """A line of the list."""

    name: str
    path: Path
    is_folder: bool


class FileChoice:
    """A folder that is looked at, and the path that is chosen or typed (`text`); files with these suffixes are shown."""

    def __init__(self, suffixes: tuple[str, ...] = SUFFIXES) -> None:
        self._suffixes = suffixes
        self.folder = Path()
        self.text = ""
        self.entries: list[FileEntry] = []

    def look_at(self, folder: Path) -> None:
        """Shows what is in a folder: the one above, folders, then files, each by name. One that cannot be read is empty."""
        self.folder = folder.absolute()
        try:
            found = sorted(self.folder.iterdir(), key=lambda path: path.name.casefold())
        except OSError:
            found = []
        visible = [path for path in found if not path.name.startswith(".")]
        folders = [FileEntry(path.name, path, True) for path in visible if path.is_dir()]
        files = [FileEntry(path.name, path, False) for path in visible if path.name.lower().endswith(self._suffixes)]
        self.entries = [FileEntry("..", self.folder.parent, True), *folders, *[f for f in files if f.path.is_file()]]

    def choose(self, entry: FileEntry) -> None:
        """A line was clicked: its folder is shown, or it is the chosen one."""
        if entry.is_folder:
            self.look_at(entry.path)
        else:
            self.text = str(entry.path)

"""What an asset browser shows: the folder one is in, what was searched, in which order. No ImGui."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal, get_args

from elys.editor_node.asset_folder import AssetFile, AssetType, Listing
from elys.editor_node.preferences import Preferences, remember

Order = Literal["name", "type", "size", "newest"]
ORDERS: Final[tuple[Order, ...]] = get_args(Order)
_TYPES: Final[tuple[AssetType, ...]] = get_args(AssetType)
_ALSO: Final[dict[str, AssetType]] = {
    "gltf": "model", "glb": "model", "mesh": "model", "texture": "image", "picture": "image", "hdr": "light",
    "hdri": "light", "environment": "light", "terrain": "heights",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Search:
    """Words that must stand in a file's name or folder, and types of which it must have one (none: any)."""

    words: tuple[str, ...] = ()
    types: frozenset[AssetType] = frozenset()
    unknown: tuple[str, ...] = ()  # types asked for that there are not

    @staticmethod
    def parsed(text: str) -> Search:
        """Of what a person typed: `brick t:image`. Types may be cut off: `t:mod`."""
        words: list[str] = []
        types: set[AssetType] = set()
        unknown: list[str] = []
        for part in text.casefold().split():
            if not part.startswith("t:"):
                words.append(part)
                continue
            wanted = part[2:]
            fitting = {name for name in _TYPES if name.startswith(wanted)}
            fitting |= {kind for name, kind in _ALSO.items() if name.startswith(wanted)}
            types |= fitting if wanted else set()
            if wanted and not fitting:
                unknown.append(wanted)
        return Search(tuple(words), frozenset(types), tuple(unknown))

    def takes(self, file: AssetFile) -> bool:
        """Whether a file is found."""
        if self.unknown or (self.types and file.type not in self.types):
            return False
        place = f"{file.folder}/{file.name}".casefold()
        return all(word in place for word in self.words)


@dataclass(slots=True)
class AssetBrowsing:
    """Where a person is in a folder of assets, and what of it they see."""

    folder: str = ""  # relative to the project's folder
    search: str = ""
    order: Order = "name"
    selected: Path | None = None
    _shown_for: tuple[object, ...] = ()
    _folders: list[str] = field(default_factory=list)
    _files: list[AssetFile] = field(default_factory=list)

    def shown(self, listing: Listing) -> tuple[list[str], list[AssetFile]]:
        """The folders and files to be seen: those right here, or, while something is searched, files in here at any depth."""
        if self.folder and self.folder not in listing.folders:
            self.folder = ""  # it was taken away
        key = (id(listing), self.folder, self.search, self.order)
        if key != self._shown_for:
            self._shown_for = key
            self._find(listing)
        return self._folders, self._files

    def _find(self, listing: Listing) -> None:
        above = f"{self.folder}/" if self.folder else ""
        if self.search.strip():
            search = Search.parsed(self.search)
            inside = (f for f in listing.files if f.folder == self.folder or f.folder.startswith(above))
            self._folders, self._files = [], [file for file in inside if search.takes(file)]
        else:
            below = (folder for folder in listing.folders if folder.startswith(above) and folder != self.folder)
            self._folders = [folder for folder in below if "/" not in folder[len(above) :]]
            self._files = [file for file in listing.files if file.folder == self.folder]
        self._files.sort(key=_KEYS[self.order])

    def enter(self, folder: str) -> None:
        """Goes into a folder."""
        self.folder, self.search, self.selected = folder, "", None

    def up(self) -> None:
        """Goes to the folder around this one."""
        self.enter(self.folder.rpartition("/")[0])

    def parts(self) -> list[tuple[str, str]]:
        """The folders from the project's down to this one: their names and themselves."""
        names = self.folder.split("/") if self.folder else []
        return [(name, "/".join(names[: place + 1])) for place, name in enumerate(names)]


_KEYS: Final = {
    "name": lambda file: (file.name.casefold(), file.folder),
    "type": lambda file: (file.type, file.name.casefold(), file.folder),
    "size": lambda file: (-file.size, file.name.casefold()),
    "newest": lambda file: (-file.modified, file.name.casefold()),
}


def project_folder(preferences: Preferences, scene_file: Path | None) -> Path:
    """Where a person's assets are: where they chose last, beside the scene's file if that is here, else where the editor was
    started.
    """
    if scene_file is not None and scene_file.parent.is_dir():
        return scene_file.parent.absolute()
    for chosen in preferences.recent_folders:
        if Path(chosen).is_dir():
            return Path(chosen)
    return Path.cwd()


def choose_folder(preferences: Preferences, text: str) -> Path:
    """The folder a person named, remembered as their latest.

    Raises:
        OSError: there is none; its sentence says what is wrong.
    """
    path = Path(text.strip()).expanduser().absolute()
    if not path.exists():
        raise FileNotFoundError(f"there is no folder {path}")
    if not path.is_dir():
        raise NotADirectoryError(f"{path} is a file: name the folder it lies in")
    next(path.iterdir(), None)  # may it be read?
    remember(preferences.recent_folders, str(path))
    return path

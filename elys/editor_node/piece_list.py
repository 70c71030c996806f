"""What the Add menu offers of the pieces that ELYS brings: their prefabs, by the names that people read."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from elys.common.scene_files import PIECES_FOLDER, PREFAB_SUFFIX
from elys.editor_node.asset_folder import AssetFile

# By menu: the folder below that of the pieces, and the names, each of which is its file's.
PIECE_MENUS: Final[dict[str, tuple[str, tuple[str, ...]]]] = {
    "Pieces": (
        "",
        (
            "Breakable",
            "Breakable stack",
            "Button",
            "Checkpoint",
            "Collectible",
            "Conveyor",
            "Crate",
            "Door",
            "Gate",
            "Goal",
            "Kill zone",
            "Moving platform",
            "Respawning ball",
            "Rotator",
            "Spawner",
            "Timer",
            "Water",
            "Wind",
        ),
    ),
    "Game": (
        "game",
        ("Gate", "Road straight", "Road bend left", "Road bend right", "Road slope", "Road jump"),
    ),
}


def piece_file(menu: str, name: str) -> AssetFile:
    """A piece as an asset that can be put into the scene."""
    folder, _ = PIECE_MENUS[menu]
    path = Path(PIECES_FOLDER, folder, f"{name.lower().replace(' ', '_')}{PREFAB_SUFFIX}")
    known = path.stat()
    return AssetFile(path=path, folder="", type="prefab", size=known.st_size, modified=known.st_mtime_ns)

"""Opening what a user names as a scene: a file, one of the samples, or a level of the game."""

from __future__ import annotations

import difflib
from pathlib import Path

from elys.common.assets.store import AssetStore
from elys.common.errors import SceneError
from elys.common.scene import OpenedScene, expand, open_scene
from elys.samples.game.levels import LEVELS
from elys.samples.hard_cases import HARD_CASES
from elys.samples.registry import FOLDER, SAMPLES, is_sample, sample


def open_scene_or_sample(name: str, assets: AssetStore | None = None) -> OpenedScene:
    """The scene file `name`, or the sample or level of that name where there is no such file.

    Raises:
        SceneError: neither is there, or the file is wrong.
    """
    store = assets if assets is not None else AssetStore()
    if not Path(name).exists():
        if name in LEVELS:
            return LEVELS[name].open(store)[0]
        if is_sample(name):
            document = sample(name).build()
            return OpenedScene(
                name=document.name or name,
                path=Path(f"{name}.scene.json").absolute(),
                settings=document.settings,
                records=expand(document, directory=FOLDER, assets=store),
            )
        if "." not in name and "/" not in name:
            close = difflib.get_close_matches(name, [*SAMPLES, *HARD_CASES, *LEVELS], n=1)
            known = (
                f"did you mean '{close[0]}'?" if close else f"samples are {', '.join(SAMPLES)}; elys samples lists all"
            )
            raise SceneError(f"there is no scene file and no sample called '{name}'; {known}")
    if name.endswith(".mcap"):
        raise SceneError(f"{name} is a recording, not a scene: elys play {name}")
    return open_scene(Path(name), store)

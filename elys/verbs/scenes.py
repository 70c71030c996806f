"""Opening what a user names as a scene: a file, or one of the samples."""

from __future__ import annotations

from pathlib import Path

from elys.common.assets.store import AssetStore
from elys.common.errors import SceneError
from elys.common.scene import OpenedScene, expand, open_scene
from elys.samples.registry import SAMPLES


def open_scene_or_sample(name: str, assets: AssetStore | None = None) -> OpenedScene:
    """The scene file `name`, or the sample of that name where there is no such file.

    Raises:
        SceneError: neither is there, or the file is wrong.
    """
    store = assets if assets is not None else AssetStore()
    if not Path(name).exists():
        if name in SAMPLES:
            document = SAMPLES[name].build()
            return OpenedScene(
                name=document.name or name,
                path=Path(f"{name}.scene.json").absolute(),
                settings=document.settings,
                records=expand(document, directory=Path(), assets=store),
            )
        if "." not in name and "/" not in name:
            known = ", ".join(SAMPLES)
            raise SceneError(f"there is no scene file and no sample called '{name}'; samples are {known}")
    if name.endswith(".mcap"):
        raise SceneError(f"{name} is a recording, not a scene: elys play {name}")
    return open_scene(Path(name), store)

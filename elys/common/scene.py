"""Scene and prefab files: reading, writing, expanding and opening them.

    yard.scene.json  --read_scene-->  SceneDocument  --expand-->  [EntityRecord]  -->  a world, or a Spawn command
                     <--write_scene--                <--collapse--

`open_scene` does all of the way from a file, and takes a bare glTF model as well.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from elys.common.assets.gltf import MODEL_SUFFIXES, import_gltf
from elys.common.assets.store import AssetStore
from elys.common.errors import SceneError
from elys.common.scene_collapsing import collapse
from elys.common.scene_document import (
    SCENE_VERSION,
    AttractorSettings,
    ComponentChanges,
    ComponentValues,
    EntityNode,
    EntityRecord,
    SceneDocument,
    SceneSettings,
)
from elys.common.scene_expansion import expand, read_prefab, read_script_file
from elys.common.scene_files import PREFAB_SUFFIX
from elys.common.scene_framing import camera_components, framing_camera, scene_bounds, sun_components
from elys.common.scene_picture import PictureSettings
from elys.common.scene_reading import SCENE_SUFFIX, parse_scene, read_scene
from elys.common.scene_writing import format_scene, write_scene

__all__ = [
    "PREFAB_SUFFIX",
    "SCENE_SUFFIX",
    "SCENE_VERSION",
    "AttractorSettings",
    "ComponentChanges",
    "ComponentValues",
    "EntityNode",
    "EntityRecord",
    "OpenedScene",
    "PictureSettings",
    "SceneDocument",
    "SceneSettings",
    "camera_components",
    "collapse",
    "expand",
    "format_scene",
    "framing_camera",
    "open_scene",
    "parse_scene",
    "read_prefab",
    "read_scene",
    "read_script_file",
    "scene_bounds",
    "sun_components",
    "write_scene",
]


class OpenedScene(msgspec.Struct, frozen=True, kw_only=True):
    """A scene ready to be loaded: `path` is the absolute file it came from."""

    name: str
    path: Path
    settings: SceneSettings
    records: list[EntityRecord]


def open_scene(path: str | Path, assets: AssetStore) -> OpenedScene:
    """Opens a `.scene.json` or `.prefab.json` file, or a .gltf or .glb model with a sun and a camera if it has none.

    Raises:
        SceneError: the scene, or a file it names, is missing or wrong.
        AssetError: the model is.
    """
    path = Path(path)
    if path.suffix.lower() in MODEL_SUFFIXES:
        return _open_model(path, assets)
    if path.exists() and path.is_file() and path.suffix.lower() != ".json":
        raise SceneError(f"{path} is no scene; ELYS opens {SCENE_SUFFIX}, {PREFAB_SUFFIX}, .gltf and .glb files")
    document = read_scene(path)
    try:
        records = expand(document, directory=path.absolute().parent, assets=assets)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from error
    name = document.name or path.name.removesuffix(SCENE_SUFFIX).removesuffix(PREFAB_SUFFIX)
    return OpenedScene(name=name, path=path.absolute(), settings=document.settings, records=records)


def _open_model(path: Path, assets: AssetStore) -> OpenedScene:
    model, *others = import_gltf(path, assets)
    # An instance of its own file, so that what is saved of it names that file.
    records = [msgspec.structs.replace(model, prefab=path.absolute().as_posix()), *others]
    present = {name for record in records for name in record.components}
    if "Light" not in present:
        records.append(EntityRecord(name="Sun", components=sun_components()))
    if "Camera" not in present:
        records.append(EntityRecord(name="Camera", components=framing_camera(*scene_bounds(records, assets))))
    return OpenedScene(name=path.stem, path=path.absolute(), settings=SceneSettings(), records=records)

"""Content that no file holds, written beside the scene that is saved: meshes that code made, scripts of other machines.

tower.scene.json
tower.parts/meshes-1f0c93aa.glb     named by what is in it, so that no file is ever written over
tower.parts/race.py                 a script that is here already in other words goes into a folder of its own, tower.parts/2/
"""

from __future__ import annotations

import ast
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Final, TypeVar

import msgspec

from elys.common.assets.gltf_writing import GltfModel
from elys.common.assets.mesh import Mesh, decode_mesh
from elys.common.assets.prefabs import put_prefab
from elys.common.assets.scripts import SCRIPT_SUFFIX, ScriptBundle, decode_script
from elys.common.assets.store import PREFIX, AssetStore, reference_of, references_in, replace_file
from elys.common.errors import AssetError, SceneError
from elys.common.scene_document import EntityRecord
from elys.common.scene_expansion import read_prefab, read_script_file
from elys.common.scene_files import PARTS_SUFFIX, PIECES_FOLDER, PREFAB_SUFFIX
from elys.common.scene_reading import SCENE_SUFFIX

T = TypeVar("T")
_MOST_FOLDERS: Final = 1000


def parts_folder(scene: Path) -> Path:
    """Where content is kept that a scene's file names and no other file holds."""
    return scene.with_name(scene.name.removesuffix(SCENE_SUFFIX).removesuffix(".json") + PARTS_SUFFIX)


def keep_made_contents(records: Sequence[EntityRecord], scene: Path, assets: AssetStore) -> None:
    """Writes the meshes and scripts that records name and `assets` knows no file of, and tells `assets` where they are now.

    What `assets` has not got, or what is neither, is left: `collapse` refuses it by name. Raises SceneError where a file cannot
    be written.
    """
    lacking = _without_source(records, assets)
    if any(_decoded(decode_script, reference, assets) for reference in lacking):
        _learn_pieces(assets)
        lacking = _without_source(records, assets)
    folder = parts_folder(scene)
    decoded = ((reference, _decoded(decode_mesh, reference, assets)) for reference in lacking)
    meshes = {reference: mesh for reference, mesh in decoded if mesh is not None and len(mesh.indices)}
    try:
        if meshes:
            _keep_meshes(meshes, records, folder, assets)
        for reference in lacking:
            bundle = _decoded(decode_script, reference, assets)
            if bundle is not None:
                _keep_script(bundle, folder, assets)
    except OSError as error:
        raise SceneError(f"{folder} cannot be written: {error.strerror}") from error


def _without_source(records: Sequence[EntityRecord], assets: AssetStore) -> list[str]:
    named = references_in(msgspec.json.encode([record.components for record in records]))
    return [reference for reference in named if not assets.source(reference) and assets.has(reference)]


def _decoded(decode: Callable[[bytes], T], reference: str, assets: AssetStore) -> T | None:
    """Content as what it is decoded for; None where it is something else."""
    try:
        return decode(assets.get(reference))
    except (AssetError, RecursionError):
        return None


def _keep_meshes(meshes: Mapping[str, Mesh], records: Sequence[EntityRecord], folder: Path, assets: AssetStore) -> None:
    model = GltfModel("elys")
    names = _names_of(meshes, records)
    for reference, mesh in meshes.items():
        made = model.add("meshes", {"name": names[reference], "primitives": [model.primitive(mesh)]})
        model.add("nodes", {"name": names[reference], "mesh": made})
    model.add("scenes", {"nodes": list(range(len(meshes)))})
    path = folder / f"meshes-{reference_of(''.join(meshes).encode()).removeprefix(PREFIX)[:8]}.glb"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        file = io.BytesIO()
        model.write(file)
        replace_file(path, file.getvalue())
    for number, reference in enumerate(meshes):
        assets.put(assets.get(reference), kind="mesh", source=f"{path}#{number}/0")


def _names_of(references: Iterable[str], records: Sequence[EntityRecord]) -> Mapping[str, str]:
    """What to call meshes: as the first who has them."""
    owners = {
        reference: record.name
        for record in reversed(records)
        for reference in references_in(msgspec.json.encode(record.components))
    }
    return {reference: owners[reference] for reference in references}


def _keep_script(bundle: ScriptBundle, folder: Path, assets: AssetStore) -> None:
    """Writes a script's files where none of them is in other words; what brings prefabs or strange names is left.

    One that a file here had, and that was changed there since, stays that file's.
    """
    known = {source for source in map(assets.source, assets.references()) if _is_of(source, bundle)}
    if len(known) == 1:
        assets.put(msgspec.json.encode(bundle), kind="script", source=known.pop())
        return
    if bundle.prefabs or not all(map(_is_plain, bundle.files)):
        return
    places = (folder, *(folder / str(number) for number in range(2, _MOST_FOLDERS)))
    place = next((place for place in places if _takes(place, bundle.files)), None)
    if place is None:
        return
    for name, text in bundle.files.items():
        path = place / name
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(path, text.encode())
    read_script_file(place / bundle.main, bundle.behaviour, assets)


def _is_of(source: str, bundle: ScriptBundle) -> bool:
    name, _, behaviour = source.partition("#")
    path = Path(name)
    return (path.name, behaviour) == (bundle.main, bundle.behaviour) and not path.is_relative_to(PIECES_FOLDER)


def _takes(place: Path, files: Mapping[str, str]) -> bool:
    paths = {place / name: text.encode() for name, text in files.items()}
    return all(not path.exists() or (path.is_file() and path.read_bytes() == text) for path, text in paths.items())


def _is_plain(name: str) -> bool:
    """Whether a file's name, which may be a stranger's, leads into the folder it is put in, to a script."""
    path = PurePosixPath(name)
    is_below = not path.is_absolute() and ".." not in path.parts and "\\" not in name and ":" not in name
    return is_below and path.suffix == SCRIPT_SUFFIX and name.isprintable()


def _learn_pieces(assets: AssetStore) -> None:
    """Tells `assets` what ELYS itself brings: behaviours and prefabs."""
    for path in sorted(PIECES_FOLDER.rglob(f"*{SCRIPT_SUFFIX}")):
        classes = [node.name for node in ast.parse(path.read_text()).body if isinstance(node, ast.ClassDef)]
        for behaviour in ("", *classes):
            read_script_file(path, behaviour, assets)
    for path in sorted(PIECES_FOLDER.rglob(f"*{PREFAB_SUFFIX}")):
        put_prefab(read_prefab(path, assets), assets, source=str(path))

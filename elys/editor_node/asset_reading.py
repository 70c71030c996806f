"""Asset files as what a scene holds of them: content by reference, and entities to be made. Runs on any thread."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import msgspec

from elys.common.assets.gltf import import_model
from elys.common.assets.heights import read_heights
from elys.common.assets.images import read_image
from elys.common.assets.store import AssetKind, AssetStore, is_reference, reference_of, references_in
from elys.common.errors import AssetError, ElysError
from elys.common.scene import EntityNode, EntityRecord, SceneDocument, expand, read_scene
from elys.editor_node.asset_folder import AssetFile, AssetType

_KIND_OF: Final[dict[AssetType, AssetKind]] = {"image": "image", "light": "image", "heights": "heights"}
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class AssetContent:
    """What a file holds. `error` says in one sentence why it cannot be used; then there is nothing else."""

    file: AssetFile
    key: str = ""  # equal for equal content
    parts: dict[str, str] = field(default_factory=dict)  # reference by place in the file; "" for the file as a whole
    meshes: dict[str, str] = field(default_factory=dict)  # of a model: by the names of the entities that show them
    entity_count: int = 0
    error: str = ""
    note: str = ""  # why it has no thumbnail, where it can be used all the same

    @property
    def references(self) -> frozenset[str]:
        """All content that the file brings."""
        return frozenset(self.parts.values())

    @property
    def dragged(self) -> tuple[dict[str, str], AssetKind] | None:
        """What a field that takes assets can hold of it, by name: the file itself, or a mesh of a model."""
        kind = _KIND_OF.get(self.file.type)
        if kind is not None:
            return ({self.file.name: self.parts[""]}, kind) if "" in self.parts else None
        return (self.meshes, "mesh") if self.meshes else None


def read_asset(file: AssetFile, assets: AssetStore) -> tuple[AssetContent, tuple[EntityRecord, ...]]:
    """Reads a file: its content goes into `assets`, the entities to be made of it come back, parents first."""
    try:
        parts, records = _read(file, assets)
    except ElysError as error:
        return AssetContent(file=file, error=str(error).replace(str(file.path.absolute()), file.name)), ()
    except (OSError, ValueError, RecursionError, MemoryError) as error:  # a file may be anything
        _log.debug("%s cannot be read", file.path, exc_info=True)
        return AssetContent(file=file, error=f"{file.name} cannot be read: {error}"), ()
    key = reference_of(msgspec.json.encode((file.type, parts, records)))
    meshes = named_meshes(records) if file.type == "model" else {}
    return AssetContent(file=file, key=key, parts=parts, meshes=meshes, entity_count=len(records)), records


def named_meshes(records: Sequence[EntityRecord]) -> dict[str, str]:
    """The meshes that entities show, each once, by the name of the first that does; of several of one name numbers follow."""
    found: dict[str, str] = {}
    for record in records:
        mesh = record.components.get("MeshRenderer", {}).get("mesh", "")
        if not is_reference(mesh) or mesh in found.values():
            continue
        name, number = record.name, 2
        while name in found:
            name, number = f"{record.name} {number}", number + 1
        found[name] = mesh
    return found


def _read(file: AssetFile, assets: AssetStore) -> tuple[dict[str, str], tuple[EntityRecord, ...]]:
    match file.type:
        case "image":
            return {"": read_image(file.path, assets)}, ()
        case "light":
            reference = read_image(file.path, assets)
            values = {"Transform": {}, "Environment": {"kind": "image", "image": reference}}
            return {"": reference}, (EntityRecord(name=file.path.stem, components=values),)
        case "heights":
            return {"": read_heights(file.path, assets)}, ()
        case "model":
            return _read_model(file, assets)
        case "prefab":
            document = SceneDocument(entities=[EntityNode(prefab=str(file.path.absolute()))])
        case "scene":
            document = read_scene(file.path)
            if len(document.entities) == 1:
                document = SceneDocument(entities=[EntityNode(prefab=str(file.path.absolute()))])
    records = expand(document, directory=file.path.absolute().parent, assets=assets)
    if file.type == "scene" and len(document.entities) > 1:
        records = _under_one(file, records)
    parts = {reference: reference for record in records for reference in references_in(msgspec.json.encode(record))}
    return parts, tuple(records)


def _read_model(file: AssetFile, assets: AssetStore) -> tuple[dict[str, str], tuple[EntityRecord, ...]]:
    model = import_model(file.path, assets)
    parts = {f"{mesh}/{primitive}": reference for (mesh, primitive), reference in model.meshes.items()}
    parts |= {f"image/{index}": reference for index, reference in model.images.items()}
    parts |= {f"skin/{index}": reference for index, reference in model.skins.items()}
    if model.clips:
        parts["clips"] = model.clips
    if not model.records:
        raise AssetError(f"{file.name} has nothing in it")
    # An instance of its own file, so that what is saved of it names that file.
    root = msgspec.structs.replace(model.records[0], prefab=file.path.absolute().as_posix())
    return parts, (root, *model.records[1:])


def _under_one(file: AssetFile, records: Sequence[EntityRecord]) -> list[EntityRecord]:
    """The entities of a scene with several roots, below a new one called as the file."""
    root = EntityRecord(name=file.name.partition(".")[0], components={"Transform": {}})
    below = [
        msgspec.structs.replace(
            record,
            parent=record.parent + 1 if record.parent >= 0 else 0,
            references={key: row + 1 for key, row in record.references.items()},
        )
        for record in records
    ]
    return [root, *below]

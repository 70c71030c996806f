"""From a SceneDocument to records: prefabs put in place, overrides laid over them, files turned into content references."""

from __future__ import annotations

import difflib
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NoReturn

from elys.common.asset_kinds import expected_kind
from elys.common.assets.gltf import MODEL_SUFFIXES, ImportedModel, import_model
from elys.common.assets.heights import HEIGHT_SUFFIXES, read_height_mesh, read_heights
from elys.common.assets.images import IMAGE_SUFFIXES, read_image
from elys.common.assets.model_parts import part_of_model
from elys.common.assets.prefabs import put_prefab
from elys.common.assets.primitives import PRIMITIVES, is_primitive
from elys.common.assets.scripts import SCRIPT_SUFFIX, SELF, read_script
from elys.common.assets.sounds import SOUND_SUFFIXES, no_sound, read_sound
from elys.common.assets.store import AssetKind, AssetStore, is_reference
from elys.common.assets.texture import parse_texture, split_texture
from elys.common.components import Kind, declaration_of, laid_over
from elys.common.components.sound import BUILT_IN_SOUNDS
from elys.common.errors import AssetError, SceneError
from elys.common.scene_document import ComponentChanges, ComponentValues, EntityNode, EntityRecord, SceneDocument
from elys.common.scene_files import is_prefab_name, path_of
from elys.common.scene_naming import Names
from elys.common.scene_reading import read_scene
from elys.common.trust import is_trusted

_Scripts = tuple[tuple[Path, str], ...]  # files and behaviours
_HEIGHT_READERS: Final[Mapping[AssetKind, Callable[[Path, AssetStore], str]]] = {
    "heights": read_heights,
    "mesh": read_height_mesh,
}
_log = logging.getLogger(__name__)
MAX_EXPANDED: Final = 1_000_000  # a few prefabs inside one another could ask for any number of entities


def expand(document: SceneDocument, *, directory: str | Path, assets: AssetStore) -> list[EntityRecord]:
    """The entities of a document, parents first; what it names by file is read relative to `directory`, into `assets`.

    Prefabs are named by absolute path: in a world nothing tells any more which folder a name was relative to.

    Raises:
        SceneError: a prefab or asset is missing or wrong, prefabs contain themselves, an override or a reference names nobody;
            the sentence starts with the place in the document.
    """
    job = _Expansion(directory=Path(directory).absolute(), assets=assets)
    for index, node in enumerate(document.entities):
        _append_entity(job, node, -1, _Place(job.directory, f"entities[{index}]", ()))
    _resolve_references(job, 0, 0)
    return [
        EntityRecord(
            name=d.name,
            parent=d.parent,
            enabled=d.enabled,
            components=d.components,
            prefab=d.prefab,
            references=d.references,
        )
        for d in job.drafts
    ]


def read_prefab(path: Path, assets: AssetStore, *, reading: _Scripts = ()) -> list[EntityRecord]:
    """What stands in a prefab, its root first, with nothing in it that tells where the file lies.

    A script that names the prefab carries it along; `reading` are those that are just being read, innermost last. Where the
    prefab has the innermost itself, its source is SELF: whoever spawns it knows which that is.

    Raises:
        SceneError: it cannot be read, is no prefab, or what it names is missing.
    """
    job = _Expansion(directory=path.parent, assets=assets, reading=reading)
    _append_prefab(job, path.name, -1, _Place(path.parent, path.name, ()))
    return [
        EntityRecord(name=d.name, parent=d.parent, enabled=d.enabled, components=d.components, references=d.references)
        for d in job.drafts
    ]


def read_script_file(path: Path, behaviour: str, assets: AssetStore, *, reading: _Scripts = ()) -> str:
    """Puts a script with the files it imports and the prefabs it names into the store and returns its reference.

    Raises:
        AssetError: the file is missing, is no UTF-8 text, or draws in too much.
    """
    within = (*reading, (path, behaviour))
    return read_script(path, behaviour, assets, read_prefab=lambda prefab: read_prefab(prefab, assets, reading=within))


@dataclass(slots=True, kw_only=True)
class _Draft:
    """A record in the making."""

    name: str
    parent: int
    enabled: bool
    components: ComponentValues
    prefab: str = ""
    references: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Reference:
    """A field of a draft that names an entity of the file it stands in."""

    row: int
    component: str
    field_name: str
    text: str
    place: _Place


@dataclass(slots=True, kw_only=True)
class _Expansion:
    """What the steps of one expansion share; every file is read once."""

    directory: Path
    assets: AssetStore
    drafts: list[_Draft] = field(default_factory=list)
    documents: dict[Path, SceneDocument] = field(default_factory=dict)
    models: dict[Path, ImportedModel] = field(default_factory=dict)
    files: dict[tuple[str, Path], str] = field(default_factory=dict)  # what was read, and as what
    references: list[_Reference] = field(default_factory=list)  # still to be looked up
    reading: _Scripts = ()  # those that carry what is expanded


@dataclass(frozen=True, slots=True)
class _Place:
    """Where in the files we are: the directory that references are relative to, words for errors, the prefabs we are in."""

    directory: Path
    words: str
    inside: tuple[Path, ...]

    def at(self, words: str) -> _Place:
        return _Place(self.directory, f"{self.words}.{words}", self.inside)


def _append_entity(job: _Expansion, node: EntityNode, parent: int, place: _Place) -> None:
    """Appends the drafts of an entity and all below it."""
    row = len(job.drafts)
    if row >= MAX_EXPANDED:
        _fail(place, f"more than {MAX_EXPANDED} entities; a prefab is instanced too often")
    components = _resolved(job, node.components, place.at("components"))
    if node.prefab:
        _append_prefab(job, node.prefab, parent, place)
        root = job.drafts[row]
        root.name = node.name or root.name
        root.enabled = root.enabled and node.enabled
        root.prefab = _path(place.directory, node.prefab, place).as_posix()
        _lay_over(job, row, components, place.at("components"))
        _apply_overrides(job, row, node, place)
    else:
        job.drafts.append(_Draft(name=node.name or "Entity", parent=parent, enabled=node.enabled, components={}))
        _lay_over(job, row, components, place.at("components"))
    for index, child in enumerate(node.children):
        _append_entity(job, child, row, place.at(f"children[{index}]"))


def _append_prefab(job: _Expansion, prefab: str, parent: int, place: _Place) -> None:
    here = place.at("prefab")
    path = _path(place.directory, prefab, here)
    if path.suffix.lower() in MODEL_SUFFIXES:
        _append_model(job, _model(job, path, here), parent)
    elif path.suffix.lower() == ".json":
        if path in place.inside:
            chain = " -> ".join(p.name for p in (*place.inside[place.inside.index(path) :], path))
            _fail(here, f"prefabs contain themselves: {chain}")
        document = _prefab_document(job, path, here)
        first, waiting = len(job.drafts), len(job.references)
        _append_entity(job, document.entities[0], parent, _Place(path.parent, here.words, (*place.inside, path)))
        _resolve_references(job, first, waiting)  # by the prefab's own names, before anybody lays others over them
    else:
        _fail(here, f"{prefab} is no prefab; prefabs are .prefab.json, .scene.json, .gltf or .glb files")


def _append_model(job: _Expansion, model: ImportedModel, parent: int) -> None:
    start = len(job.drafts)
    for record in model.records:
        job.drafts.append(
            _Draft(
                name=record.name,
                parent=parent if record.parent < 0 else start + record.parent,
                enabled=record.enabled,
                components={name: dict(values) for name, values in record.components.items()},
                references={key: start + target for key, target in record.references.items()},
            )
        )


def _prefab_document(job: _Expansion, path: Path, place: _Place) -> SceneDocument:
    if path not in job.documents:
        try:
            job.documents[path] = read_scene(path)
        except SceneError as error:
            _fail(place, str(error), error)
    document = job.documents[path]
    if len(document.entities) != 1:
        _fail(place, f"{path.name} has {len(document.entities)} root entities; a prefab has exactly one")
    return document


def _model(job: _Expansion, path: Path, place: _Place) -> ImportedModel:
    if path not in job.models:
        try:
            job.models[path] = import_model(path, job.assets)
        except AssetError as error:
            _fail(place, str(error), error)
    return job.models[path]


def _lay_over(job: _Expansion, row: int, changes: ComponentChanges, place: _Place) -> None:
    draft = job.drafts[row]
    for name, values in changes.items():
        named = {f.name for f in declaration_of(name).fields if f.kind is Kind.ENTITY}
        for key in named if values is None else named & values.keys():
            draft.references.pop(f"{name}.{key}", None)
        if values is None:
            draft.components.pop(name, None)
            continue
        plain = {key: value for key, value in values.items() if key not in named}
        draft.components[name] = laid_over(name, draft.components.get(name, {}), plain)
        job.references += [
            _Reference(row, name, key, text, place.at(f"{name}.{key}"))
            for key, text in values.items()
            if key in named and text
        ]


def _resolve_references(job: _Expansion, first: int, waiting: int) -> None:
    """Finds whom the references from place `waiting` on name, among the drafts from `first` on."""
    if len(job.references) == waiting:
        return
    names = Names([(draft.name, draft.parent - first) for draft in job.drafts[first:]])
    for reference in job.references[waiting:]:
        try:
            found = names.find(reference.text)
        except SceneError as error:
            _fail(reference.place, str(error), error)
        job.drafts[reference.row].references[f"{reference.component}.{reference.field_name}"] = first + found
    del job.references[waiting:]


def _apply_overrides(job: _Expansion, root: int, node: EntityNode, place: _Place) -> None:
    if not node.overrides:
        return
    rows_by_path: dict[str, list[int]] = {}
    paths: dict[int, str] = {root: ""}
    for row in range(root + 1, len(job.drafts)):
        above = paths[job.drafts[row].parent]
        paths[row] = f"{above}/{job.drafts[row].name}" if above else job.drafts[row].name
        rows_by_path.setdefault(paths[row], []).append(row)
    for path, changes in node.overrides.items():
        here = place.at(f'overrides["{path}"]')
        rows = rows_by_path.get(path, [])
        if not rows:
            close = difflib.get_close_matches(path, list(rows_by_path), n=1, cutoff=0.5)
            remedy = f"; did you mean '{close[0]}'?" if close else ""
            _fail(here, f"the prefab has nobody at this path{remedy}")
        if len(rows) > 1:
            _fail(here, f"the prefab has {len(rows)} entities at this path; give siblings different names")
        _lay_over(job, rows[0], _resolved(job, changes, here), here)


def _resolved(job: _Expansion, changes: ComponentChanges, place: _Place) -> ComponentChanges:
    """The same values, with content references where they name files."""
    resolved: ComponentChanges = {}
    for name, values in changes.items():
        if values is None:
            resolved[name] = None
            continue
        here = place.at(name)
        fields = {f.name for f in declaration_of(name).fields if f.kind is Kind.ASSET}
        resolved[name] = {
            key: _asset(job, value, key, here.at(key))
            if key in fields and value
            else _with_prefabs(job, value, here.at(key))
            if (name, key) == ("Script", "values") and isinstance(value, dict)
            else value
            for key, value in values.items()
        }
    return resolved


def _with_prefabs(job: _Expansion, values: dict[str, Any], place: _Place) -> dict[str, Any]:
    """What a script's fields say, with the content of prefabs that they name."""
    return {
        key: _carried_prefab(job, value, place.at(key)) if is_prefab_name(value) else value
        for key, value in values.items()
    }


def _carried_prefab(job: _Expansion, name: str, place: _Place) -> str:
    """The content of a prefab that a script's field names."""
    path = _path(place.directory, name, place)
    if ("prefab", path) not in job.files:
        try:
            records = read_prefab(path, job.assets, reading=job.reading)
        except SceneError as error:
            _fail(place, str(error), error)
        job.files["prefab", path] = put_prefab(records, job.assets, source=str(path))
    return job.files["prefab", path]


def _asset(job: _Expansion, value: str, field_name: str, place: _Place) -> str:
    """The content reference for what an ASSET field says; a texture keeps how it is laid over the mesh."""
    options = ""
    if expected_kind(field_name) == "image":
        value, options = split_texture(value)
        try:
            parse_texture(value + options)
        except AssetError as error:
            _fail(place, str(error), error)
    if field_name == "source" and not is_reference(value):
        return _script(job, value, place)
    if value in BUILT_IN_SOUNDS if field_name == "sound" else field_name != "heights" and is_primitive(value):
        return value
    reference = value if is_reference(value) else _file_asset(job, value, field_name, place)
    if not job.assets.has(reference):
        _fail(place, f"there is no asset {value}; name the file it comes from")
    expected = expected_kind(field_name)
    kind = job.assets.kind(reference)
    if expected and kind and kind != expected:
        _fail(place, f"{value} is a {kind}, expected a {expected}")
    return reference + options


def _script(job: _Expansion, value: str, place: _Place) -> str:
    """The content of a script with what it imports; the name itself where there is none, and whoever runs it says so."""
    name, _, behaviour = value.partition("#")
    path = _path(place.directory, name, place)
    if job.reading and (path, behaviour) == job.reading[-1]:
        return SELF
    if (path, behaviour) in job.reading:
        _fail(place, f"{path.name} carries a prefab that carries it again; only a script's own prefab may have it")
    try:
        _require_script(job, path)
        return read_script_file(path, behaviour, job.assets, reading=job.reading)
    except AssetError as error:
        _log.warning("%s", error)
        return value


def _require_script(job: _Expansion, path: Path) -> None:
    """Raises AssetError for a file that a scene has no business with: what it names becomes part of recordings, unasked."""
    if path.suffix != SCRIPT_SUFFIX:
        raise AssetError(f"{path} is not read as a script: scripts are files that end with {SCRIPT_SUFFIX}")
    resolved = path.resolve()
    if not resolved.is_relative_to(job.directory.resolve().parent) and not is_trusted(str(resolved)):
        raise AssetError(
            f"the script {path} is not read, as it lies neither in the scene's folder nor beside that: if you know who wrote the "
            f"scene, say `elys trust {resolved.parent}` once"
        )


def _file_asset(job: _Expansion, value: str, field_name: str, place: _Place) -> str:
    name, _, fragment = value.partition("#")
    suffix = Path(name).suffix.lower()
    if suffix in MODEL_SUFFIXES:
        model = _model(job, _path(place.directory, name, place), place)
        try:
            return part_of_model(model, Path(name).name, fragment)
        except AssetError as error:
            _fail(place, str(error), error)
    expected = expected_kind(field_name)
    if expected is not None and expected in _HEIGHT_READERS and suffix in HEIGHT_SUFFIXES:
        return _read_once(job, expected, _HEIGHT_READERS[expected], _path(place.directory, name, place), place)
    if expected == "sound":
        if suffix not in SOUND_SUFFIXES:
            _fail(place, no_sound(value))
        return _read_once(job, "sound", read_sound, _path(place.directory, name, place), place)
    if suffix in IMAGE_SUFFIXES:
        return _read_once(job, "image", read_image, _path(place.directory, name, place), place)
    if expected == "heights":
        _fail(place, f"{value!r} is no file of heights; those are {' and '.join(HEIGHT_SUFFIXES)} files")
    close = difflib.get_close_matches(value.lower(), list(PRIMITIVES), n=1, cutoff=0.6)
    remedy = f"did you mean '{close[0]}'?" if close else f"built in are {', '.join(PRIMITIVES)}"
    return _fail(place, f"{value!r} is no mesh that is built in, no model and no image; {remedy}")


def _read_once(
    job: _Expansion, kind: AssetKind, read: Callable[[Path, AssetStore], str], path: Path, place: _Place
) -> str:
    if (kind, path) not in job.files:
        try:
            job.files[kind, path] = read(path, job.assets)
        except AssetError as error:
            _fail(place, str(error), error)
    return job.files[kind, path]


def _path(directory: Path, name: str, place: _Place) -> Path:
    if "\0" in name:
        _fail(place, f"{name!r} is not a path")
    return path_of(name, directory)


def _fail(place: _Place, problem: str, cause: Exception | None = None) -> NoReturn:
    raise SceneError(f"{place.words}: {problem}") from cause

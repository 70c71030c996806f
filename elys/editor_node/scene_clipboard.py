"""Entities as text and back: what is copied is a scene file that other editors, and `elys run`, take as well.

    entities --copy_text--> text on the clipboard --read_fragment--> Fragment: records, and what became of the names in it

Content that no file here is known for keeps its content reference; prefabs are named by absolute path.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec

from elys.common.assets.store import PREFIX, AssetStore, references_in
from elys.common.components import Kind, declaration_of
from elys.common.errors import AssetError, ElysError, SceneError
from elys.common.scene import (
    EntityNode,
    EntityRecord,
    SceneDocument,
    SceneSettings,
    collapse,
    expand,
    format_scene,
    parse_scene,
)
from elys.common.scene_naming import Names, take_references
from elys.editor_node.edits import records_of
from elys.editor_node.scene_mirror import EditorScene

_ROOT: Final = Path("/")
_HIDDEN_PREFIX: Final = (
    "content="  # stands for PREFIX while a document is made, where content must have come from files
)
_STAND_IN: Final = "\ufffc outside "  # the character that stands for what cannot be shown: no name begins so


class Copied(NamedTuple):
    """A text, and sentences about what could not go along."""

    text: str
    losses: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fragment:
    """What a text holds, ready for a Spawn: `losses` are sentences about what did not come along."""

    records: tuple[EntityRecord, ...]
    losses: tuple[str, ...]
    assets: AssetStore = field(default_factory=AssetStore)  # what was read from the files it names

    @property
    def content(self) -> list[str]:
        """References of the content that it needs."""
        return references_in(msgspec.json.encode(self.records))


def copy_text(scene: EditorScene, tops: Sequence[int]) -> Copied:
    """Entities, none below another one, with all below them as the text of a scene file.

    Raises:
        SceneError: they are nested deeper than a file may be, or siblings of the same name are referred to.
    """
    records, entities = _records(scene, tops)
    outside, losses = _take_outside_names(scene, records, entities)
    document = _document([_with_content(record, PREFIX, _HIDDEN_PREFIX) for record in records])
    document.entities = [_restored(node) for node in document.entities]
    losses += _put_outside_names(document, records, outside)
    return Copied(format_scene(document), tuple(losses))


def read_fragment(text: str, scene: EditorScene, *, directory: Path) -> Fragment:
    """What a text from the clipboard holds; files it names are looked for from `directory` on.

    Raises:
        SceneError: it is no scene, an empty one, or one that names what is not there; the sentence says which.
    """
    if not text.strip():
        raise SceneError("the clipboard is empty: copy entities first")
    try:
        document = parse_scene(text)
    except SceneError as error:
        raise SceneError(f"the clipboard holds no entities of a scene: {error}") from error
    if not document.entities:
        raise SceneError("the scene on the clipboard has no entities")
    assets = _BelievedAssets()
    try:
        stands_for, losses = _point_outside(document, scene, directory=directory, assets=assets)
        records = expand(document, directory=directory, assets=assets)
    except (SceneError, AssetError) as error:
        raise SceneError(f"what is on the clipboard cannot be pasted: {error}") from error
    return Fragment(records=tuple(_with_entities(records, stands_for)), losses=tuple(losses), assets=assets)


class _BelievedAssets(AssetStore):
    """Takes content references as they are: whether the host has the content is asked when it is known what is needed."""

    def has(self, reference: str) -> bool:
        return True


def _records(scene: EditorScene, tops: Sequence[int]) -> tuple[list[EntityRecord], dict[int, int]]:
    """The records of all in one list, and the place of each entity in it."""
    records: list[EntityRecord] = []
    place_of: dict[int, int] = {}
    for top in tops:
        start = len(records)
        below, entities = records_of(scene, top)
        place_of.update((entity, start + row) for row, entity in enumerate(entities))
        for record in below:
            parent = record.parent + start if record.parent >= 0 else -1
            within = {key: start + row for key, row in record.references.items()}
            records.append(msgspec.structs.replace(record, parent=parent, references=within))
    for row, record in enumerate(records):
        across = take_references(record.components, place_of)
        if across:
            records[row] = msgspec.structs.replace(record, references={**record.references, **across})
    return records, place_of


def _take_outside_names(
    scene: EditorScene, records: Sequence[EntityRecord], place_of: dict[int, int]
) -> tuple[dict[tuple[int, str, str], str], list[str]]:
    """Takes what names others by id out of the records: the names of those by which they will be found, and what is lost."""
    named: dict[tuple[int, str, str], str] = {}
    losses: list[str] = []
    everybody: tuple[Names, dict[int, int]] | None = None
    here = Names([(record.name, record.parent) for record in records])
    for row, record in enumerate(records):
        for component, values in record.components.items():
            for name in _entity_fields(component):
                target = values.pop(name, 0)
                if not target:
                    continue
                everybody = everybody or _names_of(scene)
                try:
                    text = everybody[0].name_of(everybody[1][target])
                except (SceneError, KeyError):
                    losses.append(f"{component}.{name} of '{record.name}' is left out: nobody can be named by it")
                    continue
                if _is_found(here, text):
                    losses.append(
                        f"{component}.{name} of '{record.name}' is left out: a copied entity is called '{text}' as well"
                    )
                else:
                    named[row, component, name] = text
    return named, losses


def _names_of(scene: EditorScene) -> tuple[Names, dict[int, int]]:
    """The names of all entities, and the place of each among them."""
    ordered = scene.mirror.in_order()
    place_of = {entity.id: place for place, entity in enumerate(ordered)}
    return Names([(entity.name, place_of.get(entity.parent, -1)) for entity in ordered]), place_of


def _is_found(names: Names, text: str) -> bool:
    try:
        names.find(text)
    except SceneError as error:
        return "entities are called" in str(error)  # several: it would be ambiguous
    return True


def _document(records: Sequence[EntityRecord]) -> SceneDocument:
    """With instances of prefabs as such where their files can be read, else written out in full."""
    try:
        return _collapsed(records)
    except ElysError:
        if not any(record.prefab for record in records):
            raise
        return _collapsed([msgspec.structs.replace(record, prefab="") for record in records])


def _collapsed(records: Sequence[EntityRecord]) -> SceneDocument:
    return collapse(records, name="", settings=SceneSettings(), directory=_ROOT, assets=AssetStore())


def _with_content(record: EntityRecord, before: str, after: str) -> EntityRecord:
    components = {name: _renamed_content(values, before, after) for name, values in record.components.items()}
    return msgspec.structs.replace(record, components=components)


def _renamed_content(values: dict[str, Any], before: str, after: str) -> dict[str, Any]:
    return {
        name: after + value.removeprefix(before) if isinstance(value, str) and value.startswith(before) else value
        for name, value in values.items()
    }


def _restored(node: EntityNode) -> EntityNode:
    """The node and all below it with content references again, and with prefabs by absolute path."""
    if node.prefab:
        node.prefab = str(_ROOT / node.prefab)
    for changes in (node.components, *node.overrides.values()):
        for name, values in changes.items():
            if values is not None:
                changes[name] = _renamed_content(values, _HIDDEN_PREFIX, PREFIX)
    node.children = [_restored(child) for child in node.children]
    return node


def _put_outside_names(
    document: SceneDocument, records: Sequence[EntityRecord], named: dict[tuple[int, str, str], str]
) -> list[str]:
    """Writes names into the nodes; what is part of a prefab's own entities has no node of its own, and is lost."""
    if not named:
        return []
    children: dict[int, list[int]] = {}
    for row, record in enumerate(records):
        children.setdefault(record.parent, []).append(row)
    node_of: dict[int, EntityNode] = {}
    waiting = list(zip(children.get(-1, []), document.entities, strict=True))
    while waiting:
        row, node = waiting.pop()
        node_of[row] = node
        if not node.prefab:
            waiting.extend(zip(children.get(row, []), node.children, strict=True))
    losses: list[str] = []
    for (row, component, name), text in named.items():
        found = node_of.get(row)
        if found is None:
            losses.append(f"{component}.{name} of '{records[row].name}' is left out: it is part of a prefab")
            continue
        found.components = {**found.components, component: {**(found.components.get(component) or {}), name: text}}
    return losses


def _point_outside(
    document: SceneDocument, scene: EditorScene, *, directory: Path, assets: AssetStore
) -> tuple[list[int], list[str]]:
    """Adds a root of an unheard-of name for each entity of the scene that the document names but does not hold.

    Returns the entities that those roots stand for, in order, and what is lost because nobody is called so.
    """
    named = [
        (node, component, name)
        for node in _nodes(document.entities)
        for component, values in node.components.items()
        for name in _entity_fields(component)
        if values and values.get(name)
    ]
    if not named:
        return [], []
    plain = SceneDocument(entities=[_without_names(node) for node in document.entities])
    records = expand(plain, directory=directory, assets=assets)  # with all that prefabs bring
    here = Names([(record.name, record.parent) for record in records])
    everybody, place_of = _names_of(scene)
    entity_at = {place: entity for entity, place in place_of.items()}
    stands_for: list[int] = []
    losses: list[str] = []
    for node, component, name in named:
        values = dict(node.components[component] or {})
        text = values.pop(name)
        if _is_found(here, text):
            continue
        try:
            entity = entity_at[everybody.find(text)]
        except SceneError as error:
            losses.append(f"{component}.{name} of '{node.name}' is left out: {error}")
        else:
            stands_for.append(entity)
            values[name] = f"/{_STAND_IN}{len(stands_for)}"
            document.entities.append(EntityNode(name=f"{_STAND_IN}{len(stands_for)}"))
        node.components = {**node.components, component: values}
    return stands_for, losses


def _with_entities(records: Sequence[EntityRecord], stands_for: Sequence[int]) -> list[EntityRecord]:
    """The records without their last ones, which stand for entities of the scene: who names those names the entities."""
    first = len(records) - len(stands_for)
    pointed = []
    for record in records[:first]:
        references = {key: row for key, row in record.references.items() if row < first}
        for key, row in record.references.items():
            if row >= first:
                component, _, name = key.partition(".")
                record.components.setdefault(component, {})[name] = stands_for[row - first]
        pointed.append(msgspec.structs.replace(record, references=references))
    return pointed


def _nodes(nodes: Iterable[EntityNode]) -> Iterable[EntityNode]:
    """All nodes, parents before children."""
    waiting = list(nodes)
    for node in waiting:
        yield node
        waiting.extend(node.children)


def _without_names(node: EntityNode) -> EntityNode:
    """A copy of a node and all below it that names no other entity."""
    components = {
        component: values
        if values is None
        else {name: value for name, value in values.items() if name not in _entity_fields(component)}
        for component, values in node.components.items()
    }
    children = [_without_names(child) for child in node.children]
    return EntityNode(name=node.name, prefab=node.prefab, components=components, children=children)


def _entity_fields(component: str) -> list[str]:
    return [field.name for field in declaration_of(component).fields if field.kind is Kind.ENTITY]

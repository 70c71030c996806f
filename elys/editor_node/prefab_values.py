"""What a prefab says of the entities of its instances, so that an inspector can show what differs and take it back.

The bus tells of which file an instance's root came, not what stands in it; the file is read here, once and again when it has
changed, on a thread: a large model takes a while. Where it cannot be read (the simulation is on another machine whose folders
are not here) there is nothing to compare with, and `problem` says so.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Coroutine, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import msgspec

from elys.bus.asset_service import open_asset_cache
from elys.common.components import Component, component_from, declarations
from elys.common.errors import ElysError
from elys.common.scene import EntityNode, EntityRecord, SceneDocument, expand
from elys.editor_node.field_values import is_close
from elys.editor_node.scene_mirror import EditorScene

NamePath = tuple[str, ...]  # of names from an instance's root, which is () itself
_OWN_OF_A_ROOT: Final = (
    "position",
    "rotation",
)  # of its Transform: where an instance stands is nobody's business but its own


@dataclass(frozen=True, slots=True, kw_only=True)
class PrefabEntity:
    """One entity of an instance as its prefab has it."""

    root: int  # the instance's topmost entity
    path: NamePath
    file: str
    components: Mapping[str, Component] = field(default_factory=dict)
    problem: str = ""  # why nothing is known of it

    def changed_fields(self, now: Component) -> dict[str, Any]:
        """The fields in which a component differs from the prefab's, with what they are there; none if it has none there."""
        name = type(now).__name__
        was = self.components.get(name)
        if was is None or was == now:
            return {}
        own = _OWN_OF_A_ROOT if not self.path and name == "Transform" else ()
        pairs = [(f.name, getattr(was, f.name), getattr(now, f.name)) for f in declarations()[name].fields]
        return {key: value for key, value, is_now in pairs if key not in own and not is_close(value, is_now)}

    def changes(self, now: Mapping[str, Component]) -> dict[str, dict[str, Any] | None]:
        """What has to be laid over an entity's components to be the prefab's again; None takes a component away."""
        found: dict[str, dict[str, Any] | None] = {name: None for name in now if name not in self.components}
        for name, was in self.components.items():
            if name not in now:
                found[name] = msgspec.structs.asdict(was)
            elif changed := self.changed_fields(now[name]):
                found[name] = changed
        return {} if self.problem else found


@dataclass(slots=True, kw_only=True)
class _File:
    """A prefab as it was read: its entities by path, and where else they point."""

    modified: float
    records: Mapping[NamePath, EntityRecord] = field(default_factory=dict)
    paths: tuple[NamePath, ...] = ()  # of all its entities in order, for references
    problem: str = ""


class PrefabValues:
    """Reads prefabs as they are asked for; until one is read there is nothing to compare with."""

    def __init__(
        self,
        scene: EditorScene,
        *,
        start: Callable[[Coroutine[Any, Any, None]], object],
        on_change: Callable[[], None] = lambda: None,
    ) -> None:
        """`start` runs a coroutine beside; `on_change` is called when another file was read."""
        self._scene = scene
        self._start = start
        self._on_change = on_change
        self._files: dict[str, _File] = {}
        self._reading: set[str] = set()

    def of(self, entity: int) -> PrefabEntity | None:
        """What the prefab says of an entity that is part of an instance; None for others, and while it is being read."""
        scene = self._scene
        chain = [entity, *scene.ancestors_of(entity)] if scene.exists(entity) else []
        problem: PrefabEntity | None = None
        # The outermost instance that the entity came with decides: what stands in it says how inner ones are changed.
        for depth in range(len(chain) - 1, -1, -1):
            root = chain[depth]
            file = scene.prefab_of(root)
            if not file or (found := self._file(file)) is None:
                continue
            path = tuple(scene.name_of(one) for one in reversed(chain[:depth]))
            if found.problem:
                problem = PrefabEntity(root=root, path=path, file=file, problem=found.problem)
            elif path in found.records:
                components = self._components(root, found, found.records[path])
                return PrefabEntity(root=root, path=path, file=file, components=components)
        return problem

    def _components(self, root: int, file: _File, record: EntityRecord) -> dict[str, Component]:
        values = {name: dict(given) for name, given in record.components.items()}
        for key, row in record.references.items():
            component, _, field_name = key.partition(".")
            values.setdefault(component, {})[field_name] = self._entity_at(root, file.paths[row])
        return {name: component_from(name, given) for name, given in values.items()}

    def _entity_at(self, root: int, path: NamePath) -> int:
        """The entity at a path below an instance's root; 0 if nobody is called so any more."""
        current = root
        for name in path:
            children = self._scene.children_of(current)
            current = next((child for child in children if self._scene.name_of(child) == name), 0)
            if not current:
                return 0
        return current

    def _file(self, name: str) -> _File | None:
        try:
            modified = Path(name).stat().st_mtime
        except (OSError, ValueError):
            modified = -1.0
        found = self._files.get(name)
        if (found is None or found.modified != modified) and name not in self._reading:
            self._reading.add(name)
            self._start(self._read(name, modified))
        return found

    async def _read(self, name: str, modified: float) -> None:
        try:
            self._files[name] = await asyncio.to_thread(_read_file, name, modified)
        finally:
            self._reading.discard(name)
        self._on_change()


def _read_file(name: str, modified: float) -> _File:
    try:
        document = SceneDocument(entities=[EntityNode(prefab=name)])
        records = expand(document, directory=Path(name).parent, assets=open_asset_cache())
    except (ElysError, OSError) as error:
        return _File(modified=modified, problem=str(error).removeprefix("entities[0].prefab: "))
    paths: list[NamePath] = []
    for record in records:
        paths.append((*paths[record.parent], record.name) if record.parent >= 0 else ())
    # Who is not alone at a path cannot be told from its namesakes.
    counts = Counter(paths)
    alone = {path: record for path, record in zip(paths, records, strict=True) if counts[path] == 1}
    return _File(modified=modified, records=alone, paths=tuple(paths))

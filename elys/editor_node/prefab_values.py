"""What a prefab says of the entities of its instances, so that an inspector can show what differs and take it back.

The bus tells of which file an instance's root came; what stands in it the host is asked, once and again every now and then while
somebody looks, as the file may change. Where the host cannot tell, a recording that is played far from its files say, the file is
read here; where it is not here either there is nothing to compare with, and `problem` says so.
"""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import msgspec

from elys.bus import topics
from elys.bus.messages.scene import PrefabContent, PrefabRequest
from elys.bus.prefab_service import modified_at, read_prefab
from elys.bus.session import Session
from elys.common.components import Component, component_from, declarations
from elys.common.errors import BusError, RequestError
from elys.common.scene import EntityRecord
from elys.editor_node.field_values import is_close
from elys.editor_node.scene_mirror import EditorScene

LOOK_INTERVAL: Final = 2.0  # [s] between two questions whether a prefab that is looked at has changed
ANSWER_TIMEOUT: Final = 20.0  # [s] a large model takes a while

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

    modified: float  # -1 where it could not be read
    is_local: bool = False  # read here, as the host could not tell
    records: Mapping[NamePath, EntityRecord] = field(default_factory=dict)
    paths: tuple[NamePath, ...] = ()  # of all its entities in order, for references
    problem: str = ""


class PrefabValues:
    """Asks for prefabs as they are looked at; until one is known there is nothing to compare with."""

    def __init__(
        self,
        scene: EditorScene,
        session: Session,
        *,
        on_change: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`on_change` is called when another file is known."""
        self._scene = scene
        self._session = session
        self._on_change = on_change
        self._clock = clock
        self._files: dict[str, _File] = {}
        self._asked: dict[str, float] = {}  # when, last
        self._asking: set[str] = set()
        session.on_link(lambda connected: self._asked.clear())  # another host, or another disk

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
        asked, now = self._asked.get(name), self._clock()
        if name not in self._asking and (asked is None or now - asked >= LOOK_INTERVAL):
            self._asked[name] = now
            self._asking.add(name)
            self._session.start(self._ask(name))
        return self._files.get(name)

    async def _ask(self, name: str) -> None:
        before = self._files.get(name)
        try:
            found = await self._told(name, before)
        finally:
            self._asking.discard(name)
        if found is not None and found != before:
            self._files[name] = found
            self._on_change()

    async def _told(self, name: str, before: _File | None) -> _File | None:
        """What the host says, else what stands in the file here, else why neither; None for nothing new."""
        known = before.modified if before is not None and not before.is_local else -1.0
        request = PrefabRequest(path=name, known=known)
        try:
            content = await self._session.request(topics.PREFAB, request, timeout=ANSWER_TIMEOUT)
        except BusError as error:
            return await self._read_here(name, before, reason=str(error))
        return None if content.records is None else _file_of(content)

    async def _read_here(self, name: str, before: _File | None, *, reason: str) -> _File | None:
        modified = await asyncio.to_thread(modified_at, name)
        if before is not None and before.is_local and before.modified == modified >= 0.0:
            return None
        try:
            return _file_of(await asyncio.to_thread(read_prefab, name), is_local=True)
        except RequestError:
            return _File(modified=-1.0, is_local=True, problem=reason)


def _file_of(content: PrefabContent, *, is_local: bool = False) -> _File:
    paths: list[NamePath] = []
    records = content.records or ()
    for record in records:
        paths.append((*paths[record.parent], record.name) if record.parent >= 0 else ())
    # Who is not alone at a path cannot be told from its namesakes.
    counts = Counter(paths)
    alone = {path: record for path, record in zip(paths, records, strict=True) if counts[path] == 1}
    return _File(modified=content.modified, is_local=is_local, records=alone, paths=tuple(paths))

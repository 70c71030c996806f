"""What this editor alone knows of entities: which are locked against a careless hand, and which are not to be seen here.

Neither is part of the scene: others neither see nor save it. What is below a marked entity is marked as well.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Literal

from elys.bus.mirror import SceneMirror

Mark = Literal["locked", "hidden"]


class EntityMarks:
    """Two sets of entities. `on_change` is called when one of them changes."""

    def __init__(self, mirror: SceneMirror, *, on_change: Callable[[], None] = lambda: None) -> None:
        self.version = 0  # rises at every change
        self._mirror = mirror
        self._tell = on_change
        self._marked: dict[str, dict[int, None]] = {"locked": {}, "hidden": {}}  # in the order in which they were

    def own(self, mark: Mark) -> tuple[int, ...]:
        """Those that were marked themselves."""
        return tuple(self._marked[mark])

    def has(self, mark: Mark, entity: int) -> bool:
        """Whether the entity was marked itself."""
        return entity in self._marked[mark]

    def is_marked(self, mark: str, entity: int) -> bool:
        """Whether the entity, or one above it, is marked."""
        marked = self._marked[mark]
        if not marked:
            return False
        entities = self._mirror.entities
        while entity:
            if entity in marked:
                return True
            found = entities.get(entity)
            entity = found.parent if found is not None else 0
        return False

    def set(self, mark: Mark, entities: Iterable[int], is_marked: bool) -> None:
        """Marks entities, or takes the mark from them."""
        marked = self._marked[mark]
        before = len(marked)
        for entity in entities:
            if is_marked and entity in self._mirror.entities:
                marked[entity] = None
            elif not is_marked:
                marked.pop(entity, None)
        if len(marked) != before:
            self._on_change()

    def _on_change(self) -> None:
        self.version += 1
        self._tell()

    def clear(self, mark: Mark) -> None:
        """Takes the mark from all."""
        self.set(mark, self.own(mark), False)

    def forget(self, removed: Iterable[int]) -> None:
        """Drops those that are gone for good: another scene, whose ids mean others."""
        for marked in self._marked.values():
            for entity in removed:
                marked.pop(entity, None)

    def remap(self, new_ids: Mapping[int, int]) -> None:
        """Follows entities that came back under other ids."""
        for name, marked in self._marked.items():
            if not marked.keys().isdisjoint(new_ids):
                self._marked[name] = {new_ids.get(entity, entity): None for entity in marked}
                self._on_change()

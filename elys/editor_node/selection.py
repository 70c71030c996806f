"""Which entities are selected, in the order in which they were, and which of them came last: the primary one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping


class Selection:
    """Entities in order; the last is the primary one, whose values the inspector shows and on which the gizmo stands."""

    def __init__(self) -> None:
        self._entities: dict[int, None] = {}  # a dict keeps the order and finds fast
        self.anchor = 0  # where a range that is extended with shift starts
        self.version = 0  # rises at every change

    def __len__(self) -> int:
        return len(self._entities)

    def __iter__(self) -> Iterator[int]:
        return iter(self._entities)

    def __contains__(self, entity: int) -> bool:
        return entity in self._entities

    @property
    def primary(self) -> int:
        """The entity that was selected last; 0 when there is none."""
        return next(reversed(self._entities), 0)

    @property
    def entities(self) -> tuple[int, ...]:
        """All of them, the primary one last."""
        return tuple(self._entities)

    def replace(self, entities: Iterable[int]) -> None:
        """Selects these and no others."""
        self._entities = dict.fromkeys(entities)
        self.anchor = self.primary
        self.version += 1

    def add(self, entities: Iterable[int]) -> None:
        """Selects these as well; the last becomes the primary one."""
        for entity in entities:
            self._entities.pop(entity, None)
            self._entities[entity] = None
        self.version += 1

    def toggle(self, entity: int) -> None:
        """Takes the entity in or out."""
        if entity in self._entities:
            del self._entities[entity]
        else:
            self._entities[entity] = None
        self.anchor = entity
        self.version += 1

    def extend(self, rows: list[int], entity: int) -> None:
        """Selects all of `rows` from the anchor to `entity`, which becomes the primary one."""
        if self.anchor not in rows or entity not in rows:
            self.replace((entity,))
            return
        start, end = rows.index(self.anchor), rows.index(entity)
        between = rows[start : end + 1] if start <= end else rows[end : start + 1][::-1]
        anchor = self.anchor
        self.replace(between)
        self.anchor = anchor

    def clear(self) -> None:
        """Selects nothing."""
        if self._entities:
            self.replace(())

    def keep_only(self, exists: Callable[[int], bool]) -> None:
        """Drops those that are gone."""
        kept = [entity for entity in self._entities if exists(entity)]
        if len(kept) != len(self._entities):
            self.replace(kept)

    def remap(self, new_ids: Mapping[int, int]) -> None:
        """Follows entities that came back under other ids."""
        if any(entity in new_ids for entity in self._entities):
            self.replace([new_ids.get(entity, entity) for entity in self._entities])

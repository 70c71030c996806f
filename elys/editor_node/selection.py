"""Which entities are selected, in the order in which they were, and which of them came last: the primary one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Final

HISTORY_LIMIT: Final = 100


class Selection:
    """Entities in order; the last is the primary one, whose values the inspector shows and on which the gizmo stands.

    What was selected before can be gone back to, and forward again.
    """

    def __init__(self) -> None:
        self._past: list[tuple[int, ...]] = []
        self._listed: tuple[int, ...] = ()
        self._listed_version = 0
        self._future: list[tuple[int, ...]] = []
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
        """All of them, the primary one last; the same tuple until they change."""
        if self._listed_version != self.version:
            self._listed, self._listed_version = tuple(self._entities), self.version
        return self._listed

    def replace(self, entities: Iterable[int]) -> None:
        """Selects these and no others."""
        wanted = dict.fromkeys(entities)
        if wanted.keys() != self._entities.keys():
            self._remember()
        self._become(wanted)

    def add(self, entities: Iterable[int]) -> None:
        """Selects these as well; the last becomes the primary one."""
        self._remember()
        for entity in entities:
            self._entities.pop(entity, None)
            self._entities[entity] = None
        self.version += 1

    def toggle(self, entity: int) -> None:
        """Takes the entity in or out."""
        self._remember()
        if entity in self._entities:
            del self._entities[entity]
        else:
            self._entities[entity] = None
        self.anchor = entity
        self.version += 1

    def extend(self, rows: Sequence[int], entity: int) -> None:
        """Selects all of `rows` from the anchor to `entity`, which becomes the primary one."""
        try:
            start, end = rows.index(self.anchor), rows.index(entity)
        except ValueError:  # one of them is not among the rows
            self.replace((entity,))
            return
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
            self._become(dict.fromkeys(kept))

    def remap(self, new_ids: Mapping[int, int]) -> None:
        """Follows entities that came back under other ids."""
        for kept in (self._past, self._future):
            kept[:] = [tuple(new_ids.get(entity, entity) for entity in entities) for entities in kept]
        if any(entity in new_ids for entity in self._entities):
            self._become(dict.fromkeys(new_ids.get(entity, entity) for entity in self._entities))

    # --- back and forward ------------------------------------------------------------------------------------------

    @property
    def has_past(self) -> bool:
        """Whether something else was selected before."""
        return bool(self._past)

    @property
    def has_future(self) -> bool:
        """Whether somebody went back."""
        return bool(self._future)

    def go_back(self, exists: Callable[[int], bool]) -> None:
        """Selects what was selected before, as far as it is there still."""
        self._go(self._past, self._future, exists)

    def go_forward(self, exists: Callable[[int], bool]) -> None:
        """Selects what was selected before going back."""
        self._go(self._future, self._past, exists)

    def _go(self, source: list[tuple[int, ...]], target: list[tuple[int, ...]], exists: Callable[[int], bool]) -> None:
        now = self.entities
        while source:
            before = source.pop()
            living = [entity for entity in before if exists(entity)]
            # What is gone altogether, or is what is selected now, is no place to go to.
            if bool(living) == bool(before) and set(living) != self._entities.keys():
                target.append(now)
                self._become(dict.fromkeys(living))
                return

    def _remember(self) -> None:
        self._past.append(self.entities)
        del self._past[:-HISTORY_LIMIT]
        self._future.clear()

    def _become(self, entities: dict[int, None]) -> None:
        self._entities = entities
        self.anchor = self.primary
        self.version += 1

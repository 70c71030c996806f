"""The tree as rows: those that are to be seen, in one flat list that follows what changes instead of being made anew.

In the order of the scene a change of a few entities is spliced into the list, so that a scene of fifty thousand costs
no more than one of fifty while it changes. Found or sorted rows are made anew when asked for after a change that they depend on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final, Literal, NamedTuple, overload

from elys.bus.messages.scene import (
    ComponentRemoved,
    ComponentSet,
    Despawned,
    EnabledSet,
    Renamed,
    Reparented,
    Spawned,
)
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.editor_node.entity_filter import EVERYTHING, EntityFilter
from elys.editor_node.entity_kinds import kind_of

OPEN_AT_FIRST: Final = 64  # a root with at most so many children shows them
SPLICED_AT_MOST: Final = 16  # changes of the tree in one delta; more are cheaper made anew
Order = Literal["scene", "name", "kind"]
_IN_TREE: Final = (Spawned, Despawned, Reparented)


class Row(NamedTuple):
    """A line of the tree that is to be seen."""

    entity: int
    depth: int
    has_children: bool
    is_open: bool


class TreeRows(Sequence[Row]):
    """The lines to be seen of a mirror, from the top down. `follow` must hear of every change of it.

    Attributes:
        entities: the entity of each line; not to be changed.
        found: with a filter, those that it lets through (the lines hold all above them as well).
    """

    def __init__(
        self, mirror: SceneMirror, *, is_marked: Callable[[str, int], bool] = lambda mark, entity: False
    ) -> None:
        """`is_marked` says whether an entity, or one above it, is "locked" or "hidden" here."""
        self.entities: list[int] = []
        self.found: set[int] = set()
        self.version = 0  # rises when lines come, go or move
        self._mirror = mirror
        self._is_marked = is_marked
        self._depths: list[int] = []
        self._shown: set[int] = set()
        self._open: dict[int, bool] = {}  # also what was decided for entities that nobody opened or closed
        self._filter = EVERYTHING
        self._order: Order = "scene"
        self._sorted: dict[int, list[int]] = {}  # children by parent, unless in the order of the scene
        self._keys: dict[int, tuple[str, str]] = {}
        self._is_stale = True
        self._is_found_stale = True

    # --- reading ---------------------------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self.entities)

    @overload
    def __getitem__(self, place: int) -> Row: ...

    @overload
    def __getitem__(self, place: slice) -> list[Row]: ...

    def __getitem__(self, place: int | slice) -> Row | list[Row]:
        if isinstance(place, slice):
            return [self[index] for index in range(*place.indices(len(self)))]
        entity, depth = self.entities[place], self._depths[place]
        if self._filter is not EVERYTHING:
            below = place % len(self) + 1
            has_children = below < len(self) and self._depths[below] > depth
            return Row(entity, depth, has_children, has_children)
        has_children = bool(self._mirror.entities[entity].children)
        return Row(entity, depth, has_children, has_children and self.is_open(entity))

    def __iter__(self) -> Iterator[Row]:
        return (self[place] for place in range(len(self)))

    def __contains__(self, entity: object) -> bool:
        return entity in self._shown

    def place_of(self, entity: int) -> int:
        """The line of an entity; -1 if it is not to be seen."""
        return self.entities.index(entity) if entity in self._shown else -1

    @property
    def order(self) -> Order:
        """How siblings are sorted."""
        return self._order

    @property
    def is_filtered(self) -> bool:
        """Whether only some are to be seen."""
        return self._filter is not EVERYTHING

    def is_open(self, entity: int) -> bool:
        """Whether what is below an entity is to be seen; decided when it first has something below it, and kept."""
        is_open = self._open.get(entity)
        if is_open is None:
            found = self._mirror.entities[entity]
            is_open = found.parent == 0 and len(found.children) <= OPEN_AT_FIRST
            if found.children:
                self._open[entity] = is_open
        return is_open

    # --- what is to be seen ----------------------------------------------------------------------------------------

    def show(self, wanted: EntityFilter = EVERYTHING, order: Order = "scene") -> TreeRows:
        """The lines that a filter lets through with all above them, siblings in an order; brought up to date."""
        if wanted != self._filter:
            self._filter = wanted if wanted.terms else EVERYTHING
            self._is_stale = self._is_found_stale = True
        if order != self._order:
            self._order, self._is_stale = order, True
            self._sorted.clear()
            self._keys.clear()
        if self._is_stale:
            self._make()
        return self

    def set_open(self, entity: int, is_open: bool) -> None:
        """Shows or hides what is below an entity."""
        was_open = self.is_open(entity)
        self._open[entity] = is_open
        if self._is_stale or self.is_filtered or was_open == is_open or entity not in self._shown:
            return
        place = self.entities.index(entity)
        if is_open:
            self._put_in(place + 1, self._block(entity, self._depths[place])[1:])
        else:
            self._take_out(place + 1, self._end_of(place))

    def set_all_open(self, is_open: bool, below: Iterable[int] = ()) -> None:
        """Opens or closes all entities, or those named and all below them."""
        tops = list(below)
        entities = self._mirror.entities
        chosen = [entity for top in tops for entity in self._mirror.descendants(top)] if tops else list(entities)
        self._open.update((entity, is_open) for entity in chosen if entities[entity].children)
        self._is_stale = True

    # --- being told ------------------------------------------------------------------------------------------------

    def marks_changed(self) -> None:
        """Hears that entities were locked, hidden or neither."""
        if self._filter.asks_marks:
            self._is_stale = self._is_found_stale = True

    def follow(self, update: MirrorUpdate) -> None:
        """Hears of a change that the mirror has made."""
        if update.reset:
            self._open = {entity: is_open for entity, is_open in self._open.items() if entity in self._mirror.entities}
            self._sorted.clear()
            self._keys.clear()
            self._is_stale = self._is_found_stale = True
            return
        for entity in update.removed:
            self._open.pop(entity, None)
            self._keys.pop(entity, None)
        in_tree = [change for change in update.changes if isinstance(change, _IN_TREE)]
        if self.is_filtered:
            self._follow_found(update)
        if self._order != "scene":
            self._follow_sorted(update)
        elif in_tree and not self._is_stale and not self.is_filtered:
            if len(in_tree) > SPLICED_AT_MOST:
                self._is_stale = True
            else:
                self._splice(in_tree)

    def _follow_found(self, update: MirrorUpdate) -> None:
        """Judges anew who was touched; the lines are made anew if that makes a difference."""
        if self._is_found_stale:
            return
        if self._filter.asks_above and any(isinstance(change, EnabledSet | Reparented) for change in update.changes):
            self._is_stale = self._is_found_stale = True
            return
        for entity in dict.fromkeys(getattr(change, "entity", 0) for change in update.changes):
            found = self._mirror.entities.get(entity)
            is_found = found is not None and self._filter.lets_through(found, self._mirror, self._is_marked)
            if is_found != (entity in self.found):
                (self.found.add if is_found else self.found.discard)(entity)
                self._is_stale = True
        gone = self._shown.intersection(update.removed)
        self.found.difference_update(update.removed)
        moved = any(isinstance(change, Reparented) and change.entity in self._shown for change in update.changes)
        self._is_stale = self._is_stale or bool(gone) or moved

    def _follow_sorted(self, update: MirrorUpdate) -> None:
        for change in update.changes:
            match change:
                case Spawned() | Despawned() | Reparented():
                    self._sorted.clear()
                    self._is_stale = True
                case Renamed(entity=entity):
                    self._keys.pop(entity, None)
                    self._sorted.clear()
                    self._is_stale = True
                case ComponentSet(entity=entity) | ComponentRemoved(entity=entity) if self._order == "kind":
                    found = self._mirror.entities.get(entity)
                    if found is not None and self._keys.get(entity, ("", ""))[0] != kind_of(found).name:
                        self._keys.pop(entity, None)
                        self._sorted.clear()
                        self._is_stale = True

    # --- inside ----------------------------------------------------------------------------------------------------

    def _splice(self, changes: Sequence[Spawned | Despawned | Reparented]) -> None:
        """Takes out what has gone or moved and puts in what has come, where it stands now."""
        touched = dict.fromkeys(change.entity for change in changes)
        for entity in touched:
            if entity in self._shown:
                place = self.entities.index(entity)
                self._take_out(place, self._end_of(place))
        living = [entity for entity in touched if entity in self._mirror.entities]
        for entity in sorted(living, key=self._path):
            parent = self._mirror.entities[entity].parent
            # With its parent's block it came in already.
            if entity in self._shown or (parent and (parent not in self._shown or not self.is_open(parent))):
                continue
            place, depth = self._place_for(entity, parent)
            if place < 0:
                self._is_stale = True
                return
            self._put_in(place, self._block(entity, depth))

    def _place_for(self, entity: int, parent: int) -> tuple[int, int]:
        """The line for an entity that is not there yet, and its depth; -1 where its neighbours are not to be seen."""
        siblings = self._mirror.children_of(parent)
        index = len(siblings) - 1 if siblings[-1] == entity else siblings.index(entity)
        above = self.entities.index(parent) if parent else -1
        depth = self._depths[above] + 1 if parent else 0
        if index == 0:
            return above + 1, depth
        if parent == 0 and index == len(siblings) - 1:
            return len(self), depth
        before = self.place_of(siblings[index - 1])
        return (self._end_of(before) if before >= 0 else -1), depth

    def _path(self, entity: int) -> tuple[int, ...]:
        path = []
        while entity:
            parent = self._mirror.entities[entity].parent
            siblings = self._mirror.children_of(parent)
            path.append(len(siblings) - 1 if siblings[-1] == entity else siblings.index(entity))
            entity = parent
        return tuple(reversed(path))

    def _make(self) -> None:
        if self._is_found_stale and self.is_filtered:
            self.found = self._filter.found_in(self._mirror, self._is_marked)
        self._is_stale = self._is_found_stale = False
        self.version += 1
        if self.is_filtered:
            self._shown = self._with_above(self.found)
            lines = self._lines((entity, 0) for entity in self._children(0) if entity in self._shown)
        else:
            self.found = set()
            lines = self._lines((entity, 0) for entity in self._children(0))
            self._shown = {entity for entity, _ in lines}
        self.entities = [entity for entity, _ in lines]
        self._depths = [depth for _, depth in lines]

    def _with_above(self, found: set[int]) -> set[int]:
        entities = self._mirror.entities
        shown = set(found)
        for entity in {entities[entity].parent for entity in found}:  # siblings have the same above them
            while entity and entity not in shown:
                shown.add(entity)
                entity = entities[entity].parent
        return shown

    def _block(self, entity: int, depth: int) -> list[tuple[int, int]]:
        """An entity and what is to be seen below it, with their depths."""
        return self._lines([(entity, depth)])

    def _lines(self, tops: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
        lines: list[tuple[int, int]] = []
        entities, shown, is_filtered = self._mirror.entities, self._shown, self.is_filtered
        for top in tops:
            if not entities[top[0]].children:  # most are leaves
                lines.append(top)
                continue
            waiting = [top]
            while waiting:
                line = waiting.pop()
                lines.append(line)
                entity, depth = line
                if not entities[entity].children or not (is_filtered or self.is_open(entity)):
                    continue
                children = self._children(entity)
                if is_filtered:
                    children = [child for child in children if child in shown]
                waiting.extend((child, depth + 1) for child in reversed(children))
        return lines

    def _children(self, parent: int) -> list[int]:
        children = self._mirror.children_of(parent)
        if self._order == "scene":
            return children
        if parent not in self._sorted:
            self._sorted[parent] = sorted(children, key=self._key)
        return self._sorted[parent]

    def _key(self, entity: int) -> tuple[str, str]:
        key = self._keys.get(entity)
        if key is None:
            found = self._mirror.entities[entity]
            name = found.name.casefold()
            stem = name.rstrip("0123456789")
            # "Box 9" before "Box 10"
            name = stem + name[len(stem) :].zfill(12)
            key = self._keys[entity] = (kind_of(found).name if self._order == "kind" else "", name)
        return key

    def _end_of(self, place: int) -> int:
        """The line after all that is below that of `place`."""
        depth, end = self._depths[place], place + 1
        while end < len(self._depths) and self._depths[end] > depth:
            end += 1
        return end

    def _take_out(self, start: int, end: int) -> None:
        self._shown.difference_update(self.entities[start:end])
        del self.entities[start:end], self._depths[start:end]
        self.version += 1

    def _put_in(self, place: int, lines: list[tuple[int, int]]) -> None:
        entities = [entity for entity, _ in lines]
        self.entities[place:place] = entities
        self._depths[place:place] = [depth for _, depth in lines]
        self._shown.update(entities)
        self.version += 1

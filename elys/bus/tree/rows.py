"""The tree as rows: those that are to be seen, in one flat list that follows what changes instead of being made anew.

In the order of the scene a change of a few entities is spliced into the list, so that a scene of fifty thousand costs
no more than one of fifty while it changes. Found or sorted rows are made anew when asked for after a change that they depend on,
over several frames where there are many.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from time import perf_counter
from typing import Final, NamedTuple, overload

from elys.bus.messages.scene import Despawned, EnabledSet, Reparented, Spawned
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.bus.tree.filter import EVERYTHING, EntityFilter
from elys.bus.tree.kinds import EntityKinds
from elys.bus.tree.order import PIECE, Order, SiblingOrder, path_of, pieces_of

OPEN_AT_FIRST: Final = 64  # a root with at most so many children shows them
SPLICED_AT_MOST: Final = 16  # changes of the tree in one delta; more are cheaper made anew
_PIECES_AT_LEAST: Final = 8  # in one go, so that small scenes are never behind
_PATIENCE: Final = 3  # times in a row that a change makes void what is under way; then it is done in one go
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
        self._is_filtered = False
        self._shown_order: Order = "scene"
        # What is wanted, and the way there; until it is made, the lines are those that were wanted before
        self._filter = EVERYTHING
        self._order: Order = "scene"
        self._found: set[int] = set()
        self._kinds = EntityKinds()
        self._siblings = SiblingOrder(mirror, self._kinds)
        self._work: Iterator[None] | None = None
        self._touched: set[int] = set()  # while lines are made, who may be found now or not any more
        self._interrupted = 0  # how often in a row a change of the scene made that void
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
        if self._is_filtered:
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
        return self._shown_order

    @property
    def is_filtered(self) -> bool:
        """Whether only some are to be seen."""
        return self._is_filtered

    @property
    def is_behind(self) -> bool:
        """Whether the lines are not those that are wanted yet: `show` goes on."""
        return self._work is not None or self._is_stale

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

    def show(self, wanted: EntityFilter = EVERYTHING, order: Order = "scene", *, share: float = math.inf) -> TreeRows:
        """The lines that a filter lets through with all above them, siblings in an order; brought up to date.

        Of a large scene that takes long: with a `share` [s] it goes on for so long, the lines stay as they were until it is done
        (without those who are gone), and `is_behind` says so.
        """
        if wanted != self._filter:
            self._filter = wanted if wanted.terms else EVERYTHING
            self._is_stale = self._is_found_stale = True
            self._interrupted, self._work = 0, None
        if order != self._order:
            self._order, self._is_stale = order, True
            self._interrupted, self._work = 0, None
        if self._is_stale:
            self._make()
        if self._work is not None:
            self._go_on(share)
            if self._is_stale and share == math.inf:  # something was touched while the lines were made
                return self.show(wanted, order)
        return self

    def set_open(self, entity: int, is_open: bool) -> None:
        """Shows or hides what is below an entity."""
        was_open = self.is_open(entity)
        self._open[entity] = is_open
        if was_open == is_open:
            return
        if self._work is not None:
            self._is_stale = True
        if self.is_behind or self._is_filtered or entity not in self._shown:
            return
        place = self.entities.index(entity)
        if is_open:
            entities, depths = self._block(entity, self._depths[place])
            self._put_in(place + 1, (entities[1:], depths[1:]))
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
        self._kinds.follow(update)
        stands_otherwise = self._siblings.follow(update, self._order)
        if update.reset:
            self._open = {entity: is_open for entity, is_open in self._open.items() if entity in self._mirror.entities}
            self._is_stale = self._is_found_stale = True
            self._drop_lines()
            return
        for entity in update.removed:
            self._open.pop(entity, None)
        self._is_stale |= stands_otherwise
        in_tree = [change for change in update.changes if isinstance(change, _IN_TREE)]
        if self._filter is not EVERYTHING:
            self._follow_found(update)
        if in_tree and self._work is not None:
            self._is_stale = True
        elif in_tree and self._order == "scene" and self._filter is EVERYTHING and not self._is_stale:
            if len(in_tree) > SPLICED_AT_MOST:
                self._is_stale = True
            else:
                self._splice(in_tree)
        if self.is_behind and update.removed:
            self._drop_lines()

    def _follow_found(self, update: MirrorUpdate) -> None:
        """Judges anew who was touched; the lines are made anew if that makes a difference."""
        if self._filter.asks_above and any(isinstance(change, EnabledSet | Reparented) for change in update.changes):
            self._is_stale = self._is_found_stale = True
            return
        self._found.difference_update(update.removed)
        touched = dict.fromkeys(getattr(change, "entity", 0) for change in update.changes)
        if self._work is not None:
            self._touched.update(touched)
            return
        if self._is_found_stale:
            return
        self._judge(touched)
        gone = self._shown.intersection(update.removed)
        moved = any(isinstance(change, Reparented) and change.entity in self._shown for change in update.changes)
        self._is_stale = self._is_stale or bool(gone) or moved

    # --- inside ----------------------------------------------------------------------------------------------------

    def _splice(self, changes: Sequence[Spawned | Despawned | Reparented]) -> None:
        """Takes out what has gone or moved and puts in what has come, where it stands now."""
        touched = dict.fromkeys(change.entity for change in changes)
        for entity in touched:
            if entity in self._shown:
                place = self.entities.index(entity)
                self._take_out(place, self._end_of(place))
        living = [entity for entity in touched if entity in self._mirror.entities]
        for entity in sorted(living, key=lambda entity: path_of(self._mirror, entity)):
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

    def _make(self) -> None:
        """Begins to make the lines anew."""
        self._interrupted += self._work is not None
        self._work = self._pieces()
        self._judge_touched()
        self._is_stale = False

    def _go_on(self, share: float) -> None:
        """Goes on with the lines for `share` seconds; small scenes, and those that change all the time, are done in one go."""
        assert self._work is not None
        until = perf_counter() + share
        for piece, _ in enumerate(self._work):
            if piece >= _PIECES_AT_LEAST and self._interrupted < _PATIENCE and perf_counter() > until:
                return
        self._work, self._interrupted = None, 0

    def _pieces(self) -> Iterator[None]:
        """Finds and places all lines, in pieces; those that are shown change at the end."""
        shown: set[int] | None = None
        if self._filter is not EVERYTHING:
            if self._is_found_stale:
                yield from self._find()
            shown = set()
            for piece in pieces_of(list(self._found)):
                self._add_with_above(shown, piece)
                yield
        else:
            self._found = set()
        entities: list[int] = []
        depths: list[int] = []
        yield from self._sort_if_needed(0)
        roots = self._children(0)
        for tops in pieces_of(roots if shown is None else [root for root in roots if root in shown]):
            yield from self._walk([(top, 0) for top in tops], shown, entities, depths)
        self.entities, self._depths, self.found = entities, depths, self._found
        self._shown = set(entities) if shown is None else shown
        self._is_filtered, self._shown_order = shown is not None, self._order
        self.version += 1
        self._judge_touched()

    def _find(self) -> Iterator[None]:
        found: set[int] = set()
        for piece in pieces_of(list(self._mirror.entities.values())):
            found |= self._filter.found_among(piece, self._mirror, self._is_marked, self._kinds.of)
            yield
        self._found, self._is_found_stale = found, False

    def _add_with_above(self, shown: set[int], found: Sequence[int]) -> None:
        entities = self._mirror.entities
        shown.update(found)
        for entity in {entities[entity].parent for entity in found}:  # siblings have the same above them
            above = entity
            while above and above not in shown:
                shown.add(above)
                above = entities[above].parent

    def _judge_touched(self) -> None:
        if not self._is_found_stale:
            self._judge(self._touched)
        self._touched.clear()

    def _judge(self, touched: Iterable[int]) -> None:
        """Looks anew whether entities are found; the lines are made anew if that makes a difference."""
        for entity in touched:
            found = self._mirror.entities.get(entity)
            is_found = found is not None and self._filter.lets_through(found, self._mirror, self._is_marked)
            if is_found != (entity in self._found):
                (self._found.add if is_found else self._found.discard)(entity)
                self._is_stale = True

    def _block(self, entity: int, depth: int) -> tuple[list[int], list[int]]:
        """An entity and what is to be seen below it, and their depths; in the order of the scene."""
        entities: list[int] = []
        depths: list[int] = []
        for _ in self._walk([(entity, depth)], None, entities, depths):
            pass
        return entities, depths

    def _walk(
        self, tops: Sequence[tuple[int, int]], shown: set[int] | None, out: list[int], depths: list[int]
    ) -> Iterator[None]:
        """Puts tops (entity and depth), and what is to be seen below each, behind `out` and `depths`.

        With `shown` that is who is in it, else who is below an open entity.
        """
        entities, done = self._mirror.entities, len(out)
        for top in tops:
            waiting = [top]
            while waiting:
                entity, depth = waiting.pop()
                out.append(entity)
                depths.append(depth)
                if not entities[entity].children or not (shown is not None or self.is_open(entity)):
                    continue
                if len(out) - done >= PIECE:
                    done = len(out)
                    yield
                yield from self._sort_if_needed(entity)
                children = self._children(entity)
                below = children if shown is None else [child for child in children if child in shown]
                waiting.extend((child, depth + 1) for child in reversed(below))
        yield

    def _children(self, parent: int) -> list[int]:
        children = self._siblings.children(parent, self._order)
        assert children is not None, "they are sorted first"
        return children

    def _sort_if_needed(self, parent: int) -> Iterator[None]:
        if self._siblings.children(parent, self._order) is None:
            yield from self._siblings.sort(parent, self._order)

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

    def _put_in(self, place: int, lines: tuple[list[int], list[int]]) -> None:
        entities, depths = lines
        self.entities[place:place] = entities
        self._depths[place:place] = depths
        self._shown.update(entities)
        self.version += 1

    def _drop_lines(self) -> None:
        """Takes out the lines of those that live no more, as long as better ones are not made."""
        living = self._mirror.entities
        kept = [place for place, entity in enumerate(self.entities) if entity in living]
        if len(kept) < len(self.entities):
            self.entities = [self.entities[place] for place in kept]
            self._depths = [self._depths[place] for place in kept]
            self._shown = set(self.entities)
            self.version += 1

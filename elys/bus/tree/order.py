"""In which order siblings stand in the tree: by name or by kind, worked out in pieces, so that no frame waits for fifty thousand.

What an order goes by (a name with its number, a kind) is kept for each entity, and siblings in the order of their names: the
order of kinds is that one, dealt out to the kinds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, Literal, TypeVar

from elys.bus.messages.scene import ComponentRemoved, ComponentSet, Despawned, Renamed, Reparented, Spawned
from elys.bus.mirror import MirrorUpdate, SceneMirror
from elys.bus.tree.kinds import KIND_NAMES, EntityKinds

Order = Literal["scene", "name", "kind"]
PIECE: Final = 500  # entities that are looked at in one go, half a millisecond or so
_RUN: Final = 4000  # siblings that are sorted in one go; merging two runs takes less
_KINDS_SORTED: Final = tuple(sorted(KIND_NAMES))
T = TypeVar("T")


def pieces_of(things: Sequence[T], size: int = PIECE) -> Iterator[Sequence[T]]:
    """A sequence cut into pieces."""
    return (things[start : start + size] for start in range(0, len(things), size))


def path_of(mirror: SceneMirror, entity: int) -> tuple[int, ...]:
    """The places among siblings of all above an entity and of itself, from the root down."""
    path = []
    while entity:
        parent = mirror.entities[entity].parent
        siblings = mirror.children_of(parent)
        path.append(len(siblings) - 1 if siblings[-1] == entity else siblings.index(entity))
        entity = parent
    return tuple(reversed(path))


class SiblingOrder:
    """The children of entities by name or kind. `follow` must hear of every change of the mirror, before anything is asked."""

    def __init__(self, mirror: SceneMirror, kinds: EntityKinds) -> None:
        self._mirror = mirror
        self._kinds = kinds
        self._names: dict[int, str] = {}  # as they are compared
        self._kind_names: dict[int, str] = {}  # of entities whose siblings stand by kind
        self._sorted: dict[tuple[int, Order], list[int]] = {}  # by parent

    def children(self, parent: int, order: Order) -> list[int] | None:
        """The ids below `parent` (0: the roots) in an order, not to be changed; None: `sort` has to be gone through first."""
        return self._mirror.children_of(parent) if order == "scene" else self._sorted.get((parent, order))

    def sort(self, parent: int, order: Order) -> Iterator[None]:
        """Works out an order, in pieces. Nothing may change meanwhile: `follow` makes what is under way void."""
        by_name = self._sorted.get((parent, "name"))
        if by_name is None:
            runs: list[list[int]] = []
            for piece in pieces_of(self._mirror.children_of(parent), _RUN):
                for part in pieces_of(piece):
                    self._note_names(part)
                    yield
                runs.append(sorted(piece, key=self._names.__getitem__))
                yield
            while len(runs) > 1:
                runs.append(sorted(runs.pop(0) + runs.pop(0), key=self._names.__getitem__))
                yield
            by_name = self._sorted[parent, "name"] = runs[0] if runs else []
        if order == "kind":
            dealt: dict[str, list[int]] = {kind: [] for kind in _KINDS_SORTED}
            for piece in pieces_of(by_name):
                for entity in piece:
                    kind = self._kind_names[entity] = self._kinds.of(self._mirror.entities[entity]).name
                    dealt[kind].append(entity)
                yield
            self._sorted[parent, "kind"] = [entity for kind in _KINDS_SORTED for entity in dealt[kind]]

    def follow(self, update: MirrorUpdate, order: Order) -> bool:
        """Hears of a change; returns whether lines in this order stand otherwise now."""
        if update.reset:
            self._names.clear()
            self._kind_names.clear()
            self._sorted.clear()
            return order != "scene"
        for entity in update.removed:
            self._names.pop(entity, None)
            self._kind_names.pop(entity, None)
        names = kinds = False
        for change in update.changes:
            match change:
                case Spawned() | Despawned() | Reparented():
                    names = True
                case Renamed(entity=entity):
                    self._names.pop(entity, None)
                    names = True
                case ComponentSet(entity=entity) | ComponentRemoved(entity=entity):
                    kinds = kinds or self._has_other_kind(entity)
        if names:
            self._sorted.clear()
        elif kinds:
            self._sorted = {key: children for key, children in self._sorted.items() if key[1] != "kind"}
        return order != "scene" and (names or (kinds and order == "kind"))

    def _has_other_kind(self, entity: int) -> bool:
        before, found = self._kind_names.get(entity), self._mirror.entities.get(entity)
        return before is not None and found is not None and self._kinds.of(found).name != before

    def _note_names(self, entities: Sequence[int]) -> None:
        for entity in entities:
            if entity not in self._names:
                name = self._mirror.entities[entity].name.casefold()
                stem = name.rstrip("0123456789")
                # "Box 9" before "Box 10"
                self._names[entity] = stem + name[len(stem) :].zfill(12)

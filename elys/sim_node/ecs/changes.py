"""What happened to the world since one last asked: the log from which scene deltas are made.

Structure (who came, went or moved in the tree) is told in the order in which it happened, so that whoever repeats it gets the
same tree with the same order of children. Values are told once, as they are when asked. What systems write straight into
columns (the poses and velocities of every tick) is not logged: that travels as whole columns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from elys.common.ids import Entity

CHANGE_LIMIT: Final = 1 << 16  # beyond it a snapshot is cheaper than the list of changes


class EntitySpawned(NamedTuple):
    """An entity came to be, last among the children of `parent`."""

    entity: Entity
    parent: Entity


class EntityDespawned(NamedTuple):
    """An entity ended, and with it all below it."""

    entity: Entity


@dataclass(frozen=True, slots=True)  # no tuple, for a tuple's `index` is something else
class EntityReparented:
    """An entity was taken from its place and put at `index` among the children of `parent`."""

    entity: Entity
    parent: Entity
    index: int


StructuralChange = EntitySpawned | EntityDespawned | EntityReparented
ComponentOf = tuple[Entity, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldChanges:
    """All changes of one tick. Of entities spawned in it only `structure` tells: all that they are is new.

    Attributes:
        structure: in the order in which it happened; it may name entities that are gone by now.
        added, set, removed: (entity, component name) in the order of the first change.
        fields: of what was `set`, the fields that were written, where others were left as they are.
        renamed, switched: entities with another name, with another own enabled switch.
        overflowed: too much changed to be listed, and nothing is: take a snapshot.
    """

    structure: tuple[StructuralChange, ...] = ()
    added: tuple[ComponentOf, ...] = ()
    set: tuple[ComponentOf, ...] = ()
    removed: tuple[ComponentOf, ...] = ()
    fields: Mapping[ComponentOf, tuple[str, ...]] = field(default_factory=dict)
    renamed: tuple[Entity, ...] = ()
    switched: tuple[Entity, ...] = ()
    overflowed: bool = False

    @property
    def spawned(self) -> tuple[Entity, ...]:
        """The entities that came to be."""
        return tuple(change.entity for change in self.structure if isinstance(change, EntitySpawned))

    @property
    def despawned(self) -> tuple[Entity, ...]:
        """The entities that were ended; what was below them is not named."""
        return tuple(change.entity for change in self.structure if isinstance(change, EntityDespawned))

    @property
    def reparented(self) -> tuple[Entity, ...]:
        """The entities that moved in the tree, once for each move."""
        return tuple(change.entity for change in self.structure if isinstance(change, EntityReparented))

    def __bool__(self) -> bool:
        return self.overflowed or any((self.structure, self.added, self.set, self.removed, self.renamed, self.switched))


class ChangeLog:
    """Collects changes until they are drained; forgets them all, and says so, when they pass the limit."""

    def __init__(self, limit: int = CHANGE_LIMIT) -> None:
        self._limit = limit
        self.discard()

    def discard(self, *, overflowed: bool = False) -> None:
        """Forgets what was logged; with `overflowed` the next drain says that a snapshot is needed."""
        self._structure: list[StructuralChange] = []
        self._spawned: set[int] = set()
        # Dicts as ordered sets; the value says whether the component was there when the log began.
        self._components: dict[ComponentOf, bool] = {}
        self._fields: dict[ComponentOf, tuple[str, ...] | None] = {}  # None: all of them
        self._renamed: dict[Entity, None] = {}
        self._switched: dict[Entity, None] = {}
        self._overflowed = overflowed

    def log_spawned(self, entities: list[Entity], parents: list[Entity]) -> None:
        """Entities that came to be, parents first."""
        if self._has_room(len(entities)):
            self._structure.extend(map(EntitySpawned, entities, parents))
            self._spawned.update(entities)

    def log_structure(self, change: EntityDespawned | EntityReparented) -> None:
        """An entity ended or moved."""
        if self._has_room(1):
            self._structure.append(change)

    def log_component(
        self, entity: Entity, component: str, *, was_present: bool, fields: Iterable[str] | None = None
    ) -> None:
        """A component was added, set or removed; `was_present` before. `fields` are those that were written, None for all."""
        if entity not in self._spawned and self._has_room(1):
            key = (entity, component)
            self._components.setdefault(key, was_present)
            before = self._fields.get(key, ())
            self._fields[key] = None if fields is None or before is None else tuple(dict.fromkeys((*before, *fields)))

    def log_renamed(self, entity: Entity) -> None:
        """An entity has another name."""
        if entity not in self._spawned and self._has_room(1):
            self._renamed[entity] = None

    def log_switched(self, entity: Entity) -> None:
        """An entity's own enabled switch changed."""
        if entity not in self._spawned and self._has_room(1):
            self._switched[entity] = None

    def drain(self, is_alive: Callable[[int], bool], has: Callable[[int, str], bool]) -> WorldChanges:
        """All changes since the last drain; `has(entity, component)` says what is there now."""
        components: dict[tuple[bool, bool], list[ComponentOf]] = {}
        for key, was_present in self._components.items():
            if is_alive(key[0]):
                components.setdefault((was_present, has(*key)), []).append(key)
        were_set = components.get((True, True), ())
        changes = WorldChanges(
            structure=tuple(self._structure),
            added=tuple(components.get((False, True), ())),
            set=tuple(were_set),
            fields={key: fields for key in were_set if (fields := self._fields[key]) is not None},
            removed=tuple(components.get((True, False), ())),
            renamed=tuple(filter(is_alive, self._renamed)),
            switched=tuple(filter(is_alive, self._switched)),
            overflowed=self._overflowed,
        )
        self.discard()
        return changes

    def _has_room(self, count: int) -> bool:
        size = len(self._structure) + len(self._components) + len(self._renamed) + len(self._switched)
        if not self._overflowed and size + count > self._limit:
            self.discard(overflowed=True)
        return not self._overflowed

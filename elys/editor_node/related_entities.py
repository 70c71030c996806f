"""Who is to be selected with, or instead of, those that are: children, parents, the others, those of the same components."""

from __future__ import annotations

from collections.abc import Iterable

from elys.bus.mirror import SceneMirror


def children_of(mirror: SceneMirror, entities: Iterable[int]) -> list[int]:
    """Those right below, in order, each once."""
    return list(dict.fromkeys(child for entity in entities for child in mirror.children_of(entity)))


def parents_of(mirror: SceneMirror, entities: Iterable[int]) -> list[int]:
    """Those right above, each once; roots have none."""
    parents = (mirror.entities[entity].parent for entity in entities)
    return list(dict.fromkeys(parent for parent in parents if parent))


def others_than(shown: Iterable[int], entities: Iterable[int]) -> list[int]:
    """Of `shown` all but these."""
    chosen = set(entities)
    return [entity for entity in shown if entity not in chosen]


def of_same_components(mirror: SceneMirror, entity: int) -> list[int]:
    """All that have exactly the components of an entity, itself last, so that it stays the primary one."""
    wanted = mirror.entities[entity].components.keys()
    found = [i for i, other in mirror.entities.items() if other.components.keys() == wanted and i != entity]
    return [*found, entity]

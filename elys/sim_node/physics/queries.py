"""Questions to a world about where shapes are, for many at once. Asking changes nothing."""

from __future__ import annotations

from typing import Any, Literal, TypedDict, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError
from elys.sim_node.physics import checks
from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.colliders import ColliderTable
from elys.sim_node.physics.kernels.queries import cast_rays
from elys.sim_node.physics.query_tree import QueryTree
from elys.sim_node.physics.states import AllHits, Hits

Array = np.ndarray[Any, Any]

_FARTHEST = 1e300  # stands for infinity where differences are taken
EVERY_LAYER = 0xFFFFFFFF


class Filters(TypedDict, total=False):
    """What a question passes over; the same for all questions."""

    own_body: ArrayLike  # (R,) for each of R questions an entity whose body is not met, 0 for none
    mask: int  # only colliders with a layer whose bit is set in it
    exclude: ArrayLike  # entities whose colliders, their own or those of their bodies, are not met
    include_triggers: bool  # colliders that nothing collides with are met as well


class WorldQueries:
    """What a world answers about its shapes; keywords that every question takes are those of `Filters`."""

    def __init__(self, bodies: BodyTable, colliders: ColliderTable) -> None:
        self._bodies = bodies
        self._colliders = colliders
        self._query_tree = QueryTree()

    @overload
    def raycast(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        max_distance: ArrayLike = ...,
        *,
        all_hits: Literal[False] = ...,
        **filters: Unpack[Filters],
    ) -> Hits: ...

    @overload
    def raycast(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        max_distance: ArrayLike = ...,
        *,
        all_hits: Literal[True],
        **filters: Unpack[Filters],
    ) -> AllHits: ...

    def raycast(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        max_distance: ArrayLike = np.inf,
        *,
        all_hits: bool = False,
        **filters: Unpack[Filters],
    ) -> Hits | AllHits:
        """The first collider that each ray meets, or all of them.

        Parameters: origins (R, 3) [m], directions (R, 3) of any length but 0, farthest distances (R,) or one for all [m].
        A ray that begins inside a shape meets it at distance 0, with a normal against the ray.

        Raises:
            PhysicsError: a ray is not finite, has no direction or a negative length.
        """
        start, along, limits = rays_of("raycast", origins, directions, max_distance)
        own, chosen = self._filter(len(start), **filters)

        def ask(room: int) -> tuple[int, tuple[Array, ...]]:
            found = answer_rows(room if all_hits else len(start))
            tree = self._query_tree
            walk = (tree.nodes, chosen, own, tree.stack, tree.entries)
            return cast_rays(self._colliders.rows, *walk, start, along, limits, all_hits, *found), found

        query, hit, distance, normal = self._answer(ask, len(start), all_hits)
        with np.errstate(invalid="ignore"):
            point = start[query] + distance[:, None] * along[query]
        return self._hits(all_hits, query, hit, distance, point, normal)

    def _filter(
        self,
        count: int,
        own_body: ArrayLike = 0,
        mask: int = EVERY_LAYER,
        exclude: ArrayLike = (),
        include_triggers: bool = False,
    ) -> tuple[Array, Array]:
        """The own body's row (R,) of each question, and which colliders count (C,). Brings the tree up to date."""
        self._query_tree.follow(self._bodies.rows, self._colliders.rows)
        colliders = self._colliders.rows
        try:
            entities = np.broadcast_to(np.asarray(own_body, np.int64), (count,))
        except ValueError as error:
            raise PhysicsError(f"own_body must be one entity, or one for each of {count} questions") from error
        own = np.full(count, -1, np.int32)
        if (entities != 0).any():
            own[entities != 0] = self._bodies.rows_of(checks.entity_column(entities[entities != 0], unique=False))
        chosen = np.ones(len(colliders), np.uint8)
        passed_over = checks.entity_column(np.asarray(exclude, np.int64), unique=False)
        if len(passed_over):
            bodies = self._bodies.rows["entity"][colliders["body"]]
            chosen[np.isin(colliders["entity"], passed_over) | np.isin(bodies, passed_over)] = 0
        return own, chosen

    def _answer(self, ask: Any, count: int, all_hits: bool) -> tuple[Array, ...]:
        """Rows of hits: (query, collider, ...), those of `all_hits` in order."""
        if not len(self._colliders.rows):
            return answer_rows(0 if all_hits else count)
        found, rows = ask(2 * count)
        if not all_hits:
            return rows
        if found > len(rows[0]):
            found, rows = ask(found)
        query, hit, distance = (column[:found] for column in rows[:3])
        order = np.lexsort((hit, distance, query))
        return tuple(column[:found][order] for column in rows)

    def _hits(
        self, all_hits: bool, query: Array, hit: Array, distance: Array, point: Array, normal: Array
    ) -> Hits | AllHits:
        entity = np.zeros(len(hit), np.uint32)
        entity[hit >= 0] = self._colliders.rows["entity"][hit[hit >= 0]]
        if all_hits:
            return AllHits(query, entity, distance, point, normal)
        return Hits(entity, distance, point, normal)


def answer_rows(count: int) -> tuple[Array, Array, Array, Array]:
    """Room for hits that says "nothing": query, collider, distance, normal."""
    return np.arange(count), np.full(count, -1, np.int32), np.full(count, np.inf), np.zeros((count, 3))


def rays_of(
    question: str, origins: ArrayLike, directions: ArrayLike, max_distance: ArrayLike
) -> tuple[Array, Array, Array]:
    """Origins and unit directions (R, 3) and finite lengths (R,), checked; `question` is what sentences call it."""
    start, along = vectors_of(question, "origins", origins, "directions", directions)
    # Scaled first: the square of a very long or very short direction is no number of this size.
    largest = abs(along).max(axis=1, keepdims=True)
    if (largest == 0.0).any():
        raise PhysicsError(f"{question} cannot look along a direction of length 0: direction {largest.argmin()} is")
    along = along / largest
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    return start, along, limits_of(question, max_distance, len(start))


def vectors_of(question: str, name: str, first: ArrayLike, other_name: str, second: ArrayLike) -> tuple[Array, Array]:
    """Two columns of vectors (R, 3), one of either taken for all."""
    try:
        a, b = (np.atleast_2d(np.asarray(values, np.float64)) for values in (first, second))
        a, b = np.broadcast_arrays(a, b)
    except ValueError as error:
        raise PhysicsError(f"{question} takes as many {name} as {other_name}, or one of either") from error
    if a.ndim != 2 or a.shape[1] != 3 or not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise PhysicsError(f"{question} takes finite {name} and {other_name} of shape (R, 3)")
    return np.ascontiguousarray(a), np.ascontiguousarray(b)


def limits_of(question: str, max_distance: ArrayLike, count: int) -> Array:
    """Farthest distances (R,), infinity as a number that can be calculated with."""
    try:
        limits = np.broadcast_to(np.asarray(max_distance, np.float64), (count,))
    except ValueError as error:
        raise PhysicsError(f"{question} takes one farthest distance, or one for each of {count}") from error
    if not (limits >= 0.0).all():
        raise PhysicsError(f"{question} takes distances of 0 m or more")
    return np.minimum(limits, _FARTHEST)

"""Questions to a world about where shapes are, for many at once. Asking changes nothing.

hits = world.raycast([[0, 9, 0], [1, 9, 1]], [0, -1, 0], max_distance=20.0)
hits.entity, hits.distance                                        # (2,) each: 0 and infinity for a ray that met nothing
world.cast_sphere([0, 9, 0], [0, -1, 0], radius=0.5, all_hits=True)
world.overlap_box([0, 1, 0], size=[2, 2, 2], exclude=[7])
world.closest_point([[0, 9, 0]], max_distance=3.0)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from elys.common.errors import PhysicsError
from elys.sim_node.physics import checks, probes
from elys.sim_node.physics.bodies import BodyTable
from elys.sim_node.physics.colliders import EVERY_LAYER, ColliderTable
from elys.sim_node.physics.kernels.cast import TOUCH
from elys.sim_node.physics.kernels.nearby import find_closest, find_overlaps
from elys.sim_node.physics.kernels.queries import cast_rays, cast_shapes
from elys.sim_node.physics.kernels.tables import Geometry
from elys.sim_node.physics.query_tree import QueryTree
from elys.sim_node.physics.states import Hits, Overlaps

Array = np.ndarray[Any, Any]

NO_TURN = (0.0, 0.0, 0.0, 1.0)


class Filters(TypedDict, total=False):
    """What a question passes over; the same keywords for all questions."""

    own_body: ArrayLike  # (R,) for each of R questions an entity whose body is not met, 0 for none
    mask: int  # only colliders on layers whose bit is set in it
    exclude: ArrayLike  # entities whose colliders, their own or those of their bodies, are not met
    include_triggers: bool  # colliders that nothing collides with are met as well


class WorldQueries:
    """What a world answers about its shapes.

    Questions come in arrays; one value of anything stands for all. `filters` are the keywords of `Filters`. A cast with
    `all_hits` answers with every collider on the way instead of the first. Bad questions raise PhysicsError.
    """

    def __init__(self, bodies: BodyTable, colliders: ColliderTable) -> None:
        self._bodies = bodies
        self._colliders = colliders
        self._query_tree = QueryTree()

    # ---------------------------------------------------------------- along a line

    def raycast(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        max_distance: ArrayLike = np.inf,
        *,
        all_hits: bool = False,
        **filters: Unpack[Filters],
    ) -> Hits:
        """The first collider that each ray meets.

        Parameters: origins (R, 3) [m], directions (R, 3) of any length but 0, farthest distances (R,) [m]. A ray that begins
        inside a shape meets it at distance 0, with a normal against the ray.
        """
        start, along, limits = probes.rays_of("raycast", origins, directions, max_distance)
        own, chosen = self._filtered(len(start), **filters)
        tree = self._query_tree

        def ask(rows: Hits, hit: Array) -> int:
            walk = (tree.nodes, chosen, own, tree.stack, tree.entries)
            answer = (rows.query, hit, *rows[1:])
            return int(cast_rays(*self._tables(), *walk, start, along, limits, all_hits, *answer))

        return self._collected(ask, len(start), all_hits)

    def cast_sphere(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        radius: ArrayLike,
        max_distance: ArrayLike = np.inf,
        *,
        all_hits: bool = False,
        **filters: Unpack[Filters],
    ) -> Hits:
        """What balls of radii (R,) [m] touch first on their way from origins (R, 3) along directions (R, 3).

        A shape that overlaps another where it begins meets it at distance 0, with a normal against the way.
        """
        rays = probes.rays_of("cast_sphere", origins, directions, max_distance)
        return self._cast(probes.balls("cast_sphere", radius, len(rays[0])), rays, all_hits, filters)

    def cast_box(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        size: ArrayLike,
        max_distance: ArrayLike = np.inf,
        *,
        rotation: ArrayLike = NO_TURN,
        all_hits: bool = False,
        **filters: Unpack[Filters],
    ) -> Hits:
        """What boxes of full edge lengths (R, 3) [m], turned by (R, 4), touch first; see `cast_sphere`."""
        rays = probes.rays_of("cast_box", origins, directions, max_distance)
        return self._cast(probes.boxes("cast_box", size, rotation, len(rays[0])), rays, all_hits, filters)

    def cast_capsule(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        radius: ArrayLike,
        half_length: ArrayLike,
        max_distance: ArrayLike = np.inf,
        *,
        rotation: ArrayLike = NO_TURN,
        all_hits: bool = False,
        **filters: Unpack[Filters],
    ) -> Hits:
        """What capsules along y, of radii and half lengths of the straight part (R,) [m], turned by (R, 4), touch first; see
        `cast_sphere`."""
        rays = probes.rays_of("cast_capsule", origins, directions, max_distance)
        shapes = probes.capsules("cast_capsule", radius, half_length, rotation, len(rays[0]))
        return self._cast(shapes, rays, all_hits, filters)

    # ---------------------------------------------------------------- at a place

    def overlap_point(self, points: ArrayLike, **filters: Unpack[Filters]) -> Overlaps:
        """All colliders that hold points (R, 3) [m]."""
        return self.overlap_sphere(points, 0.0, **filters)

    def overlap_sphere(self, centers: ArrayLike, radius: ArrayLike, **filters: Unpack[Filters]) -> Overlaps:
        """All colliders that share a point with balls around centers (R, 3), of radii (R,) [m]."""
        places = probes.places_of("overlap_sphere", "centers", centers)
        return self._overlaps(probes.balls("overlap_sphere", radius, len(places)), places, filters)

    def overlap_box(
        self, centers: ArrayLike, size: ArrayLike, *, rotation: ArrayLike = NO_TURN, **filters: Unpack[Filters]
    ) -> Overlaps:
        """All colliders that share a point with boxes of full edge lengths (R, 3) [m], turned by (R, 4)."""
        places = probes.places_of("overlap_box", "centers", centers)
        return self._overlaps(probes.boxes("overlap_box", size, rotation, len(places)), places, filters)

    def overlap_capsule(
        self,
        centers: ArrayLike,
        radius: ArrayLike,
        half_length: ArrayLike,
        *,
        rotation: ArrayLike = NO_TURN,
        **filters: Unpack[Filters],
    ) -> Overlaps:
        """All colliders that share a point with capsules along y, given as in `cast_capsule`."""
        places = probes.places_of("overlap_capsule", "centers", centers)
        shapes = probes.capsules("overlap_capsule", radius, half_length, rotation, len(places))
        return self._overlaps(shapes, places, filters)

    def closest_point(self, points: ArrayLike, max_distance: ArrayLike = np.inf, **filters: Unpack[Filters]) -> Hits:
        """The collider closest to each of the points (R, 3) [m], and where on it, up to max_distance (R,) [m] away.

        A point inside a shape is its own closest point, at distance 0 with no normal.
        """
        places = probes.places_of("closest_point", "points", points)
        limits = probes.limits_of("closest_point", max_distance, len(places))
        own, chosen = self._filtered(len(places), **filters)
        tree = self._query_tree
        nearest = np.zeros(len(tree.stack))

        def ask(rows: Hits, hit: Array) -> int:
            walk = (tree.nodes, chosen, own, tree.stack, nearest)
            answer = (hit, *rows[1:])
            find_closest(*self._tables(), *walk, places, limits, *answer)
            return len(places)

        return self._collected(ask, len(places), False)

    # ---------------------------------------------------------------- within

    def _cast(self, shapes: probes.Probes, rays: tuple[Array, Array, Array], all_hits: bool, filters: Filters) -> Hits:
        count = len(rays[0])
        own, chosen = self._filtered(count, **filters)
        tree = self._query_tree
        touch = np.zeros(1, TOUCH)

        def ask(rows: Hits, hit: Array) -> int:
            walk = (tree.nodes, chosen, own, tree.stack, tree.entries)
            answer = (rows.query, hit, *rows[1:])
            return int(cast_shapes(*self._tables(), *walk, *rays, *shapes, touch, all_hits, *answer))

        return self._collected(ask, count, all_hits)

    def _overlaps(self, shapes: probes.Probes, places: Array, filters: Filters) -> Overlaps:
        own, chosen = self._filtered(len(places), **filters)
        if not len(self._colliders.rows):
            return Overlaps(np.zeros(0, np.int64), np.zeros(0, np.uint32))
        tree = self._query_tree
        walk = (tree.nodes, chosen, own, tree.stack)
        found = 4 * len(places)
        while True:
            query, hit = np.zeros(found, np.int64), np.zeros(found, np.int32)
            found = int(find_overlaps(*self._tables(), *walk, places, *shapes, query, hit))
            if found <= len(query):
                break
        order = np.lexsort((hit[:found], query[:found]))
        return Overlaps(query[order], self._colliders.rows["entity"][hit[order]])

    def _collected(self, ask: Callable[[Hits, Array], int], count: int, all_hits: bool) -> Hits:
        """The answers that `ask(rows, collider of each)` writes, in order; it tells how many there are."""
        room = 2 * count if all_hits else count
        while True:
            rows, hit = nothing_met(room), np.full(room, -1, np.int32)
            found = ask(rows, hit) if len(self._colliders.rows) else 0
            if not all_hits or found <= room:
                break
            room = found
        if not all_hits:
            return rows
        order = np.lexsort((hit[:found], rows.distance[:found], rows.query[:found]))
        return Hits(*(column[order] for column in rows))

    def _tables(self) -> tuple[Array, Geometry]:
        return self._colliders.rows, self._colliders.geometry.arrays

    def _filtered(
        self,
        count: int,
        own_body: ArrayLike = 0,
        mask: int = EVERY_LAYER,
        exclude: ArrayLike = (),
        include_triggers: bool = False,
    ) -> tuple[Array, Array]:
        """The own body's row (R,) of each question, and which colliders count (C,). Brings the tree up to date."""
        self._query_tree.follow(self._bodies.rows, self._colliders.rows, self._colliders.geometry.arrays)
        colliders = self._colliders.rows
        entities = np.asarray(own_body)
        if entities.shape not in ((), (1,), (count,)):
            raise PhysicsError(f"own_body takes one entity or one for each of {count} questions")
        own = np.full(count, -1, np.int32)
        if (entities != 0).any():
            entities = np.broadcast_to(entities, (count,))
            own[entities != 0] = self._bodies.rows_of(checks.entity_column(entities[entities != 0], unique=False))
        if not 0 <= mask <= EVERY_LAYER:
            raise PhysicsError(f"mask must be from 0 to 2^32 - 1, a bit for each layer, not {mask}")
        chosen = (colliders["layer"] & np.uint32(mask) != 0).astype(np.uint8)
        if not include_triggers:
            chosen[colliders["trigger"] != 0] = 0
        if np.size(exclude):
            passed_over = checks.entity_column(exclude, unique=False)
            bodies = self._bodies.rows["entity"][colliders["body"]]
            chosen[np.isin(colliders["entity"], passed_over) | np.isin(bodies, passed_over)] = 0
        return own, chosen


def nothing_met(count: int) -> Hits:
    """The answers to questions that met nothing."""
    return Hits(
        np.arange(count),
        np.zeros(count, np.uint32),
        np.full(count, np.inf),
        np.full((count, 3), np.nan),
        np.zeros((count, 3)),
    )

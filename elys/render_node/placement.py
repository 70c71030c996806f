"""Where drawn things stand at this moment: those that physics moves, those that animations move, those that ride on either, and
those that stand still.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from elys.common.math import quaternion
from elys.common.math.matrix import compose_affine, depth_levels, inverse_affine, multiply_affine, propagate_affine
from elys.render_node.pose_columns import FixedTransforms, matrices_of
from elys.render_node.scene_tables import Rows, SceneTables, places_in, ranges
from elys.render_node.timeline import Timeline, rows_in


class Placement:
    """World transforms of M items, each an entity that may appear in state frames or ride on one that does.

    Frames give the pose of a body. An item's place follows as `world_from_body @ body_from_item`, of which the second, with all
    scales, changes only when the scene does. Of what is animated frames give the local transform; it and all below it, down to
    the next bodies, is placed from parent to child.

    Attributes:
        position: [M, 3] f64 m, world. linear: [M, 3, 3] f32, rotation and scale of world_from_item.
        articulated: which items are animated or ride on what is.
    """

    def __init__(
        self, tables: SceneTables, rows: Rows, bodies: NDArray[np.uint32], animated: NDArray[np.uint32]
    ) -> None:
        """`rows` (M,) of the tables are the items; state frames tell of `bodies` (B,) and of the `animated` (A,)."""
        _, is_body = rows_in(bodies, tables.entity)
        self._limbs = _Limbs(tables, is_body, animated) if len(animated) else None
        item_count = len(rows)
        if self._limbs is not None:
            rows = np.concatenate([rows, self._limbs.bases])
        # Kept as columns: `position.T` and `linear.transpose(1, 2, 0)` are contiguous.
        self._position = np.empty((3, len(rows))).T
        self._linear = np.empty((3, 3, len(rows)), np.float32).transpose(2, 0, 1)
        self.position, self.linear = self._position[:item_count], self._linear[:item_count]
        self._rows = rows
        self._order: Rows = np.argsort(rows, kind="stable")
        self._sorted_rows = rows[self._order]
        self._rest(tables, np.arange(len(rows)))
        carrier = _carrier_rows(tables, is_body)[rows]
        self._moving = np.flatnonzero(carrier >= 0)
        self._carrier_rows, self._carrier = _numbered(carrier[self._moving])
        self._is_alone = len(self._carrier_rows) == len(self._moving)  # each item has a body of its own
        self._carriers = tables.entity[self._carrier_rows]
        self._told_by_scene = tables.pose_sequence[self._carrier_rows]
        self._carrier_from_item = FixedTransforms(self._fixed(tables, np.arange(len(self._moving))))
        self.articulated: Rows = np.zeros(0, np.intp)
        if self._limbs is not None:
            node_of_item = self._limbs.node_of_row[rows[:item_count]]
            self.articulated = np.flatnonzero(node_of_item >= 0)
            self._nodes = node_of_item[self.articulated]

    @property
    def limb_rows(self) -> Rows:
        """Of the tables, those that are animated or placed below such, and those that carry them."""
        return np.zeros(0, np.intp) if self._limbs is None else self._limbs.rows

    def move(self, tables: SceneTables, moved: Rows) -> None:
        """Takes where some rows of the tables, ascending and no limbs, and all below them stand now; `follow` moves those on that
        ride.
        """
        first, last = (np.searchsorted(self._sorted_rows, moved, side) for side in ("left", "right"))
        places = np.sort(self._order[ranges(first, last)])
        self._rest(tables, places)
        riders, _ = places_in(self._moving, places)
        if len(riders):
            carriers = self._carrier[riders]
            self._told_by_scene[carriers] = tables.pose_sequence[self._carrier_rows[carriers]]
            self._carrier_from_item.replace(riders, self._fixed(tables, riders))

    def riding(self, items: Rows) -> Rows:
        """Those of some items that ride on bodies."""
        return items[places_in(self._moving, items)[1]]

    def on_carriers(self, items: Rows) -> NDArray[np.float32]:
        """How items (N,) that ride stand on their bodies (N, 3, 4)."""
        affine: NDArray[np.float32] = self._carrier_from_item.affine[np.searchsorted(self._moving, items)]
        return affine

    def _rest(self, tables: SceneTables, places: Rows) -> None:
        world_from_item = tables.world_from_local[self._rows[places]]
        self._position[places] = world_from_item[:, :, 3]
        self._linear[places] = world_from_item[:, :, :3]

    def _fixed(self, tables: SceneTables, riders: Rows) -> NDArray[np.float64]:
        """carrier_from_item (N, 3, 4) of some that ride."""
        carrier, rows = self._carrier_rows[self._carrier[riders]], self._rows[self._moving[riders]]
        world_from_carrier = np.empty((len(riders), 3, 4))
        world_from_carrier[:, :, :3] = quaternion.to_matrix(tables.rotation[carrier])
        world_from_carrier[:, :, 3] = tables.world_from_local[carrier][:, :, 3]
        return np.asarray(multiply_affine(inverse_affine(world_from_carrier), tables.world_from_local[rows]))

    @property
    def moving(self) -> Rows:
        """Who rides on a body."""
        return self._moving[: np.searchsorted(self._moving, len(self.position))]  # then come those that carry others

    def untold(self, riders: Rows, timeline: Timeline) -> Rows:
        """Those of some who ride of which the newest frame does not know yet where the scene put their bodies."""
        if timeline.newest is None:
            return riders
        told = self._told_by_scene[self._carrier[np.searchsorted(self._moving, riders)]]
        return riders[told > timeline.newest.delta_sequence]

    def body_rows(self, timeline: Timeline) -> tuple[NDArray[np.int32], bool]:
        """Rows (M, 2) of the bodies, in the newest frame and in the one before, on which the items ride, -1 for none; and
        whether they stay while frames tell of the same bodies. Edits that frames do not contain yet keep items where they are.
        """
        found, item_count = np.full((len(self._position), 2), -1, np.int32), len(self.position)
        newest, previous = timeline.newest, timeline.previous
        if newest is None or not len(self._moving):
            return found[:item_count], newest is not None
        rows, known = rows_in(newest.entity, self._carriers)
        known = known & (self._told_by_scene <= newest.delta_sequence)
        found[self._moving, 0] = np.where(known, rows, -1)[self._carrier]
        if previous is not None:
            rows, was_known = rows_in(previous.entity, self._carriers)
            found[self._moving, 1] = np.where(known & was_known, rows, -1)[self._carrier]
        is_settled = bool(known.all()) and previous is not None and np.array_equal(previous.entity, newest.entity)
        return found[:item_count], is_settled

    def follow(self, timeline: Timeline, fraction: float) -> None:
        """Moves the items to where they are `fraction` of the way to the newest frame."""
        if timeline.newest is None:
            return
        if len(self._moving):
            self._follow_bodies(timeline, fraction)
        if self._limbs is not None:
            bases = np.empty((len(self._limbs.bases), 3, 4))
            bases[:, :, :3], bases[:, :, 3] = self._linear[len(self.linear) :], self._position[len(self.linear) :]
            world_from_node = self._limbs.placed(timeline, fraction, bases)[self._nodes]
            self.linear[self.articulated] = world_from_node[:, :, :3]
            self.position[self.articulated] = world_from_node[:, :, 3]

    def _follow_bodies(self, timeline: Timeline, fraction: float) -> None:
        assert timeline.newest is not None
        position, rotation, known = timeline.poses(self._carriers, fraction)
        known = known & (self._told_by_scene <= timeline.newest.delta_sequence)
        turn = matrices_of(rotation)
        moving, carrier, chosen = self._moving, self._carrier, None
        if not known.all():  # gone from the frames, or moved by an edit they do not contain yet: stays where it is
            chosen = np.flatnonzero(known[carrier])
            moving, carrier = moving[chosen], carrier[chosen]
        if not self._is_alone or chosen is not None:
            turn, position = turn[:, :, carrier], position[carrier]
        turned = self._carrier_from_item.turned(turn, chosen=chosen)
        target: Rows | slice = moving
        if len(moving) and moving[-1] - moving[0] == len(moving) - 1:
            target = slice(moving[0], moving[-1] + 1)
        self._linear.transpose(1, 2, 0)[:, :, target] = turned[:, :3]
        place = position.T
        self._position.T[:, target] = place if self._carrier_from_item.offsets_are_none else place + turned[:, 3]


def _numbered(carriers: Rows) -> tuple[Rows, Rows]:
    """Each carrier once, in the order in which they first appear, and for each place which of them stands there."""
    rows, first, number = np.unique(carriers, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(rows), np.intp)
    rank[order] = np.arange(len(rows))
    return rows[order], rank[number]


class _Limbs:
    """The animated rows and all below them down to the next bodies, placed from what each stands on.

    Attributes:
        bases: rows that carry such ones and are none themselves. rows: of all nodes, which are the bases, then the limbs.
        node_of_row: [N] place of a limb among the nodes, -1 for others.
    """

    def __init__(self, tables: SceneTables, is_body: NDArray[np.bool_], animated: NDArray[np.uint32]) -> None:
        _, is_animated = rows_in(animated, tables.entity)
        is_animated &= ~is_body
        is_limb = is_animated.copy()
        for level in tables.levels[1:]:
            is_limb[level] |= is_limb[tables.parent[level]] & ~is_body[level]
        limbs = np.flatnonzero(is_limb)
        above = tables.parent[limbs]
        self.bases: Rows = np.unique(above[(above >= 0) & ~is_limb[above]])
        nodes = self.rows = np.concatenate([self.bases, limbs])
        self.node_of_row = np.full(len(tables.entity), -1)
        self.node_of_row[nodes] = np.arange(len(nodes))
        self._parents = np.full(len(nodes), -1)
        self._parents[len(self.bases) :] = np.where(above >= 0, self.node_of_row[above], -1)
        self.node_of_row[self.bases] = -1  # they are placed as other items are
        self._levels = depth_levels(self._parents)
        self._parent_from_node = np.zeros((len(nodes), 3, 4))
        self._rest = tuple(column[nodes] for column in tables.local)
        self._parent_from_node[:] = compose_affine(*self._rest)
        self._animated = np.flatnonzero(is_animated[nodes])
        self._entities = tables.entity[nodes[self._animated]]
        self._told_by_scene = tables.pose_sequence[nodes[self._animated]]

    def placed(self, timeline: Timeline, fraction: float, bases: NDArray[np.float64]) -> NDArray[np.float64]:
        """world_from_node (K, 3, 4), given that of the bases (K', 3, 4)."""
        assert timeline.newest is not None
        position, rotation, scale, known = timeline.locals(self._entities, fraction)
        known &= self._told_by_scene <= timeline.newest.delta_sequence
        self._parent_from_node[self._animated] = compose_affine(position, rotation, scale)
        if not known.all():
            resting = self._animated[~known]
            self._parent_from_node[resting] = compose_affine(*(column[resting] for column in self._rest))
        self._parent_from_node[: len(bases)] = bases
        return np.asarray(propagate_affine(self._parents, self._parent_from_node, levels=self._levels))


def _carrier_rows(tables: SceneTables, is_body: NDArray[np.bool_]) -> Rows:
    """For every row the row of the nearest body at or above it, -1 for none."""
    carrier = np.where(is_body, np.arange(len(tables.entity)), -1)
    for rows in tables.levels[1:]:
        carrier[rows] = np.where(carrier[rows] >= 0, carrier[rows], carrier[tables.parent[rows]])
    return carrier

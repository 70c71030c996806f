"""Where drawn things stand at this moment: those that physics moves, those that ride on them, and those that stand still."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from elys.common.math import quaternion
from elys.common.math.matrix import inverse_affine, multiply_affine
from elys.render_node.scene_tables import Rows, SceneTables
from elys.render_node.timeline import Timeline, rows_in


class Placement:
    """World transforms of M items, each an entity that may appear in state frames or ride on one that does.

    Frames give the pose of a body. An item's place follows as `world_from_body @ body_from_item`, of which the second, with all
    scales, changes only when the scene does.

    Attributes:
        position: [M, 3] f64 m, world. linear: [M, 3, 3] f32, rotation and scale of world_from_item.
    """

    def __init__(self, tables: SceneTables, rows: Rows, bodies: NDArray[np.uint32]) -> None:
        """`rows` (M,) of the tables are the items, `bodies` (B,) the entities that state frames tell of."""
        world_from_item = tables.world_from_local[rows]
        self.position = world_from_item[:, :, 3].copy()
        self.linear = world_from_item[:, :, :3].astype(np.float32)
        carrier = _carrier_rows(tables, bodies)[rows]
        self._moving = np.flatnonzero(carrier >= 0)
        carrier_rows, self._carrier = np.unique(carrier[self._moving], return_inverse=True)
        self._carriers = tables.entity[carrier_rows]
        self._told_by_scene = tables.pose_sequence[carrier_rows]
        world_from_carrier = np.empty((len(carrier_rows), 3, 4))
        world_from_carrier[:, :, :3] = quaternion.to_matrix(tables.rotation[carrier_rows])
        world_from_carrier[:, :, 3] = tables.world_from_local[carrier_rows][:, :, 3]
        carrier_from_world = inverse_affine(world_from_carrier)[self._carrier]
        self._carrier_from_item = multiply_affine(carrier_from_world, world_from_item[self._moving]).astype(np.float32)

    def follow(self, timeline: Timeline, fraction: float) -> None:
        """Moves the items to where they are `fraction` of the way to the newest frame."""
        if timeline.newest is None or not len(self._moving):
            return
        position, rotation, known = timeline.poses(self._carriers, fraction)
        known &= self._told_by_scene <= timeline.newest.delta_sequence
        turn = quaternion.to_matrix(rotation.astype(np.float32, copy=False))
        moving, carrier, from_item = self._moving, self._carrier, self._carrier_from_item
        if not known.all():  # gone from the frames, or moved by an edit they do not contain yet: stays where it is
            still_there = known[carrier]
            moving, carrier, from_item = moving[still_there], carrier[still_there], from_item[still_there]
        turned = turn[carrier] @ from_item
        self.linear[moving] = turned[:, :, :3]
        self.position[moving] = position[carrier] + turned[:, :, 3]


def _carrier_rows(tables: SceneTables, bodies: NDArray[np.uint32]) -> Rows:
    """For every row the row of the nearest body at or above it, -1 for none."""
    _, is_body = rows_in(bodies, tables.entity)
    carrier = np.where(is_body, np.arange(len(tables.entity)), -1)
    for rows in tables.levels[1:]:
        carrier[rows] = np.where(carrier[rows] >= 0, carrier[rows], carrier[tables.parent[rows]])
    return carrier

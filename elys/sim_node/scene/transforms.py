"""Where everything stands in the world, from what every Transform says relative to its parent.

The Transform component's columns are the one truth. What follows from them, world_from_local of every entity, is cached here
and worked out again only for what was marked dirty and all below it. Entities without a Transform stand where their parent
stands.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from elys.common.components import Quat, Vec3
from elys.common.ids import Entity
from elys.common.math.matrix import decompose_affine, inverse_affine, multiply_affine
from elys.sim_node.ecs.columns import NO_ROW, ComponentTable, require_row
from elys.sim_node.ecs.entities import Entities, EntityAllocator, Indices, grown, indices_of
from elys.sim_node.scene.hierarchy import GROUND, Hierarchy, places_of
from elys.sim_node.scene.kernels import LocalColumns, TargetPoses, WorldPoses, place_tree, read_poses


class Transforms:
    """World transforms of the entities of one hierarchy. Whoever writes Transform columns marks the entities dirty."""

    def __init__(self, allocator: EntityAllocator, hierarchy: Hierarchy, table: ComponentTable) -> None:
        self._allocator = allocator
        self._hierarchy = hierarchy
        self._table = table
        self.clear()

    def clear(self) -> None:
        """Forgets all world transforms, after the hierarchy was cleared."""
        capacity = self._allocator.capacity
        self._affine = np.zeros((capacity, 3, 4))
        self._affine[GROUND] = np.eye(3, 4)
        self._is_dirty = np.zeros(capacity, np.bool_)
        self._target_of = np.full(capacity, NO_ROW, np.int32)
        self._is_settled = True

    def mark_dirty(self, indices: Indices | int) -> None:
        """Says that local values or the parent changed for the entities at one or [N] places."""
        self._reserve(self._allocator.capacity)
        self._is_dirty[indices] = True
        self._is_settled = False

    def propagate(self) -> None:
        """Works out the world transforms of what is dirty and all below it; does nothing when nothing is."""
        if not self._is_settled:
            self._place(np.zeros((0, 3)), np.zeros((0, 4), np.float32))

    def world_from_local(self, entity: Entity) -> NDArray[np.float64]:
        """[3, 4] the entity's world transform: its axes and, last, its position [m]. A copy."""
        index = self._hierarchy.require(entity)
        self.propagate()
        return np.array(self._affine[index])

    def world_affines(self, entities: Entities) -> NDArray[np.float64]:
        """[N, 3, 4] the world transforms of [N] entities."""
        indices = self._indices_of(entities)
        self.propagate()
        affines: NDArray[np.float64] = self._affine[indices]
        return affines

    def world_poses(self, entities: Entities) -> WorldPoses:
        """Positions [N, 3] f64 m, rotations [N, 4] f32 and scales [N, 3] f32 of [N] entities in the world."""
        count = len(self._indices_of(entities))
        self.propagate()
        poses = WorldPoses(np.empty((count, 3)), np.empty((count, 4), np.float32), np.empty((count, 3), np.float32))
        read_poses(places_of(entities), self._hierarchy.parent, self._local_columns(), self._affine, poses)
        return poses

    def world_pose(self, entity: Entity) -> tuple[Vec3, Quat, Vec3]:
        """Position [m], rotation x y z w and scale of one entity in the world."""
        poses = self.world_poses(np.array([entity], np.uint32))
        position, rotation, scale = (column[0].tolist() for column in poses)
        return tuple(position), tuple(rotation), tuple(scale)

    def set_world_poses(
        self, entities: Entities, positions: NDArray[np.float64], rotations: NDArray[np.float32]
    ) -> None:
        """Writes the local poses that put [N] different entities at these world poses; logs no change.

        An entity and one of its ancestors may both be among them: what lies under what moved, moves along. Scales stay. Under a
        parent that is squeezed flat there is no such local pose: then it stays.

        Args:
            positions: [N, 3] m. rotations: [N, 4] unit quaternions x y z w.

        Raises:
            EntityError: one does not live. ComponentError: one has no Transform.
        """
        indices = self._indices_of(entities)
        lacking = np.flatnonzero(self._table.row_of[indices] == NO_ROW)
        if lacking.size:
            require_row(self._table, int(indices[lacking[0]]), self._hierarchy.describe(int(entities[lacking[0]])))
        self._reserve(self._allocator.capacity)
        self._target_of[indices] = np.arange(len(indices), dtype=np.int32)
        self._place(np.require(positions, np.float64, ["C", "W"]), np.require(rotations, np.float32, ["C", "W"]))
        self._target_of[indices] = NO_ROW

    def set_world_affines(self, entities: Entities, world_from_local: NDArray[np.float64]) -> None:
        """Writes the local poses and scales that give [N] entities these [N, 3, 4] world transforms, as far as they can.

        None of them stands below another. They can unless the parent is stretched unevenly at an angle (that takes a shear, which
        is left out) or squeezed flat (then nothing changes). Logs no change; ComponentError if one has no Transform.
        """
        indices = self._indices_of(entities)
        for entity, index in zip(entities.tolist(), indices.tolist(), strict=True):
            require_row(self._table, index, self._hierarchy.describe(entity))
        self.propagate()
        parents = self._hierarchy.parent[indices]
        for parent in np.unique(parents).tolist():
            chosen = parents == parent
            try:
                parent_from_world = inverse_affine(self._affine[parent])
            except np.linalg.LinAlgError:
                continue
            parent_from_local = multiply_affine(parent_from_world, world_from_local[chosen])
            self._write_local(indices[chosen], np.asarray(parent_from_local, np.float64))

    def _write_local(self, indices: Indices, parent_from_local: NDArray[np.float64]) -> None:
        rows = self._table.row_of[indices]
        # Mirrored axes stay the ones that were: the decomposition alone would mirror x instead, and turn the rest about.
        scale = self._table.column("scale")
        signs = np.where(scale[rows] < 0.0, -1.0, 1.0)
        parent_from_local[..., :3] *= signs[:, None, :]
        position, rotation, stretch = decompose_affine(parent_from_local)
        self._table.column("position")[rows] = position
        self._table.column("rotation")[rows] = rotation
        scale[rows] = stretch * signs
        self.mark_dirty(indices)

    def _place(self, target_positions: NDArray[np.float64], target_rotations: NDArray[np.float32]) -> None:
        self._reserve(self._allocator.capacity)
        place_tree(
            self._hierarchy.order,
            self._hierarchy.parent,
            self._local_columns(),
            self._affine,
            self._is_dirty,
            TargetPoses(self._target_of, target_positions, target_rotations),
        )
        self._is_dirty.fill(False)
        self._is_settled = True

    def _local_columns(self) -> LocalColumns:
        table = self._table
        return LocalColumns(table.row_of, *(table.whole_column(field) for field in ("position", "rotation", "scale")))

    def _indices_of(self, entities: Entities) -> Indices:
        alive = self._allocator.are_alive(entities)
        if not alive.all():
            self._hierarchy.require(int(entities[np.argmin(alive)]))
        return indices_of(entities)

    def _reserve(self, capacity: int) -> None:
        if capacity <= len(self._affine):
            return
        self._affine = grown(self._affine, capacity)
        self._is_dirty = grown(self._is_dirty, capacity)
        self._target_of = grown(self._target_of, capacity, fill=NO_ROW)

"""How entities stood before clips moved them: what is seen of them where clips say nothing, or not all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from elys.common.components import Transform
from elys.common.math.arrays import Floats
from elys.sim_node.ecs.changes import WorldChanges
from elys.sim_node.ecs.entities import Entities, Indices, indices_of
from elys.sim_node.ecs.world import World


class RestPoses:
    """Rows of [R] entities that clips move or have moved, by their ids."""

    def __init__(self) -> None:
        self.entity = np.zeros(0, np.uint32)  # rising
        self.position = np.zeros((0, 3))
        self.rotation = np.zeros((0, 4), np.float32)
        self.scale = np.zeros((0, 3), np.float32)

    def learn(self, world: World, places: Indices) -> None:
        """Remembers those at places that are not known yet, as they stand now; forgets who is no more."""
        alive = world.allocator.are_alive(self.entity)
        ids: Entities = world.allocator.ids[places]
        new = np.setdiff1d(ids, self.entity)
        if alive.all() and not len(new):
            return
        entity = np.concatenate((self.entity[alive], new))
        order = np.argsort(entity, kind="stable")
        table = world.table(Transform)
        rows = table.rows(new)
        for name in ("position", "rotation", "scale"):
            both = np.concatenate((getattr(self, name)[alive], table.column(name)[rows]))
            setattr(self, name, both[order])
        self.entity = entity[order]

    def follow(self, world: World, changes: WorldChanges) -> None:
        """What somebody edits is how it rests from then on."""
        edited = [entity for entity, component in changes.set if component == Transform.__name__]
        if not edited or not len(self.entity):
            return
        ids = np.array(edited, np.uint32)
        rows = np.searchsorted(self.entity, ids)
        known = self.entity[np.minimum(rows, len(self.entity) - 1)] == ids
        rows, ids = rows[known], ids[known]
        table = world.table(Transform)
        for name in ("position", "rotation", "scale"):
            getattr(self, name)[rows] = table.column(name)[table.row_of[indices_of(ids)]]

    def of(self, name: str, ids: Entities) -> NDArray[np.float64]:
        """[N, 3 or 4] float64: position, rotation or scale of known entities [N]."""
        column: Floats = getattr(self, name)
        return np.asarray(column[np.searchsorted(self.entity, ids)], np.float64)

    def knows(self, entity: int) -> bool:
        """Whether it is one of them."""
        row = int(np.searchsorted(self.entity, entity))
        return row < len(self.entity) and int(self.entity[row]) == entity

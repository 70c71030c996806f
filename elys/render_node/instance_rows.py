"""Instances as the card reads them, kept between pictures: a picture copies rows and puts in where they are from the eye."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from elys.render_node.gpu import INSTANCE_DTYPE

if TYPE_CHECKING:
    from elys.render_node.render_world import RenderWorld
    from elys.render_node.scene_tables import Rows

_FLOATS = INSTANCE_DTYPE.itemsize // 4
_PLACE = (3, 7, 11)  # floats of a row that hold the translation of its affine transform


class InstanceRows:
    """Of one RenderWorld. What does not depend on the eye is written when the scene or a pose changes, not for each picture."""

    def __init__(self) -> None:
        self._rows = np.zeros((0, _FLOATS), np.float32)
        self._scene_version = self._pose_version = -1

    def seen_from(self, world: RenderWorld, rows: Rows, eye: NDArray[np.float64]) -> NDArray[np.void]:
        """Instances (N,) of INSTANCE_DTYPE for these rows of the world."""
        self._follow(world)
        taken = self._rows[rows]
        for axis, place in enumerate(_PLACE):  # in 64 bits, before what is left fits into 32
            taken[:, place] = (world.position[:, axis] - eye[axis]).astype(np.float32)[rows]
        return taken.view(INSTANCE_DTYPE)[:, 0]

    def _follow(self, world: RenderWorld) -> None:
        if self._scene_version != world.scene_version:
            self._rows = np.empty((world.instance_count, _FLOATS), np.float32)
            named = self._rows.view(INSTANCE_DTYPE)[:, 0]
            named["surface"] = world.surface
            named["entity"] = world.entity
            named["pose"] = world.pose
        elif self._pose_version == world.pose_version:
            return
        for row in range(3):
            for column in range(3):
                self._rows[:, 4 * row + column] = world.linear[:, row, column]
        self._scene_version, self._pose_version = world.scene_version, world.pose_version

"""Instances as the card reads them, kept between pictures: a picture copies rows and puts in where they are from the eye."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from elys.render_node.batch_terms import GLOWING
from elys.render_node.gpu import INSTANCE_DTYPE, PLAIN_INSTANCE_DTYPE

if TYPE_CHECKING:
    from elys.render_node.render_world import RenderWorld
    from elys.render_node.scene_tables import Rows

_PLACE = (3, 7, 11)  # floats of a row that hold the translation of its affine transform


class InstanceRows:
    """Of one RenderWorld. What does not depend on the eye is written when the scene or a pose changes, not for each picture."""

    def __init__(self) -> None:
        self._kept: dict[int, _Kept] = {}  # by the size of a row

    def seen_from(
        self, world: RenderWorld, rows: Rows, eye: NDArray[np.float64], *, for_light: bool = False
    ) -> NDArray[np.void]:
        """Instances (N,) of INSTANCE_DTYPE for these rows of the world, until they are asked for anew.

        `for_light` leaves out what programs that shade do not read of this world: then they are of PLAIN_INSTANCE_DTYPE.
        """
        layout = PLAIN_INSTANCE_DTYPE if for_light and _is_plain(world) else INSTANCE_DTYPE
        kept = self._kept.setdefault(layout.itemsize, _Kept(layout))
        kept.follow(world)
        return kept.taken(world, rows, eye)


class _Kept:
    """Rows of one layout."""

    def __init__(self, layout: np.dtype[np.void]) -> None:
        self._layout = layout
        self._rows = np.zeros((0, layout.itemsize // 4), np.float32)
        self._taken = self._rows  # memory that has been touched: fresh pages cost more than what is written to them
        self._scene_version = self._pose_version = -1

    def taken(self, world: RenderWorld, rows: Rows, eye: NDArray[np.float64]) -> NDArray[np.void]:
        if len(self._taken) < len(rows):
            self._taken = np.empty((len(rows), self._rows.shape[1]), np.float32)
        taken = self._taken[: len(rows)]
        for axis, place in enumerate(_PLACE):  # in 64 bits, before what is left fits into 32
            self._rows[:, place] = world.position[:, axis] - eye[axis]
        np.take(self._rows, rows, axis=0, out=taken, mode="clip")  # other modes copy once more
        return taken.view(self._layout)[:, 0]

    def follow(self, world: RenderWorld) -> None:
        if self._scene_version != world.scene_version:
            self._rows = np.zeros((world.instance_count, self._rows.shape[1]), np.float32)
            named = self._rows.view(self._layout)[:, 0]
            named["base_color"] = world.surface[:, 0]
            named["reflection"] = world.surface[:, 2, :2]
            if self._layout is INSTANCE_DTYPE:
                named["emissive"] = world.surface[:, 1]
                named["entity"] = world.entity
                named["pose"] = world.pose
        elif self._pose_version == world.pose_version:
            return
        for row in range(3):
            for column in range(3):
                self._rows[:, 4 * row + column] = world.linear[:, row, column]
        self._scene_version, self._pose_version = world.scene_version, world.pose_version


def _is_plain(world: RenderWorld) -> bool:
    """Whether nobody glows, has holes, or is bent or morphed."""
    return not any(
        GLOWING in batch.terms or batch.look.alpha_mode == "mask" or batch.look.deformation for batch in world.batches
    )

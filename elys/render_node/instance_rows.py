"""Instances as the card reads them before it knows where they are: what stays of each of them, and on which body it rides.

    ITEM_DTYPE rows ──┐
    body poses ───────┼──> instance_place.vert ──> INSTANCE_DTYPE rows, for the passes
    eye, share of way ┘

Written when the scene changes, or who rides on what; never because a body has moved. What an edit touches is written alone.
"""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.state_frame import StateFrame
from elys.render_node.instances import Instances
from elys.render_node.placement import Placement
from elys.render_node.scene_tables import Rows
from elys.render_node.timeline import Timeline

# As `instance_place.vert` reads it.
ITEM_DTYPE: Final = np.dtype(
    [
        ("affine", "<f4", (3, 4)),  # body_from_instance of who rides, world_from_instance of who does not
        ("low", "<f4", (3,)),  # [m] what the 32 bits of the translation leave over
        (
            "body",
            "<i4",
            (2,),
        ),  # rows in the newest frame and in the one before, -1 for none; -2 - k: the k-th that is led
        ("base_color", "<f4", (4,)),
        ("reflection", "<f4", (2,)),
        ("emissive", "<f4", (4,)),
        ("entity", "<u4"),
        ("pose", "<i4", (2,)),
    ]
)
TEXELS_OF_LED: Final = 4
KEPT_CHANGES: Final = 16  # versions back, of which it is known which rows have changed since


class InstanceRows:
    """Of M instances of one RenderWorld, of which some are `led`: placed by the processor, as animations are.

    Attributes:
        items: [M] of ITEM_DTYPE. version: rises when they change.
        rides: whether any rides on a body.
    """

    def __init__(self) -> None:
        self.items = np.zeros(0, ITEM_DTYPE)
        self.version = 0
        self.rides = False
        self._is_settled = False
        self._changes: deque[Rows] = deque(maxlen=KEPT_CHANGES)  # the rows that each of the last versions wrote

    def rest(self, instances: Instances, world_from_instance: NDArray[np.float64], led: Rows) -> None:
        """Takes another scene, or others that ride: the transforms (M, 3, 4) at rest, and who is led."""
        self.items, self._rest, self._led = np.zeros(len(instances.rows), ITEM_DTYPE), world_from_instance, led
        everybody = np.arange(len(self.items))
        self.items["entity"] = instances.entity
        self.items["pose"] = instances.deformation.pose
        self._write_surface(instances.surface, everybody)
        self._is_settled = False
        self._seen: tuple[StateFrame | None, StateFrame | None] = (None, None)
        self._write_places(np.full((len(everybody), 2), -1, np.int32), everybody, None)
        self.rides = False
        self._changes.clear()

    def paint(self, instances: Instances, rows: Rows) -> None:
        """Takes the materials of some."""
        self._write_surface(instances.surface, rows)
        self._changed(rows)

    def move(self, placement: Placement, rows: Rows, world_from_instance: NDArray[np.float64]) -> None:
        """Takes where some, none of them led, are at rest (N, 3, 4) and how they stand on their bodies, ascending."""
        self._rest[rows] = world_from_instance
        if len(placement.riding(rows)):
            self._is_settled, self._seen = False, (None, None)  # frames may not know of it
        self._write_places(self.items["body"][rows], rows, placement)

    def changed_since(self, version: int) -> Rows | None:
        """The rows, ascending, in which these differ from an earlier version; None where that is not known any more."""
        back = self.version - version
        if back > len(self._changes):
            return None
        return np.unique(np.concatenate([*self._changes][-back:]))

    def follow(self, placement: Placement, timeline: Timeline) -> None:
        """Takes who rides on which body of the newest two frames."""
        frames = (timeline.newest, timeline.previous)
        if self._is_settled or (frames[0] is self._seen[0] and frames[1] is self._seen[1]):
            return
        self._seen = frames
        body, self._is_settled = placement.body_rows(timeline)
        body[self._led] = self.items["body"][self._led]
        rows = np.flatnonzero((body != self.items["body"]).any(axis=1))
        if len(rows):
            self._write_places(body[rows], rows, placement)
            self.rides = bool((body[:, 0] >= 0).any())

    def _write_surface(self, surface: NDArray[np.float32], rows: Rows) -> None:
        self.items["base_color"][rows] = surface[rows, 0]
        self.items["reflection"][rows] = surface[rows, 2, :2]
        self.items["emissive"][rows] = surface[rows, 1]

    def _write_places(self, body: NDArray[np.int32], rows: Rows, placement: Placement | None) -> None:
        """Of some, ascending, that ride on these bodies (N, 2)."""
        affine, low = split(self._rest[rows])
        riding = np.flatnonzero(body[:, 0] >= 0)
        if placement is not None and len(riding):
            affine[riding] = placement.on_carriers(rows[riding])
        self.items["affine"][rows], self.items["low"][rows] = affine, low
        self.items["body"][rows] = body
        self.items["body"][self._led, 0] = -2 - np.arange(len(self._led))
        self._changed(rows)

    def _changed(self, rows: Rows) -> None:
        self._changes.append(rows)
        self.version += 1


def split(world_from_instance: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Transforms (N, 3, 4) in 32 bits, and what these leave over of the translations (N, 3)."""
    affine = world_from_instance.astype(np.float32)
    return affine, (world_from_instance[:, :, 3] - affine[:, :, 3]).astype(np.float32)


def led_texels(position: NDArray[np.float64], linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """Four texels (4 K, 4) of each that is led."""
    texels = np.zeros((len(position), TEXELS_OF_LED, 4), np.float32)
    texels[:, :3, :3] = linear
    texels[:, :3, 3] = position
    texels[:, 3, :3] = position - texels[:, :3, 3]
    return texels.reshape(-1, 4)

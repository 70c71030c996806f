"""Instances as the card reads them before it knows where they are: what stays of each of them, and on which body it rides.

    ITEM_DTYPE rows ──┐
    body poses ───────┼──> instance_place.vert ──> INSTANCE_DTYPE rows, for the passes
    eye, share of way ┘

Written when the scene changes, or who rides on what; never because something has moved.
"""

from __future__ import annotations

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

    def rest(self, instances: Instances, world_from_instance: NDArray[np.float64], led: Rows) -> None:
        """Takes another scene, or others that ride: the transforms (M, 3, 4) at rest, and who is led."""
        items = np.zeros(len(instances.rows), ITEM_DTYPE)
        items["base_color"] = instances.surface[:, 0]
        items["reflection"] = instances.surface[:, 2, :2]
        items["emissive"] = instances.surface[:, 1]
        items["entity"] = instances.entity
        items["pose"] = instances.deformation.pose
        self.items, self._rest, self._led = items, world_from_instance, led
        self._is_settled = False
        self._seen: tuple[StateFrame | None, StateFrame | None] = (None, None)
        self._write(np.full((len(items), 2), -1, np.int32), None)

    def follow(self, placement: Placement, timeline: Timeline) -> None:
        """Takes who rides on which body of the newest two frames."""
        frames = (timeline.newest, timeline.previous)
        if self._is_settled or (frames[0] is self._seen[0] and frames[1] is self._seen[1]):
            return
        self._seen = frames
        body, self._is_settled = placement.body_rows(timeline)
        body[self._led] = self.items["body"][self._led]
        if not np.array_equal(body, self.items["body"]):
            self._write(body, placement)

    def _write(self, body: NDArray[np.int32], placement: Placement | None) -> None:
        items = self.items
        items["affine"], items["low"] = split(self._rest)
        rides = np.flatnonzero(body[:, 0] >= 0)
        if placement is not None and len(rides):
            moving, affine = placement.carrier_from_item
            riding = body[moving, 0] >= 0
            items["affine"][moving[riding]] = affine[riding]
        items["body"] = body
        items["body"][self._led, 0] = -2 - np.arange(len(self._led))
        self.rides = len(rides) > 0
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

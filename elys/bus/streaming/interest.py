"""How much each body matters to a viewer, and how exactly it has to be told.

What is seen near and large comes first; what is behind the camera seldom, but it comes. What is selected or unfolded, so that its
numbers are read, is told as exactly as can be. Weights only order bodies: each waits with growing impatience (see `sender`).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.bus.messages.streaming import MOST_CAMERAS, MOST_NAMED, StreamInterest
from elys.bus.messages.views import ViewCamera
from elys.bus.state_packing.compact import POSITION_STEPS
from elys.bus.streaming.telling import COARSEST
from elys.common.math import quaternion

UNSEEN: Final = 0.1  # weight of what is in no picture
CHOSEN: Final = 8.0
OPEN: Final = 4.0
NO_CAMERA_LEVEL: Final = 3  # steps of 4 mm, where nobody says from where it is seen
_HALF_WEIGHT: Final = 10.0  # [m]
_PIXEL: Final = 0.5e-3  # [rad] half a pixel of a picture 1080 high
_LEVEL_AT_A_METRE: Final = math.log2(_PIXEL * POSITION_STEPS)
_MARGIN: Final = 1.0  # [m] by which a body may reach into the picture


class Regard(NamedTuple):
    """How N bodies are regarded."""

    weight: NDArray[np.float64]  # [N] above 0
    level: NDArray[np.int32]  # [N] at which a viewer sees no difference; below 0: it reads numbers


def regard(interest: StreamInterest, position: NDArray[np.float64], entities: NDArray[np.uint32]) -> Regard:
    """Weights and levels of bodies at [3, N] m."""
    count = len(entities)
    cameras = [camera for camera in interest.cameras[:MOST_CAMERAS] if _is_sane(camera)]
    if not cameras:
        weight, level = np.ones(count), np.full(count, NO_CAMERA_LEVEL, np.int32)
    else:
        weight, level = np.zeros(count), np.full(count, COARSEST, np.int32)
        for camera in cameras:
            seen_weight, seen_level = _seen(camera, interest.aspect, position)
            np.maximum(weight, seen_weight, out=weight)
            np.minimum(level, seen_level, out=level)
    for named, factor in ((interest.open, OPEN), (interest.chosen, CHOSEN)):
        rows = np.isin(entities, [entity for entity in named[:MOST_NAMED] if 0 <= entity < 1 << 32])
        weight[rows] = np.maximum(weight[rows], 1.0) * factor
        level[rows] = -COARSEST
    return Regard(weight, level)


def _seen(
    camera: ViewCamera, aspect: float, position: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    offset = position.T - np.array(camera.position)
    inverse = np.array(camera.rotation) * (-1.0, -1.0, -1.0, 1.0)
    x, y, z = quaternion.rotate(inverse, offset).T
    aspect = aspect if 0.1 < aspect < 10.0 else 1.0
    if camera.ortho_height > 0.0:
        distance = np.full(position.shape[1], camera.ortho_height)
        height = np.full(position.shape[1], camera.ortho_height * 0.5)
    else:
        distance = np.sqrt((offset * offset).sum(axis=1))
        height = np.maximum(-z, 0.0) * math.tan(min(max(camera.field_of_view, 0.01), 3.0) * 0.5)
    is_seen = (-z > -_MARGIN) & (np.abs(y) < height + _MARGIN) & (np.abs(x) < height * aspect + _MARGIN)
    weight = np.where(is_seen, 1.0, UNSEEN) / (1.0 + distance / _HALF_WEIGHT)
    level = np.floor(np.log2(np.maximum(distance, 0.1)) + _LEVEL_AT_A_METRE) + np.where(is_seen, 0, 2)
    return weight, np.clip(level, 0, COARSEST).astype(np.int32)


def _is_sane(camera: ViewCamera) -> bool:
    numbers = (*camera.position, *camera.rotation, camera.field_of_view, camera.ortho_height)
    if not all(map(math.isfinite, numbers)) or max(map(abs, numbers)) > 1e9:
        return False
    return 0.5 < sum(part * part for part in camera.rotation) < 2.0

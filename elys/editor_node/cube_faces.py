"""The cube in the viewport's corner as geometry: what of it is seen, and what a point on it stands for."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from elys.common.components import Quat
from elys.common.math import quaternion

Direction = tuple[float, float, float]

HALF: Final = 0.58  # of the picture's half: the cube's half edge, so that its corners stay inside however it is turned
_RIM: Final = 0.62  # of the half edge: what is farther out on a face belongs to its edge or corner
NAMES: Final = {
    (1.0, 0.0, 0.0): "Right",
    (-1.0, 0.0, 0.0): "Left",
    (0.0, 1.0, 0.0): "Top",
    (0.0, -1.0, 0.0): "Bottom",
    (0.0, 0.0, 1.0): "Front",
    (0.0, 0.0, -1.0): "Back",
}


# Cameras rest in most frames, and few are open.
@lru_cache(maxsize=16)
def seen_faces(rotation: Quat) -> tuple[tuple[Direction, NDArray[np.float64]], ...]:
    """The faces turned to a camera of this rotation (world_from_view), and their corners (4, 2) in its picture, y up."""
    view_from_world = quaternion.conjugate(np.asarray(rotation, dtype=np.float64))
    faces = []
    for normal in NAMES:
        if quaternion.rotate(view_from_world, np.array(normal))[2] > 1e-3:
            corners = quaternion.rotate(view_from_world, _square(normal, 1.0, np.zeros(3)))
            faces.append((normal, np.asarray(corners, dtype=np.float64)[:, :2] * HALF))
    return tuple(faces)


@lru_cache(maxsize=16)
def axes_along(rotation: Quat, length: float) -> NDArray[np.float64]:
    """The axes from the cube's corner of lowest x, y and z, `length` half edges long: (3, 2, 3) beginnings and ends in view
    axes, z to the eye, for a camera of this rotation.
    """
    view_from_world = quaternion.conjugate(np.asarray(rotation, dtype=np.float64))
    corner = quaternion.rotate(view_from_world, np.full(3, -1.0))
    ways = quaternion.rotate(view_from_world, np.eye(3))
    return np.stack((np.broadcast_to(corner, (3, 3)), corner + length * ways), axis=1) * HALF


def part_at(rotation: ArrayLike, point: tuple[float, float]) -> Direction | None:
    """What is seen at a point of the picture (-1 to 1, y up): a face, an edge or a corner, as -1, 0, 1 along each axis."""
    turn = np.asarray(rotation, dtype=np.float64)
    start = np.asarray(quaternion.rotate(turn, np.array((point[0] / HALF, point[1] / HALF, 4.0))))
    way = np.asarray(quaternion.rotate(turn, (0.0, 0.0, -1.0)))
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack(((-1.0 - start) / way, (1.0 - start) / way))  # slabs: Kay and Kajiya 1986
    ends = np.where(np.abs(way) < 1e-12, np.where(np.abs(start) <= 1.0, [[-np.inf], [np.inf]], np.inf), ends)
    enter, leave = float(ends.min(axis=0).max()), float(ends.max(axis=0).min())
    if enter > leave:
        return None
    hit = start + way * enter
    x, y, z = np.where(np.abs(hit) > _RIM, np.sign(hit), 0.0).tolist()
    return x + 0.0, y + 0.0, z + 0.0


def part_corners(rotation: ArrayLike, part: Direction, normal: Direction) -> NDArray[np.float64] | None:
    """What of a face belongs to a part, as corners (4, 2) in the picture; None where the part does not touch the face."""
    if float(np.dot(part, normal)) < 0.5:
        return None
    low, high = -np.ones(3), np.ones(3)
    for axis in range(3):
        if part[axis] == 0.0:
            low[axis], high[axis] = -_RIM, _RIM
        elif part[axis] != normal[axis]:
            low[axis], high[axis] = sorted((part[axis] * _RIM, part[axis]))
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    view_from_world = quaternion.conjugate(np.asarray(rotation, dtype=np.float64))
    corners = quaternion.rotate(view_from_world, _square(normal, half, middle))
    return np.asarray(corners, dtype=np.float64)[:, :2] * HALF


def _square(normal: Direction, half: ArrayLike, middle: NDArray[np.float64]) -> NDArray[np.float64]:
    """The corners (4, 3) of a face of a box, one after the other."""
    axis = int(np.argmax(np.abs(normal)))
    others = [other for other in range(3) if other != axis]
    corners = np.tile(np.array(normal), (4, 1))
    for row, (a, b) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1))):
        corners[row, others] = (a, b)
    place = np.where(np.array(normal) != 0.0, 0.0, middle)
    size = np.where(np.array(normal) != 0.0, 1.0, half)
    return corners * size + place

"""A scene as plain columns, one row a body: what any engine can be told."""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

Array = np.ndarray[Any, Any]

DYNAMIC: Final = 0
STATIC: Final = 2
BOX: Final = 0
SPHERE: Final = 1
CAPSULE: Final = 2

G: Final = 9.81  # [m/s^2]


class Bodies(NamedTuple):
    """N bodies of one shape each, the shape's centre at the body's."""

    motion: Array  # (N,) uint8: 0 dynamic, 2 static
    shape: Array  # (N,) uint8: 0 box, 1 sphere, 2 capsule
    size: Array  # (N, 3) full edge lengths of boxes [m]
    radius: Array  # (N,) of spheres and capsules [m]
    half_length: Array  # (N,) of a capsule from its centre to that of a cap, along its y [m]
    position: Array  # (N, 3) [m]
    rotation: Array  # (N, 4) x y z w
    linear_velocity: Array  # (N, 3) [m/s]
    angular_velocity: Array  # (N, 3) in world axes [rad/s]
    mass: Array  # (N,) [kg], of even density
    friction: Array  # (N,) equal for all that touch, so that no rule of combination matters
    restitution: Array  # (N,) likewise
    fast: Array  # (N,) bool: for engines that do continuous collision only where they are asked to


class RigidScene(NamedTuple):
    """Bodies and what pulls them."""

    bodies: Bodies
    gravity: tuple[float, float, float] = (0.0, -G, 0.0)  # [m/s^2]


def bodies(
    position: ArrayLike,
    *,
    motion: ArrayLike = DYNAMIC,
    shape: ArrayLike = BOX,
    size: ArrayLike = (1.0, 1.0, 1.0),
    radius: ArrayLike = 0.5,
    half_length: ArrayLike = 0.0,
    rotation: ArrayLike = (0.0, 0.0, 0.0, 1.0),
    linear_velocity: ArrayLike = (0.0, 0.0, 0.0),
    angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    mass: ArrayLike = 1.0,
    friction: ArrayLike = 0.5,
    restitution: ArrayLike = 0.0,
    fast: ArrayLike = False,
) -> Bodies:
    """Bodies at positions (N, 3); one value stands for all, else there is a row for each."""
    where = np.atleast_2d(np.asarray(position, np.float64))
    count = len(where)

    def column(values: ArrayLike, width: int = 0, dtype: Any = np.float64) -> Array:
        return np.array(np.broadcast_to(np.asarray(values, dtype), (count, width) if width else (count,)))

    return Bodies(
        column(motion, dtype=np.uint8),
        column(shape, dtype=np.uint8),
        column(size, 3),
        column(radius),
        column(half_length),
        column(where, 3),
        column(rotation, 4),
        column(linear_velocity, 3),
        column(angular_velocity, 3),
        column(mass),
        column(friction),
        column(restitution),
        column(fast, dtype=np.bool_),
    )


def joined(*parts: Bodies) -> Bodies:
    """The bodies of all parts, in order."""
    return Bodies(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def ground(*, friction: float = 0.5, restitution: float = 0.0, x: float = 0.0, width: float = 200.0) -> Bodies:
    """A static slab whose top is at y = 0."""
    slab = (width, 2.0, width)
    return bodies((x, -1.0, 0.0), motion=STATIC, size=slab, friction=friction, restitution=restitution)


def turn_about_z(angle: float) -> Array:
    """The quaternion of a turn by `angle` [rad] about z."""
    return np.array([0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)])

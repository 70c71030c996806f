"""A camera led by a hand: it circles around a point, comes nearer, and moves sideways with what it looks at."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from elys.bus.messages.views import ViewCamera
from elys.common.math import quaternion
from elys.common.math.matrix import look_rotation
from elys.render_node.camera import framing_camera

TURN_SPEED: Final = 4.0  # [rad] for a drag over the window's height
ZOOM_STEP: Final = 0.88  # of the distance for one step of the wheel
STEEPEST: Final = math.radians(89.5)


class Orbit:
    """Looks at `target` from `distance` [m], `yaw` [rad] around y (0: along -z) and `pitch` [rad] upwards."""

    def __init__(self) -> None:
        self.target: NDArray[np.float64] = np.zeros(3)
        self.distance = 10.0
        self.yaw = 0.0
        self.pitch = -0.4
        self.field_of_view = 0.9
        self.far = 500.0
        self.is_parallel = False  # as an orthographic camera sees

    def take(self, camera: ViewCamera, target_distance: float) -> None:
        """Stands where a camera stands, to circle around what is `target_distance` [m] before it."""
        forward = quaternion.rotate(np.asarray(camera.rotation, np.float64), np.array((0.0, 0.0, -1.0)))
        self.distance = max(target_distance, 1e-3)
        self.target = np.asarray(camera.position, np.float64) + forward * self.distance
        self.yaw = math.atan2(-forward[0], -forward[2])
        self.pitch = min(max(math.asin(float(np.clip(forward[1], -1.0, 1.0))), -STEEPEST), STEEPEST)
        self.field_of_view, self.far = camera.field_of_view, camera.far
        self.is_parallel = camera.ortho_height > 0.0
        if self.is_parallel:  # stands where the same would be seen in perspective: zooming and panning need a distance
            self.distance = camera.ortho_height / (2.0 * math.tan(self.field_of_view / 2.0))

    def frame(self, lower: ArrayLike, upper: ArrayLike, *, aspect: float) -> None:
        """Shows all of a box, from the side it is looked at already."""
        camera = framing_camera(
            lower, upper, aspect=aspect, field_of_view=self.field_of_view, direction=self._direction()
        )
        low, high = np.asarray(lower, np.float64), np.asarray(upper, np.float64)
        middle = (low + high) / 2 if np.isfinite(low).all() and np.isfinite(high).all() else np.zeros(3)
        is_parallel = self.is_parallel
        self.take(camera, float(np.linalg.norm(np.asarray(camera.position) - middle)))
        self.is_parallel = is_parallel

    def turn(self, x: float, y: float) -> None:
        """Circles by a drag of `x`, `y` window heights, right and down."""
        self.yaw -= x * TURN_SPEED
        self.pitch = min(max(self.pitch - y * TURN_SPEED, -STEEPEST), STEEPEST)

    def pan(self, x: float, y: float) -> None:
        """Moves so that what is looked at stays under the pointer."""
        axes = quaternion.to_matrix(look_rotation(self._direction()))
        height = 2.0 * self.distance * math.tan(self.field_of_view / 2)
        self.target = self.target + axes[:, 0] * (-x * height) + axes[:, 1] * (y * height)

    def zoom(self, steps: float) -> None:
        """Comes nearer by steps of the wheel, or goes away."""
        self.distance = min(max(self.distance * ZOOM_STEP**steps, 1e-3), 1e6)

    def camera(self) -> ViewCamera:
        """The point of view."""
        direction = self._direction()
        position = self.target - np.asarray(direction) * self.distance
        return ViewCamera(
            position=tuple(position.tolist()),
            rotation=tuple(look_rotation(direction).tolist()),
            field_of_view=self.field_of_view,
            ortho_height=2.0 * self.distance * math.tan(self.field_of_view / 2.0) if self.is_parallel else 0.0,
            near=max(self.distance * 2e-3, 1e-4),
            far=max(self.far, self.distance * 20.0),
        )

    def _direction(self) -> tuple[float, float, float]:
        flat = math.cos(self.pitch)
        return (-math.sin(self.yaw) * flat, math.sin(self.pitch), -math.cos(self.yaw) * flat)

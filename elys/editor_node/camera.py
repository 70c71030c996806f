"""The viewport's camera: turns about a target, pans, zooms to the cursor, flies, and glides to other points of view."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from elys.bus.messages.views import ViewCamera
from elys.common.math import matrix, quaternion
from elys.editor_node.preferences import CameraPose

ORBIT_SPEED: Final = 0.006  # [rad/pixel]
LOOK_SPEED: Final = 0.004  # [rad/pixel]
ZOOM_STEP: Final = 0.88  # distance left after one notch of the wheel
PITCH_LIMIT: Final = math.radians(89.0)
MIN_DISTANCE: Final = 0.02  # [m]
MAX_DISTANCE: Final = 20_000.0  # [m]
GLIDE_TIME: Final = 0.25  # [s] from one point of view to another
# A parallel view sees the same from however far away: it stands back so that nothing nearer than its target is cut off.
_STAND_BACK: Final = 4.0  # of the distance
_LEAST_STAND_BACK: Final = 200.0  # [m]

Vector = NDArray[np.float64]


class OrbitCamera:
    """A point of view at `distance` from a `target`, turned by yaw about the world's y and pitch about its own x."""

    def __init__(self) -> None:
        self.target: Vector = np.array((0.0, 0.75, 0.0))  # [m]
        self.distance = 12.0  # [m]
        self.yaw = math.radians(35.0)
        self.pitch = math.radians(-24.0)
        self.field_of_view = 0.9  # [rad] vertical
        self.fly_speed = 6.0  # [m/s]
        self.is_parallel = False  # rather than in perspective
        self._glide: tuple[CameraPose, CameraPose, float] | None = None  # from, to, and for how long already [s]

    @property
    def rotation(self) -> Vector:
        """world_from_view as a quaternion x y z w."""
        turn = quaternion.from_axis_angle((0.0, 1.0, 0.0), self.yaw)
        return _float64(quaternion.multiply(turn, quaternion.from_axis_angle((1.0, 0.0, 0.0), self.pitch)))

    @property
    def position(self) -> Vector:
        """Where it stands [m]."""
        return self.target + self.backward * self.distance

    @property
    def backward(self) -> Vector:
        """Away from what it looks at."""
        return _float64(quaternion.rotate(self.rotation, (0.0, 0.0, 1.0)))

    @property
    def view(self) -> ViewCamera:
        """As it is sent to a render node. The clip planes go with the distance, so that depth stays fine up close."""
        position, rotation = self.position, self.rotation
        near, far = min(0.1, max(0.005, self.distance * 0.01)), max(1000.0, self.distance * 20.0)
        if self.is_parallel:
            back = max(_LEAST_STAND_BACK, self.distance * _STAND_BACK)
            position = self.target + self.backward * back
            near, far = 0.1, back + far
        return ViewCamera(
            position=(float(position[0]), float(position[1]), float(position[2])),
            rotation=(float(rotation[0]), float(rotation[1]), float(rotation[2]), float(rotation[3])),
            field_of_view=self.field_of_view,
            ortho_height=self.height if self.is_parallel else 0.0,
            near=near,
            far=far,
        )

    @property
    def height(self) -> float:
        """What is seen from below to above [m] at the target."""
        return 2.0 * self.distance * math.tan(self.field_of_view / 2.0)

    @property
    def pose(self) -> CameraPose:
        """The point of view, to come back to; where it glides to, while it does."""
        if self._glide is not None:
            return self._glide[1]
        return self._pose

    @pose.setter
    def pose(self, pose: CameraPose) -> None:
        self._glide = None
        self._stand(pose)

    @property
    def _pose(self) -> CameraPose:
        x, y, z = self.target.tolist()
        return CameraPose(
            target=(x, y, z),
            yaw=self.yaw,
            pitch=self.pitch,
            distance=self.distance,
            field_of_view=self.field_of_view,
            is_parallel=self.is_parallel,
        )

    def _stand(self, pose: CameraPose) -> None:
        self.target = np.array(pose.target, dtype=np.float64)
        self.yaw, self.pitch, self.distance = pose.yaw, pose.pitch, pose.distance
        self.field_of_view, self.is_parallel = pose.field_of_view, pose.is_parallel

    @property
    def is_gliding(self) -> bool:
        """Whether it is under way to another point of view."""
        return self._glide is not None

    def glide_to(self, pose: CameraPose) -> None:
        """Goes to another point of view, the short way about; `advance` takes it there."""
        self.is_parallel = pose.is_parallel
        self._glide = (self._pose, pose, 0.0)

    def advance(self, elapsed: float) -> None:
        """Glides on."""
        if self._glide is None:
            return
        start, end, before = self._glide
        share = min((before + elapsed) / GLIDE_TIME, 1.0)
        if share >= 1.0:
            self.pose = end
            return
        self._glide = (start, end, before + elapsed)
        share = share * share * (3.0 - 2.0 * share)
        self.target = _float64(start.target) * (1.0 - share) + _float64(end.target) * share
        self.yaw = _wrapped(start.yaw + _wrapped(end.yaw - start.yaw) * share)
        self.pitch = start.pitch + (end.pitch - start.pitch) * share
        self.distance = start.distance * (end.distance / start.distance) ** share
        self.field_of_view = start.field_of_view + (end.field_of_view - start.field_of_view) * share

    def stop(self) -> None:
        """Stays where it is: a hand took hold of it."""
        self._glide = None

    def orbit(self, x: float, y: float) -> None:
        """Turns about the target by a drag of x, y pixels."""
        self.stop()
        self.yaw = _wrapped(self.yaw - x * ORBIT_SPEED)
        self.pitch = _clamped_pitch(self.pitch - y * ORBIT_SPEED)

    def look(self, x: float, y: float) -> None:
        """Turns about itself by a drag of x, y pixels."""
        self.stop()
        position = self.position
        self.yaw = _wrapped(self.yaw - x * LOOK_SPEED)
        self.pitch = _clamped_pitch(self.pitch - y * LOOK_SPEED)
        self.target = position - self.backward * self.distance

    def pan(self, x: float, y: float, height: int) -> None:
        """Shifts by a drag of x, y pixels in a picture `height` pixels high: what lies at the target keeps under the pointer."""
        self.stop()
        scale = self.height / max(height, 1)
        self.target = self.target + quaternion.rotate(self.rotation, (-x * scale, y * scale, 0.0))

    def zoom(self, notches: float, toward: tuple[float, float], aspect: float) -> None:
        """Comes closer by `notches` of the wheel; what lies under `toward` (-1 to 1, y up) at the target's depth stays there."""
        self.stop()
        before = self.distance
        self.distance = min(max(before * ZOOM_STEP**notches, MIN_DISTANCE), MAX_DISTANCE)
        reach = math.tan(self.field_of_view / 2.0) * (before - self.distance)
        offset = (toward[0] * aspect * reach, toward[1] * reach, 0.0)
        self.target = self.target + quaternion.rotate(self.rotation, offset)

    def fly(self, right: float, up: float, forward: float, elapsed: float, *, fast: bool = False) -> None:
        """Moves along its own axes; each is -1, 0 or 1."""
        self.stop()
        step = np.array((right, up, -forward))
        length = float(np.linalg.norm(step))
        if length > 0.0:
            speed = self.fly_speed * (4.0 if fast else 1.0) * elapsed
            self.target = self.target + quaternion.rotate(self.rotation, step / length * speed)

    def frame(self, center: Vector, radius: float) -> None:
        """Looks at a ball from where it fills most of the picture."""
        self.stop()
        self.target = np.asarray(center, dtype=np.float64)
        self.distance = min(max(1.4 * radius / math.sin(self.field_of_view / 2.0), MIN_DISTANCE), MAX_DISTANCE)

    def look_from(self, position: ArrayLike, forward: ArrayLike, distance: float) -> None:
        """Stands at `position` [m] and looks along `forward` at what is `distance` [m] away, upright."""
        self.stop()
        x, y, z = _float64(forward) / np.linalg.norm(forward)
        self.yaw = math.atan2(-x, -z)
        self.pitch = _clamped_pitch(math.asin(min(max(y, -1.0), 1.0)))
        self.distance = min(max(distance, MIN_DISTANCE), MAX_DISTANCE)
        self.target = _float64(position) - self.backward * self.distance


def view_from_world(camera: ViewCamera) -> Vector:
    """(4, 4), row by row."""
    world_from_view = matrix.compose_affine(np.array(camera.position), np.array(camera.rotation), np.ones(3))
    return _float64(matrix.affine_to_mat4(matrix.inverse_affine(world_from_view)))


def clip_from_view(camera: ViewCamera, aspect: float) -> Vector:
    """(4, 4), row by row."""
    if camera.ortho_height > 0.0:
        return matrix.orthographic(camera.ortho_height, aspect, camera.near, camera.far)
    return matrix.perspective(camera.field_of_view, aspect, camera.near, camera.far)


def project(camera: ViewCamera, aspect: float, point: Vector) -> tuple[float, float] | None:
    """Where a point in the world is seen, x and y from -1 to 1 (y up); None behind the camera."""
    clip = clip_from_view(camera, aspect) @ view_from_world(camera) @ np.append(point, 1.0)
    return (float(clip[0] / clip[3]), float(clip[1] / clip[3])) if clip[3] > 1e-9 else None


def _float64(values: ArrayLike) -> Vector:
    return np.asarray(values, dtype=np.float64)


def _wrapped(angle: float) -> float:
    return math.remainder(angle, math.tau)


def _clamped_pitch(pitch: float) -> float:
    return min(max(pitch, -PITCH_LIMIT), PITCH_LIMIT)

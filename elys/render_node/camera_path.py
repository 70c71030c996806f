"""Cameras that move by themselves: along keyframes of a file, or around the scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from elys.bus.messages.views import ViewCamera
from elys.common.components import Vec3
from elys.common.errors import ElysError
from elys.common.math.matrix import look_rotation
from elys.render_node.camera import FRAMING_DIRECTION, framing_camera

FIELD_OF_VIEW: Final = 0.9  # [rad] where a keyframe says none and none before it did
NEAR_SHARE: Final = 2e-3  # of the distance to what is looked at
FAR: Final = 500.0  # [m] at least
EXAMPLE: Final = '{"keyframes": [{"time": 0, "eye": [0, 2, 8], "target": [0, 0, 0]}, ...]}'
MAX_FILE_SIZE: Final = 1 << 24  # [bytes]
_DIRECTIONS: Final = 32  # from which an orbit's distance is measured


class Keyframe(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where a camera is at a time, and what it looks at."""

    time: float  # [s] of the simulation
    eye: Vec3  # [m] world
    target: Vec3  # [m] world
    field_of_view: Annotated[float, msgspec.Meta(gt=0.0, lt=math.pi)] | None = None  # [rad] vertical; None: as before


class _PathFile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    keyframes: Annotated[list[Keyframe], msgspec.Meta(min_length=1)]


class CameraPath:
    """A smooth way through keyframes: eye, target and opening angle pass each at its time, and rest before and after."""

    def __init__(self, keyframes: list[Keyframe]) -> None:
        """At least one keyframe, their times rising."""
        self._time = np.array([key.time for key in keyframes])
        opening = FIELD_OF_VIEW
        values = []
        for key in keyframes:
            opening = key.field_of_view or opening
            values.append((*key.eye, *key.target, opening))
        self._values = np.array(values, np.float64)
        self._slopes = _slopes(self._time, self._values)

    def camera_at(self, time: float) -> ViewCamera:
        """The point of view at a time [s]."""
        values = self._value_at(time)
        eye, target = values[:3], values[3:6]
        distance = float(np.linalg.norm(target - eye))
        rotation = look_rotation(target - eye) if distance > 0.0 else np.array((0.0, 0.0, 0.0, 1.0))
        return ViewCamera(
            position=tuple(eye.tolist()),
            rotation=tuple(rotation.tolist()),
            # A curve may swing beyond its keyframes, an opening angle must stay one.
            field_of_view=min(max(float(values[6]), 0.02), 3.0),
            near=min(max(distance * NEAR_SHARE, 1e-3), 0.05),
            far=max(FAR, distance * 20.0),
        )

    def _value_at(self, time: float) -> NDArray[np.float64]:
        times, values = self._time, self._values
        if time <= times[0] or len(times) == 1:
            return np.asarray(values[0])
        if time >= times[-1]:
            return np.asarray(values[-1])
        i = int(np.searchsorted(times, time, side="right")) - 1
        gap = times[i + 1] - times[i]
        s = (time - times[i]) / gap
        # The cubic Hermite basis.
        return np.asarray(
            (1.0 + 2.0 * s) * (1.0 - s) ** 2 * values[i]
            + s * (1.0 - s) ** 2 * gap * self._slopes[i]
            + s * s * (3.0 - 2.0 * s) * values[i + 1]
            + s * s * (s - 1.0) * gap * self._slopes[i + 1]
        )


def read_camera_path(path: Path) -> CameraPath:
    """The path in a JSON file. Raises ElysError that names the file, the place and what was expected."""
    try:
        if path.stat().st_size > MAX_FILE_SIZE:
            raise ElysError(f"{path} is too large for a camera path")
        keyframes = msgspec.json.decode(path.read_bytes(), type=_PathFile).keyframes
    except OSError as error:
        raise ElysError(f"the camera path {path} cannot be read: {error.strerror or error}") from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:  # a ValidationError is one, too
        raise ElysError(f"{path} is no camera path: {error}; write {EXAMPLE}") from error
    for place, key in enumerate(keyframes):
        numbers = (key.time, *key.eye, *key.target)
        if not all(math.isfinite(number) and abs(number) < 1e9 for number in numbers):
            raise ElysError(f"{path}: keyframes[{place}] has a number beyond all scenes")
        if key.eye == key.target:
            raise ElysError(f"{path}: keyframes[{place}] looks at the place where it stands: move eye or target")
        if place and key.time <= keyframes[place - 1].time:
            raise ElysError(
                f"{path}: keyframes[{place}] is at {key.time:g} s, not after the one before"
                f" at {keyframes[place - 1].time:g} s: sort them"
            )
    return CameraPath(keyframes)


@dataclass(frozen=True, slots=True, kw_only=True)
class CircularPath:
    """A turn around the vertical axis through `centre` [m], once in `period` [s], always looking at it."""

    centre: tuple[float, float, float]
    first: ViewCamera
    distance: float  # [m]
    period: float

    @classmethod
    def around(cls, lower: ArrayLike, upper: ArrayLike, *, period: float, aspect: float) -> CircularPath:
        """Has a box from `lower` to `upper` (3,) [m] in the picture all the way round."""
        low, high = np.asarray(lower, np.float64), np.asarray(upper, np.float64)
        if not (np.isfinite(low).all() and np.isfinite(high).all()):
            low, high = np.full(3, -1.0), np.full(3, 1.0)
        centre = (low + high) / 2
        cameras = [
            framing_camera(low, high, aspect=aspect, direction=_turned(2.0 * math.pi * i / _DIRECTIONS))
            for i in range(_DIRECTIONS)
        ]
        distances = [float(np.linalg.norm(np.asarray(camera.position) - centre)) for camera in cameras]
        farthest = int(np.argmax(distances))
        x, y, z = centre.tolist()
        return cls(centre=(x, y, z), first=cameras[farthest], distance=distances[farthest], period=period)

    def camera_at(self, time: float) -> ViewCamera:
        """The point of view at a time [s]."""
        direction = _turned(2.0 * math.pi * (time / self.period % 1.0))
        position = np.asarray(self.centre) - direction / np.linalg.norm(direction) * self.distance
        return msgspec.structs.replace(
            self.first, position=tuple(position.tolist()), rotation=tuple(look_rotation(direction).tolist())
        )


def _turned(angle: float) -> NDArray[np.float64]:
    """The direction of an automatic camera, turned around the vertical axis."""
    x, y, z = FRAMING_DIRECTION
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array((x * cosine + z * sine, y, z * cosine - x * sine))


def _slopes(time: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of each value (K, N) at its keyframe: between its neighbours, as Catmull and Rom have it, for times at any distance."""
    if len(time) < 2:
        return np.zeros_like(values)
    before, after = np.maximum(np.arange(len(time)) - 1, 0), np.minimum(np.arange(len(time)) + 1, len(time) - 1)
    return np.asarray((values[after] - values[before]) / (time[after] - time[before])[:, None])

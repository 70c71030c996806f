"""Points of view as matrices and planes. `relative` space has the world's axes and its origin in the eye."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from elys.bus.messages.views import ViewCamera
from elys.common.components import Camera, Quat, Vec3
from elys.common.math import quaternion
from elys.common.math.matrix import look_rotation, orthographic, perspective

Vector = NDArray[np.float64]
Region = tuple[int, int, int, int]  # of a picture: x, y of its upper left corner, width, height [pixels]
# Where an automatic camera looks: down onto the scene, from the front right.
FRAMING_DIRECTION: Final = (-0.55, -0.42, -0.72)


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """A camera at one picture size."""

    camera: ViewCamera
    width: int
    height: int
    eye: Vector  # (3,) world [m]
    world_from_view: Vector  # (3, 3) rotation alone: relative space has the eye as its origin
    clip_from_relative: Vector  # (4, 4)

    @classmethod
    def of(cls, camera: ViewCamera, width: int, height: int) -> View:
        """The view of a camera in a picture of `width` by `height` pixels."""
        world_from_view = _rotation_matrix(tuple(camera.rotation))
        view_from_relative = np.eye(4)
        view_from_relative[:3, :3] = world_from_view.T
        near = max(camera.near, 1e-5)
        far = max(camera.far, near * 1.001)
        if camera.ortho_height > 0.0:
            clip_from_view = orthographic(camera.ortho_height, width / height, near, far)
        else:
            clip_from_view = perspective(camera.field_of_view, width / height, near, far)
        return cls(
            camera=camera,
            width=width,
            height=height,
            eye=np.array(camera.position, np.float64),
            world_from_view=world_from_view,
            clip_from_relative=clip_from_view @ view_from_relative,
        )

    @property
    def pixels_a_metre(self) -> float:
        """How many pixels a metre is high at a distance of one metre, and in a parallel view at any."""
        # A region of a picture adds a share of depth to the row, on which the way up has none.
        return float(self.clip_from_relative[1, :3] @ self.world_from_view[:, 1]) * self.height / 2.0

    def of_pixel(self, x: int, y: int) -> View:
        """What is seen in one pixel, counted from the upper left, as a picture of that pixel alone."""
        return self.of_region((x, y, 1, 1))

    def of_region(self, region: Region) -> View:
        """What is seen in a part of the picture, as a picture of that part alone."""
        x, y, width, height = region
        part_from_clip = np.eye(4)
        part_from_clip[0, 0], part_from_clip[1, 1] = self.width / width, self.height / height
        part_from_clip[0, 3] = (self.width - 2.0 * x - width) / width
        part_from_clip[1, 3] = (2.0 * y + height - self.height) / height
        return replace(self, width=width, height=height, clip_from_relative=part_from_clip @ self.clip_from_relative)


def camera_of(camera: Camera, position: Vec3, rotation: Quat) -> ViewCamera:
    """The view of a camera of the scene that stands at `position` [m], turned by `rotation`."""
    return ViewCamera(
        position=position,
        rotation=rotation,
        field_of_view=camera.field_of_view,
        ortho_height=camera.ortho_height if camera.projection == "orthographic" else 0.0,
        near=camera.near,
        far=camera.far,
    )


@lru_cache(maxsize=16)
def _rotation_matrix(rotation: tuple[float, float, float, float]) -> Vector:
    """(3, 3) of a quaternion of any length."""
    unit = quaternion.normalize(np.asarray(rotation, np.float64))
    found: Vector = quaternion.to_matrix(unit).astype(np.float64, copy=False)
    found.setflags(write=False)  # others get the same
    return found


def frustum_planes(clip_from_space: NDArray[np.floating]) -> Vector:
    """Six planes (6, 4) with unit normals that point inwards. Gribb and Hartmann, "Fast Extraction of Viewing Frustum Planes"."""
    m = clip_from_space
    planes = np.stack([m[3] + m[0], m[3] - m[0], m[3] + m[1], m[3] - m[1], m[3] + m[2], m[3] - m[2]])
    return np.asarray(planes / np.linalg.norm(planes[:, :3], axis=1, keepdims=True))


def frustum_corners(clip_from_space: NDArray[np.floating]) -> Vector:
    """The eight corners (8, 3) of what is seen."""
    cube = np.array([(x, y, z, 1.0) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = cube @ np.linalg.inv(clip_from_space).T
    return np.asarray(corners[:, :3] / corners[:, 3:])


def framing_camera(
    lower: ArrayLike,
    upper: ArrayLike,
    *,
    aspect: float = 16 / 9,
    field_of_view: float = 0.9,
    direction: ArrayLike = FRAMING_DIRECTION,
) -> ViewCamera:
    """A camera that looks along `direction` and has the whole box from `lower` to `upper` (3,) [m] in the picture."""
    low, high = np.asarray(lower, np.float64), np.asarray(upper, np.float64)
    if not (np.isfinite(low).all() and np.isfinite(high).all() and (high >= low).all()):
        low, high = np.full(3, -1.0), np.full(3, 1.0)
    centre, half = (low + high) / 2, np.maximum((high - low) / 2, 1e-3)
    rotation = look_rotation(direction)
    view_from_world = quaternion.to_matrix(rotation).T
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half @ view_from_world.T
    tangent = np.tan(field_of_view / 2) * 0.94  # a margin
    # Each corner asks for a distance at which it is within the opening angle; the greediest one gets it.
    needed = np.maximum(np.abs(corners[:, 0]) / (tangent * aspect), np.abs(corners[:, 1]) / tangent) + corners[:, 2]
    distance = max(float(needed.max()), 1e-3)
    backward = view_from_world.T[:, 2]
    reach = distance + float(np.linalg.norm(half)) * 2
    return ViewCamera(
        position=tuple((centre + backward * distance).tolist()),
        rotation=tuple(rotation.tolist()),
        field_of_view=field_of_view,
        near=max(reach * 2e-4, 1e-3),
        far=max(reach * 4, 100.0),
    )
